"""What can be told of formulas without a flight: from regions, starts, limits and the mission's invariants.

Only what is certain is said; silence is no promise that a plan exists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from fleet.stl.vocabulary import Formula

from .knots import Array
from .spec import Invariant, specification

if TYPE_CHECKING:
    from fleet.scenario import Region, Scenario


@dataclass(frozen=True)
class Sure:
    """A formula is certainly true (or false) over an interval of times, why, and by which other clauses."""

    true: bool
    why: str
    by: tuple[str, ...] = ()


@dataclass
class Judge:
    """Decides formulas in negation normal form where regions, reach and `invariants` are enough to."""

    scenario: Scenario
    invariants: list[Invariant]
    trusting: bool
    regions: dict[str, Region] = field(init=False)
    starts: dict[str, Array] = field(init=False)
    by_kind: dict[tuple[str, frozenset[str]], list[Invariant]] = field(init=False)
    needed: dict[tuple[str, str], float] = field(init=False)
    overlapping: dict[tuple[str, str], bool] = field(init=False)

    def __init__(
        self, scenario: Scenario, invariants: Iterable[Invariant] | None = None, *, trusting: bool = False
    ) -> None:
        """Takes the invariants that hold in any case; those of the whole mission if not given.

        A `trusting` judge calls what an invariant says true; of invariants that a formula itself asks
        for, that would prove nothing.
        """
        self.scenario, self.trusting = scenario, trusting
        if invariants is None:
            invariants = specification(scenario.clauses(), float(scenario.mission.T)).invariants
        self.invariants = list(invariants)
        self.regions = {r.name: r for r in scenario.every_region}
        self.starts = {d.id: np.asarray(d.start, dtype=float) for d in scenario.drones}
        self.by_kind, self.needed, self.overlapping = {}, {}, {}
        for i in self.invariants:
            self.by_kind.setdefault((i.kind, frozenset(i.drones)), []).append(i)

    def over(self, f: Formula, first: float, last: float) -> Sure | None:
        """Whether `f` holds at every time from `first` to `last` [s], or at none of them; None if unsure."""
        op = f["op"]
        if op == "and":
            return self._together(f["fs"], first, last) or self._fold(f["fs"], first, last, False)
        if op == "or":
            return self._fold(f["fs"], first, last, True)
        if op in ("always", "eventually"):
            return self._ahead(f, first, last)
        if op in ("once", "historically"):
            return self._back(f, first, last)
        if op in ("until", "since"):
            return self._chain(f, first, last)
        if op == "not":
            found = self.over(f["f"], first, last)
            return None if found is None else Sure(not found.true, found.why, found.by)
        judges: dict[str, Callable[[Formula, float, float], Sure | None]] = {
            "in": self._inside, "outside": self._outside, "dist": self._distance, "linear": self._linear,
        }  # fmt: skip
        return judges[op](f, first, last)

    def _ahead(self, f: Formula, first: float, last: float) -> Sure | None:
        """Over the whole of what it looks at, or at one time of its window for all of the times."""
        a, b = f["from"], f["to"]
        whole = self.over(f["f"], first + a, last + b)
        if whole is not None:
            return whole
        inner = (i.window[0] for i in self.invariants) if first == last and f["op"] == "eventually" else ()
        times = [a, b, *(t - first for t in dict.fromkeys(inner) if first + a < t < first + b)]
        ends = (self.over(f["f"], first + t, last + t) for t in times)
        return next((s for s in ends if s is not None and s.true == (f["op"] == "eventually")), None)

    def _back(self, f: Formula, first: float, last: float) -> Sure | None:
        """What lies before mission time 0 decides nothing here; windows that are cut there do."""
        a, b = f["from"], f["to"]
        return self.over(f["f"], max(0.0, first - b), last - a) if first >= a else None

    def _chain(self, f: Formula, first: float, last: float) -> Sure | None:
        """Until and since fail where one of their sides does."""
        a, b = f["from"], f["to"]
        if f["op"] == "since":
            sides = [("right", max(0.0, first - b), last - a)] if last >= a else []
        else:
            sides = [("right", first + a, last + b)]
        for side, start, end in (*sides, ("left", first, last)):
            found = self.over(f[side], start, end)
            if found is not None and not found.true:
                return found
        return None

    def _fold(self, fs: list[Formula], first: float, last: float, wanted: bool) -> Sure | None:
        """One part that is `wanted` decides; the other way all parts must agree."""
        decided = []
        for g in fs:
            s = self.over(g, first, last)
            if s is not None and s.true == wanted:
                return s
            decided.append(s)
        agreed = [s for s in decided if s is not None]
        if len(agreed) < len(decided):
            return None
        why = "; ".join(dict.fromkeys(s.why for s in agreed))
        return Sure(not wanted, why, tuple(dict.fromkeys(c for s in agreed for c in s.by)))

    def _together(self, fs: list[Formula], first: float, last: float) -> Sure | None:
        """No drone is in two regions that share no inside at once."""
        places = [g for g in fs if g["op"] == "in"]
        for a, b in combinations(places, 2):
            if a["drone"] == b["drone"] and not self._overlap(a["region"], b["region"]):
                where = f"{a['region']} and {b['region']}"
                return Sure(False, f"{a['drone']} cannot be in {where} at once: they are disjoint")
        return None

    def _overlap(self, one: str, other: str) -> bool:
        key = (min(one, other), max(one, other))
        if key not in self.overlapping:
            self.overlapping[key] = one == other or self.regions[one].overlaps(self.regions[other])
        return self.overlapping[key]

    def _kept(self, kind: str, drones: Iterable[str], first: float, last: float) -> Iterator[Invariant]:
        """The invariants of a kind that cover all of these times."""
        for i in self.by_kind.get((kind, frozenset(drones)), []):
            if i.window[0] <= first + 1e-9 and i.window[1] >= last - 1e-9:
                yield i

    def _too_far(self, drone: str, region: str, last: float) -> str | None:
        """Why the drone cannot be in the region by `last` [s]; None if it may be."""
        if (drone, region) not in self.needed:
            corners, start = self.regions[region].vertices, self.starts[drone]
            limits = self.scenario.limits
            # Into the box around a region it is no farther than into the region itself.
            way = np.maximum(corners.min(axis=0) - start, start - corners.max(axis=0)).max()
            self.needed[drone, region] = _least_time(max(float(way), 0.0), limits.v_max, limits.a_max)
        needs = self.needed[drone, region]
        if needs <= last + 1e-9:
            return None
        return f"{drone} cannot be in {region} by {last:g} s: it needs {needs:.1f} s or more"

    def _inside(self, f: Formula, first: float, last: float) -> Sure | None:
        drone, region = f["drone"], f["region"]
        far = self._too_far(drone, region, last)
        if far is not None:
            return Sure(False, far)
        for i in self._kept("inside", (drone,), first, last):
            if self.trusting and self.regions[region].covers(self.regions[i.region]):
                return Sure(True, f"@{i.clause} keeps {drone} in {i.region} then", (i.clause,))
            if not self._overlap(i.region, region):
                why = f"{drone} cannot be in {region}: @{i.clause} keeps it in {i.region} then"
                return Sure(False, why, (i.clause,))
        for i in self._kept("outside", (drone,), first, last):
            if self.regions[i.region].covers(self.regions[region]):
                why = f"{drone} cannot be in {region}: @{i.clause} keeps it outside {i.region}"
                return Sure(False, why, (i.clause,))
        return None

    def _outside(self, f: Formula, first: float, last: float) -> Sure | None:
        drone, region = f["drone"], f["region"]
        if last <= 0 and self.regions[region].depth(self.starts[drone]) >= 0:
            return Sure(False, f"{drone} starts in {region}")
        far = self._too_far(drone, region, last)
        if far is not None:
            return Sure(True, far)
        for i in self._kept("outside", (drone,), first, last) if self.trusting else ():
            if self.regions[i.region].covers(self.regions[region]):
                return Sure(True, f"@{i.clause} keeps {drone} outside {i.region} then", (i.clause,))
        for i in self._kept("inside", (drone,), first, last):
            if self.regions[region].covers(self.regions[i.region]):
                why = f"{drone} cannot leave {region}: @{i.clause} keeps it in {i.region}"
                return Sure(False, why, (i.clause,))
            if not self._overlap(i.region, region):
                why = f"@{i.clause} keeps {drone} in {i.region}, which is outside of {region}"
                return Sure(True, why, (i.clause,))
        return None

    def _distance(self, f: Formula, first: float, last: float) -> Sure | None:
        pair, value, least = (f["a"], f["b"]), float(f["value"]), f["cmp"] == "ge"
        text = f"dist({pair[0]}, {pair[1]})"
        if least and value == 0:
            return Sure(True, f"{text} is never below 0 m")
        kept = max(self._kept("apart", pair, first, last), key=lambda i: i.value, default=None)
        if kept is not None and value <= kept.value and (self.trusting or not least):
            why = f"{text} is {kept.value:g} m or more by the mission's own separation, @{kept.clause}"
            return Sure(least, why, (kept.clause,))
        start = float(np.linalg.norm(self.starts[pair[0]] - self.starts[pair[1]]))
        # Limits hold per axis, so that a speed is at most sqrt(3) v_max.
        change = 2 * np.sqrt(3) * self.scenario.limits.v_max * last
        if start - change > value or start + change < value:
            far = start - change > value
            shown = (
                f"{text} is {start:.1f} m at the start and cannot {'fall' if far else 'rise'} to {value:g} m"
            )
            return Sure(far == least, f"{shown} by {last:g} s")
        room = self._corners(pair, first, last)
        if room is not None:
            corners, by = room
            widest = max(float(np.linalg.norm(p - q)) for p, q in combinations(corners, 2))
            if value >= widest:
                return Sure(not least, f"{text} is at most {widest:.1f} m, the width of the workspace", by)
        return None

    def _corners(
        self, drones: Iterable[str], first: float, last: float
    ) -> tuple[Array, tuple[str, ...]] | None:
        """Corners of the workspace, and by which clauses, if all of the drones are kept inside it then."""
        space, by = self.scenario.workspace, []
        for d in drones:
            kept = next((i for i in self._kept("inside", (d,), first, last) if i.region == space.name), None)
            if kept is None:
                return None
            by.append(kept.clause)
        return space.vertices, tuple(dict.fromkeys(by))

    def _linear(self, f: Formula, first: float, last: float) -> Sure | None:
        drones = tuple(dict.fromkeys(t["drone"] for t in f["terms"]))
        room = self._corners(drones, first, last)
        if room is None:
            return None
        corners, by = room
        low = high = float(f["constant"])
        for d in drones:
            row = np.zeros(3)
            for t in (t for t in f["terms"] if t["drone"] == d):
                row["xyz".index(t["axis"])] += t["coef"]
            low, high = low + float((corners @ row).min()), high + float((corners @ row).max())
        if high <= 0:
            return Sure(False, "no positions in the workspace satisfy this linear condition", by)
        if low > 0:
            return Sure(True, "all positions in the workspace satisfy this linear condition", by)
        return None


def _least_time(length: float, v_max: float, a_max: float) -> float:
    """Least time [s] to pass `length` [m] along one axis from rest, at the limits."""
    ramp = length * 2 * a_max < v_max**2
    return float(np.sqrt(2 * length / a_max) if ramp else length / v_max + v_max / (2 * a_max))
