"""Missions that have no plan: the smallest set of clauses that conflict, with times and missing margins."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from fleet.errors import Conflict, InfeasibleError
from fleet.planner import plan
from fleet.planner.subset import irreducible
from fleet.scenario import Scenario, load

#: A room of 60 m with targets at both ends, one beside a pillar, and one that overlaps another.
WORLD = """
[mission]
T = {T}
T_s = 0.05
seed = 1
formula = '''
{formula}
'''

[limits]
v_max = 3.0
a_max = 3.0
delta_min = 3.0
tube = 0.4
heading_rate = {rate}

[workspace]
box = [[-30.0, -10.0, 0.0], [30.0, 10.0, 12.0]]

[[obstacle]]
name = "pillar"
box = [[9.0, 3.0, 0.0], [12.0, 6.0, 12.0]]

[[target]]
name = "west"
box = [[-28.0, -1.0, 4.0], [-26.0, 1.0, 6.0]]

[[target]]
name = "east"
box = [[26.0, -1.0, 4.0], [28.0, 1.0, 6.0]]

[[target]]
name = "near"
box = [[3.0, -4.0, 4.0], [5.0, -2.0, 6.0]]
heading = 3.1

[[target]]
name = "tight"
box = [[10.0, 2.4, 4.0], [11.0, 3.4, 6.0]]

[[drone]]
id = "d1"
home = {{ box = [[-1.0, -1.0, 0.5], [1.0, 1.0, 2.5]] }}
pad = [0.0, 0.0, 0.1]
heading = 0.0

[[drone]]
id = "d2"
home = {{ box = [[-1.0, {y0}, 0.5], [1.0, {y1}, 2.5]] }}
pad = [0.0, {y}, 0.1]
heading = 0.0
"""

SAFE = "@safe always[0,T] all d: d in workspace and d outside obstacles"
APART = "@apart always[0,T] all d != e: dist(d,e) >= delta_min"
HOME = "@home eventually[2T/3,T] all d: d in home"


def world(folder: Path, *clauses: str, T: float = 30.0, rate: float = 0.5236, y: float = 6.0) -> Scenario:
    """The room with these clauses; the home of d2 is `y` [m] beside that of d1."""
    path = folder / "room.toml"
    text = WORLD.format(T=T, formula="\n".join(clauses), rate=rate, y=y, y0=y - 1, y1=y + 1)
    path.write_text(text)
    return load(path)


def conflict_of(scenario: Scenario) -> Conflict:
    with pytest.raises(InfeasibleError) as caught:
        plan(scenario)
    assert caught.value.conflict is not None
    return caught.value.conflict


def without(scenario: Scenario, kept: Sequence[str]) -> Scenario:
    """The scenario with some of its clauses only; one that says nothing stands for none."""
    lines = [f"@{c.id} {c.text}" for c in scenario.clauses() if c.id in kept]
    formula = "\n".join(lines or ["@nothing always[0,T] d1 in workspace"])
    return dataclasses.replace(scenario, mission=scenario.mission.model_copy(update={"formula": formula}))


#: Name, clauses, settings of the room, the conflict that is expected, and a word of the reason.
PROVED = [
    ("too far", ["@w eventually[0,8] d1 in west"], {}, {"w"}, "d1 cannot reach west before 8.0 s"),
    (
        "way home",
        ["@w eventually[0,12] d1 in west"],
        {"T": 15.0},
        {"w"},
        "d1 cannot reach home.d1 before 15.0 s",
    ),
    (
        "two far targets",
        [
            *(f"@{r[0]} eventually[0,20] d1 in {r}" for r in ("east", "west")),
            "@n eventually[0,20] d2 in near",
        ],
        {"T": 60.0},
        {"e", "w"},
        "before 20.0 s: needs 2",
    ),
    (
        "two targets, nobody free",
        [
            "@e eventually[0,12] some d: d in east",
            "@w eventually[0,12] d2 in west",
            "@n eventually[12,12] d1 in near",
        ],
        {"T": 60.0},
        {"e", "w", "n"},
        "too many",
    ),
    (
        "target in obstacle",
        ["@t eventually[0,T] d1 in tight"],
        {},
        {"safe", "t"},
        "pillar the margin is at most 0.30 m",
    ),
    ("homes too near", ["@w eventually[0,T/2] d1 in west"], {"y": 3.4}, {"apart"}, "m apart"),
    (
        "same time",
        ["@e eventually[10,10] d1 in east", "@w eventually[10,10] d1 in west"],
        {},
        {"e", "w"},
        "before 10.0 s",
    ),
    (
        "slow turn",
        ["@n eventually[0,20] d1 in near"],
        {"rate": 0.2},
        {"n"},
        "d1 cannot reach near before 20.0 s: needs 29",
    ),
    (
        "meeting",
        ["@meet eventually[0,20] (d1 in east and d2 in east)"],
        {"T": 60.0},
        {"apart", "meet"},
        "d1 in east and d2 in east are at most 2.08 m apart",
    ),
    ("two places", ["@both eventually[0,20] (d1 in east and d1 in near)"], {"T": 60.0}, {"both"}, "disjoint"),
    (
        "stay and go",
        ["@stay always[0,20] d1 in home", "@n eventually[5,15] d1 in near"],
        {},
        {"stay", "n"},
        "inside near and inside home.d1",
    ),
    (
        "nested too early",
        ["@late eventually[0,5] (always[0,2] (d1 in near and d2 in east))"],
        {"T": 60.0},
        {"late"},
        "d2 cannot reach east before 7.0 s",
    ),
]


@pytest.mark.parametrize(("name", "clauses", "room", "expected", "word"), PROVED, ids=[p[0] for p in PROVED])
def test_least_conflict_is_proved_and_irreducible(
    tmp_path: Path, name: str, clauses: list[str], room: dict[str, float], expected: set[str], word: str
) -> None:
    """The set is the expected one, and the planner has a plan for it without any one of its clauses."""
    scenario = world(tmp_path, SAFE, APART, *clauses, HOME, **room)
    began = time.process_time()
    found = conflict_of(scenario)
    assert time.process_time() - began < 10
    assert set(found.clauses) == expected
    assert found.proved
    assert found.minimal
    assert word in found.text
    for left_out in found.clauses:
        plan(without(scenario, [c for c in found.clauses if c != left_out]))


def test_every_visit_of_a_conflict_has_its_times(tmp_path: Path) -> None:
    """From x = 0 to x = 26.4 is 8.8 s at 3 m/s and 0.5 s to speed up; from there to x = -26.4, 17.6 s."""
    clauses = ["@e eventually[0,20] d1 in east", "@w eventually[0,25] d1 in west"]
    found = conflict_of(world(tmp_path, *clauses, T=60.0))
    assert [(n.drone, n.region, n.by_s) for n in found.times] == [("d1", "east", 20.0), ("d1", "west", 25.0)]
    assert found.times[0].needs_s == pytest.approx(26.4 / 3 + 0.5, abs=1e-3)
    assert found.times[1].needs_s == pytest.approx(26.4 / 3 + 0.5 + 2 * 26.4 / 3, abs=1e-3)
    assert found.as_dict()["times"][1]["by_s"] == 25.0
    assert "d1 cannot reach west before 25.0 s: needs 26.9 s, 1.9 s too many" in found.text


def test_what_is_not_proved_is_not_called_so(tmp_path: Path) -> None:
    """A wall without a gap: no bound through free space forbids it, and yet there is no way."""
    text = WORLD.replace(
        "[[obstacle]]",
        """[[obstacle]]
