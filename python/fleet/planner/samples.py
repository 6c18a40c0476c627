"""The paper's motion planner as a nonlinear program over samples (its section IV-A), for IPOPT.

Unknowns are (p, v, a) of every drone at k T_s. The paper's splines S carry one sample to the next; with
all of alpha, beta and gamma free they would reach any sample from any other, so alpha = beta = 0 and
gamma, the jerk, is what is left free over a sample: p + v t + a/2 t^2 + gamma/6 t^3 (the printed `a t^2`
is wrong). The log-sum-exp robustness of the mission is maximised. Limits hold at the samples, per axis, and
between them too: acceleration is linear there, so that speed rises by at most a_max T_s / 4 above both ends,
and that much is kept back. The three axes are one problem, because obstacles and mutual distance couple them.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import casadi as ca
import numpy as np

from fleet.stl.vocabulary import Formula

from .algebra import Score, Symbols
from .knots import KNOT, Array
from .lifted import Lifted
from .listening import Listener
from .problem import Problem
from .program import Program
from .smooth import Smooth

#: Called with the iteration and positions (d, n, 3) [m]; what it raises ends the solve.
Watcher = Callable[[int, Array], None]

#: Share of a_max that may be used: rounding of the result takes the rest.
SPARED = 0.999


class Hessian(StrEnum):
    """Second derivatives that IPOPT is given, in words for people."""

    QUASI_NEWTON = "quasi-Newton"
    EXACT = "exact"


#: Options of IPOPT of each; what is not said is its default. Weights near 0 must not be pushed away from it.
OPTIONS: dict[Hessian, dict[str, Any]] = {
    Hessian.EXACT: {
        "hessian_approximation": "exact",
        "mu_init": 1e-3,
        "bound_push": 1e-8,
        "bound_frac": 1e-8,
    },
    Hessian.QUASI_NEWTON: {"hessian_approximation": "limited-memory"},
}


@dataclass(frozen=True)
class Optimum:
    """Samples (d, n, 9: p, v, a), smooth score [m], iterations, and IPOPT's last word.

    `residual` the largest by which an equation, among them the dynamics, is missed; `build_s` time to
    build the program [s].
    """

    samples: Array
    score: float
    iterations: int
    status: str
    residual: float
    build_s: float


def telling(shape: tuple[int, ...], watcher: Watcher) -> Callable[[Any], None]:
    """What is called with the unknowns after every iteration; samples of `shape` (d, n, 9) come first."""
    count = itertools.count()

    def tell(unknowns: Any) -> None:
        samples = np.asarray(unknowns).ravel()[: math.prod(shape)].reshape(shape)
        watcher(next(count), samples[:, :, :3])

    return tell


def pose_dynamics(program: Program, task: Problem, warm: Array) -> Mapping[str, Any]:
    """Unknown samples, their dynamics, limits and ends; returns positions (n, 3) per drone.

    At the end every drone is at rest inside its home, as in every plan.
    """
    h, n = task.sample, warm.shape[1]
    positions = {}
    for d, name in enumerate(task.ids):
        fastest, hardest = task.v_max - task.a_max * h / 4, task.a_max * SPARED
        high = np.repeat([np.inf, fastest, hardest], 3)
        upper = np.repeat(high[:, None], n, axis=1)
        upper[3:, [0, -1]] = 0.0
        lower = -upper
        lower[:3, 0] = upper[:3, 0] = task.starts[d]
        x = program.unknown(f"x_{name}", KNOT, n, warm[d].T, lower, upper)
        p, v, a = x[:3, :], x[3:6, :], x[6:, :]
        moved = h * v[:, :-1] + h**2 * (a[:, :-1] / 3 + a[:, 1:] / 6)
        program.constrain(p[:, 1:] - p[:, :-1] - moved, 0.0, 0.0)
        program.constrain(v[:, 1:] - v[:, :-1] - h / 2 * (a[:, :-1] + a[:, 1:]), 0.0, 0.0)
        faces = task.regions[task.homes[d]]
        program.constrain(ca.DM(faces[:, 3]) - ca.DM(faces[:, :3]) @ p[:, -1], 0.0, np.inf)
        positions[name] = p.T
    return positions


def maximise(task: Problem, mission: Formula, warm: Array, hessian: Hessian, watcher: Watcher) -> Optimum:
    """Maximise the smooth score of a formula from samples `warm` (d, n, 9) on; the start is one result."""
    begin = time.perf_counter()
    program = Program()
    positions = pose_dynamics(program, task, warm)
    algebra = Lifted(program, task.c) if hessian is Hessian.EXACT else Symbols(Score.PAPER, task.c)
    score = Smooth(positions, task.regions, task.sample, algebra).at_start(mission)
    unknowns, g = ca.vertcat(*program.unknowns), ca.vertcat(*program.g)
    listener = Listener("listener", (unknowns.numel(), g.numel(), 0))
    options: dict[str, Any] = {
        "ipopt": {
            "linear_solver": "mumps",
            "max_iter": task.max_iterations,
            "tol": task.tolerance,
            "print_level": 0,
            "sb": "yes",
            **OPTIONS[hessian],
        },
        "print_time": False,
        # A step too far overflows an exponent; IPOPT then shortens it.
        "show_eval_warnings": False,
        "iteration_callback": listener,
    }
    solver = ca.nlpsol("paper", "ipopt", {"x": unknowns, "f": -score, "g": g}, options)
    build = time.perf_counter() - begin
    low, high = (np.concatenate(rows) for rows in (program.g_low, program.g_high))
    with listener.listening(telling(warm.shape, watcher)):
        found = solver(
            x0=np.concatenate(program.guess),
            lbx=np.concatenate(program.low),
            ubx=np.concatenate(program.high),
            lbg=low,
            ubg=high,
        )
    stats = solver.stats()
    samples = np.asarray(found["x"]).ravel()[: warm.size].reshape(warm.shape)
    off = float(np.abs(np.asarray(found["g"]).ravel() - low)[low == high].max())
    return Optimum(
        samples, -float(found["f"]), int(stats["iter_count"]), str(stats["return_status"]), off, build
    )
