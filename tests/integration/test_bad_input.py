"""What a user can get wrong, at the command line: exit code, place and reason, and never a traceback."""

import json
import socket
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.integration.conftest import SCENARIOS, Answer, finish, start

HOVER = (SCENARIOS / "hover.toml").read_text()
TOWER = (SCENARIOS / "power_tower.toml").read_text()
Fleet = Callable[..., Answer]

SECOND_HOME = """
[[drone]]
id = "d2"
home = { box = [[-0.5, -0.5, 0.5], [1.5, 1.5, 2.5]] }
pad = [0.5, 0.5, 0.1]
"""
INSIDE_TOWER = """
[[target]]
name = "core"
box = [[-1.0, -1.0, 9.0], [1.0, 1.0, 11.0]]
"""

# name: scenario text, field that must be named, word of the reason
SCENARIO_MISTAKES = {
    "wrong type": (HOVER.replace("v_max = 3.0", 'v_max = "fast"'), "limits.v_max", "number"),
    "T = 0": (HOVER.replace("T = 12.0", "T = 0"), "mission.T", "greater than 0"),
    "negative T": (HOVER.replace("T = 12.0", "T = -5"), "mission.T", "greater than 0"),
    "overlapping homes": (HOVER + SECOND_HOME, "home", "overlap"),
    "target inside the tower": (TOWER + INSIDE_TOWER, "target", "tower"),
    "unknown key": (HOVER.replace("[limits]", "[limits]\nspeed = 1.0"), "limits.speed", "legal: "),
    "not TOML": (HOVER.replace("[mission]", "[mission"), "", "line "),
    "bad formula": (
        HOVER.replace("seed = 1", 'seed = 1\nformula = "always[0,T] d1 inn home"'),
        "mission.formula",
        "line 1",
    ),
    "unknown name in a formula": (
        HOVER.replace("seed = 1", 'seed = 1\nformula = "eventually[0,T] d1 in nowhere"'),
        "mission.formula",
        "nowhere",
    ),
}


@pytest.mark.parametrize(
    ("command", "name"),
    [
        *(("check", name) for name in SCENARIO_MISTAKES),
        *((one, "T = 0") for one in ("plan", "simulate", "fly")),
    ],
)
def test_mistakes_in_a_scenario(fleet: Fleet, tmp_path: Path, command: str, name: str) -> None:
    text, field, reason = SCENARIO_MISTAKES[name]
    path = tmp_path / "mission.toml"
    path.write_text(text)
    answer = fleet(command, str(path), "--json")
    answer.assert_no_traceback()
    assert answer.code == 2, answer.err
    assert answer.json["exit"] == 2
    assert answer.json["command"] == command
    problems = answer.json["errors"]
    assert all(one["file"] == str(path) for one in problems)
    assert any(field in one["field"] and reason in one["message"] for one in problems), problems
    assert sorted(tmp_path.iterdir()) == [path]


def test_all_problems_are_named_at_once(fleet: Fleet, tmp_path: Path) -> None:
    path = tmp_path / "mission.toml"
    path.write_text(HOVER.replace("T = 12.0", "T = 0").replace("a_max = 3.0", "a_max = -1"))
    fields = {one["field"] for one in fleet("check", str(path), "--json").json["errors"]}
    assert {"mission.T", "limits.a_max"} <= fields


@pytest.mark.parametrize(
    "words",
    [
        ("plan", "missing.toml"),
        ("check", "missing.toml"),
        ("simulate", "missing.toml"),
        ("fly", "missing.plan.cbor"),
        ("verify", "missing.plan.cbor"),
        ("report", "missing.mcap"),
        ("export", "missing.mcap", "--csv", "out.csv"),
        ("plan", "."),
    ],
)
def test_missing_files(fleet: Fleet, words: tuple[str, ...]) -> None:
    answer = fleet(*words, "--json")
    answer.assert_no_traceback()
    assert answer.code == 2
    (problem,) = answer.json["errors"]
    assert problem["file"] == words[1]
    assert problem["message"]