name = "wall"
box = [[15.0, -11.0, -1.0], [16.0, 11.0, 13.0]]

[[obstacle]]""",
    )
    formula = "\n".join(
        [SAFE, APART, "@e eventually[0,T/2] d1 in east", "@w eventually[0,T/2] d2 in west", HOME]
    )
    path = tmp_path / "walled.toml"
    path.write_text(text.format(T=60.0, formula=formula, rate=0.5, y=6.0, y0=5.0, y1=7.0))
    scenario = load(path)
    found = conflict_of(scenario)
    assert not found.proved
    assert set(found.clauses) == {"safe", "e"}
    assert found.minimal
    for left_out in found.clauses:
        plan(without(scenario, [c for c in found.clauses if c != left_out]))


def test_margins_that_are_missing_are_told(tmp_path: Path) -> None:
    """Both drones in one small place at one time, half by a formula that no rule looks into."""
    clauses = [
        "@e eventually[15,15] d1 in east",
        "@n always[15,15] (d2 in east or d2 in near and d1 in west)",
    ]
    found = conflict_of(world(tmp_path, APART, *clauses, T=30.0))
    assert not found.proved
    assert set(found.clauses) == {"apart", "e", "n"}
    assert "d1 and d2 keep 3 m apart with a margin of" in found.text
    assert "less than the tube asks" in found.text


@pytest.mark.parametrize("seed", range(40))
def test_irreducible_parts_are_bad_and_nothing_smaller_is(seed: int) -> None:
    """Against all subsets, for random families of bad sets and what contains them."""
    rng = np.random.default_rng(seed)
    items = tuple("abcdefgh"[: int(rng.integers(1, 9))])
    bad = [{x for x in items if rng.random() < 0.4} for _ in range(int(rng.integers(1, 4)))]

    def is_bad(part: Sequence[str]) -> bool:
        return any(core <= set(part) for core in bad)

    least = irreducible(items, is_bad)
    assert is_bad(least)
    assert not any(is_bad([x for x in least if x != y]) for y in least)
    assert list(least) == [x for x in items if x in least]
