"""Plans of least violation: what gives way, in which order, by how little, and what never does."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from fleet import certificate
from fleet.errors import InfeasibleError
from fleet.planner import PlanResult, Status, plan
from fleet.planner.relax import LATE, ON_TIME, SKIPPED, hitting
from fleet.scenario import load

from .test_planner_conflict import APART, HOME, SAFE, world

SCENARIOS = Path(__file__).parents[2] / "scenarios"
TUBE = 0.4


def gave_way(found: PlanResult) -> dict[str, tuple[str, float | None]]:
    return {gave.clause: (gave.how, gave.by_s) for gave in found.relaxed}


def checked(found: PlanResult) -> PlanResult:
    """The plan, after all that no relaxation may touch: safety, separation, limits, rest at home, truth."""
    given_up = {gave.clause for gave in found.relaxed}
    proof = certificate.verify(found.bytes)
    blamed = tuple(f"clause {name}:" for name in given_up)
    assert [p for p in proof.problems if not p.startswith(blamed)] == []
    for clause in found.plan["clauses"]:
        if clause["id"] not in given_up:
            assert clause["result"]["rho_lower"] >= TUBE - 1e-3, clause["id"]
    for drone in found.plan["drones"]:
        for visit in drone["visits"]:
            assert visit["window"][0] - 1e-6 <= visit["t"] <= visit["window"][1] + 1e-6
    return found


def test_late_by_as_little_as_possible(tmp_path: Path) -> None:
    """From x = 0 to -26.4 takes at least 9.3 s; the deadline is 8 s."""
    scenario = world(tmp_path, SAFE, APART, "@w eventually[0,8] d1 in west", HOME)
    found = checked(plan(scenario, relax=True))
    (how, by_s) = gave_way(found)["w"]
    assert how == "late"
    assert by_s is not None
    assert 1.3 <= by_s < 2.0
    assert found.status is Status.VIOLATED
    assert found.plan["status"] == "violated"
    (event,) = found.events
    assert event["t"] == pytest.approx(8.0 + by_s)
    assert str(found.relaxed[0]) == f"w (west): reached at {event['t']:.1f} s, {by_s:.1f} s late"


@pytest.mark.parametrize(("east", "west", "late"), [(2, 0, "w"), (0, 2, "e")])
def test_smaller_priorities_give_way_first(tmp_path: Path, east: int, west: int, late: str) -> None:
    clauses = (
        f"@e {{priority {east}}} eventually[0,20] d1 in east",
        f"@w {{priority {west}}} eventually[0,20] d1 in west",
    )
    found = checked(plan(world(tmp_path, SAFE, APART, *clauses, HOME, T=60.0), relax=True))
    assert gave_way(found).keys() == {late}
    assert found.relaxed[0].how == "late"


def test_late_rather_than_skipped_and_skipped_when_late_does_not_help(tmp_path: Path) -> None:
    """After the west there is no time for the east before T; the tight place has no room at all."""
    clauses = (
        "@t eventually[0,20] d1 in tight",
        "@w eventually[0,8] d1 in west",
        "@e eventually[0,20] d2 in east",
    )
    found = checked(plan(world(tmp_path, SAFE, APART, *clauses, HOME, T=40.0), relax=True))
    ways = gave_way(found)
    assert ways.keys() == {"t", "w"}
    assert ways["t"] == ("skipped", None)
    assert ways["w"][0] == "late"
    assert [e["region"] for e in found.events] == ["west", "east"]


def test_coming_home_gives_way_last(tmp_path: Path) -> None:
    """Home by 12 s and the west by 10 s do not go together; the west comes after home then."""
    clauses = ("@back eventually[9,12] d1 in home", "@w eventually[5,10] d1 in west")
    found = checked(plan(world(tmp_path, SAFE, APART, *clauses, T=60.0), relax=True))
    assert gave_way(found).keys() == {"w"}


def test_what_is_no_visit_never_gives_way(tmp_path: Path) -> None:
    with pytest.raises(InfeasibleError) as caught:
        plan(world(tmp_path, SAFE, APART, "@w eventually[0,15] d1 in west", y=3.4), relax=True)
    assert caught.value.conflict is not None
    assert caught.value.conflict.clauses == ("apart",)
    assert "nothing that may give way" in " ".join(caught.value.__notes__)


@pytest.mark.parametrize("name", ["hover", "power_tower", "crossing"])
def test_a_mission_that_holds_has_its_ordinary_plan(name: str) -> None:
    scenario = load(SCENARIOS / f"{name}.toml")
    found = plan(scenario, relax=True)
    assert found.relaxed == ()
    assert found.bytes == plan(scenario).bytes


@pytest.mark.parametrize("seed", range(6))
def test_safety_and_separation_never_give_way(tmp_path: Path, seed: int) -> None:
    """Random deadlines, many of them too early."""
    rng = np.random.default_rng(seed)
    clauses = [
        f"@{r} {{priority {rng.integers(0, 3)}}} eventually[0,{rng.integers(3, 25)}] some d: d in {r}"
        for r in rng.permutation(["west", "east", "near", "tight"])[:3]
    ]
    found = checked(plan(world(tmp_path, SAFE, APART, *clauses, HOME, T=45.0), relax=True))
    assert (found.status is Status.VIOLATED) == bool(found.relaxed)


@pytest.mark.parametrize("seed", range(60))
def test_least_hitting_sets(seed: int) -> None:
    """Against all actions of up to five visits."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    ranks = [(int(rng.integers(0, 3)), bool(rng.random() < 0.2)) for _ in range(n)]
    cores = [
        frozenset(
            (int(e), int(rng.integers(LATE, SKIPPED + 1)))
            for e in rng.permutation(n)[: rng.integers(1, n + 1)]
        )
        for _ in range(int(rng.integers(1, 4)))
    ]

    def cost(actions: Sequence[int]) -> list[int]:
        order = sorted(set(ranks), reverse=True)
        of = [[a for a, r in zip(actions, ranks, strict=True) if r == level] for level in order]
        return [count for level in of for count in (level.count(SKIPPED), level.count(LATE))]

    every = itertools.product((ON_TIME, LATE, SKIPPED), repeat=n)
    legal = [a for a in every if all(any(a[e] >= act for e, act in core) for core in cores)]
    least = min(cost(a) for a in legal)
    assert set(hitting(cores, ranks)) == {a for a in legal if cost(a) == least}