def test_files_of_another_kind(fleet: Fleet, tmp_path: Path) -> None:
    (tmp_path / "noise.cbor").write_bytes(bytes(range(200)))
    (tmp_path / "broken.mcap").write_bytes(b"\x89MCAP0\r\n and no more")
    scenario = str(SCENARIOS / "hover.toml")
    for words in (
        ("verify", "noise.cbor"),
        ("fly", "noise.cbor"),
        ("simulate", "noise.cbor"),
        ("plan", "noise.cbor"),
        ("export", "noise.cbor", "--csv", "out.csv"),
        ("report", "noise.cbor"),
        ("verify", "broken.mcap"),
        ("report", "broken.mcap"),
        ("verify", scenario),
        ("report", scenario),
    ):
        answer = fleet(*words, "--json")
        answer.assert_no_traceback()
        assert answer.code == 2, (words, answer.err)
        assert answer.json["errors"][0]["file"].endswith(words[1]), words


@pytest.mark.parametrize(
    "words",
    [
        ("plan", "SCENARIO", "--method", "magic"),
        ("fly", "SCENARIO", "--connect", "127.0.0.1:7447"),
        ("fly", "SCENARIO", "--connect", "tcp/10.1.2.3:7447"),
        ("router", "--listen", "tcp/0.0.0.0:7447"),
        ("router", "--listen", "tcp/127.0.0.1:99999"),
        ("status", "--connect", "here"),
        ("hold", "d-1"),
        ("status", "d1", "d 2"),
        ("land", "--fleet", "a/b"),
        ("export", "SCENARIO", "--csv", "no/such/folder/out.csv"),
        ("plan", "SCENARIO", "-o", "no/such/folder/x.plan.cbor"),
        ("plan", "SCENARIO", "-o", "/"),
        ("plan", "SCENARIO", "-o", "/proc/x.plan.cbor"),
        ("fly",),
        ("nonsense",),
        ("plan", "SCENARIO", "--nonsense"),
    ],
)
def test_illegal_options(fleet: Fleet, words: tuple[str, ...]) -> None:
    scenario = str(SCENARIOS / "hover.toml")
    answer = fleet(*(scenario if word == "SCENARIO" else word for word in words), "--json")
    answer.assert_no_traceback()
    # Options are judged before anything is asked: without a router the exit would be 4.
    assert answer.code == 2, answer.err
    assert answer.json["errors"][0]["message"]


def test_infeasible_names_the_clause(fleet: Fleet, tmp_path: Path) -> None:
    path = tmp_path / "mission.toml"
    # The target is 30 m away and the window closes after 8 s: 3 m/s cannot do that.
    text = HOVER.replace(
        "box = [[-3.0, -3.0, 0.0], [3.0, 3.0, 6.0]]", "box = [[-3.0, -3.0, 0.0], [40.0, 3.0, 6.0]]"
    )
    path.write_text(
        text.replace(
            "box = [[-1.0, -1.0, 2.5], [1.0, 1.0, 4.5]]", "box = [[30.0, -1.0, 2.5], [32.0, 1.0, 4.5]]"
        )
    )
    answer = fleet("plan", str(path), "--json")
    answer.assert_no_traceback()
    assert answer.code == 3, answer.err
    assert answer.json["conflict"]["clauses"] == ["up"]
    assert answer.json["conflict"]["proved"] is True


def test_what_gave_way_is_told_and_not_flown(fleet: Fleet, tmp_path: Path) -> None:
    """Two metres up within half a second: the visit is late, and no drone would accept that plan."""
    path = tmp_path / "mission.toml"
    formula = 'seed = 1\nformula = "@up eventually[0,0.5] d1 in up"'
    path.write_text(HOVER.replace("seed = 1", formula))
    found = fleet("plan", str(path), "--json", "--relax", "-o", "late.plan.cbor")
    found.assert_no_traceback()
    assert (found.code, found.json["status"]) == (1, "violated")
    (gave,) = found.json["relaxed"]
    assert (gave["clause"], gave["how"]) == ("up", "late")
    assert gave["by_s"] == pytest.approx(found.json["events"][0]["t"] - 0.5)
    shown = fleet("plan", str(path), "--relax")
    assert f"gave way: up: reached at {found.json['events'][0]['t']:.1f} s" in shown.out
    flown = fleet("simulate", "late.plan.cbor", "--json")
    assert flown.code == 1
    assert [problem["code"] for problem in flown.json["errors"]] == ["violated"]
    assert "no drone accepts" in flown.err


