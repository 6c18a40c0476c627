"""How long legs take: from place to place over the map, slow and smooth or as fast as can be."""

from __future__ import annotations

from typing import Literal

import numpy as np

from fleet.legs import Legs
from fleet.route import leg_time, reach, turn_time

from .knots import Array
from .problem import Problem
from .spec import Visit
from .survey import Map
from .turns import shortest_turn, turn_times

#: How legs are timed: a factor on the time from rest to rest, or faster than that (`flight_time`).
Ease = float | Literal["through", "edges"]


def heading_at(problem: Problem, name: str, drone: int) -> float | None:
    """Heading required at a place [rad], if any; at the start the pad's."""
    return float(problem.psi[drone]) if name.startswith("start of ") else problem.headings.get(name)


def place_times(problem: Problem, world: Map, ease: Ease | None, rests: int = 0) -> Array:
    """Least time [s] from place i to j, flight and turn, at rest at `rests` of both ends; see `flight_time`.

    Infinite where there is no way. Numbers of the first places are those of the drones that start there.
    """
    out = np.full((len(world.points), len(world.points)), np.inf)
    headings = [heading_at(problem, name, k) for k, name in enumerate(world.names)]
    deep = [problem.inradii.get(name, problem.tube) - problem.tube for name in world.names]
    for (i, j), path in world.ways.paths.items():
        flight = flight_time(problem, reach(path), deep[i] + deep[j], ease, rests)
        a, b = headings[i], headings[j]
        turn = 0.0 if a is None or b is None else turn_time(shortest_turn(a, b), problem.heading_rate)
        out[i, j] = max(flight, turn)
    return out


def flight_time(problem: Problem, length: float, deep: float, ease: Ease | None, rests: int) -> float:
    """Time [s] of a leg of `length` [m], of which `deep` is inside the places at its ends, by the `ease`.

    A factor on the time from rest to rest; None flies through at v_max; "through" is at rest at `rests` of
    its ends; "edges" too, and only flies where the tube does not fit into the places yet.
    """
    v, a = problem.v_max, problem.a_max
    if isinstance(ease, float):
        return leg_time(length, v, a) * ease
    if ease == "edges":
        length = max(length - deep, 0.0)
    if ease is None or rests == 0:
        return leg_time(length, v, a, rest=False)
    # At rest at one end: half of twice the way from rest to rest.
    return leg_time(length, v, a) if rests == 2 else leg_time(2 * length, v, a) / 2


def leg_times(problem: Problem, world: Map, ease: Ease | None) -> Legs:
    """All leg times of the assignment; hand-made assignments forbid the other drones."""
    visits = problem.spec.visits
    drones, n = len(problem.ids), len(visits)
    first, last = np.full((drones, n), np.inf), np.full((drones, n), np.inf)
    middle = np.full((drones, n, n), np.inf)
    # Eased legs do not depend on where the drone is at rest.
    kinds = (0, 1, 2) if isinstance(ease, str) else (0,)
    each = [place_times(problem, world, ease, rests) for rests in kinds]
    times = np.stack(each if len(each) == 3 else each * 3)
    dwell = np.array([v.dwell for v in visits])
    stays = (dwell > 0).astype(int)
    for d in range(drones):
        places = np.array(world.place[d], dtype=int)
        mine = np.array([e for e in range(n) if places[e] >= 0 and permitted(problem, d, visits[e])], int)
        there = np.flatnonzero(places >= 0)
        first[d, mine] = times[1 + stays[mine], world.start[d], places[mine]]
        last[d, mine] = times[1 + stays[mine], places[mine], world.home[d]]
        both = stays[mine][:, None] + stays[there]
        middle[d][np.ix_(mine, there)] = times[both, places[mine][:, None], places[there]]
        middle[d, mine, mine] = np.inf
    idle = times[2, list(world.start), list(world.home)]
    windows = np.array([v.window for v in visits], dtype=float).reshape(n, 2)
    return Legs(first, middle, last, idle, windows, dwell, problem.horizon, turn_times(problem))


def permitted(problem: Problem, drone: int, visit: Visit) -> bool:
    """Whether a hand-made assignment, and then the paper's split, leave this visit to this drone."""
    name = problem.ids[drone]
    region = next((r for d, r in visit.options if d == name), None)
    given = problem.given or {}
    if any(region in order for order in given.values()):
        return region in given.get(name, ())
    owner = None if region is None else problem.split.get(region)
    return owner in (None, name) or not any(d == owner for d, _ in visit.options)
