"""What a mission formula says in vain: clauses that cannot hold, and clauses that hold whatever is flown.

Only what can be told for certain from regions, start positions, v_max and the mission's own invariants
is said; silence is no promise that a plan exists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from fleet.planner.spec import Invariant, negation_normal, specification
from fleet.stl.vocabulary import Formula

if TYPE_CHECKING:
    from fleet.scenario import Region, Scenario


@dataclass(frozen=True)
class Doubt:
    """A clause and what is wrong with it; `code` is "contradictory" or "vacuous"."""

    clause: str
    code: str
    message: str


@dataclass(frozen=True)
class Sure:
    """A formula is certainly true (or false) over an interval of times, and why."""

    true: bool
    why: str


class Judge:
    """Decides formulas in negation normal form where regions, reach and invariants are enough to."""

    def __init__(self, scenario: Scenario, invariants: list[Invariant] | None = None) -> None:
        """Takes the invariants that hold in any case; those of the whole mission if not given."""
        self._scenario = scenario
        spaces = [scenario.workspace, *scenario.obstacles, *scenario.targets]
        self._regions: dict[str, Region] = {r.name: r for r in (*spaces, *(d.home for d in scenario.drones))}
        self._starts = {d.id: np.asarray(d.start, dtype=float) for d in scenario.drones}
        if invariants is None:
            invariants = specification(scenario.clauses(), float(scenario.mission.T)).invariants
        self._invariants = invariants

    def over(self, f: Formula, first: float, last: float) -> Sure | None:
        """Whether `f` holds at every time from `first` to `last` [s], or at none of them; None if unsure."""
        op = f["op"]
        if op == "and":
            return self._together(f["fs"], first, last) or self._fold(f["fs"], first, last, False)
        if op == "or":
            return self._fold(f["fs"], first, last, True)
        if op in ("always", "eventually"):
            # Over the whole of what it looks at, or at one end of its window for all of the times.
            a, b = f["from"], f["to"]
            whole = self.over(f["f"], first + a, last + b)
            ends = [self.over(f["f"], first + t, last + t) for t in (a, b)]
            decided = [s for s in ends if s is not None and s.true == (op == "eventually")]
            return whole or next(iter(decided), None)
        if op == "until":
            for side, start, end in (("right", f["from"], f["to"]), ("left", 0.0, 0.0)):
                found = self.over(f[side], first + start, last + end)
                if found is not None and not found.true:
                    return found
            return None
        if op == "not":
            found = self.over(f["f"], first, last)
            return None if found is None else Sure(not found.true, found.why)
        judges: dict[str, Callable[[Formula, float, float], Sure | None]] = {
            "in": self._inside, "outside": self._outside, "dist": self._distance, "linear": self._linear,
        }  # fmt: skip
        return judges[op](f, first, last)

    def _fold(self, fs: list[Formula], first: float, last: float, wanted: bool) -> Sure | None:
        """One part that is `wanted` decides; the other way all parts must agree."""
        found = [self.over(g, first, last) for g in fs]
        decided = [s for s in found if s is not None]
        for s in decided:
            if s.true == wanted:
                return s
        return Sure(not wanted, "; ".join(s.why for s in decided)) if len(decided) == len(found) else None

    def _together(self, fs: list[Formula], first: float, last: float) -> Sure | None:
        """No drone is in two regions that share no inside at once."""
        places = [g for g in fs if g["op"] == "in"]
        for a, b in combinations(places, 2):
            if a["drone"] == b["drone"] and not self._overlap(a["region"], b["region"]):
                where = f"{a['region']} and {b['region']}"
                return Sure(False, f"{a['drone']} cannot be in {where} at once: they are disjoint")
        return None

    def _overlap(self, one: str, other: str) -> bool:
        return one == other or self._regions[one].overlaps(self._regions[other])

    def _kept(self, kind: str, drones: tuple[str, ...], first: float, last: float) -> list[Invariant]:
        """The mission's own invariants of a kind that cover all of these times."""
        return [
            i
            for i in self._invariants
            if i.kind == kind
            and set(i.drones) == set(drones)
            and i.window[0] <= first + 1e-9
            and i.window[1] >= last - 1e-9
        ]

    def _needs(self, drone: str, region: str) -> float:
        """Time [s] before which the region is out of reach: from rest, at the limits, along one axis."""
        from scipy.optimize import linprog

        shape, start, limits = self._regions[region], self._starts[drone], self._scenario.limits
        rows = [np.column_stack([shape.A, np.zeros(len(shape.b))])]
        rows += [np.column_stack([sign * np.eye(3), -np.ones(3)]) for sign in (1, -1)]
        rhs = np.concatenate([shape.b, start, -start])
        found = linprog([0, 0, 0, 1], A_ub=np.vstack(rows), b_ub=rhs, bounds=[(None, None)] * 4)
        if found.x is None:
            raise RuntimeError(f"the distance from {drone} to {region}, a linear program, was not solved")
        length = max(float(found.x[3]), 0.0)
        v, a = limits.v_max, limits.a_max
        return float(np.sqrt(2 * length / a)) if length * 2 * a < v**2 else length / v + v / (2 * a)

    def _inside(self, f: Formula, first: float, last: float) -> Sure | None:
        drone, region = f["drone"], f["region"]
        needs = self._needs(drone, region)
        if needs > last + 1e-9:
            return Sure(False, f"{drone} cannot be in {region} by {last:g} s: it needs {needs:.1f} s or more")
        for i in self._kept("inside", (drone,), first, last):
            if not self._overlap(i.region, region):
                return Sure(False, f"{drone} cannot be in {region}: @{i.clause} keeps it in {i.region} then")
        for i in self._kept("outside", (drone,), first, last):
            if self._regions[i.region].covers(self._regions[region]):
                return Sure(False, f"{drone} cannot be in {region}: @{i.clause} keeps it outside {i.region}")
        return None

    def _outside(self, f: Formula, first: float, last: float) -> Sure | None:
        drone, region = f["drone"], f["region"]
        if last <= 0 and self._regions[region].depth(self._starts[drone]) >= 0:
            return Sure(False, f"{drone} starts in {region}")
        needs = self._needs(drone, region)
        if needs > last + 1e-9:
            return Sure(True, f"{drone} cannot be in {region} by {last:g} s: it needs {needs:.1f} s or more")
        for i in self._kept("inside", (drone,), first, last):
            if self._regions[region].covers(self._regions[i.region]):
                return Sure(False, f"{drone} cannot leave {region}: @{i.clause} keeps it in {i.region}")
            if not self._overlap(i.region, region):
                return Sure(True, f"@{i.clause} keeps {drone} in {i.region}, which is outside of {region}")
        return None

    def _distance(self, f: Formula, first: float, last: float) -> Sure | None:
        pair, value, least = (f["a"], f["b"]), float(f["value"]), f["cmp"] == "ge"
        text = f"dist({pair[0]}, {pair[1]})"
        if least and value == 0:
            return Sure(True, f"{text} is never below 0 m")
        nearest = max([0.0, *(i.value for i in self._kept("apart", pair, first, last))])
        if not least and value <= nearest:
            return Sure(False, f"{text} is {nearest:g} m or more by the mission's own separation")
        start = float(np.linalg.norm(self._starts[pair[0]] - self._starts[pair[1]]))
        # Limits hold per axis, so that a speed is at most sqrt(3) v_max.
        change = 2 * np.sqrt(3) * self._scenario.limits.v_max * last
        if start - change > value or start + change < value:
            far = start - change > value
            shown = (
                f"{text} is {start:.1f} m at the start and cannot {'fall' if far else 'rise'} to {value:g} m"
            )
            return Sure(far == least, f"{shown} by {last:g} s")
        corners = self._corners(pair, first, last)
        if corners is not None:
            widest = max(float(np.linalg.norm(p - q)) for p, q in combinations(corners, 2))
            if value >= widest:
                return Sure(not least, f"{text} is at most {widest:.1f} m, the width of the workspace")
        return None

    def _corners(self, drones: tuple[str, ...], first: float, last: float) -> np.ndarray | None:
        """Corners of the workspace if all of the drones are kept inside it then."""
        space = self._scenario.workspace
        kept = (any(i.region == space.name for i in self._kept("inside", (d,), first, last)) for d in drones)
        return space.vertices if all(kept) else None

    def _linear(self, f: Formula, first: float, last: float) -> Sure | None:
        drones = tuple(dict.fromkeys(t["drone"] for t in f["terms"]))
        corners = self._corners(drones, first, last)
        if corners is None:
            return None
        low = high = float(f["constant"])
        for d in drones:
            row = np.zeros(3)
            for t in (t for t in f["terms"] if t["drone"] == d):
                row["xyz".index(t["axis"])] += t["coef"]
            low, high = low + float((corners @ row).min()), high + float((corners @ row).max())
        if high <= 0:
            return Sure(False, "no positions in the workspace satisfy this linear condition")
        return Sure(True, "all positions in the workspace satisfy this linear condition") if low > 0 else None


def doubts(scenario: Scenario) -> list[Doubt]:
    """Clauses of a scenario that cannot hold, or that say nothing."""
    judge = Judge(scenario)
    out = []
    for clause in scenario.clauses():
        found = judge.over(negation_normal(clause.formula), 0.0, 0.0)
        if found is not None:
            out.append(Doubt(clause.id, "vacuous" if found.true else "contradictory", found.why))
    return out
