"""stlpy's mixed-integer encodings solved by HiGHS: their own solvers, Gurobi and Mosek, need licences.

The encoding is stlpy's, untouched; only the program that it builds is handed to another solver.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp


def solve(stated: Any, limit: float) -> tuple[Any, Any, float, str]:
    """States (n, T), inputs (m, T), seconds and the status of a built DrakeMICPSolver or DrakeSos1Solver.

    `limit` [s] of wall clock. States are None when nothing was found. Only linear costs are possible.
    """
    mp = stated.mp
    n = mp.num_vars()
    cost = np.zeros(n)
    for binding in mp.linear_costs():
        cost[mp.FindDecisionVariableIndices(binding.variables())] += binding.evaluator().a()
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    for binding in mp.bounding_box_constraints():
        index = mp.FindDecisionVariableIndices(binding.variables())
        low[index] = np.maximum(low[index], binding.evaluator().lower_bound())
        high[index] = np.minimum(high[index], binding.evaluator().upper_bound())
    rows = [*mp.linear_constraints(), *mp.linear_equality_constraints()]
    blocks, lower, upper = [], [], []
    for binding in rows:
        index = mp.FindDecisionVariableIndices(binding.variables())
        a = np.atleast_2d(binding.evaluator().GetDenseA())
        r, c = np.nonzero(a)
        blocks.append((r, np.asarray(index)[c], a[r, c], len(a)))
        lower.append(binding.evaluator().lower_bound())
        upper.append(binding.evaluator().upper_bound())
    first = np.concatenate([[0], np.cumsum([b[3] for b in blocks])])
    matrix = sparse.csr_matrix(
        (
            np.concatenate([b[2] for b in blocks]),
            (
                np.concatenate([b[0] + k for b, k in zip(blocks, first[:-1], strict=True)]),
                np.concatenate([b[1] for b in blocks]),
            ),
        ),
        shape=(first[-1], n),
    )
    whole = np.zeros(n)
    binary = [k for k, v in enumerate(mp.decision_variables()) if str(v.get_type()).endswith("BINARY")]
    whole[binary] = 1
    low[binary], high[binary] = np.maximum(low[binary], 0), np.minimum(high[binary], 1)
    begin = time.perf_counter()
    found = milp(
        cost,
        integrality=whole,
        bounds=Bounds(low, high),
        constraints=LinearConstraint(matrix, np.concatenate(lower), np.concatenate(upper)),
        options={"time_limit": limit},
    )
    spent = time.perf_counter() - begin
    words = {0: "optimal", 1: "time limit", 2: "infeasible"}
    status = words.get(found.status, found.message)
    if found.x is None:
        return None, None, spent, status
    pick = np.asarray([mp.FindDecisionVariableIndex(v) for v in stated.x.ravel()]).reshape(stated.x.shape)
    push = np.asarray([mp.FindDecisionVariableIndex(v) for v in stated.u.ravel()]).reshape(stated.u.shape)
    return found.x[pick], found.x[push], spent, status
