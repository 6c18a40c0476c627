"""Random convex shapes, as faces and as the text of a scenario file."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Random = np.random.Generator


@dataclass(frozen=True)
class Shape:
    """A convex polyhedron: outward faces (n, 4: unit normal, offset) [m], its middle (3,), and its TOML."""

    faces: Array
    middle: Array
    toml: str

    def inside(self, points: Array) -> Array:
        """How far inside points (..., 3) are [m]."""
        return np.asarray((self.faces[:, 3] - points @ self.faces[:, :3].T).min(axis=-1))


def numbers(values: Array) -> str:
    """A TOML array of numbers, or of arrays of them."""
    return str(np.round(values, 4).tolist())


def box(low: Array, high: Array) -> Shape:
    """The box between two corners, on centimetres."""
    low, high = np.round(low, 2), np.round(high, 2)
    faces = np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.concatenate([high, -low])])
    return Shape(faces, (low + high) / 2, f"box = {numbers(np.array([low, high]))}")


def cube(middle: Array, half: float) -> Shape:
    """The cube around a point."""
    return box(middle - half, middle + half)


def prism(middle: Array, apothem: float, sides: int, height: float) -> Shape:
    """An upright regular prism; face normals from the x axis on (scenario files)."""
    middle, apothem, height = np.round(middle, 2), round(apothem, 2), round(height, 2)
    angles = 2 * np.pi * np.arange(sides) / sides
    sideways = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    normals = np.vstack([sideways, [[0, 0, 1], [0, 0, -1]]])
    low, high = middle[2] - height / 2, middle[2] + height / 2
    offsets = np.concatenate([sideways @ middle + apothem, [high, -low]])
    text = (
        f"prism = {{ center = {numbers(middle[:2])}, apothem = {apothem}, sides = {sides}, "
        f"z = {numbers(np.array([low, high]))} }}"
    )
    return Shape(np.column_stack([normals, offsets]), middle, text)


def polyhedron(rng: Random, middle: Array, radius: float) -> Shape:
    """Random faces around a ball of `radius`, cut by a box so that it is bounded."""
    extra = rng.normal(size=(int(rng.integers(1, 7)), 3))
    normals = np.vstack([np.eye(3), -np.eye(3), extra / np.linalg.norm(extra, axis=1, keepdims=True)])
    normals = np.round(normals, 4)
    reach = np.concatenate([rng.uniform(1.0, 1.6, 6), rng.uniform(1.0, 1.3, len(extra))]) * radius
    offsets = np.round(normals @ middle + reach, 4)
    text = f"polyhedron = {{ A = {numbers(normals)}, b = {numbers(offsets)} }}"
    size = np.linalg.norm(normals, axis=1)
    return Shape(np.column_stack([normals / size[:, None], offsets / size]), middle, text)


def obstacle(rng: Random, middle: Array, size: float) -> Shape:
    """A box, an upright prism or a polyhedron about `size` [m] wide."""
    kind = rng.choice(["box", "prism", "polyhedron"])
    if kind == "box":
        half = size / 2 * rng.uniform(0.5, 1.5, 3)
        return box(middle - half, middle + half)
    if kind == "prism":
        return prism(middle, size / 2, int(rng.integers(3, 9)), size * rng.uniform(0.7, 2.5))
    return polyhedron(rng, middle, size / 2)


def corners(shape: Shape) -> Array:
    """Corners (k, 3) [m]: where three faces meet that no other cuts off."""
    index = np.array(list(combinations(range(len(shape.faces)), 3)))
    normals, offsets = shape.faces[index][:, :, :3], shape.faces[index][:, :, 3]
    regular = np.abs(np.linalg.det(normals)) > 1e-9
    points = np.linalg.solve(normals[regular], offsets[regular][:, :, None])[:, :, 0]
    return np.asarray(points[shape.inside(points) >= -1e-6])


def apart(a: Shape, b: Shape, least: float) -> bool:
    """Whether a face of one of two shapes has the other wholly `least` [m] beyond it."""
    for one, two in ((a, b), (b, a)):
        nearest = (corners(two) @ one.faces[:, :3].T).min(axis=0)
        if (nearest - one.faces[:, 3] >= least).any():
            return True
    return False
