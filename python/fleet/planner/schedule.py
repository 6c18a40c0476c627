"""From the problem to an itinerary: who visits what and when, along which way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from fleet.assign import EXACT, assign
from fleet.errors import InfeasibleError
from fleet.legs import Legs, cost
from fleet.route import spread

from .choices import chosen
from .knots import Array
from .leg_times import Ease, leg_times
from .problem import Problem
from .spec import Visit
from .survey import Map, survey
from .turns import least_legs

#: Factors on rest-to-rest leg times, tried in turn: room for smooth flight first.
EASE = (1.4, 1.15, 1.0)
#: Share of the mission that visits keep from the ends of their windows, where time allows.
SPARE = 0.04
#: Fleets up to this size are routed over the whole map [drones].
FEW = 8


@dataclass(frozen=True)
class Stop:
    """One visit of one drone: at time `t` [s] in `region` at `point` (3,) [m], for `dwell` [s]."""

    visit: Visit
    region: str
    point: Array
    t: float


@dataclass(frozen=True)
class Itinerary:
    """Stops of every drone in order, and the polyline of every leg (the last one goes home)."""

    stops: tuple[tuple[Stop, ...], ...]
    paths: tuple[tuple[Array, ...], ...]


def by_hand(problem: Problem, orders: list[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Orders of visits with the hand-made order of targets put in where there is one."""
    if problem.given is None:
        return orders
    out = []
    for d, name in enumerate(problem.ids):
        wanted = problem.given.get(name, ())
        region = {e: next(r for k, r in problem.spec.visits[e].options if k == name) for e in orders[d]}
        rank = {e: wanted.index(r) if r in wanted else len(wanted) for e, r in region.items()}
        out.append(tuple(sorted(orders[d], key=lambda e: rank[e])))
    return out


def schedules(problem: Problem, bound: float, *, whole: bool = True) -> Iterator[Itinerary]:
    """Itineraries to start from, routed at a clearance of up to `bound` [m], in order of preference.

    The first spreads the slack evenly; then come visits as early and as late as can be, for invariants
    that hold over a part of the mission only, and then those of faster legs. Large fleets are routed
    among near places, and where that fails over the `whole` map. Raises InfeasibleError, naming the
    clause, when even flight through at v_max misses a window.
    """
    problem = replace(problem, obstacles=problem.walls())
    if len(problem.spec.visits) > EXACT or len(problem.ids) > FEW:
        world = survey(problem, bound, local=True)
        found = begun(timed_itineraries(problem, world))
        if found is None and not whole:
            raise unreachable(problem, world)
        if found is not None:
            yield from found
            return
    world = survey(problem, bound)
    found = begun(timed_itineraries(problem, world))
    asked = asked_for(problem)
    if found is None and asked != problem.obstacles:
        # Ways keep off every obstacle where they can, and off those of the mission in any case.
        world = survey(replace(problem, obstacles=asked), bound)
        found = begun(timed_itineraries(problem, world))
    if found is None:
        raise unreachable(problem, world)
    yield from found


def begun(source: Iterator[Itinerary]) -> Iterator[Itinerary] | None:
    """The iterator with its first item made, or None when it has none."""
    first = next(source, None)
    return None if first is None else chain([first], source)


def asked_for(problem: Problem) -> tuple[str, ...]:
    """The obstacles that the mission speaks of; all of them where it has clauses without a normal form."""
    if problem.spec.rest:
        return problem.obstacles
    named = {inv.region for inv in problem.spec.invariants if inv.kind == "outside"}
    return tuple(o for o in problem.obstacles if o in named)


def timed_itineraries(problem: Problem, world: Map) -> Iterator[Itinerary]:
    """The itineraries of `schedules` over the ways of `world`; none when a window would be missed."""
    known: list[tuple[object, ...]] = []
    for ease in (*EASE, "through", "edges", None):
        found = assigned(problem, world, ease)
        if found is None:
            continue
        one, ways, legs, orders = found
        orders = by_hand(one, orders)
        timed = [event_times(one, legs, d, order) for d, order in enumerate(orders)]
        times = [t for t in timed if t is not None]
        if len(times) < len(timed):
            continue
        mark = (ways.place, *map(tuple, orders), *map(tuple, times))
        if mark not in known:
            yield itinerary(one, ways, orders, times)
        for late in (False, True) if not known else ():
            shifted = [extreme_times(one, legs, d, order, late) for d, order in enumerate(orders)]
            yield itinerary(one, ways, orders, shifted)
        known.append(mark)


def assigned(
    problem: Problem, world: Map, ease: Ease | None
) -> tuple[Problem, Map, Legs, list[tuple[int, ...]]] | None:
    """The assignment of least makespan over all choices of regions, with what it chose; None if none fits."""
    best: tuple[Problem, Map, Legs, list[tuple[int, ...]]] | None = None
    least = (np.inf, np.inf)
    for one, ways in chosen(problem, world):
        legs = leg_times(one, ways, ease)
        orders = assign(legs, proved=problem.proved)
        if orders is not None and (best is None or cost(legs, orders) < least):
            best, least = (one, ways, legs, orders), cost(legs, orders)
    return best


