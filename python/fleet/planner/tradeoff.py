"""The paper's weighted form: maximise r - eps' Q eps, with eps >= 0 above the squared acceleration.

Silano et al. 2021, equation of section III-E: at sample k and axis j |a'a|^2 <= eps'eps, so eps bounds the
squared acceleration, and Q is a multiple of the identity over samples, axes and drones. Here the samples are
the nodes of a quadrature, so that the sum over samples T_s apart is 1/T_s times an integral; a^2 <= eps is a
second-order cone, and every step is convex.
"""

from __future__ import annotations

from math import comb
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from fleet import _core

from .convex import Steps
from .knots import Array, Grid
from .problem import Problem
from .rows import Block, derivative_maps, stack
from .setup import Setup
from .solver import solve

if TYPE_CHECKING:
    from fleet.scenario.tables import Energy

#: Points of the Gauss-Legendre rule in a segment: exact to degree 7 of the 12 that a^4 has.
POINTS = 4
#: Most convex steps, and the gain of one that ends them, as a share of the objective.
STEPS, ENOUGH = 8, 1e-4
#: Least scale of acceleration that cones are written in [m/s^2].
GENTLEST = 1e-3


def bernstein(degree: int, s: Array) -> Array:
    """Values (len(s), degree + 1) of the Bernstein polynomials at `s` in [0, 1]."""
    k = np.arange(degree + 1)
    of = np.array([comb(degree, int(i)) for i in k])
    return np.asarray(of * s[:, None] ** k * (1 - s[:, None]) ** (degree - k))


def price(goal: Energy, task: Problem, rho: float, tracks: list[_core.Trajectory]) -> float:
    """eps' Q eps - rho [m] of trajectories with the least eps, by samples T_s apart."""
    times = np.arange(round(task.horizon / task.sample) + 1).astype(np.float64) * task.sample
    fourth = [float((track.sample(times)[:, 6:9] ** 4).sum()) for track in tracks]
    return goal.weight * sum(fourth) - rho


def traded(stage: Setup, x: Array, goal: Energy, least: float) -> Array:
    """Trajectories that maximise r - eps' Q eps at r >= `least`, from `x` that keeps it; same visit times."""
    steps, best = Steps.of(stage), x
    maps, weights = accelerations(stage.grid)
    top = steps.margins(x)
    value = worth(stage, maps, weights, goal, x, top.r)
    for _ in range(STEPS):
        y = weighted_step(steps, best, goal, least, maps, weights)
        if y is None:
            break
        now = steps.margins(y)
        gain = worth(stage, maps, weights, goal, y, now.r) - value
        if now.share > 1 or now.tube < min(top.tube, 0.0) or gain <= ENOUGH * abs(value):
            break
        best, value = y, value + gain
    return best


def accelerations(grid: Grid) -> tuple[sparse.csr_matrix, Array]:
    """Rows (n, size) that give accelerations at all nodes and axes [m/s^2]; quadrature weights (n,) [s]."""
    node, weight = np.polynomial.legendre.leggauss(POINTS)
    shape = bernstein(3, (node + 1) / 2)
    rows, cols, vals, weights, count = [], [], [], [], 0
    for d, times in enumerate(grid.times):
        h = np.diff(times)
        maps = shape @ derivative_maps(h, 2)  # (m, POINTS, 6)
        base = grid.offsets[d] + 9 * np.arange(len(h))[:, None] + 3 * np.arange(6)[None, :]
        for axis in range(3):
            n = len(h) * POINTS
            rows.append(np.repeat(np.arange(count, count + n), 6))
            cols.append(np.repeat((base + axis)[:, None], POINTS, axis=1).ravel())
            vals.append(maps.ravel())
            weights.append((h[:, None] * weight / 2).ravel())
            count += n
    data = (np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols)))
    return sparse.csr_matrix(data, shape=(count, grid.size)), np.concatenate(weights)


def worth(stage: Setup, maps: sparse.csr_matrix, weights: Array, goal: Energy, x: Array, r: float) -> float:
    """r - eps' Q eps [m] with the least eps."""
    return r - goal.weight / stage.problem.sample * float(weights @ (maps @ x) ** 4)


def weighted_step(
    steps: Steps, x: Array, goal: Energy, least: float, maps: sparse.csr_matrix, weights: Array
) -> Array | None:
    """One convex step over knots, r and eps, with the planes found at `x`."""
    stage = steps.setup
    size, n = stage.grid.size, len(weights)
    # In units of the largest acceleration squared, so that all cones are of size one.
    unit = max(float(np.abs(maps @ x).max()), GENTLEST)
    slack = np.array([[size]])
    blocks = [*steps.rows(x, least), Block(np.ones((1, 1)), slack, np.array([stage.bound]), np.zeros(1))]
    blocks.append(Block(-np.ones((1, 1)), slack, np.array([-least]), np.zeros(1)))
    curve = 2 * goal.weight / stage.problem.sample * unit**4 * weights
    diagonal = np.concatenate([np.zeros(size + 1), curve])
    quadratic = sparse.csc_matrix(sparse.diags(diagonal))
    linear = np.zeros(size + 1 + n)
    linear[size] = -1.0
    found = solve(
        quadratic,
        linear,
        widened(stack(stage.equal, size), n),
        widened(stack(blocks, size), n),
        discs(sparse.csr_matrix(maps / unit), n),
    )
    return None if found is None else found.x[:size]


def widened(rows: tuple[sparse.csc_matrix, Array], n: int) -> tuple[sparse.csc_matrix, Array]:
    """Rows over the unknowns with `n` further ones that they do not touch."""
    matrix, rhs = rows
    return sparse.hstack([matrix, sparse.csc_matrix((matrix.shape[0], n))], format="csc"), rhs


def discs(maps: sparse.csr_matrix, n: int) -> tuple[sparse.csc_matrix, Array]:
    """Cones |(2 a, eps - 1)| <= eps + 1, that is a^2 <= eps, as `rhs - matrix x`, three rows each."""
    size = maps.shape[1]
    place = sparse.identity(n, format="csr")
    none, gap = sparse.csr_matrix((n, size)), sparse.csr_matrix((n, 1))
    parts = [
        sparse.hstack([none, gap, -place]),
        sparse.hstack([-2.0 * maps, gap, sparse.csr_matrix((n, n))]),
        sparse.hstack([none, gap, -place]),
    ]
    order = np.arange(3 * n).reshape(3, n).T.ravel()
    matrix = sparse.vstack(parts, format="csr")[order]
    return sparse.csc_matrix(matrix), np.tile([1.0, 0.0, -1.0], n)
