"""Clauses that cannot hold or say nothing are named; clauses that do neither are not."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fleet.doubts import doubts
from fleet.errors import ScenarioError
from fleet.generate import line
from fleet.scenario import Scenario, load
from fleet.stl import parse
from tests.unit.test_planner_rest import SCENARIOS, mission


@pytest.mark.parametrize(
    ("clause", "code", "words"),
    [
        ("eventually[0,40] (d1 in tr1 and d1 in tr2)", "contradictory", "tr1 and tr2 at once"),
        ("always[0,9] (d1 in home and d1 in tr1)", "contradictory", "at once"),
        ("eventually[0,1] d1 in tr1", "contradictory", "by 1 s"),
        ("always[0,10] d1 in tr1", "contradictory", "by 0 s"),
        ("eventually[0,40] d1 in tower", "contradictory", "@safe keeps it outside tower"),
        ("d2 outside tr2 until[1,2] d1 in tr1", "contradictory", "by 2 s"),
        ("eventually[5,40] dist(d1,d2) <= 2", "contradictory", "separation"),
        ("eventually[0,1] dist(d1,d2) <= 4", "contradictory", "cannot fall to 4 m"),
        ("always[5,40] dist(d1,d2) <= 100", "implied", "width of the workspace"),
        ("always[5,40] d1.z >= -1", "implied", "workspace"),
        ("eventually[5,40] d1.z >= 30", "contradictory", "workspace"),
        ("always[0,1] (d1 in tr1 -> d2 in tr2)", "vacuous", "by 1 s"),
        ("always[0,T] d1 outside tower", "implied", "@safe keeps d1 outside tower"),
        ("eventually[10,20] d1 in workspace", "implied", "@safe keeps d1 in workspace"),
        ("always[5,20] dist(d1,d2) >= 2", "implied", "3 m or more by the mission's own separation, @apart"),
        ("always[0,T] all d: d in workspace and d outside obstacles", "implied", "@safe"),
        ("always[0,T] dist(d1,d2) >= 0", "vacuous", "never below 0 m"),
        ("always[20,40] historically[0,20] d1 in workspace", "implied", "@safe keeps d1 in workspace"),
        ("eventually[20,40] once[0,1] (d1 in tr1 and d1 in tr2)", "contradictory", "at once"),
        ("eventually[5,40] (d1 in tr3 since[0,5] d1 in tower)", "contradictory", "@safe keeps it outside"),
        ("always[5,40] (d1 in tr3 -> once[0,5] d1 in tr1)", "", ""),
        ("eventually[0,3] (d2 in tr2 and once[0,1] d1 in home)", "contradictory", "by 3 s"),
        ("not eventually[0,40] (d1 in tr1 and d1 in tr2)", "", ""),
        ("always[0,50] (d1 in tr1 -> eventually[0,10] d2 in tr2)", "", ""),
        ("(eventually[0,1] d1 in tr1) or (eventually[0,40] d1 in tr1)", "", ""),
        ("eventually[0,40] (d1 in tr1 and d2 in tr2)", "", ""),
        ("d1 outside tr1 until[0,40] d1 in tr3", "", ""),
        ("always[10,20] dist(d1,d2) <= 12", "", ""),
    ],
)
def test_doubts(tmp_path: Path, clause: str, code: str, words: str) -> None:
    found = doubts(mission(tmp_path, f"@odd {clause}"))
    if code:
        assert [(d.clause, d.code) for d in found] == [("odd", code)]
        assert words in found[0].message
    else:
        assert found == []


def test_two_clauses_that_exclude_each_other(tmp_path: Path) -> None:
    """Each alone could hold."""
    found = doubts(mission(tmp_path, "@one always[30,40] d1 in tr1", "@two eventually[32,38] d1 in tr2"))
    assert [(d.clause, d.code) for d in found] == [("two", "contradictory")]
    assert "@one keeps it in tr1" in found[0].message


@pytest.mark.parametrize(
    ("clauses", "found"),
    [
        # Of two clauses that say the same, or where one is the stricter, the other says nothing.
        (("@a eventually[0,40] d1 in tr1", "@b eventually[0,40] d1 in tr1"), [("b", "implied", ("a",))]),
        (("@a eventually[0,40] d1 in tr1", "@b eventually[0,20] d1 in tr1"), [("a", "implied", ("b",))]),
        (
            ("@a eventually[0,40] some d: d in tr1", "@b eventually[0,40] d2 in tr1"),
            [("a", "implied", ("b",))],
        ),
        (
            ("@a eventually[0,40] d1 in tr1", "@b eventually[5,30] stay 2 d1 in tr1"),
            [("a", "implied", ("b",))],
        ),
        (("@a always[30,32] d1 in tr1", "@b eventually[20,40] d1 in tr1"), [("b", "implied", ("a",))]),
        (("@a always[5,30] d1.z >= 0.5", "@b always[5,30] d1.z >= 0.5"), [("b", "implied", ("a",))]),
        (("@a eventually[0,40] stay 1 d1 in tr1", "@b eventually[5,30] d1 in tr1"), []),
        (("@a eventually[0,40] d1 in tr1", "@b eventually[0,40] d2 in tr1"), []),
        (("@a eventually[0,20] d1 in tr1", "@b eventually[10,40] d1 in tr1"), []),
        # Each visit could be made; nobody is quick enough for both.
        (
            ("@a eventually[10,11] d1 in tr1", "@b eventually[11,12] d1 in tr2"),
            [("b", "contradictory", ("a",))],
        ),
    ],
)
def test_clauses_against_each_other(
    tmp_path: Path, clauses: tuple[str, ...], found: list[tuple[str, str, tuple[str, ...]]]
) -> None:
    assert [(d.clause, d.code, d.others) for d in doubts(mission(tmp_path, *clauses))] == found


def test_a_region_that_nobody_may_enter(tmp_path: Path) -> None:
    """Inside an obstacle a region is a mistake of the scenario; elsewhere it is not."""
    mission(tmp_path, "@there eventually[0,40] d1 in tr1")
    path = tmp_path / "mission.toml"
    clauses = "@there eventually[0,40] d1 in shaft\n@out always[0,T] d2 outside shaft"
    path.write_text(path.read_text().replace("@there eventually[0,40] d1 in tr1", clauses))
    with pytest.raises(ScenarioError, match="region shaft is wholly inside obstacle tower"):
        load_with(path, "[[-1.0, -1.0, 1.0], [1.0, 1.0, 3.0]]")
    assert doubts(load_with(path, "[[-7.0, -3.0, 4.0], [-3.5, 1.0, 9.0]]")) == []


def load_with(path: Path, box: str) -> Scenario:
    """The scenario with a region `shaft`."""
    (path.parent / "shaft.toml").write_text(f'{path.read_text()}\n[[region]]\nname = "shaft"\nbox = {box}\n')
    return load(path.parent / "shaft.toml")


def test_large_fleets_are_judged_in_time(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text(line(8, 1))
    began = time.process_time()
    assert doubts(load(path)) == []
    assert time.process_time() - began < 20


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_missions_raise_no_doubts(path: Path) -> None:
    assert doubts(load(path)) == []


def spec(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "fleet", "spec", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_command_answers_in_json(tmp_path: Path) -> None:
    scenario = mission(tmp_path, "@odd eventually[0,1] d1 in tr1", "@near always[10,20] dist(d1,d2) <= 12")
    answer = json.loads(spec(str(tmp_path / "mission.toml"), "--json").stdout)
    assert (answer["exit"], answer["command"], answer["errors"]) == (0, "spec", [])
    assert [c["kind"] for c in answer["clauses"]] == ["invariant", "invariant", "event", "event", "rest"]
    for shown, clause in zip(answer["clauses"], scenario.clauses(), strict=True):
        assert parse(shown["formula"], scenario.vocabulary)[0].formula == clause.formula
    form = answer["normal_form"]
    assert {
        "clause": "odd",
        "choices": [{"drone": "d1", "region": "tr1"}],
        "window": [0, 1],
        "dwell": 0,
    } in form["events"]
    assert {(e["clause"], e["choices"][0]["drone"]) for e in form["events"] if e["window"] is None} == {
        ("home", "d1"),
        ("home", "d2"),
    }
    assert {
        "clause": "apart",
        "text": "dist(d1, d2) >= 3",
        "drones": ["d1", "d2"],
        "window": [0, 60],
    } in form["invariants"]
    assert form["rest"] == [{"clause": "near", "formula": "always[10, 20] dist(d1, d2) <= 12"}]
    assert [w["clause"] for w in answer["warnings"]] == ["odd"]


def test_command_answers_in_words(tmp_path: Path) -> None:
    mission(tmp_path, "@odd {weight 2, priority 3} eventually[0,40] (d1 in tr1 and d1 in tr2)")
    done = spec(str(tmp_path / "mission.toml"))
    assert done.returncode == 0, done.stderr
    assert "warning: @odd is contradictory: d1 cannot be in tr1 and tr2 at once" in done.stdout
    assert "@apart  dist(d1, d2) >= 3  over [0, 60] s" in done.stdout
    assert "@odd {weight 2, priority 3} (rest)  eventually[0, 40]" in done.stdout
    assert "@apart (invariant)" in done.stdout


def test_command_names_a_missing_file() -> None:
    done = spec("missing.toml")
    assert done.returncode == 2
    assert "missing.toml" in done.stderr
    assert "Traceback" not in done.stderr
