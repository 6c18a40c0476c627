"""Largest ball and corners of convex polyhedra {x : A x <= b}, by linear programming and Qhull.

Signed distances, which decide missions, are in the core (`fleet._core`); these are for checking
scenarios and for drawing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class GeometryError(ValueError):
    """Numbers that do not describe a bounded convex polyhedron with an inside."""


def largest_ball(A: Array, b: Array) -> tuple[Array, float]:
    """Centre (3,) and radius [m] of the largest ball inside; rows of A of unit length.

    Chebyshev centre by linear programming (Boyd and Vandenberghe 2004, section 8.5.1). Where many
    balls are as large, the middle one along x, of those the middle one along y, and so for z.

    Raises:
        GeometryError: the polyhedron is empty, unbounded or flat.
    """
    for direction in _AXES:
        _farthest(A, b, direction)
    radius = inradius(A, b)
    if radius < 1e-9:
        raise GeometryError("the polyhedron has no inside: it is flat or empty")
    # The set of centres is often a single point; the slack keeps it from being rounded away.
    inner = b - radius + 1e-9
    center = np.zeros(3)
    for axis in range(3):
        known = [(x, x) for x in center[:axis]]
        ends = [_farthest(A, inner, sign * np.eye(3)[axis], known)[axis] for sign in (-1.0, 1.0)]
        center[axis] = (ends[0] + ends[1]) / 2
    return center, radius


def inradius(A: Array, b: Array) -> float:
    """Radius of the largest ball inside a bounded polyhedron, 0 when it is flat or empty [m]."""
    from scipy.optimize import linprog

    rows = np.column_stack((A, np.ones(len(b))))
    bounds = [(None, None)] * 3 + [(0, None)]
    found = linprog([0, 0, 0, -1], A_ub=rows, b_ub=b, bounds=bounds, method="highs")
    return float(found.x[3]) if found.status == 0 and found.x is not None else 0.0


_AXES = np.vstack((np.eye(3), -np.eye(3)))


def _farthest(A: Array, b: Array, direction: Array, known: Sequence[tuple[float, float]] = ()) -> Array:
    """The point of the polyhedron farthest along `direction`, its first coordinates within `known`."""
    from scipy.optimize import linprog

    bounds = [*known, *[(None, None)] * (3 - len(known))]
    found = linprog(-direction, A_ub=A, b_ub=b, bounds=bounds, method="highs")
    if found.status == 2:
        raise GeometryError("the polyhedron is empty: no point satisfies all of its faces")
    if found.status != 0 or found.x is None:
        raise GeometryError("the polyhedron is unbounded; add faces until it is closed on every side")
    return np.asarray(found.x, dtype=float)


def corners(A: Array, b: Array, inside: Array) -> Array:
    """Corners of {A x <= b} around a point strictly inside, shape (k, 3) [m].

    Raises:
        GeometryError: the point is not inside by more than rounding.
    """
    from scipy.spatial import HalfspaceIntersection, QhullError

    try:
        found = HalfspaceIntersection(np.column_stack((A, -b)), inside).intersections
    except QhullError as error:
        raise GeometryError("the corners of the polyhedron cannot be computed; it is too thin") from error
    found = found[np.isfinite(found).all(axis=1)]  # redundant faces meet nowhere
    # A corner of more than three faces comes once for each three of them.
    unique: Array = np.unique(found.round(9) + 0.0, axis=0)
    return unique
