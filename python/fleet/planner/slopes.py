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
from numpy.typing import NDArray

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
        segments, values = np.arange(len(grid.times[d]) - 1), energy_slope(grid, x, d, weights)
        np.add.at(out[d], segments + 1, values)
        np.add.at(out[d], segments, -values)
    for block, z in rows:
        for drone, knots, values in row_slopes(grid, x, block, z > IDLE * z.max(initial=0.0)):
            np.add.at(out[drone], knots, z * values)
    return out


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


def locals_of(grid: Grid, x: Array, drone: int, segments: Ints) -> Array:
    """The two knots around each segment (m, 6, 3)."""
    knots = grid.knots(x, drone)
    return np.concatenate([knots[segments], knots[segments + 1]], axis=1)


def row_slopes(
    grid: Grid, x: Array, block: Block, wanted: NDArray[np.bool_]
) -> Iterator[tuple[int, Ints, Array]]:
    """Derivatives of the rows of a block by times of knots: (drone, knot (r,), derivative (r,)), to be added.

    Rows of pieces and segments none of whose rows are `wanted` (r,) may be left at 0.
    """
    if isinstance(block.origin, Limit):
        yield from limit_slopes(grid, x, block.origin)
    elif block.origin and wanted.any():
        busy = np.flatnonzero(wanted.reshape(-1, 6).any(axis=1))
        for drone, knots, values in piece_slopes(grid, x, block.origin, busy):
            all_knots, all_values = np.zeros(len(wanted), dtype=int), np.zeros((len(wanted) // 6, 6))
            all_values[busy] = values
            all_knots.reshape(-1, 6)[busy] = knots[:, None]
            yield drone, all_knots, all_values.ravel()


def limit_slopes(grid: Grid, x: Array, where: Limit) -> Iterator[tuple[int, Ints, Array]]:
    """As `row_slopes`, of the rows of limits: a segment's duration is the difference of two times."""
    h = np.diff(grid.times[where.drone])[where.segments]
    local = locals_of(grid, x, where.drone, where.segments)
    up, down = (derivative_maps(h * (1 + s), where.order) @ local for s in (STEP, -STEP))
    values = (up - down) / (2 * STEP * h)[:, None, None]
    both = np.concatenate([values, -values]).ravel()
    segments = np.tile(np.repeat(where.segments, 3 * (6 - where.order)), 2)
    yield where.drone, segments + 1, both
    yield where.drone, segments, -both


def piece_slopes(
    grid: Grid, x: Array, pulls: Sequence[Pull], busy: Ints
) -> Iterator[tuple[int, Ints, Array]]:
    """As `row_slopes`, of the rows (m, 6) of some pieces.

    The ends of a piece move with the knot that they are at, else in proportion within their segment.
    """
    ends = np.zeros((2, len(busy), 6))
    for pull in pulls:
        pieces = pull.pieces.take(busy)
        times = grid.times[pieces.drone]
        segments = (pieces.columns[:, 0] - grid.offsets[pieces.drone]) // KNOT
        local = x[pieces.columns].reshape(-1, 6, 3)
        along = (local @ pull.ways[busy][:, :, None])[:, :, 0]
        at = np.stack([pieces.start, pieces.end, times[segments], times[segments + 1]])
        parts = partials(at, along)
        ends += parts[:2]
        yield pieces.drone, segments, parts[2]
        yield pieces.drone, segments + 1, parts[3]
    drones, first = [p.pieces.drone for p in pulls], pulls[0].pieces
    for t, values in ((first.start[busy], ends[0]), (first.end[busy], ends[1])):
        for drone, knots, share in carriers(grid, drones, t):
            yield drone, knots, share[:, None] * values


def partials(at: Array, along: Array) -> Array:
    """Derivatives (4, m, 6) of control points by start, end and the two knots of a segment, `at` (4, m).

    `along` (m, 6) are the values of the two knots in one direction.
    """

    def value(at: Array) -> Array:
        h = at[3] - at[2]
        maps = restriction((at[0] - at[2]) / h, (at[1] - at[2]) / h) @ hermite(h)
        return np.asarray((maps @ along[:, :, None])[:, :, 0])

    step, out = STEP * (at[3] - at[2]), np.empty((4, *along.shape))
    for k in range(4):
        up, down = at.copy(), at.copy()
        up[k] += step
        down[k] -= step
        out[k] = (value(up) - value(down)) / (2 * step[:, None])
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
