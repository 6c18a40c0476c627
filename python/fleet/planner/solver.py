"""Clarabel, with one outcome that counts: solved, and the rows hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .knots import Array

#: Interior-point iterations: several times the 15 to 30 of a normal solve.
MAX_ITERATIONS = 100
#: Largest violation of a row that still counts as satisfied [m, m/s or m/s^2].
ROW_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Solution:
    """Minimiser `x`, multipliers `z` >= 0 of the rows `G x <= h`, and the value of the objective."""

    x: Array
    z: Array
    value: float


def solve(
    quadratic: sparse.csc_matrix,
    linear: Array,
    equal: tuple[sparse.csc_matrix, Array],
    below: tuple[sparse.csc_matrix, Array],
    discs: tuple[sparse.csc_matrix, Array] | None = None,
) -> Solution | None:
    """Minimum of `x' P x / 2 + q' x` with `A x = b` and `G x <= h`; None unless solved and checked.

    `discs` are rows (M, m) in threes: (s, u, v) = m - M x with |(u, v)| <= s, a second-order cone.
    """
    import clarabel

    matrix = sparse.vstack([equal[0], below[0]], format="csc")
    rhs = np.concatenate([equal[1], below[1]])
    cones = [clarabel.ZeroConeT(len(equal[1])), clarabel.NonnegativeConeT(len(below[1]))]
    if discs is not None:
        matrix = sparse.vstack([matrix, discs[0]], format="csc")
        rhs = np.concatenate([rhs, discs[1]])
        cones += [clarabel.SecondOrderConeT(3)] * (len(discs[1]) // 3)
    upper = sparse.triu(quadratic, format="csc")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = MAX_ITERATIONS
    settings.max_threads = 1
    rows = slice(len(equal[1]), len(equal[1]) + len(below[1]))
    # Iterative refinement is two fifths of the time and hardly ever needed; the rows are checked anyway.
    for refined in (False, True):
        settings.iterative_refinement_enable = refined
        outcome = clarabel.DefaultSolver(upper, linear, matrix, rhs, cones, settings).solve()
        if outcome.status == clarabel.SolverStatus.PrimalInfeasible:
            return None
        x = np.asarray(outcome.x)
        residual = np.abs(equal[0] @ x - equal[1]).max(initial=0.0)
        excess = (below[0] @ x - below[1]).max(initial=0.0)
        holds = max(residual, excess) <= ROW_TOLERANCE and bool(np.isfinite(x).all())
        if outcome.status == clarabel.SolverStatus.Solved and holds:
            return Solution(x, np.asarray(outcome.z)[rows], float(outcome.obj_val))
    return None
