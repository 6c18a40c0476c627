"""What is told without a flight is true of real flights: formulas of the whole language on a shipped plan."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import given, settings

from fleet import _core
from fleet.planner import plan
from fleet.planner.judge import Judge
from fleet.planner.spec import negation_normal
from fleet.scenario import Scenario, load
from tests.unit.formulas import T_S, formulas

SCENARIO = Path(__file__).parents[2] / "scenarios" / "power_tower_4.toml"


@cache
def flown() -> tuple[Scenario, _core.Fleet, np.ndarray]:
    """Scenario, and positions (d, n, 3) [m] of a plan that keeps its limits and invariants."""
    scenario = load(SCENARIO)
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in plan(scenario).plan["drones"]]
    times = np.arange(1201) * T_S
    positions = np.stack([np.ascontiguousarray(t.sample(times)[:, :3]) for t in tracks])
    return scenario, _core.Fleet([d.id for d in scenario.drones], scenario.regions()), positions


def named(f: dict[str, Any]) -> dict[str, Any]:
    """The formula with the names of the scenario."""
    out = {k: named(v) if isinstance(v, dict) else v for k, v in f.items()}
    if "fs" in f:
        out["fs"] = [named(g) for g in f["fs"]]
    return {**out, "region": "cable_north"} if f.get("region") == "cable" else out


@cache
def judges() -> tuple[Judge, Judge, Judge]:
    scenario = flown()[0]
    return Judge(scenario), Judge(scenario, trusting=True), Judge(scenario, [])


@settings(max_examples=200, deadline=None, derandomize=True)
@given(formulas(depth=3))
def test_what_is_sure_is_so(formula: dict[str, Any]) -> None:
    _, fleet, positions = flown()
    f = named(formula)
    rho, _ = fleet.evaluate(f, positions, T_S)
    for judge in judges():
        sure = judge.over(negation_normal(f), 0.0, 0.0)
        if sure is not None:
            assert rho >= 0 if sure.true else rho <= 0, sure


def test_the_judges_are_not_silent() -> None:
    """What each of them is sure of: reach, a disjoint place, and what an invariant keeps."""
    plain, trusting, bare = judges()
    safe = {"op": "outside", "drone": "d1", "region": "tower"}
    whole = {"op": "always", "from": 0.0, "to": 60.0, "f": safe}
    far = {"op": "eventually", "from": 0.0, "to": 1.0, "f": {"op": "in", "drone": "d1", "region": "tr2"}}
    assert [j.over(whole, 0.0, 0.0) is None for j in (plain, trusting, bare)] == [True, False, True]
    assert [j.over(far, 0.0, 0.0) for j in (plain, trusting, bare)] == [bare.over(far, 0.0, 0.0)] * 3
    found = bare.over(far, 0.0, 0.0)
    assert found is not None and not found.true
