"""Other itineraries near one that is there: visits given to other drones, in other orders, at other times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from fleet.assign import EXACT
from fleet.legs import Legs
from fleet.route import leg_time, reach

from .knots import Array
from .leg_times import leg_times
from .problem import Problem
from .schedule import EASE, Itinerary, event_times, itinerary
from .survey import Map, survey

Orders = tuple[tuple[int, ...], ...]

#: Reorderings that are flown at most, the gentlest first.
MOST = 10


def reordered(problem: Problem, way: Itinerary, bound: float) -> Iterator[Itinerary]:
    """Itineraries with one visit moved to another place, or two swapped; none where orders are given."""
    visits = [stop.visit for stops in way.stops for stop in stops]
    if problem.given is not None or not visits:
        return
    # Visits that clauses without a normal form have added are the itinerary's own.
    own = replace(problem, spec=replace(problem.spec, visits=visits))
    world = survey(own, bound, local=len(visits) > EXACT)
    legs = leg_times(own, world, EASE[-1])
    count = 0
    now: list[tuple[int, ...]] = []
    for stops in way.stops:
        now.append(tuple(range(count, count + len(stops))))
        count += len(stops)
    found: list[tuple[float, Orders, list[Array]]] = []
    for orders in sorted(neighbours(tuple(now))):
        timed = [event_times(own, legs, d, order) for d, order in enumerate(orders)]
        times = [t for t in timed if t is not None]
        if len(times) == len(timed):
            found.append((effort(world, legs, orders, times), orders, times))
    for _, orders, times in sorted(found, key=lambda one: one[:2])[:MOST]:
        yield itinerary(own, world, list(orders), times)


def neighbours(orders: Orders) -> set[Orders]:
    """All orders with one event taken out and put in elsewhere, or two events swapped."""
    out: set[Orders] = set()
    places = [(d, k) for d, order in enumerate(orders) for k in range(len(order))]
    for d, k in places:
        event, rest = orders[d][k], [list(order) for order in orders]
        del rest[d][k]
        for e in range(len(orders)):
            for j in range(len(rest[e]) + 1):
                moved = [tuple(order) for order in rest]
                moved[e] = (*rest[e][:j], event, *rest[e][j:])
                out.add(tuple(moved))
    for n, (d, k) in enumerate(places):
        for e, j in places[:n]:
            swapped = [list(order) for order in orders]
            swapped[d][k], swapped[e][j] = orders[e][j], orders[d][k]
            out.add(tuple(tuple(order) for order in swapped))
    return out - {orders}


def effort(world: Map, legs: Legs, orders: Orders, times: list[Array]) -> float:
    """Integral of |a|^2 [m^2/s^3] of the legs flown on their own, rest to rest: 12 L^2 / T^3 each."""
    total = 0.0
    for d, order in enumerate(orders):
        at = [world.start[d], *(world.place[d][e] for e in order), world.home[d]]
        leave = [0.0, *(t + legs.dwell[e] for e, t in zip(order, times[d], strict=True))]
        arrive = [*times[d], legs.horizon]
        for (a, b), t0, t1 in zip(pairwise(at), leave, arrive, strict=True):
            path = world.ways.path(a, b)
            length = 0.0 if path is None else float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
            total += 12 * length**2 / max(t1 - t0, 1e-3) ** 3
    return total


def shifted(problem: Problem, way: Itinerary, spread: float, rng: np.random.Generator) -> Itinerary:
    """The itinerary with every visit moved by about `spread` [s], inside its window and in order."""
    out = []
    for stops, paths in zip(way.stops, way.paths, strict=True):
        least = [leg_time(reach(path), problem.v_max, problem.a_max, rest=False) for path in paths]
        moved, clock = [], 0.0
        for k, stop in enumerate(stops):
            # What the legs and windows after this visit leave of the time.
            latest, soonest = problem.horizon, clock + least[k]
            for j in reversed(range(k, len(stops))):
                later = stops[j].visit
                latest = min(latest - least[j + 1] - later.dwell, later.window[1])
            t = float(np.clip(stop.t + rng.normal(0.0, spread), soonest, max(latest, soonest)))
            t = float(np.clip(round(t / problem.sample) * problem.sample, *stop.visit.window))
            moved.append(replace(stop, t=round(t, 9)))
            clock = moved[-1].t + stop.visit.dwell
        out.append(tuple(moved))
    return Itinerary(tuple(out), way.paths)
