"""Energy of plans for power_tower_energy: ours, a long IPOPT run at the same floor, the paper's method.

The IPOPT run (reference.py) leaves peers and electrical energy out of account, so its figure is a lower mark
than any plan's. tests/unit/test_planner_energy.py holds ours to the figure stored there, which this prints.
"""

import time
from dataclasses import replace
from typing import Any

import numpy as np

from fleet import _core, certificate
from fleet.errors import InfeasibleError
from fleet.planner import PlanResult, plan
from fleet.planner.plan import itineraries, wanted
from fleet.planner.problem import problem
from fleet.scenario import Scenario, load
from tests.bench import reference
from tests.bench.table import ROOT, publish

CASE = "power_tower_energy"


def row(name: str, found: PlanResult, cpu_s: float) -> dict[str, Any]:
    """One plan."""
    return {
        "case": CASE,
        "plan": name,
        "cpu_s": cpu_s,
        "int_a2": found.int_a2,
        "rho": found.rho,
        "rho_lower": found.rho_lower,
        "energy_J": found.energy,
        "hover_share": found.hover_share,
        "status": str(found.status),
    }


def planned(name: str, scenario: Scenario, method: str = "auto") -> dict[str, Any]:
    """Plan and measure; a plan that a method does not find is a row without numbers."""
    begin = time.process_time()
    try:
        found = plan(scenario, method=method)
    except InfeasibleError as error:
        empty = dict.fromkeys(("int_a2", "rho", "rho_lower", "energy_J", "hover_share"))
        return {
            "case": CASE,
            "plan": name,
            "cpu_s": time.process_time() - begin,
            **empty,
            "status": str(error),
        }
    return row(name, found, time.process_time() - begin)


def yardstick(scenario: Scenario) -> dict[str, Any]:
    """The best that IPOPT finds, certified like any plan; its visit times are between samples."""
    begin = time.process_time()
    task = problem(scenario)
    way = itineraries(task, wanted(task))[0][0]
    assert scenario.energy is not None and scenario.energy.floor is not None
    tours = [reference.best_tour(task, way, d, scenario.energy.floor)[0] for d in range(len(task.ids))]
    spent = time.process_time() - begin
    tracks = []
    for tour in tours:
        rows = np.hstack([tour.times[:, None], tour.knots, np.zeros((len(tour.knots), 3))])
        tracks.append(_core.Trajectory(rows))
    clauses = [(c.id, c.formula) for c in scenario.clauses()]
    proof = certificate.prove(list(task.ids), scenario.regions(), clauses, tracks, task.horizon, task.sample)
    totals, hovers = zip(*(track.energy() for track in tracks), strict=True)
    return {
        "case": CASE,
        "plan": "long IPOPT",
        "cpu_s": spent,
        "int_a2": sum(tour.cost for tour in tours),
        "rho": proof.rho,
        "rho_lower": proof.rho_lower,
        "energy_J": sum(totals),
        "hover_share": sum(hovers) / sum(totals),
        "status": "reference",
    }


if __name__ == "__main__":
    shipped = load(ROOT / "scenarios" / f"{CASE}.toml")
    assert shipped.energy is not None
    weighted = shipped.energy.model_copy(update={"objective": "weighted"})
    rows = [
        planned("basic", replace(shipped, energy=None)),
        planned("lexicographic", shipped),
        planned("weighted", replace(shipped, energy=weighted)),
        yardstick(shipped),
        planned("method paper", shipped, method="paper"),
    ]
    publish("energy", rows)
    ours, best, paper = (rows[k]["int_a2"] for k in (1, 3, 4))
    print(f"lexicographic over long IPOPT: {ours / best:.4f} (at most 1.05)")
    if paper is not None:
        print(f"lexicographic over method paper: {ours / paper:.4f} (at most 0.5)")