def event_times(problem: Problem, legs: Legs, drone: int, order: tuple[int, ...]) -> Array | None:
    """Times of one drone's visits with the slack spread over its legs, or None."""
    if not order:
        return np.zeros(0)
    least = least_legs(legs, drone, order, problem.sample)
    windows = legs.windows[list(order)]
    # A visit at the very end of its window would be missed by a drone that lags: keep off it if possible.
    spared = np.maximum(windows[:, 1] - SPARE * problem.horizon, windows[:, 0])
    early = np.column_stack([windows[:, 0], spared])
    times = spread(least, early, problem.horizon, problem.sample)
    return times if times is not None else spread(least, windows, problem.horizon, problem.sample)


def extreme_times(problem: Problem, legs: Legs, drone: int, order: tuple[int, ...], late: bool) -> Array:
    """Times of one drone's visits, all as early or as late as legs and windows allow; multiples of T_s."""
    out = np.zeros(len(order))
    if not order:
        return out
    least = least_legs(legs, drone, order, problem.sample)
    if late:
        clock = problem.horizon
        for k in reversed(range(len(order))):
            clock = min(clock - least[k + 1], legs.windows[order[k], 1])
            out[k] = np.floor(clock / problem.sample + 1e-6) * problem.sample
        return out
    clock = 0.0
    for k, e in enumerate(order):
        clock = max(clock + least[k], legs.windows[e, 0])
        out[k] = clock = np.ceil(clock / problem.sample - 1e-6) * problem.sample
    return np.minimum(out, legs.windows[list(order), 1])


def itinerary(problem: Problem, world: Map, orders: list[tuple[int, ...]], times: list[Array]) -> Itinerary:
    """Stops and polylines of every drone."""
    stops, paths = [], []
    for d, order in enumerate(orders):
        at = [world.start[d], *(world.place[d][e] for e in order), world.home[d]]
        found = [world.ways.path(i, j) for i, j in pairwise(at)]
        paths.append(tuple(p for p in found if p is not None))
        stops.append(
            tuple(
                Stop(problem.spec.visits[e], world.names[place], world.points[place], float(t))
                for e, place, t in zip(order, at[1:-1], times[d], strict=True)
            )
        )
    return Itinerary(tuple(stops), tuple(paths))


def unreachable(problem: Problem, world: Map) -> InfeasibleError:
    """Why no itinerary exists: the first clause that cannot hold, with the time that it would need."""
    legs = leg_times(problem, world, None)
    visits = problem.spec.visits
    for e, visit in enumerate(visits):
        soonest = float(legs.first[:, e].min())
        name = visit.options[0][1]
        if not np.isfinite(soonest):
            text = (
                f"no way from any drone to {name} that keeps {problem.tube:g} m (the tube) to all obstacles"
            )
            return InfeasibleError(text, clause=visit.clause)
        if soonest > visit.window[1] + 1e-9:
            late = f"{name} cannot be reached by {visit.window[1]:.2f} s"
            text = f"{late}: the nearest drone needs {soonest:.2f} s"
            return InfeasibleError(f"{text} at v_max = {problem.v_max:g} m/s", clause=visit.clause)
    open_windows = np.column_stack([legs.windows[:, 0], np.full(len(visits), np.inf)])
    orders = assign(replace(legs, windows=open_windows, horizon=np.inf))
    if orders is None:
        clause = visits[0].clause if visits else None
        text = (
            f"no drone can come home from its visits and keep {problem.tube:g} m (the tube) to all obstacles"
        )
        return InfeasibleError(text, clause=clause)
    return too_late(problem, legs, by_hand(problem, orders))


def too_late(problem: Problem, legs: Legs, orders: list[tuple[int, ...]]) -> InfeasibleError:
    """The first visit, or coming home, that the best tour without windows makes too late."""
    for d, order in enumerate(orders):
        clock, before = 0.0, -1
        for e in order:
            leg = legs.first[d, e] if before < 0 else legs.between[d, before, e]
            clock = max(clock + float(leg), float(legs.windows[e, 0]))
            visit = problem.spec.visits[e]
            if clock > visit.window[1] + 1e-9:
                region = dict(visit.options)[problem.ids[d]]
                text = f"{region} cannot be reached by {visit.window[1]:.2f} s after the other visits"
                why = f"{problem.ids[d]} needs {clock:.2f} s at v_max = {problem.v_max:g} m/s"
                return InfeasibleError(f"{text}: {why}", clause=visit.clause)
            clock, before = clock + visit.dwell, e
        clock += float(legs.last[d, before]) if before >= 0 else float(legs.idle[d])
        if clock > problem.horizon + 1e-9:
            clause = next((h.clause for h in problem.spec.homes if h.drone == problem.ids[d]), None)
            text = f"{problem.ids[d]} cannot be home by T = {problem.horizon:.2f} s: needs {clock:.2f} s"
            return InfeasibleError(f"{text} at v_max = {problem.v_max:g} m/s", clause=clause)
    visit = problem.spec.visits[0]
    text = "the visits do not fit into their windows at v_max and a_max with the turns that headings need"
    return InfeasibleError(text, clause=visit.clause)
