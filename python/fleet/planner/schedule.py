"""From the problem to an itinerary: who visits what and when, along which way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fleet.assign import EXACT, assign
from fleet.errors import InfeasibleError
from fleet.legs import Legs
from fleet.route import leg_time, reach, spread, turn_time

from .knots import Array
from .problem import Problem
from .spec import Visit
from .survey import Map, survey

#: Factors on rest-to-rest leg times, tried in turn: room for smooth flight first.
EASE = (1.4, 1.15, 1.0)
#: Share of the mission that visits keep from the ends of their windows, where time allows.
SPARE = 0.04


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


def heading_at(problem: Problem, name: str, drone: int) -> float | None:
    """Heading required at a place [rad], if any; at the start the pad's."""
    return float(problem.psi[drone]) if name.startswith("start of ") else problem.headings.get(name)


def place_times(problem: Problem, world: Map, ease: float | None) -> Array:
    """Least time [s] from place i to j: flight and turn; `ease` None flies through at v_max.

    Infinite where there is no way. Numbers of the first places are those of the drones that start there.
    """
    out = np.full((len(world.points), len(world.points)), np.inf)
    headings = [heading_at(problem, name, k) for k, name in enumerate(world.names)]
    for (i, j), path in world.ways.paths.items():
        flight = leg_time(reach(path), problem.v_max, problem.a_max, rest=ease is not None) * (ease or 1.0)
        a, b = headings[i], headings[j]
        turn = 0.0 if a is None or b is None else turn_time(shortest_turn(a, b), problem.heading_rate)
        out[i, j] = max(flight, turn)
    return out


def shortest_turn(a: float, b: float) -> float:
    """Angle [rad] from heading a to b the short way, in (-pi, pi]; half turns go counter-clockwise."""
    turn = (b - a) % (2 * np.pi)
    return float(turn - 2 * np.pi if turn > np.pi + 1e-9 else turn)


def leg_times(problem: Problem, world: Map, ease: float | None) -> Legs:
    """All leg times of the assignment; hand-made assignments forbid the other drones."""
    visits = problem.spec.visits
    drones, n = len(problem.ids), len(visits)
    first, last = np.full((drones, n), np.inf), np.full((drones, n), np.inf)
    middle = np.full((drones, n, n), np.inf)
    times = place_times(problem, world, ease)
    for d in range(drones):
        places = np.array(world.place[d], dtype=int)
        mine = np.array([e for e in range(n) if places[e] >= 0 and permitted(problem, d, visits[e])], int)
        there = np.flatnonzero(places >= 0)
        first[d, mine] = times[world.start[d], places[mine]]
        last[d, mine] = times[places[mine], world.home[d]]
        middle[d][np.ix_(mine, there)] = times[np.ix_(places[mine], places[there])]
        middle[d, mine, mine] = np.inf
    idle = times[list(world.start), list(world.home)]
    windows = np.array([v.window for v in visits], dtype=float).reshape(n, 2)
    dwell = np.array([v.dwell for v in visits])
    return Legs(first, middle, last, idle, windows, dwell, problem.horizon)


def permitted(problem: Problem, drone: int, visit: Visit) -> bool:
    """Whether a hand-made assignment, and then the paper's split, leave this visit to this drone."""
    name = problem.ids[drone]
    region = next((r for d, r in visit.options if d == name), None)
    given = problem.given or {}
    if any(region in order for order in given.values()):
        return region in given.get(name, ())
    owner = None if region is None else problem.split.get(region)
    return owner in (None, name) or not any(d == owner for d, _ in visit.options)


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


def schedules(problem: Problem, bound: float) -> Iterator[Itinerary]:
    """Itineraries to start from, routed at a clearance of up to `bound` [m], in order of preference.

    The first spreads the slack evenly; then come visits as early and as late as can be, for invariants
    that hold over a part of the mission only. Raises InfeasibleError, naming the clause, when even
    flight through at v_max misses a window.
    """
    problem = replace(problem, obstacles=problem.walls())
    if len(problem.spec.visits) > EXACT:
        found = list(timed_itineraries(problem, survey(problem, bound, local=True)))
        if found:
            yield from found
            return
    world = survey(problem, bound)
    found = list(timed_itineraries(problem, world))
    asked = asked_for(problem)
    if not found and asked != problem.obstacles:
        # Ways keep off every obstacle where they can, and off those of the mission in any case.
        world = survey(replace(problem, obstacles=asked), bound)
        found = list(timed_itineraries(problem, world))
    if not found:
        raise unreachable(problem, world)
    yield from found


def asked_for(problem: Problem) -> tuple[str, ...]:
    """The obstacles that the mission speaks of; all of them where it has clauses without a normal form."""
    if problem.spec.rest:
        return problem.obstacles
    named = {inv.region for inv in problem.spec.invariants if inv.kind == "outside"}
    return tuple(o for o in problem.obstacles if o in named)


def timed_itineraries(problem: Problem, world: Map) -> Iterator[Itinerary]:
    """The itineraries of `schedules` over the ways of `world`; none when a window would be missed."""
    for ease in (*EASE, None):
        legs = leg_times(problem, world, ease)
        orders = assign(legs, proved=problem.proved)
        if orders is None:
            continue
        orders = by_hand(problem, orders)
        timed = [event_times(problem, legs, d, order) for d, order in enumerate(orders)]
        times = [t for t in timed if t is not None]
        if len(times) == len(timed):
            yield itinerary(problem, world, orders, times)
            for late in (False, True):
                shifted = [extreme_times(problem, legs, d, order, late) for d, order in enumerate(orders)]
                yield itinerary(problem, world, orders, shifted)
            return


def event_times(problem: Problem, legs: Legs, drone: int, order: tuple[int, ...]) -> Array | None:
    """Times of one drone's visits with the slack spread over its legs, or None."""
    if not order:
        return np.zeros(0)
    least = [legs.first[drone, order[0]]]
    least += [legs.between[drone, a, b] + legs.dwell[a] for a, b in pairwise(order)]
    least.append(legs.last[drone, order[-1]] + legs.dwell[order[-1]])
    windows = legs.windows[list(order)]
    # A visit at the very end of its window would be missed by a drone that lags: keep off it if possible.
    spared = np.maximum(windows[:, 1] - SPARE * problem.horizon, windows[:, 0])
    early = np.column_stack([windows[:, 0], spared])
    times = spread(np.array(least), early, problem.horizon, problem.sample)
    return times if times is not None else spread(np.array(least), windows, problem.horizon, problem.sample)


def extreme_times(problem: Problem, legs: Legs, drone: int, order: tuple[int, ...], late: bool) -> Array:
    """Times of one drone's visits, all as early or as late as legs and windows allow; multiples of T_s."""
    out = np.zeros(len(order))
    if late:
        clock = problem.horizon
        legs_after = [*(legs.between[drone, a, b] for a, b in pairwise(order)), *legs.last[drone, order[-1:]]]
        for k in reversed(range(len(order))):
            e = order[k]
            clock = min(clock - legs_after[k] - legs.dwell[e], legs.windows[e, 1])
            out[k] = np.floor(clock / problem.sample + 1e-6) * problem.sample
        return out
    clock, before = 0.0, -1
    for k, e in enumerate(order):
        clock += legs.first[drone, e] if before < 0 else legs.between[drone, before, e]
        clock = max(clock, legs.windows[e, 0])
        out[k] = np.ceil(clock / problem.sample - 1e-6) * problem.sample
        clock, before = out[k] + legs.dwell[e], e
    return np.minimum(out, legs.windows[list(order), 1]) if order else out


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
