"""Knots as decision variables, and their control points as linear maps of them.

A drone's trajectory is a quintic between knots (position, velocity, acceleration), exactly as
`Trajectory` of crates/core reads it. Every bound of the planner is a linear row on Bernstein control
points, which hold their curve over continuous time (Farin, Curves and Surfaces for CAGD, 4.3).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Entries of one knot: position, velocity, acceleration, three axes each.
KNOT = 9
#: A time nearer to a knot than this is that of the knot [s].
SAME_KNOT = 1e-6


@dataclass(frozen=True)
class Grid:
    """Knot times of every drone and where their variables lie in the vector of unknowns.

    `times[d]` (n_d,) [s], rising. The unknowns of drone d are an (n_d, 3, 3) array (knot, derivative,
    axis), stored from `offsets[d]`; `size` is the number of unknowns.
    """

    times: tuple[Array, ...]

    @property
    def offsets(self) -> tuple[int, ...]:
        """First unknown of each drone."""
        sizes = [KNOT * len(t) for t in self.times]
        return tuple(int(x) for x in np.concatenate([[0], np.cumsum(sizes)[:-1]]))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return KNOT * sum(len(t) for t in self.times)

    def knots(self, x: Array, drone: int) -> Array:
        """Knots (n, 3, 3) of `drone` in the unknowns `x`."""
        n, start = len(self.times[drone]), self.offsets[drone]
        return x[start : start + KNOT * n].reshape(n, 3, 3)

    def at(self, drone: int, t: float) -> int:
        """Index of the knot of `drone` at time `t` [s]; the caller placed a knot there."""
        times = self.times[drone]
        k = int(np.argmin(np.abs(times - t)))
        if abs(times[k] - t) > SAME_KNOT:
            raise ValueError(f"drone {drone} has no knot at {t} s")
        return k

    def columns(self, drone: int, knot: int, derivative: int) -> Ints:
        """Columns (3,) of one derivative of one knot."""
        base = self.offsets[drone] + KNOT * knot + 3 * derivative
        return np.arange(base, base + 3)


@dataclass(frozen=True)
class Pieces:
    """Pieces of one drone's trajectory: control points are `maps @ (the two knots around)`.

    `maps` (m, 6, 6), `columns` (m, 18) ordered (knot value, axis), `start` and `end` (m,) [s].
    """

    drone: int
    maps: Array
    columns: Ints
    start: Array
    end: Array

    def points(self, x: Array) -> Array:
        """Position control points (m, 6, 3) [m]."""
        local = x[self.columns].reshape(len(self.start), 6, 3)
        return np.asarray(self.maps @ local)

    def take(self, index: Ints) -> Pieces:
        """The pieces of `index`."""
        return Pieces(self.drone, self.maps[index], self.columns[index], self.start[index], self.end[index])


def hermite(h: Array) -> Array:
    """Matrices (m, 6, 6) from (p0, v0, a0, p1, v1, a1) to control points over durations `h` (m,) [s]."""
    out = np.zeros((len(h), 6, 6))
    out[:, :3, 0] = 1.0
    out[:, 3:, 3] = 1.0
    out[:, 1, 1], out[:, 2, 1], out[:, 2, 2] = h / 5, 0.4 * h, h**2 / 20
    out[:, 4, 4], out[:, 3, 4], out[:, 3, 5] = -h / 5, -0.4 * h, h**2 / 20
    return out


def restriction(s0: Array, s1: Array) -> Array:
    """Matrices (m, 6, 6) that cut control points to [s0, s1] of the unit interval (blossoming)."""
    out = np.empty((len(s0), 6, 6))
    for j in range(6):
        c = np.broadcast_to(np.eye(6), (len(s0), 6, 6))
        for step in range(5):
            u = (s1 if step < j else s0)[:, None, None]
            c = c[:, :-1] * (1 - u) + c[:, 1:] * u
        out[:, j] = c[:, 0]
    return out


def cut(grid: Grid, drone: int, times: Array) -> Pieces:
    """Pieces of `drone` between successive `times` (k,) [s]; none may straddle a knot."""
    knots = grid.times[drone]
    start, end = times[:-1], times[1:]
    seg = np.clip(np.searchsorted(knots, 0.5 * (start + end)) - 1, 0, len(knots) - 2)
    h = np.diff(knots)[seg]
    s0 = np.clip((start - knots[seg]) / h, 0.0, 1.0)
    s1 = np.clip((end - knots[seg]) / h, 0.0, 1.0)
    maps = restriction(s0, s1) @ hermite(h)
    columns = grid.offsets[drone] + KNOT * seg[:, None] + np.arange(2 * KNOT)[None, :]
    return Pieces(drone, maps, columns, start, end)


def refine(times: Array, parts: int) -> Array:
    """`times` with every interval cut into `parts` equal ones."""
    steps = np.arange(parts) / parts
    inner = times[:-1, None] + np.diff(times)[:, None] * steps
    return np.append(inner.ravel(), times[-1])


def merge(*times: Array) -> Array:
    """Common refinement of several rising lists of times [s]."""
    union = np.sort(np.concatenate(times))
    keep = np.append(True, np.diff(union) > SAME_KNOT)
    return np.asarray(union[keep])


def constant(matrix: Array) -> Array:
    """The matrix, which from here on cannot be written to: it is shared."""
    matrix.flags.writeable = False
    return matrix


@cache
def difference(order: int) -> Array:
    """Matrix (5 - order + 1, 6): control points of the derivative of `order`, times h^order; constant."""
    out = np.eye(6)
    for k in range(order):
        out = (5 - k) * np.diff(out, axis=0)
    return constant(out)


def sample(grid: Grid, x: Array, drone: int, times: Array) -> Array:
    """Positions (m, 3) [m] of `drone` at `times` (m,) [s]."""
    points, _, s = located(grid, x, drone, times)
    return value(points, s)


def states(grid: Grid, x: Array, drone: int, times: Array) -> Array:
    """Position, velocity and acceleration (m, 3, 3) of `drone` at `times` (m,) [s]."""
    points, h, s = located(grid, x, drone, times)
    out = [value(difference(k) @ points, s) / h[:, None] ** k for k in range(3)]
    return np.stack(out, axis=1)


def located(grid: Grid, x: Array, drone: int, times: Array) -> tuple[Array, Array, Array]:
    """Control points (m, 6, 3) and duration (m,) of the segments at `times`, and the places (m,) in them."""
    knots = grid.times[drone]
    seg = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    h = np.diff(knots)[seg]
    columns = grid.offsets[drone] + KNOT * seg[:, None] + np.arange(2 * KNOT)[None, :]
    points = hermite(h) @ x[columns].reshape(len(times), 6, 3)
    return points, h, np.clip((times - knots[seg]) / h, 0.0, 1.0)


def value(points: Array, s: Array) -> Array:
    """Values (m, 3) at `s` (m,) of curves with control points (m, k, 3) (de Casteljau)."""
    c, u = points, s[:, None, None]
    while c.shape[1] > 1:
        c = c[:, :-1] * (1 - u) + c[:, 1:] * u
    return np.asarray(c[:, 0])
