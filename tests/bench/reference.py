"""The least integral of |a|^2 that a long IPOPT run finds, over knots and visit times together.

A yardstick for the energy-aware planner, and not meant to be fast: one nonlinear program per drone (peers are
left out, which can only lower the figure), free leg durations, every order of its visits, several timings and
ways, then finer knots from the best. Obstacles are kept off by a convex combination of faces per piece, as in
fleet.planner.nlp.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, permutations

import casadi as ca
import numpy as np

from fleet.planner.knots import KNOT, Array, hermite, restriction
from fleet.planner.problem import Problem
from fleet.planner.rows import gram
from fleet.planner.schedule import Itinerary
from fleet.planner.stages import stage
from fleet.planner.survey import survey
from fleet.route import follow

#: Segments a leg at first, and after each refinement.
SEGMENTS = (12, 24, 48)
#: First timings tried: visits at these shares of their window, evenly spread below them.
SHARES = (0.55, 0.8, 1.0)
#: Parts of a segment that may lie beyond different faces of an obstacle.
PARTS = 2
#: Pieces within this of an obstacle at the guess are kept off it [m].
NEAR = 5.0
#: IPOPT's iterations; its own default tolerance of 1e-8 stays.
ITERATIONS = 3000

#: Adds `low <= expression <= high`, element by element.
Keep = Callable[[ca.MX, float | Array, float | Array], None]


@dataclass(frozen=True)
class Tour:
    """One drone's solution: regions in order, legs' durations [s], knots (n, 9), cost [m^2/s^3]."""

    regions: tuple[str, ...]
    legs: Array
    knots: Array
    cost: float

    @property
    def times(self) -> Array:
        """Knot times (n,) [s]."""
        per_leg = (len(self.knots) - 1) // len(self.legs)
        return np.concatenate([[0.0], np.cumsum(np.repeat(self.legs / per_leg, per_leg))])


def best_tour(task: Problem, way: Itinerary, drone: int, floor: float) -> tuple[Tour, int]:
    """The best of all starts for one drone with the visits that `way` gives it, and how many succeeded."""
    regions = [stop.region for stop in way.stops[drone]]
    found = []
    for order in permutations(regions):
        for share in SHARES:
            guess = routed(task, drone, order, share)
            tour = None if guess is None else solve(task, drone, guess, floor)
            if tour is not None:
                found.append(tour)
    if not found:
        raise SystemExit(f"IPOPT found nothing for {task.ids[drone]}")
    best = min(found, key=lambda t: t.cost)
    for segments in SEGMENTS[1:]:
        finer = solve(task, drone, refined(best, segments), floor)
        if finer is not None and finer.cost < best.cost:
            best = finer
    return best, len(found)


def routed(task: Problem, drone: int, order: tuple[str, ...], share: float) -> Tour | None:
    """A guess: rest to rest along ways round obstacles, visits at even times up to `share` of a window."""
    world = survey(task, task.tube)
    place = [drone, *(world.names.index(r) for r in order), world.home[drone]]
    paths = [world.ways.path(a, b) for a, b in pairwise(place)]
    known = [p for p in paths if p is not None]
    if len(known) < len(paths):
        return None
    last = share * min(v.window[1] for v in task.spec.visits)
    legs = np.append(np.full(len(order), last / len(order)), task.horizon - last)
    n = SEGMENTS[0]
    u = np.arange(n) / n
    rows = [follow(path, u**3 * (10 - 15 * u + 6 * u**2)) for path in known]
    positions = np.vstack([*rows, known[-1][-1:]])
    return Tour(order, legs, np.hstack([positions, np.zeros((len(positions), 6))]), np.inf)


def refined(tour: Tour, segments: int) -> Tour:
    """The same trajectory on more knots (values of the quintics at them)."""
    per_leg = (len(tour.knots) - 1) // len(tour.legs)
    h = np.repeat(tour.legs / per_leg, per_leg)
    times = Tour(tour.regions, tour.legs, np.zeros((segments * len(tour.legs) + 1, 9)), 0.0).times
    index = np.clip(np.searchsorted(tour.times, times, side="right") - 1, 0, len(h) - 1)
    s = np.clip((times - tour.times[index]) / h[index], 0.0, 1.0)
    local = np.concatenate([tour.knots[:-1], tour.knots[1:]], axis=1).reshape(-1, 6, 3)[index]
    points = hermite(h[index]) @ local
    out = []
    for order in range(3):
        c = points
        for _ in range(5 - order):
            c = c[:, :-1] * (1 - s)[:, None, None] + c[:, 1:] * s[:, None, None]
        out.append(c[:, 0])
        points = (5 - order) * np.diff(points, axis=1) / h[index][:, None, None]
    return Tour(tour.regions, tour.legs, np.hstack(out), tour.cost)


def solve(task: Problem, drone: int, guess: Tour, floor: float) -> Tour | None:
    """One IPOPT solve from a guess; None unless it succeeded."""
    n, legs = len(guess.knots), len(guess.legs)
    per_leg = (n - 1) // legs
    X, tau = ca.MX.sym("X", KNOT, n), ca.MX.sym("tau", legs)
    h = ca.repmat(tau.T / per_leg, per_leg, 1).reshape((1, n - 1))
    derivatives, _ = stage()
    speed, acceleration = derivatives.map(n - 1)(X[:, :-1], X[:, 1:], h)
    blocks, low, high = [], [], []

    def keep(expression: ca.MX, least: float | Array, most: float | Array) -> None:
        column = ca.vec(expression)
        blocks.append(column)
        low.append(np.broadcast_to(least, column.numel()).astype(float))
        high.append(np.broadcast_to(most, column.numel()).astype(float))

    keep(X[:, 0] - ca.DM([*task.starts[drone], *[0.0] * 6]), 0.0, 0.0)
    keep(X[3:, -1], 0.0, 0.0)
    keep(speed, -task.v_max, task.v_max)
    keep(acceleration, -task.a_max, task.a_max)
    keep(ca.sum1(tau), task.horizon, task.horizon)
    windows = {region: v.window for v in task.spec.visits for _, region in v.options}
    for k, region in enumerate(guess.regions):
        faces = task.regions[region]
        keep(ca.sum1(tau[: k + 1]), *windows[region])
        keep(ca.DM(faces[:, :3]) @ X[:3, (k + 1) * per_leg], -np.inf, faces[:, 3] - floor)
    home = task.regions[task.homes[drone]]
    keep(ca.DM(home[:, :3]) @ X[:3, -1], -np.inf, home[:, 3] - floor)
    pieces = halves().map(n - 1)(X[:, :-1], X[:, 1:], h)
    room = task.regions[task.workspace]
    keep(ca.DM(room[:, :3]) @ pieces, -np.inf, np.tile(room[:, 3] - floor, 6 * PARTS * (n - 1)))
    mixes, mixed = obstacles(task, guess, pieces, floor, keep)
    cost = squares().map(n - 1)(X[:, :-1], X[:, 1:], h)
    unknowns = ca.vertcat(ca.vec(X), tau, *(ca.vec(m) for m in mixes))
    statement = {"x": unknowns, "f": 100.0 * ca.sum2(cost), "g": ca.vertcat(*blocks)}
    options = {"ipopt": {"max_iter": ITERATIONS, "print_level": 0, "sb": "yes"}, "print_time": False}
    solver = ca.nlpsol("reference", "ipopt", statement, options)
    start = np.concatenate([guess.knots.ravel(), guess.legs, *mixed])
    free = KNOT * n
    below = np.concatenate([np.full(free, -np.inf), np.full(legs, 0.5), np.zeros(len(start) - free - legs)])
    found = solver(x0=start, lbx=below, ubx=np.inf, lbg=np.concatenate(low), ubg=np.concatenate(high))
    if solver.stats()["return_status"] not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
        return None
    x = np.asarray(found["x"]).ravel()
    return Tour(guess.regions, x[free : free + legs], x[:free].reshape(n, KNOT), float(found["f"]) / 100.0)


def local_points(first: ca.MX, second: ca.MX, h: ca.MX) -> ca.MX:
    """Position control points (3, 6) of the quintic between two knots."""
    local = ca.horzcat(ca.reshape(first, 3, 3), ca.reshape(second, 3, 3))
    scale = ca.vertcat(1, h, h**2, 1, h, h**2)
    return (local * ca.repmat(scale.T, 3, 1)) @ hermite(np.ones(1))[0].T


def halves() -> ca.Function:
    """Stage function: control points (3, 6 PARTS) of the parts of a segment."""
    first, second, h = ca.MX.sym("a", KNOT), ca.MX.sym("b", KNOT), ca.MX.sym("h")
    points = local_points(first, second, h)
    cuts = restriction(np.arange(PARTS) / PARTS, np.arange(1, PARTS + 1) / PARTS)
    return ca.Function("halves", [first, second, h], [ca.horzcat(*(points @ c.T for c in cuts))])


def squares() -> ca.Function:
    """Stage function: integral of |a|^2 over a segment."""
    first, second, h = ca.MX.sym("a", KNOT), ca.MX.sym("b", KNOT), ca.MX.sym("h")
    a = stage()[0](first, second, h)[1]
    return ca.Function("squares", [first, second, h], [h * ca.sum1(ca.sum2((a @ gram(3)) * a))])


def obstacles(
    task: Problem, guess: Tour, pieces: ca.MX, floor: float, keep: Keep
) -> tuple[list[ca.MX], list[Array]]:
    """Constraints that keep near pieces off obstacles; the mixing unknowns and their guesses."""
    X = guess.knots
    h = np.diff(guess.times)
    points = hermite(h) @ np.concatenate([X[:-1], X[1:]], axis=1).reshape(-1, 6, 3)
    cuts = restriction(np.arange(PARTS) / PARTS, np.arange(1, PARTS + 1) / PARTS)
    parts = (cuts[None] @ points[:, None]).reshape(-1, 6, 3)
    mixes, guesses = [], []
    for number, name in enumerate(task.obstacles):
        faces = task.regions[name]
        least = (parts @ faces[:, :3].T - faces[:, 3]).min(axis=1)
        near = np.flatnonzero(least.max(axis=1) < NEAR)
        if len(near) == 0:
            continue
        mix = ca.MX.sym(f"mix{number}", len(faces), len(near))
        c, m = ca.MX.sym("c", 3, 6), ca.MX.sym("m", len(faces))
        reach = ca.Function("off", [c, m], [c.T @ (ca.DM(faces[:, :3]).T @ m) - ca.DM(faces[:, 3]).T @ m])
        columns = (6 * near[:, None] + np.arange(6)).ravel()
        keep(reach.map(len(near))(pieces[:, [int(k) for k in columns]], mix), floor, np.inf)
        keep(ca.sum1(mix), 1.0, 1.0)
        guess_mix = np.full((len(near), len(faces)), 0.1 / len(faces))
        guess_mix[np.arange(len(near)), least[near].argmax(axis=1)] += 0.9
        mixes.append(mix)
        guesses.append(guess_mix.ravel())
    return mixes, guesses