def test_a_port_that_is_taken(fleet: Fleet, endpoint: str, tmp_path: Path) -> None:
    port = int(endpoint.rpartition(":")[2])
    with socket.create_server(("127.0.0.1", port)):
        taken = fleet("router", "--listen", endpoint, "--json")
        flown = fleet(
            "fly",
            str(SCENARIOS / "hover.toml"),
            "--connect",
            endpoint,
            "--json",
            FLEET_BIN_DIR=str(doubles(tmp_path)),
        )
    taken.assert_no_traceback()
    assert taken.code == 4
    assert str(port) in taken.json["errors"][0]["message"]
    flown.assert_no_traceback()
    assert flown.code == 4
    # An agent that does not answer would be 4 too: the error must be the port's, before anything is started.
    assert f"{port} is not a Zenoh router" in flown.json["errors"][0]["message"]
    assert not list((tmp_path / "runs").glob("*"))


def test_results_that_cannot_be_written(fleet: Fleet, tmp_path: Path) -> None:
    """A folder that refuses files, found only after the work is done."""
    assert fleet("simulate", str(SCENARIOS / "hover.toml"), "--run-dir", "run").code == 0
    log = str(tmp_path / "run" / "flight.mcap")
    for words in (("report", log, "-o"), ("export", log, "--csv")):
        for place in ("/proc/x", str(tmp_path)):
            answer = fleet(*words, place, "--json")
            answer.assert_no_traceback()
            assert answer.code == 2, answer.err
            assert answer.json["errors"][0]["file"] == place


def test_a_missing_program(fleet: Fleet, tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    (tmp_path / "empty").mkdir()
    for command in ("fly", "simulate"):
        options = ["--connect", endpoint] if command == "fly" else []
        scenario = str(SCENARIOS / "hover.toml")
        answer = fleet(command, scenario, *options, "--json", FLEET_BIN_DIR=str(tmp_path / "empty"))
        answer.assert_no_traceback()
        assert answer.code == 4
        (problem,) = answer.json["errors"]
        assert "cargo build --release -p fleet-" in problem["message"]
        assert not list((tmp_path / "runs").glob("*"))


def test_no_router_and_no_drone(fleet: Fleet, router: str) -> None:
    for command in ("status", "hold", "abort"):
        answer = fleet(command, "--connect", router, "--json")
        answer.assert_no_traceback()
        assert answer.code == 4
        assert "no drone" in answer.json["errors"][0]["message"]


def doubles(folder: Path) -> Path:
    """A folder with programs that come up and then do nothing: an agent that never answers."""
    sim = {"ready": True, "vehicles": [{"id": "d1", "system": 101, "mavlink": "127.0.0.1:9"}]}
    for name, ready in (
        ("fleet-sim", sim),
        ("fleet-agent", {"ready": True, "drone": "d1", "mavlink": "127.0.0.1:9"}),
    ):
        path = folder / "doubles" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!/bin/sh\necho '{json.dumps(ready)}'\nexec sleep 600\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return folder / "doubles"


def test_an_agent_that_never_answers(tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    scenario, bins = str(SCENARIOS / "hover.toml"), str(doubles(tmp_path))
    run = str(tmp_path / "run")
    process = start(
        "fly", scenario, "--connect", endpoint, "--run-dir", run, "--json", cwd=tmp_path, FLEET_BIN_DIR=bins
    )
    answer = finish(process, 40.0)
    answer.assert_no_traceback()
    assert answer.code == 4, answer.err
    (problem,) = answer.json["errors"]
    assert problem["field"] == "d1"
    assert "did not answer" in problem["message"]


@pytest.mark.parametrize(
    ("sim", "agent", "words"),
    [
        ("echo oh no >&2; exit 3", "exec sleep 600", ("fleet-sim", "exit code 3", "oh no")),
        ("echo not json; exec sleep 600", "exec sleep 600", ("fleet-sim", "not a JSON object")),
        (None, "echo port taken >&2; exit 4", ("fleet-agent d1", "exit code 4", "port taken")),
    ],
)
def test_a_program_that_fails_is_quoted(
    fleet: Fleet,
    tmp_path: Path,
    endpoint: str,
    nothing_left: None,
    sim: str | None,
    agent: str,
    words: tuple[str, ...],
) -> None:
    folder = doubles(tmp_path)
    if sim is not None:
        (folder / "fleet-sim").write_text(f"#!/bin/sh\n{sim}\n")
    (folder / "fleet-agent").write_text(f"#!/bin/sh\n{agent}\n")
    answer = fleet(
        "fly", str(SCENARIOS / "hover.toml"), "--connect", endpoint, "--json", FLEET_BIN_DIR=str(folder)
    )
    answer.assert_no_traceback()
    assert answer.code == 4, answer.err
    message = answer.json["errors"][0]["message"]
    assert all(word in message for word in words), message
