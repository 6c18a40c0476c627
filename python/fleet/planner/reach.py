"""Who can be where by when, at best: lower bounds of all leg times, and sets of visits that do not fit.

A leg lasts at least the longest axis of the way through free space at v_max, plus the time lost on
speeding up from rest or slowing down to rest at a_max, and at least the turn between the headings.
Nothing that these times forbid can be flown (limits hold per axis; design.md, Conventions).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from fleet.assign import EXACT, assign
from fleet.errors import Need
from fleet.legs import Legs, tour_time
from fleet.route import leg_time, turn_time

from .choices import ambiguous
from .knots import Array
from .leg_times import permitted
from .necessary import Geometry, gatherings
from .problem import Problem
from .spec import Visit
from .turns import shortest_turn

#: Largest sets of visits that are looked at one by one, so that the smallest is found.
LOOKED_AT = 3
#: Steps of bisection for the least extension of deadlines; the last is far below a sample.
BISECTIONS = 40


@dataclass(frozen=True)
class Reach:
    """Least leg times of some visits, and in which region each drone would do each of them."""

    problem: Problem
    visits: tuple[Visit, ...]
    legs: Legs

    def part(self, index: Sequence[int]) -> Reach:
        """Some of the visits alone."""
        return Reach(self.problem, tuple(self.visits[e] for e in index), chosen(self.legs, list(index)))


def chosen(legs: Legs, index: list[int]) -> Legs:
    """Leg times of some events alone."""
    return Legs(
        legs.first[:, index],
        legs.between[:, index][:, :, index],
        legs.last[:, index],
        legs.idle,
        legs.windows[index],
        legs.dwell[index],
        legs.horizon,
    )


def ramp(length: Array, v_max: float, a_max: float) -> Array:
    """Least time [s] to pass `length` [m] along one axis from rest, or to come to rest after it."""
    slow = np.sqrt(2 * length / a_max)
    return np.where(length * 2 * a_max < v_max**2, slow, length / v_max + v_max / (2 * a_max))


def least_times(problem: Problem, geometry: Geometry) -> Reach:
    """Lower bounds of all legs of the visits, those that `rest` needs included; infinite where barred.

    Visits that one drone may make in several regions are left out: bounds without them are bounds still.
    """
    extra = needed_by_rest(problem)
    visits = (*(visit for visit in problem.spec.visits if not ambiguous(visit)), *extra)
    drones, n = len(problem.ids), len(visits)
    first, last = np.full((drones, n), np.inf), np.full((drones, n), np.inf)
    between = np.full((drones, n, n), np.inf)
    v, a = problem.v_max, problem.a_max
    # Only visits that are stops of the plan have a heading to be reached.
    names = [*((r, True) for r in sorted(geometry.corners)), *((r, False) for r in sorted(geometry.corners))]
    number = {name: k for k, name in enumerate(names)}
    boxes = np.concatenate([box(geometry.corners[name]) for name, _ in names], axis=1)
    psi = [problem.headings.get(name) if stop else None for name, stop in names]
    starts = np.stack([problem.starts, problem.starts])
    away = np.array([[turn(problem, float(p), q) for q in psi] for p in problem.psi])
    turns = np.array([[turn(problem, p, q) for q in psi] for p in psi])
    out, ways = np.maximum(ramp(gap(starts, boxes), v, a), away), gap(boxes, boxes)
    back, legs = ramp(ways, v, a), np.maximum(ways / v, turns)
    homes = [number[h, False] for h in problem.homes]
    idle = np.array([leg_time(float(x), v, a) for x in gap(starts, boxes)[range(drones), homes]])
    dwell = np.array([visit.dwell for visit in visits])
    for d, name in enumerate(problem.ids):
        may = [e for e in range(n) if goes(problem, geometry, name, visits[e])]
        regions = [dict(visits[e].options)[name] for e in may]
        at = [number[r, e < n - len(extra)] for e, r in zip(may, regions, strict=True)]
        first[d, may], last[d, may] = out[d, at], back[at, homes[d]]
        between[d][np.ix_(may, may)] = legs[np.ix_(at, at)]
        between[d, may, may] = np.inf
        # Where regions overlap, one stay can be part of another.
        shared = (ways[np.ix_(at, at)] <= 0).sum(axis=1) > 1
        dwell[np.array(may, dtype=int)[shared]] = 0.0
        ordered(problem, name, may, regions, between[d])
    windows = np.array([visit.window for visit in visits], dtype=float).reshape(n, 2)
    return Reach(problem, visits, Legs(first, between, last, idle, windows, dwell, problem.horizon))


def needed_by_rest(problem: Problem) -> tuple[Visit, ...]:
    """Visits without which a clause that has no normal form is false whatever its witnesses and branches."""
    found = [
        Visit(part.clause, ((place["drone"], place["region"]),), (first, last))
        for part in problem.spec.rest
        for places, first, last in gatherings(part.formula, 0.0, 0.0)
        for place in places
        if place["region"] not in (problem.workspace, *problem.obstacles)
    ]
    return tuple(dict.fromkeys(found))


def ordered(problem: Problem, name: str, may: list[int], regions: list[str], between: Array) -> None:
    """Forbid legs against the order of targets that is given by hand."""
    order = (problem.given or {}).get(name, ())
    if not order:
        return
    for (e, one), (f, other) in combinations(zip(may, regions, strict=True), 2):
        if one in order and other in order and one != other:
            before, after = (e, f) if order.index(one) < order.index(other) else (f, e)
            between[after, before] = np.inf


def goes(problem: Problem, geometry: Geometry, drone: str, visit: Visit) -> bool:
    """Whether a drone may make a visit: named by it, not forbidden by hand, not barred by an invariant."""
    region = dict(visit.options).get(drone)
    if (
        region is None
        or region not in geometry.corners
        or not permitted(problem, problem.number(drone), visit)
    ):
        return False
    return len(geometry.corners[region]) > 0 and geometry.barred(drone, region, visit.window) is None


def box(corners: Array) -> Array:
    """Bounding box (2, 1, 3: low, high) of corners; everything when there are none."""
    if len(corners) == 0:
        return np.stack([np.full((1, 3), -np.inf), np.full((1, 3), np.inf)])
    return np.stack([corners.min(axis=0)[None], corners.max(axis=0)[None]])


def gap(one: Array, other: Array) -> Array:
    """Longest axis (m, n) [m] between boxes (2, m, 3) and (2, n, 3): a bound for what is inside."""
    over = np.maximum(one[0][:, None] - other[1][None], other[0][None] - one[1][:, None])
    return np.asarray(np.maximum(over, 0.0).max(axis=2))


def turn(problem: Problem, a: float | None, b: float | None) -> float:
    """Time [s] of the turn between two headings, none where one of them is free."""
    return 0.0 if a is None or b is None else turn_time(shortest_turn(a, b), problem.heading_rate)


def misfits(reach: Reach) -> Iterator[tuple[int, ...]]:
    """Sets of visits that no drones can make in their windows; small ones first."""
    legs, n = reach.legs, len(reach.visits)
    if (legs.idle > legs.horizon + 1e-9).any():
        yield ()
        return
    arrival = np.maximum(legs.first, legs.windows[:, 0])
    alone = (arrival <= legs.windows[:, 1] + 1e-9) & (arrival + legs.dwell + legs.last <= legs.horizon + 1e-9)
    for e in np.flatnonzero(~alone.any(axis=0)):
        yield (int(e),)
    if n > EXACT:
        # What only one drone can do, that drone must do.
        for d in range(len(legs.idle)):
            own = [int(e) for e in np.flatnonzero((alone.sum(axis=0) == 1) & alone[d])]
            if 1 < len(own) <= EXACT:
                yield from smallest(reach, own)
        return
    yield from smallest(reach, list(range(n)))


def smallest(reach: Reach, index: list[int]) -> Iterator[tuple[int, ...]]:
    """The smallest set among the visits `index` that does not fit, if there is any."""
    if fits(reach, index):
        return
    for size in range(1, LOOKED_AT + 1):
        for some in combinations(index, size):
            if not fits(reach, some):
                yield some
                return
    kept = list(index)
    for e in index:
        without = [k for k in kept if k != e]
        if not fits(reach, without):
            kept = without
    yield tuple(kept)


def fits(reach: Reach, index: Sequence[int]) -> bool:
    """Whether some drones can make these visits."""
    return assign(chosen(reach.legs, list(index))) is not None


def needs(reach: Reach) -> list[Need]:
    """Every visit, and coming home, on the tours that make all visits with the least delay.

    Empty when there is no way at all.
    """
    legs = reach.legs

    def tours(late: float) -> list[tuple[int, ...]] | None:
        windows = np.column_stack([legs.windows[:, 0], legs.windows[:, 1] + late])
        return assign(replace(legs, windows=windows, horizon=legs.horizon + late))

    finite = [x[np.isfinite(x)].sum() for x in (legs.first, legs.between, legs.last, legs.idle)]
    low, high = 0.0, float(sum(finite) + legs.dwell.sum() + legs.horizon)
    best = tours(high)
    if best is None:
        return []
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        found = tours(middle)
        low, high, best = (low, middle, found) if found is not None else (middle, high, best)
    return [need for d, order in enumerate(best) for need in timeline(reach, d, order)]


def timeline(reach: Reach, drone: int, order: Sequence[int]) -> Iterator[Need]:
    """The earliest times of one drone along its order of visits, deadlines aside."""
    legs, name = reach.legs, reach.problem.ids[drone]
    clock, before = 0.0, -1
    for e in order:
        leg = legs.first[drone, e] if before < 0 else legs.between[drone, before, e]
        clock = max(clock + float(leg), float(legs.windows[e, 0]))
        region = dict(reach.visits[e].options)[name]
        yield Need(name, region, clock, float(legs.windows[e, 1]))
        clock, before = clock + float(legs.dwell[e]), e
    home = tour_time(replace(legs, windows=unbounded(legs), horizon=np.inf), drone, order)
    yield Need(name, reach.problem.homes[drone], home, legs.horizon)


def unbounded(legs: Legs) -> Array:
    """The windows without their ends."""
    return np.column_stack([legs.windows[:, 0], np.full(len(legs.windows), np.inf)])
