"""Regions as half-spaces, with the few properties that describe them: centre, inradius, vertices.

Signed distances for planning, monitoring and judging come from `fleet._core`; here is only what it
takes to build a region and to tell whether a scenario makes sense. Boxes and regular prisms need no
solver; scipy is imported only where a general shape does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from fleet.scenario.polyhedron import Array, GeometryError, corners, inradius, largest_ball

Point = Sequence[float]


class Region:
    """A named convex polyhedron {x : A x <= b} [m; scenario frame], rows of A of unit length.

    Attributes:
        name: unique in the scenario; `home.ID` for the home of drone ID.
        A: shape (m, 3), outward unit normals.
        b: shape (m,) [m].
    """

    def __init__(
        self,
        name: str,
        A: Array,
        b: Array,
        *,
        ball: tuple[Array, float] | None = None,
        vertices: Array | None = None,
    ) -> None:
        """Takes `ball` (centre and radius of the largest inscribed ball) and `vertices` where known.

        Raises:
            GeometryError: a zero or non-finite row, an empty or an unbounded polyhedron.
        """
        norms = np.linalg.norm(A, axis=1)
        if not (np.isfinite(A).all() and np.isfinite(b).all() and (norms > 1e-12).all()):
            raise GeometryError("every row of A must be finite and not zero, and b finite")
        self.name = name
        self.A: Array = A / norms[:, None] + 0.0
        self.b: Array = b / norms + 0.0
        self._center, self.inradius = ball or largest_ball(self.A, self.b)
        self._vertices = vertices
        for array in (self.A, self.b, self._center):
            array.setflags(write=False)

    def __repr__(self) -> str:
        """Its name and number of faces."""
        return f"{type(self).__name__}({self.name!r}, {len(self.b)} faces)"

    @property
    def center(self) -> Array:
        """Centre of the largest ball inside, shape (3,) [m]; the middle of a box."""
        return self._center

    @cached_property
    def vertices(self) -> Array:
        """Corners, shape (k, 3) [m], in no particular order."""
        return self._vertices if self._vertices is not None else corners(self.A, self.b, self.center)

    @cached_property
    def faces(self) -> list[dict[str, Any]]:
        """The half-spaces as the wire has them: `{"a": [ax, ay, az], "b": b}`."""
        return [{"a": a, "b": b} for a, b in zip(self.A.tolist(), self.b.tolist(), strict=True)]

    def wire(self) -> dict[str, Any]:
        """The region as `Region` of a plan."""
        return {"name": self.name, "shape": self.faces}

    def depth(self, point: Point | Array) -> float:
        """How far inside `point` is: min of b - A x [m], negative outside. For validation."""
        return float(np.min(self.b - self.A @ np.asarray(point, dtype=float)))

    def overlaps(self, other: Region) -> bool:
        """Whether the two share more than a surface."""
        if _separated(self, other) or _separated(other, self):
            return False
        return inradius(np.vstack((self.A, other.A)), np.concatenate((self.b, other.b))) > 1e-9

    def covers(self, other: Region) -> bool:
        """Whether nothing of `other` reaches out of this region."""
        return bool(np.all(other.vertices @ self.A.T <= self.b + 1e-9))


def from_box(name: str, low: Point, high: Point) -> Region:
    """The axis-aligned box between two corners.

    Raises:
        GeometryError: `low` is not below `high` on every axis.
    """
    lo, hi = np.array(low, dtype=float), np.array(high, dtype=float)
    if not np.all(lo < hi):
        raise GeometryError(
            f"the first corner {list(low)} must be below the second {list(high)} on every axis"
        )
    A = np.zeros((6, 3))
    A[0::2], A[1::2] = np.eye(3), -np.eye(3)
    b = np.empty(6)
    b[0::2], b[1::2] = hi, -lo
    ends = np.array(list(product(*zip(lo, hi, strict=True))))
    return Region(name, A, b, ball=(lo + (hi - lo) / 2, float(np.min(hi - lo)) / 2), vertices=ends)


def from_prism(name: str, base: Sequence[Point], low: float, high: float) -> Region:
    """The upright prism over a convex polygon `base` (corners in order, either way round).

    Raises:
        GeometryError: fewer than three corners, not convex, no area, or `low` not below `high`.
    """
    if not low < high:
        raise GeometryError(f"z must be [low, high] with low < high, not [{low:g}, {high:g}]")
    A2, b2 = _polygon_faces(np.array(base, dtype=float))
    A, b = _upright(A2, b2, low, high)
    ends = np.array([(*map(float, xy), z) for xy in base for z in (low, high)])
    return Region(name, A, b, vertices=ends)


def from_regular_prism(
    name: str, center: Point, apothem: float, sides: int, *, low: float, high: float
) -> Region:
    """The upright prism over a regular polygon whose face normals are at k x 360/sides degrees.

    Raises:
        GeometryError: fewer than three sides, no apothem, or `low` not below `high`.
    """
    if sides < 3 or sides > 64 or apothem <= 0:
        raise GeometryError(f"need 3 to 64 sides and apothem > 0, not {sides} and {apothem:g}")
    if not low < high:
        raise GeometryError(f"z must be [low, high] with low < high, not [{low:g}, {high:g}]")
    turn = 2 * math.pi / sides
    angles = turn * np.arange(sides)
    # Rounded so that normals at multiples of 90 degrees are exact.
    A2 = np.column_stack((np.cos(angles), np.sin(angles))).round(15)
    middle = np.array([*center, (low + high) / 2], dtype=float)
    A, b = _upright(A2, A2 @ middle[:2] + apothem, low, high)
    reach = apothem / math.cos(turn / 2)
    ring = middle[:2] + reach * np.column_stack((np.cos(angles + turn / 2), np.sin(angles + turn / 2)))
    ends = np.array([(x, y, z) for x, y in ring for z in (low, high)])
    return Region(name, A, b, ball=(middle, min(apothem, (high - low) / 2)), vertices=ends)


def _upright(A2: Array, b2: Array, low: float, high: float) -> tuple[Array, Array]:
    A = np.vstack((np.column_stack((A2, np.zeros(len(A2)))), [[0, 0, 1], [0, 0, -1]]))
    return A, np.concatenate((b2, [high, -low]))


def _polygon_faces(base: Array) -> tuple[Array, Array]:
    """Outward unit normals and offsets of a convex polygon's edges."""
    edges = np.roll(base, -1, axis=0) - base
    following = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
    angles = np.arctan2(turns, np.sum(edges * following, axis=1))
    # One turn in all: a star polygon turns the same way at each corner but more than once.
    once = math.isclose(abs(float(np.sum(angles))), 2 * math.pi, rel_tol=1e-6)
    if len(base) < 3 or not once or not (np.all(turns > 1e-9) or np.all(turns < -1e-9)):
        raise GeometryError("base must be a convex polygon: at least 3 corners in order, none on a line")
    side = 1.0 if turns[0] > 0 else -1.0
    normals = side * np.column_stack((edges[:, 1], -edges[:, 0]))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return normals, np.sum(normals * base, axis=1)


def _separated(region: Region, other: Region) -> bool:
    """Whether one face of `region` has all of `other` on its far side; exact for two boxes."""
    beyond = other.vertices @ region.A.T - region.b
    return bool(np.any(np.min(beyond, axis=0) >= -1e-9))
