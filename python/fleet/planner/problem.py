"""The planning problem as arrays, made once from a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .knots import Array
from .spec import Invariant, Specification, specification
from .weights import shares

if TYPE_CHECKING:
    from fleet.scenario import Region, Scenario

#: Share of the closing speed that the pair margin adds [s] (design.md, Tube).
CLOSING = 0.02


@dataclass(frozen=True)
class Problem:
    """Regions are faces (n, 4): outward unit normal and offset [m]; drones are numbered in order.

    `starts` (d, 3) [m], `psi` (d,) heading at the start [rad], `homes` region name per drone,
    `headings` required heading per target [rad],
    `segment` longest segment [s], `c` sharpness of smooth robustness [1/m], `max_iterations` and
    `tolerance` those of the nonlinear program, `given` hand-made orders of targets, or None, `weights` of
    clauses by id, the heaviest 1 (weights.py), `excused` clauses that a plan may violate (relax.py),
    `split` drone of each target where the paper's split is asked for, `proved` whether the assignment must be
    the proved best.
    """

    ids: tuple[str, ...]
    starts: Array
    psi: Array
    homes: tuple[str, ...]
    regions: Mapping[str, Array]
    centers: Mapping[str, Array]
    inradii: Mapping[str, float]
    headings: Mapping[str, float | None]
    workspace: str
    obstacles: tuple[str, ...]
    spec: Specification
    horizon: float
    sample: float
    v_max: float
    a_max: float
    heading_rate: float
    tube: float
    segment: float
    c: float
    max_iterations: int
    tolerance: float
    given: Mapping[str, tuple[str, ...]] | None
    weights: Mapping[str, float]
    excused: frozenset[str] = frozenset()
    split: Mapping[str, str] = field(default_factory=dict)
    proved: bool = False

    def number(self, drone: str) -> int:
        """Index of a drone."""
        return self.ids.index(drone)

    def weight(self, clause: str) -> float:
        """Weight of a clause; 1 for what the mission does not name, such as coming home at T."""
        return self.weights.get(clause, 1.0)

    def walls(self) -> tuple[str, ...]:
        """Regions that routes keep off: obstacles, and what no drone may enter all through the mission."""
        kept: dict[str, set[str]] = {}
        for inv in self.spec.invariants:
            if inv.kind == "outside" and inv.window[0] <= 0 and inv.window[1] >= self.horizon - 1e-9:
                kept.setdefault(inv.region, set()).add(inv.drones[0])
        closed = (r for r, drones in kept.items() if drones >= set(self.ids))
        return tuple(dict.fromkeys([*self.obstacles, *closed]))

    def pairs(self) -> list[tuple[int, int, Invariant]]:
        """Pairs of drones (a < b) that must keep apart, each once, by the heaviest invariant that says so."""
        found: dict[tuple[int, int, float, tuple[float, float]], Invariant] = {}
        for inv in self.spec.invariants:
            if inv.kind == "apart":
                a, b = sorted(self.number(d) for d in inv.drones)
                key = (a, b, inv.value, inv.window)
                if key not in found or self.weight(inv.clause) > self.weight(found[key].clause):
                    found[key] = inv
        return [(a, b, inv) for (a, b, _, _), inv in found.items()]


def faces_of(region: Region) -> Array:
    """Faces (n, 4) of a scenario region."""
    return np.column_stack([region.A, region.b])


def problem(scenario: Scenario) -> Problem:
    """The arrays of a scenario; its mission in normal form."""
    named = {region.name: region for region in scenario.every_region}
    mission, limits = scenario.mission, scenario.limits
    given = scenario.assignment
    return Problem(
        ids=tuple(d.id for d in scenario.drones),
        starts=np.array([d.start for d in scenario.drones], dtype=float),
        psi=np.array([d.pad_heading for d in scenario.drones], dtype=float),
        homes=tuple(f"home.{d.id}" for d in scenario.drones),
        regions={name: faces_of(r) for name, r in named.items()},
        centers={name: np.asarray(r.center, dtype=float) for name, r in named.items()},
        inradii={name: float(r.inradius) for name, r in named.items()},
        headings={t.name: t.heading for t in scenario.targets},
        workspace=scenario.workspace.name,
        obstacles=tuple(o.name for o in scenario.obstacles),
        spec=specification(scenario.clauses(), float(mission.T)),
        horizon=float(mission.T),
        sample=float(mission.T_s),
        v_max=float(limits.v_max),
        a_max=float(limits.a_max),
        heading_rate=float(limits.heading_rate),
        tube=float(limits.tube),
        segment=float(scenario.planner.segment),
        c=float(mission.c),
        max_iterations=int(scenario.planner.max_iterations),
        tolerance=float(scenario.planner.tolerance),
        given=None if given is None else {d: tuple(order) for d, order in given.items()},
        weights=shares(scenario.clauses()),
        split=balanced(scenario) if scenario.planner.assignment == "paper" else {},
        proved=scenario.planner.assignment == "exact",
    )


def balanced(scenario: Scenario) -> dict[str, str]:
    """The paper's split: targets dealt to the drones in turn.

    Its inspection formula (section on the power tower) gives tr1 and tr3 to one cluster of drones, tr2 and
    tr4 to the other, and asks for a balance only.
    """
    ids = [d.id for d in scenario.drones]
    return {target.name: ids[k % len(ids)] for k, target in enumerate(scenario.targets)}
