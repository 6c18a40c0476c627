"""One run of stlpy on one mission; a process of its own, in the peers' environment.

Usage: python solve.py METHOD LIMIT_S MISSION.json ANSWER.json (solvers print on stdout as they like)
METHOD is highs-micp, highs-sos1, smooth (SNOPT) or bnb. The mission is either {"own": NAME} for a scenario
of stlpy itself or what `missions.py` writes. The answer has states and inputs a step, and the times.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import highs
import numpy as np
import own
import shim  # noqa: F401  (before stlpy)
from stlpy.solvers import DrakeMICPSolver, DrakeSmoothSolver, DrakeSos1Solver
from translate import Translator, fleet_system


def stated(mission: dict[str, Any]) -> tuple[Any, Any, np.ndarray, int, dict[str, np.ndarray]]:
    """Specification, system, initial state, steps and bounds."""
    if "own" in mission:
        found, steps, start, size = own.scenario(mission["own"])
        spec = found.GetSpecification()
        spec.simplify()
        return spec, found.GetSystem(), np.array(start), steps, own.limits(size)
    q, words = len(mission["drones"]), Translator(mission)
    spec = words.formula({"op": "and", "fs": mission["clauses"]})
    spec.simplify()
    x0 = np.concatenate([np.ravel(mission["starts"]), np.zeros(3 * q)])
    fastest, push = np.full(3 * q, mission["v_max"]), np.full(3 * q, mission["a_max"])
    low, high = np.tile(mission["low"], q), np.tile(mission["high"], q)
    bounds = {
        "x_min": np.concatenate([low, -fastest]),
        "x_max": np.concatenate([high, fastest]),
        "u_min": -push,
        "u_max": push,
    }
    return spec, fleet_system(q, mission["dt"]), x0, mission["steps"], bounds


def run(method: str, limit: float, mission: dict[str, Any]) -> dict[str, Any]:
    """Build, solve, and what stlpy says of its own solution."""
    begin = time.perf_counter()
    spec, system, x0, steps, bounds = stated(mission)
    if method == "smooth":
        solver = DrakeSmoothSolver(spec, system, x0, steps, k=2.0, verbose=False)
        half = system.n // 2
        # The running cost of stlpy's examples, which "helps the numerics in a gradient-based method".
        solver.AddQuadraticCost(1e-1 * np.diag([0.0] * half + [1.0] * half), 1e-1 * np.eye(system.m))
    else:
        kind = {"highs-micp": DrakeMICPSolver, "bnb": DrakeMICPSolver, "highs-sos1": DrakeSos1Solver}[method]
        solver = kind(spec, system, x0, steps, solver="bnb", verbose=False)
    solver.AddControlBounds(bounds["u_min"], bounds["u_max"])
    solver.AddStateBounds(bounds["x_min"], bounds["x_max"])
    built = time.perf_counter() - begin
    if method.startswith("highs"):
        x, u, spent, status = highs.solve(solver, limit)
    else:
        x, u, _, spent = solver.Solve()
        status = "solved" if x is not None else "failed"
    answer: dict[str, Any] = {"build_s": built, "solve_s": spent, "status": status, "x": None, "u": None}
    if x is not None:
        y = system.C @ x + system.D @ u
        answer |= {"x": x.tolist(), "u": u.tolist(), "rho": float(np.ravel(spec.robustness(y, 0))[0])}
    return answer


if __name__ == "__main__":
    method, limit, asked, answer = sys.argv[1:]
    found = run(method, float(limit), json.loads(Path(asked).read_text()))
    Path(answer).write_text(json.dumps(found))
