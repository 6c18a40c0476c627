"""Everything that stays fixed while the convex steps run: knots, ends, visits, warm start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse

from fleet.route import follow

from .knots import Array, Grid, cut
from .problem import Problem
from .rows import Block, energy, fixed, knot_inside, pieces_inside, stack
from .schedule import Itinerary
from .solver import solve

#: Most segments of one drone; the wire allows 512 (design.md, Wire).
MOST_SEGMENTS = 480
#: Weights of squared acceleration and jerk: smooth flight tracks well (integral of |a|^2 and |j|^2).
SMOOTH = {2: 1.0, 3: 0.3}


@dataclass(frozen=True)
class Setup:
    """The fixed part of the optimisation over the unknowns of `grid` and the common slack r."""

    problem: Problem
    itinerary: Itinerary
    grid: Grid
    equal: list[Block]
    visits: list[tuple[str, Block]]
    bound: float


def marks(problem: Problem, drone: int) -> set[float]:
    """Times [s] at which a drone has a knot whenever its visits are: ends of windows of its invariants."""
    found = {0.0, problem.horizon}
    for inv in problem.spec.invariants:
        if problem.ids[drone] in inv.drones:
            found |= {t for t in inv.window if 0.0 <= t <= problem.horizon}
    return found


def knot_times(problem: Problem, itinerary: Itinerary, drone: int) -> Array:
    """Knots of one drone: at its visits, at ends of windows of its invariants, and evenly between."""
    points = marks(problem, drone)
    for stop in itinerary.stops[drone]:
        points |= {stop.t, stop.t + stop.visit.dwell}
    fixed_times = np.array(sorted(round(t, 9) for t in points if -1e-9 <= t <= problem.horizon + 1e-9))
    fixed_times = fixed_times[np.append(True, np.diff(fixed_times) > 1e-6)]
    length = max(problem.segment, problem.horizon / (MOST_SEGMENTS - len(fixed_times)))
    parts = [
        np.linspace(a, b, max(1, int(np.ceil((b - a) / length - 1e-9))), endpoint=False)
        for a, b in pairwise(fixed_times)
    ]
    return np.append(np.concatenate(parts), problem.horizon)


def setup(problem: Problem, itinerary: Itinerary, bound: float) -> Setup:
    """Grid, equalities and visit rows of an itinerary."""
    drones = range(len(problem.ids))
    return on_grid(problem, itinerary, Grid(tuple(knot_times(problem, itinerary, d) for d in drones)), bound)


def on_grid(problem: Problem, itinerary: Itinerary, grid: Grid, bound: float) -> Setup:
    """Equalities and visit rows of an itinerary on given knots, which its visits are among."""
    visits = list(visit_rows(problem, itinerary, grid))
    return Setup(problem, itinerary, grid, list(ends(problem, grid)), visits, bound)


def ends(problem: Problem, grid: Grid) -> Iterator[Block]:
    """At rest at the start, at rest at T."""
    zero = np.zeros(3)
    for d in range(len(problem.ids)):
        yield fixed(grid, d, 0, 0, problem.starts[d])
        final = len(grid.times[d]) - 1
        for knot in (0, final):
            yield fixed(grid, d, knot, 1, zero)
            yield fixed(grid, d, knot, 2, zero)


def visit_rows(problem: Problem, itinerary: Itinerary, grid: Grid) -> Iterator[tuple[str, Block]]:
    """Clause and rows: inside each target at its event (and over its dwell), inside home at T, all by r."""
    for d, stops in enumerate(itinerary.stops):
        for stop in stops:
            faces = problem.regions[stop.region]
            yield stop.visit.clause, knot_inside(grid, d, grid.at(d, stop.t), faces)
            if stop.visit.dwell > 0:
                times = grid.times[d]
                stay = (times >= stop.t - 1e-6) & (times <= stop.t + stop.visit.dwell + 1e-6)
                yield stop.visit.clause, pieces_inside(cut(grid, d, times[stay]), faces)
        clause = next((h.clause for h in problem.spec.homes if h.drone == problem.ids[d]), problem.homes[d])
        yield clause, knot_inside(grid, d, len(grid.times[d]) - 1, problem.regions[problem.homes[d]])


def route_positions(setup: Setup, drone: int) -> Array:
    """Route position (n, 3) [m] at every knot: each leg rest to rest with least jerk along its polyline."""
    stops, times = setup.itinerary.stops[drone], setup.grid.times[drone]
    leave = np.array([0.0, *(s.t + s.visit.dwell for s in stops)])
    reach = np.array([*(s.t for s in stops), setup.problem.horizon])
    leg = np.clip(np.searchsorted(reach, times - 1e-9), 0, len(reach) - 1)
    out = np.empty((len(times), 3))
    for k, path in enumerate(setup.itinerary.paths[drone]):
        mine = leg == k
        # A visit may be where the drone is already: a leg that takes no time is flown.
        time = reach[k] - leave[k]
        u = np.clip((times[mine] - leave[k]) / time, 0.0, 1.0) if time > 0 else np.ones(mine.sum())
        out[mine] = follow(path, u**3 * (10 - 15 * u + 6 * u**2))
    return out


def warm_start(setup: Setup) -> Array:
    """Unknowns of the smoothest trajectory near the route (least squares, no inequality posed)."""
    grid = setup.grid
    wanted, weight = np.zeros(grid.size), np.zeros(grid.size)
    for d in range(len(grid.times)):
        knots = grid.knots(wanted, d)
        knots[:, 0] = route_positions(setup, d)
        grid.knots(weight, d)[:, 0] = 1.0
    quadratic = energy(grid, {3: 0.02, 2: 0.01}) + sparse.diags(weight)
    matrix, rhs = stack(setup.equal, grid.size)
    none = sparse.csc_matrix((0, grid.size)), np.zeros(0)
    found = solve(quadratic, -wanted, (matrix[:, : grid.size], rhs), none)
    if found is None:
        raise RuntimeError("the warm start, a least-squares problem, was not solved")
    return found.x
