"""Objectives and constraints: small functions that each return rows; the convex step stacks them.

A row reads `vals . x[cols] + rho * r <= rhs` with r the common slack [m] that the step maximises
(r is held at a number in the second, energy-minimising step).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import comb

import numpy as np
from scipy import sparse

from .knots import Array, Grid, Ints, Pieces, constant, difference, hermite


@dataclass(frozen=True)
class Pull:
    """Where rows come from: row 6 i + j is `ways[i] . control point j of piece i`; `ways` (m, 3)."""

    pieces: Pieces
    ways: Array


@dataclass(frozen=True)
class Limit:
    """Where rows come from: control points of a derivative (segment, point, axis), first plus, then minus."""

    drone: int
    segments: Ints
    order: int


@dataclass(frozen=True)
class Block:
    """Rows of one width: `vals` and `cols` (r, w), `rhs` and `rho` (r,).

    `origin` tells what the rows are sums of where they depend on the times of knots (slopes.py).
    """

    vals: Array
    cols: Ints
    rhs: Array
    rho: Array
    origin: tuple[Pull, ...] | Limit = ()


def half_spaces(pieces: Pieces, normals: Array, offsets: Array, rho: float = 1.0) -> Block:
    """Rows `n . c >= offset + rho r` on the six control points of each piece; normals (m, 3)."""
    m = len(pieces.start)
    vals = -np.einsum("mij,ma->mija", pieces.maps, normals).reshape(6 * m, 18)
    cols = np.repeat(pieces.columns, 6, axis=0)
    return Block(vals, cols, -np.repeat(offsets, 6), np.full(6 * m, rho), (Pull(pieces, -normals),))


def separation(a: Pieces, b: Pieces, normals: Array, offsets: Array, rho: float = 1.0) -> Block:
    """Rows `n . (c_a - c_b) >= offset + rho r` on the control points of pieces over the same times."""
    one = half_spaces(a, normals, offsets, rho)
    two = half_spaces(b, -normals, offsets, rho)
    return joined([one, two], one.rhs, one.rho)


def joined(parts: Sequence[Block], rhs: Array, rho: Array) -> Block:
    """Rows that are sums of the rows of `parts`, which come from pieces."""
    origin = [pull for b in parts if not isinstance(b.origin, Limit) for pull in b.origin]
    vals, cols = np.hstack([b.vals for b in parts]), np.hstack([b.cols for b in parts])
    return Block(vals, cols, rhs, rho, tuple(origin))


def knot_inside(grid: Grid, drone: int, knot: int, faces: Array, rho: float = 1.0) -> Block:
    """Rows that hold the position of one knot inside faces (n, 4: normal, offset) by `rho r`."""
    cols = np.tile(grid.columns(drone, knot, 0), (len(faces), 1))
    return Block(faces[:, :3], cols, faces[:, 3], np.full(len(faces), rho))


def pieces_inside(pieces: Pieces, faces: Array, rho: float = 1.0) -> Block:
    """Rows that hold every control point of the pieces inside faces (n, 4) by `rho r`."""
    m, n = len(pieces.start), len(faces)
    many = pieces.take(np.repeat(np.arange(m), n))
    return half_spaces(many, np.tile(-faces[:, :3], (m, 1)), np.tile(-faces[:, 3], m), rho)


def fixed(grid: Grid, drone: int, knot: int, derivative: int, value: Array) -> Block:
    """Equality rows: one derivative of one knot has `value` (3,)."""
    cols = grid.columns(drone, knot, derivative)[:, None]
    return Block(np.ones((3, 1)), cols, np.asarray(value, dtype=float), np.zeros(3))


def derivative_maps(h: Array, order: int) -> Array:
    """Matrices (m, 6 - order, 6) from two knots to control points of a derivative, over h (m,) [s]."""
    return np.asarray((difference(order) @ hermite(h)) / (h**order)[:, None, None])


def limits(grid: Grid, drone: int, segments: Ints, order: int, bound: float) -> Block:
    """Rows `|c| <= bound` on the control points of velocity (1) or acceleration (2), every axis."""
    h = np.diff(grid.times[drone])[segments]
    maps = derivative_maps(h, order)
    m, k = len(segments), 6 - order
    base = grid.offsets[drone] + 9 * segments[:, None] + 3 * np.arange(6)[None, :]
    cols = np.broadcast_to(base[:, None, None, :] + np.arange(3)[None, None, :, None], (m, k, 3, 6))
    vals = np.broadcast_to(maps[:, :, None, :], (m, k, 3, 6)).reshape(-1, 6)
    flat = cols.reshape(-1, 6)
    rhs = np.full(2 * len(vals), bound)
    origin = Limit(drone, segments, order)
    return Block(np.vstack([vals, -vals]), np.vstack([flat, flat]), rhs, np.zeros(2 * len(vals)), origin)


def derivative_points(grid: Grid, x: Array, drone: int, order: int) -> Array:
    """Control points (segments, 6 - order, 3) of a derivative of the whole trajectory."""
    knots = grid.knots(x, drone)
    h = np.diff(grid.times[drone])
    local = np.concatenate([knots[:-1], knots[1:]], axis=1)
    return np.asarray(derivative_maps(h, order) @ local)


@cache
def gram(degree: int) -> Array:
    """Integrals of products of Bernstein polynomials of one degree over [0, 1]; constant."""
    n = degree
    w = [[comb(n, i) * comb(n, j) / comb(2 * n, i + j) for j in range(n + 1)] for i in range(n + 1)]
    return constant(np.asarray(w) / (2 * n + 1))


def energy(grid: Grid, weights: Mapping[int, float]) -> sparse.csc_matrix:
    """P with `x' P x / 2 = sum over orders of weight * integral |d^order p|^2 dt`, all drones.

    Steps on the same knots share one matrix, which is not to be written to.
    """
    return smoothness(tuple(t.tobytes() for t in grid.times), tuple(weights.items()))


@lru_cache(maxsize=64)
def smoothness(knots: tuple[bytes, ...], weights: tuple[tuple[int, float], ...]) -> sparse.csc_matrix:
    """`energy` by the bytes of the knot times."""
    grid = Grid(tuple(np.frombuffer(times) for times in knots))
    rows, cols, vals = [], [], []
    for d, times in enumerate(grid.times):
        h = np.diff(times)
        q = np.zeros((len(h), 6, 6))
        for order, weight in weights:
            m = derivative_maps(h, order)
            q += 2 * weight * h[:, None, None] * (m.transpose(0, 2, 1) @ gram(5 - order) @ m)
        base = grid.offsets[d] + 9 * np.arange(len(h))[:, None] + 3 * np.arange(6)[None, :]
        for axis in range(3):
            index = base + axis
            rows.append(np.repeat(index, 6, axis=1).ravel())
            cols.append(np.tile(index, (1, 6)).ravel())
            vals.append(q.ravel())
    shape = (grid.size, grid.size)
    data = (np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols)))
    return sparse.csc_matrix(data, shape=shape)


def stack(blocks: Sequence[Block], size: int) -> tuple[sparse.csc_matrix, Array]:
    """Matrix (rows, size + 1; the last column is r) and right-hand side of all blocks."""
    rows, cols, vals, rhs = [], [], [], []
    count = 0
    for b in blocks:
        n, w = b.vals.shape
        rows.append(np.repeat(np.arange(count, count + n), w + 1))
        cols.append(np.hstack([b.cols, np.full((n, 1), size)]).ravel())
        vals.append(np.hstack([b.vals, b.rho[:, None]]).ravel())
        rhs.append(b.rhs)
        count += n
    data = (np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols)))
    matrix = sparse.csc_matrix(data, shape=(count, size + 1))
    matrix.eliminate_zeros()
    return matrix, np.concatenate(rhs)
