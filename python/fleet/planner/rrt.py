"""The baseline of the paper's section on kinodynamic RRT*: drone after drone, leg after leg.

Every drone visits its targets in the order of the itinerary, each leg planned by RRT* (tree.py) from rest to
rest, past the obstacles and past the corridors of the drones before it. As in the paper, windows are not
looked at: legs are as fast as the cost makes them. The margins are those of the tube, as in every plan.

OMPL is not used: from Python its state spaces cannot be derived from, its motion validators are not told
the time of a state, and its random numbers are seeded once a process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fleet import _core
from fleet.errors import InfeasibleError
from fleet.route import turn_time

from .forbidden import INSTANT, Connections, forbidden
from .knots import KNOT, Array, Grid
from .problem import Problem
from .rounding import FASTER, LIMIT, Cubics
from .schedule import Itinerary, Stop
from .tree import Leg, grow
from .turns import shortest_turn

#: Samples of a leg, and the most while there is no way yet.
SAMPLES, PATIENCE = 1000, 4000
#: Room around the straight line of a leg in which samples are drawn [m].
AROUND = 8.0
#: Least stay at a stop before and after its visit [s]: room for the rounding of corners and one segment.
REST = 0.1
#: Stays before a leg that are tried in turn [s]: an earlier drone may have passed by then.
DELAYS = (0.0, 4.0, 8.0, 16.0)

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Stay:
    """The stay that ends a leg: its visit not before `ready` [s] (heading), for `dwell`; at home until T."""

    ready: float
    dwell: float
    sample: float
    until: float | None

    def visit(self, arrival: float) -> float:
        """Time of the visit [s] for an arrival: a multiple of T_s."""
        return float(np.ceil(max(arrival + REST, self.ready) / self.sample - 1e-9) * self.sample)

    def leave(self, arrival: float) -> float:
        """When the next leg may begin [s]."""
        return self.until if self.until is not None else self.visit(arrival) + self.dwell + REST

    def lasts(self, arrival: float) -> float:
        """Duration of the stay [s]."""
        return max(self.leave(arrival) - arrival, REST)


def fly(task: Problem, way: Itinerary, seed: int, tell: Tell) -> tuple[Grid, Array, Itinerary]:
    """Knots of all drones, as a grid and its unknowns, and the itinerary at the times of its visits.

    `tell(what)` is called now and then. Raises InfeasibleError when a leg has no way within
    the samples, or a drone is not home by T.
    """
    flown: list[tuple[Array, Array]] = []
    stops: list[tuple[Stop, ...]] = []
    earlier: dict[int, Array] = {}
    clock = np.arange(round(task.horizon / INSTANT) + 1).astype(np.float64) * INSTANT
    for d in range(len(task.ids)):
        cubics, made = drone(task, way, d, earlier, seed, tell)
        marks = np.array([t for s in made for t in (s.t, s.t + s.visit.dwell)])
        times, knots = cubics.knots(marks)
        flown.append((times, knots))
        stops.append(made)
        heading = np.zeros((len(times), 3))
        rows = np.column_stack([times, knots.reshape(len(times), KNOT), heading]).astype(np.float64)
        earlier[d] = _core.Trajectory(rows).sample(clock)[:, :3]
    unknowns = np.concatenate([knots.reshape(-1) for _, knots in flown])
    return Grid(tuple(times for times, _ in flown)), unknowns, Itinerary(tuple(stops), way.paths)


def drone(
    task: Problem, way: Itinerary, d: int, earlier: dict[int, Array], seed: int, tell: Tell
) -> tuple[Cubics, tuple[Stop, ...]]:
    """The way of one drone through its stops and home, and the stops at their new times."""
    rng = np.random.default_rng([seed, d])
    here, leave, psi, turned = task.starts[d], REST, float(task.psi[d]), 0.0
    time, state = [np.zeros(1)], [at_rest(here)[None]]
    stops: list[Stop] = []
    for stop in way.stops[d]:
        wanted = task.headings.get(stop.region)
        if wanted is not None:
            turn = shortest_turn(psi, wanted)
            turned += turn_time(turn, task.heading_rate)
            psi += turn
        stay = Stay(turned, stop.visit.dwell, task.sample, None)
        where = f"{task.ids[d]} to {stop.region}"
        times, states = leg(task, d, (here, stop.point), leave, earlier, stay, rng, where, tell)
        arrival, here = float(times[-1]), stop.point
        stops.append(replace(stop, t=stay.visit(arrival)))
        leave = stay.leave(arrival)
        if wanted is not None:
            turned = stops[-1].t + stop.visit.dwell
        time.append(times)
        state.append(states)
    stay = Stay(0.0, 0.0, task.sample, task.horizon)
    home = task.centers[task.homes[d]]
    where = f"{task.ids[d]} home"
    times, states = leg(task, d, (here, home), leave, earlier, stay, rng, where, tell)
    if times[-1] > task.horizon - REST:
        clause = next((h.clause for h in task.spec.homes if h.drone == task.ids[d]), None)
        text = f"the way that RRT* found takes {task.ids[d]} {times[-1]:.2f} s, and T is {task.horizon:.2f} s"
        raise InfeasibleError(text, clause=clause)
    last = np.array([task.horizon])
    return Cubics(np.concatenate([*time, times, last]), np.vstack([*state, states, states[-1:]])), tuple(
        stops
    )


def at_rest(point: Array) -> Array:
    """The state (6,) at rest at a point."""
    return np.concatenate([point, np.zeros(3)])


def leg(
    task: Problem,
    d: int,
    ends: tuple[Array, Array],
    leave: float,
    earlier: dict[int, Array],
    stay: Stay,
    rng: np.random.Generator,
    where: str,
    tell: Tell,
) -> tuple[Array, Array]:
    """Times (n,) and states (n, 6) at the nodes of one leg, left for at `leave` [s] or some time later."""
    low, high = np.minimum(*ends) - AROUND, np.maximum(*ends) + AROUND
    clear = forbidden(task, d, earlier, low, high)
    a_max = task.a_max * LIMIT
    weight = 1 / a_max**2  # then the acceleration of a leg from rest to rest peaks at a_max
    spent = 0
    for delay in DELAYS:
        rest = at_rest(ends[0])[None]
        wait = Connections(rest, rest, np.array([delay + REST]), np.array([leave - REST]))
        if delay and clear.meets(wait)[0]:
            break
        one = Leg(
            *ends, leave + delay, low, high, task.v_max - FASTER * a_max, a_max, weight, clear, stay.lasts
        )
        tree = grow(one, rng, SAMPLES, PATIENCE, lambda n: tell(f"RRT* {where}, {n} samples"))
        spent += PATIENCE
        if np.isfinite(tree.found):
            path = tree.path()
            return tree.time[path], tree.state[path]
    text = f"RRT* found no way for {where} within {spent} samples"
    raise InfeasibleError(text)
