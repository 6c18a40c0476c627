"""How the value of a convex step changes with the times of its knots (envelope theorem).

At a solution the derivative of the optimal value by a parameter is that of the Lagrangian at fixed
unknowns and multipliers (Milgrom and Segal 2002; Nocedal and Wright, Numerical Optimization, 12.3). Here
the parameters are times of knots: the energy and every row but those of single knots depend on them,
position, velocity and acceleration at the knots being held. Control points are polynomials of low degree
in the times, so central differences are exact to about 1e-9.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from .knots import KNOT, SAME_KNOT, Array, Grid, Ints, hermite, restriction
from .rows import Block, Limit, Pull, derivative_maps, gram

#: Step of the central differences, as a share of a segment's duration.
STEP = 1e-5
#: Multipliers below this share of the largest one of their block do not count.
IDLE = 1e-9


def slopes(
    grid: Grid, x: Array, rows: Sequence[tuple[Block, Array]], weights: Mapping[int, float]
) -> list[Array]:
    """Derivative (n_d,) per drone of `energy + sum of multiplier * row` by every knot time [1/s].

    `rows` are blocks with their multipliers (r,), `weights` those of the energy by order of derivative.
    """
    out = [np.zeros(len(t)) for t in grid.times]
    for d in range(len(grid.times)):
        stretch(out, grid, d, np.arange(len(grid.times[d]) - 1), energy_slope(grid, x, d, weights))
    for block, z in rows:
        if isinstance(block.origin, Limit):
            where = block.origin
            stretch(out, grid, where.drone, where.segments, limit_slope(grid, x, where, z))
        elif block.origin:
            for drone, knots, values in piece_slopes(grid, x, block.origin, z):
                np.add.at(out[drone], knots, values)
    return out


def stretch(out: list[Array], grid: Grid, drone: int, segments: Ints, values: Array) -> None:
    """Add derivatives (m,) by the durations of segments: a duration is the difference of two times."""
    np.add.at(out[drone], segments + 1, values)
    np.add.at(out[drone], segments, -values)


def locals_of(grid: Grid, x: Array, drone: int, segments: Ints) -> Array:
    """The two knots around each segment (m, 6, 3)."""
    knots = grid.knots(x, drone)
    return np.concatenate([knots[segments], knots[segments + 1]], axis=1)


def energy_slope(grid: Grid, x: Array, drone: int, weights: Mapping[int, float]) -> Array:
    """Derivative (n - 1,) of the weighed energy by the duration of every segment."""
    h = np.diff(grid.times[drone])
    local = locals_of(grid, x, drone, np.arange(len(h)))

    def value(h: Array) -> Array:
        total = np.zeros(len(h))
        for order, weight in weights.items():
            c = derivative_maps(h, order) @ local
            total += weight * h * np.einsum("mia,ij,mja->m", c, gram(5 - order), c)
        return total

    return np.asarray((value(h * (1 + STEP)) - value(h * (1 - STEP))) / (2 * STEP * h))


def limit_slope(grid: Grid, x: Array, where: Limit, z: Array) -> Array:
    """Derivative (m,) of the rows of limits, times multipliers, by the durations of their segments."""
    h = np.diff(grid.times[where.drone])[where.segments]
    local = locals_of(grid, x, where.drone, where.segments)
    plus, minus = z.reshape(2, len(h), 6 - where.order, 3)

    def value(h: Array) -> Array:
        return np.asarray(((plus - minus) * (derivative_maps(h, where.order) @ local)).sum(axis=(1, 2)))

    return np.asarray((value(h * (1 + STEP)) - value(h * (1 - STEP))) / (2 * STEP * h))


def piece_slopes(grid: Grid, x: Array, pulls: Sequence[Pull], z: Array) -> Iterator[tuple[int, Ints, Array]]:
    """(drone, knots (m,), derivatives (m,)) of the rows of pieces, times multipliers.

    The ends of a piece move with the knot that they are at, else in proportion within their segment.
    """
    each = z.reshape(-1, 6)
    busy = np.flatnonzero(each.max(axis=1) > IDLE * max(float(z.max(initial=0.0)), 1e-300))
    if len(busy) == 0:
        return
    each = each[busy]
    ends = np.zeros((2, len(busy)))
    for pull in pulls:
        pieces, force = pull.pieces.take(busy), each[:, :, None] * pull.ways[busy][:, None, :]
        times = grid.times[pieces.drone]
        segments = (pieces.columns[:, 0] - grid.offsets[pieces.drone]) // KNOT
        local = x[pieces.columns].reshape(-1, 6, 3)
        at = np.stack([pieces.start, pieces.end, times[segments], times[segments + 1]])
        parts = partials(at, local, force)
        ends += parts[:2]
        yield pieces.drone, segments, parts[2]
        yield pieces.drone, segments + 1, parts[3]
    drones, first = [p.pieces.drone for p in pulls], pulls[0].pieces
    for t, values in ((first.start[busy], ends[0]), (first.end[busy], ends[1])):
        for drone, knots, share in carriers(grid, drones, t):
            yield drone, knots, share * values


def partials(at: Array, local: Array, force: Array) -> Array:
    """Derivatives (4, m) of `sum of force * control point` by start, end, and the two knots of a segment."""

    def value(at: Array) -> Array:
        h = at[3] - at[2]
        points = restriction((at[0] - at[2]) / h, (at[1] - at[2]) / h) @ hermite(h) @ local
        return np.asarray((force * points).sum(axis=(1, 2)))

    step, out = STEP * (at[3] - at[2]), np.empty_like(at)
    for k in range(4):
        up, down = at.copy(), at.copy()
        up[k] += step
        down[k] -= step
        out[k] = (value(up) - value(down)) / (2 * step)
    return out


def carriers(grid: Grid, drones: Sequence[int], t: Array) -> Iterator[tuple[int, Ints, Array]]:
    """(drone, knots (m,), shares (m,)): the knots that the times `t` (m,) move with, and how much.

    A time at no knot of any drone keeps its proportions in its segment of the first drone.
    """
    times = grid.times[drones[0]]
    segment = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    along = np.clip((t - times[segment]) / np.diff(times)[segment], 0.0, 1.0)
    own = np.ones(len(t))
    loose = np.abs(t[:, None] - times[segment[:, None] + np.arange(2)]).min(axis=1) > SAME_KNOT
    for drone in drones[1:]:
        knots = np.abs(t[:, None] - grid.times[drone]).argmin(axis=1)
        other = np.abs(t - grid.times[drone][knots]) <= SAME_KNOT
        # Where both have a knot, whichever is first ends one piece and the other begins the next.
        share = np.where(other, np.where(loose, 1.0, 0.5), 0.0)
        own -= share
        yield drone, knots, share
    yield drones[0], segment, own * (1.0 - along)
    yield drones[0], segment + 1, own * along
