"""Expressions of the nonlinear program: stage functions built once and mapped, numbers as parameters.

Nothing here holds a number of a mission. What an expression is made of is its `Term`'s shape (counts, and
which unknowns its matrices touch); what the matrices hold comes in as parameters, so that a solver serves
every program of the same shape.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .knots import KNOT, Array, difference, hermite
from .rows import gram
from .setup import SMOOTH


@dataclass(frozen=True)
class Pattern:
    """Which entries of a matrix are stored, in compressed columns; hashable."""

    shape: tuple[int, int]
    starts: tuple[int, ...]
    rows: bytes

    @classmethod
    def of(cls, matrix: sparse.csc_matrix) -> Pattern:
        """The pattern of a matrix with sorted rows; its numbers are `matrix.data`."""
        starts = tuple(int(k) for k in matrix.indptr)
        return cls(matrix.shape, starts, matrix.indices.astype(np.int64).tobytes())

    @property
    def count(self) -> int:
        """How many entries are stored."""
        return self.starts[-1]

    def filled(self, numbers: Any) -> Any:
        """The CasADi matrix with these stored entries."""
        rows = [int(k) for k in np.frombuffer(self.rows, dtype=np.int64)]
        return ca.MX(ca.Sparsity(*self.shape, list(self.starts), rows), numbers)


@dataclass
class Given:
    """What expressions are made of: all knots `x`, the slack `r`, the term's own unknowns and its parameters.

    `c` is the sharpness of smooth robustness [1/m]. Parameters are taken in order.
    """

    x: Any
    r: Any
    own: Any
    numbers: Any
    c: Any
    read: int = 0

    def take(self, count: int) -> Any:
        """The next parameters (count,)."""
        self.read += count
        return self.numbers[self.read - count : self.read]

    def margin(self) -> Any:
        """The margin asked for [m]: a weight times r and what is added to it, the next two parameters."""
        weight, more = ca.vertsplit(self.take(2))
        return weight * self.r + more


@dataclass(frozen=True)
class Posed:
    """Columns of constraints, and what is added to the objective at the weight of smoothness."""

    columns: list[Any]
    cost: Any = None


@cache
def stage() -> tuple[Any, Any]:
    """Stage functions of one segment (two knots (9,), duration): derivative control points, and cost.

    Control points of velocity (3, 5) [m/s] and acceleration (3, 4) [m/s^2]; cost as `SMOOTH` weighs.
    """
    first, second, h = ca.MX.sym("k0", KNOT), ca.MX.sym("k1", KNOT), ca.MX.sym("h")
    local = ca.horzcat(ca.reshape(first, 3, 3), ca.reshape(second, 3, 3))
    unit = hermite(np.ones(1))[0]
    scale = ca.vertcat(1, h, h**2, 1, h, h**2)
    points = (local * ca.repmat(scale.T, 3, 1)) @ unit.T
    speed, acceleration, jerk = (points @ difference(k).T / h**k for k in (1, 2, 3))
    cost = SMOOTH[2] * h * ca.sum1(ca.sum2((acceleration @ gram(3)) * acceleration))
    cost += SMOOTH[3] * h * ca.sum1(ca.sum2((jerk @ gram(2)) * jerk))
    derivatives = ca.Function("stage", [first, second, h], [speed, acceleration])
    return derivatives, ca.Function("cost", [first, second, h], [cost])


@cache
def mapped(segments: int) -> tuple[Any, Any]:
    """The stage functions over a number of segments."""
    derivatives, cost = stage()
    return derivatives.map(segments), cost.map(segments)


def control_points(given: Given, axes: tuple[Pattern, ...]) -> list[Any]:
    """Position control points of pieces per axis, (6, m): one sparse matrix's numbers serve all axes."""
    numbers = given.take(axes[0].count)
    return [ca.reshape(axis.filled(numbers) @ given.x, 6, axis.shape[0] // 6) for axis in axes]


def linear(given: Given, matrix: Pattern) -> Posed:
    """Rows of a matrix over all knots and r, less a right-hand side."""
    rows = matrix.filled(given.take(matrix.count)) @ ca.vertcat(given.x, given.r)
    return Posed([rows - given.take(matrix.shape[0])])


def limits(given: Given, offset: int, knots: int) -> Posed:
    """Control points of velocity and of acceleration of one drone, and the cost of smoothness."""
    points = ca.reshape(given.x[offset : offset + KNOT * knots], KNOT, knots)
    h = given.take(knots - 1).T
    derivatives, cost = mapped(knots - 1)
    speed, acceleration = derivatives(points[:, :-1], points[:, 1:], h)
    return Posed([ca.vec(speed), ca.vec(acceleration)], ca.sum2(cost(points[:, :-1], points[:, 1:], h)))


def outside(given: Given, axes: tuple[Pattern, ...], faces: int) -> Posed:
    """Pieces beyond a convex combination of faces, the term's unknowns (faces, m), by a margin."""
    points = control_points(given, axes)
    mix = ca.reshape(given.own, faces, points[0].shape[1])
    plane = ca.reshape(given.take(4 * faces), faces, 4)
    normal, distance = plane[:, :3].T @ mix, plane[:, 3].T @ mix
    reached = sum(points[k] * ca.repmat(normal[k, :], 6, 1) for k in range(3))
    short = reached - ca.repmat(distance, 6, 1) - given.margin()
    return Posed([ca.vec(ca.sum1(mix)), ca.vec(short)])


def apart(given: Given, one: tuple[Pattern, ...], two: tuple[Pattern, ...]) -> Posed:
    """Pieces of a pair apart by a margin along vectors of at most unit length, the term's unknowns (3, m)."""
    first, second = control_points(given, one), control_points(given, two)
    pieces = first[0].shape[1]
    along = ca.reshape(given.own, 3, pieces)
    gap = sum((first[k] - second[k]) * ca.repmat(along[k, :], 6, 1) for k in range(3))
    asked = ca.repmat(given.take(pieces).T, 6, 1) + given.margin()
    return Posed([ca.vec(ca.sum1(along**2)), ca.vec(gap - asked)])


def held(given: Given) -> Posed:
    """r less the number that it is held at."""
    return Posed([given.r - given.take(1)])


def matrix_of(
    rows: NDArray[Any], columns: NDArray[Any], values: Array, shape: tuple[int, int]
) -> sparse.csc_matrix:
    """A sparse matrix from its entries, zeros kept, rows sorted."""
    found = sparse.coo_matrix((values, (rows, columns)), shape=shape).tocsc()
    found.sort_indices()
    return found
