"""The reference: one nonlinear program over the same knots, solved by IPOPT with MUMPS.

Where a convex step holds separating planes fixed, here they are unknowns too: per piece and obstacle a
convex combination of faces, per piece and pair a vector of at most unit length. Both conditions are
smooth, hold in continuous time and never overstate the margin. Clauses without a normal form enter
through the smooth robustness of smooth.py. Stage functions are built once and mapped.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from . import clearance as near
from .algebra import Score, Symbols
from .convex import GIVEN_UP, SOFT, TOLERANCE, Margins, Steps, better
from .knots import KNOT, Array, Grid, Pieces, difference, hermite
from .listening import Listener
from .problem import Problem
from .rows import Block, gram, stack
from .setup import SMOOTH, Setup, warm_start
from .smooth import Smooth
from .weights import added

Progress = Callable[[str, float], None]

#: Sharpness of smooth robustness [1/m] as multiples of the mission's c, one solve each.
SHARPER = (1.0, 4.0, 16.0)
#: Distance of the samples of smooth robustness [s]; windows are rounded to them.
GUIDE = 0.5
#: Margins round a corner are measured on parts of a piece, up to this much too low [m].
MEASURED = 5e-3
#: CPU time after which no further solve of clauses without a normal form starts, and longest of one [s].
PATIENCE = 5.0
#: The same where the nonlinear program is the last resort, so that a refusal does not take long [s].
LAST_PATIENCE = 2.0
#: Solves with further pieces posed, when a solution passes what was not posed.
ROUNDS = 4


@dataclass
class Program:
    """Unknowns, constraints `low <= g <= high` and a first guess, in parts as they are added."""

    unknowns: list[Any] = field(default_factory=list)
    guess: list[Array] = field(default_factory=list)
    low: list[Array] = field(default_factory=list)
    high: list[Array] = field(default_factory=list)
    g: list[Any] = field(default_factory=list)
    g_low: list[Array] = field(default_factory=list)
    g_high: list[Array] = field(default_factory=list)
    smoothed: bool = False

    def unknown(
        self, name: str, rows: int, columns: int, guess: Array, low: float | Array, high: float | Array
    ) -> Any:
        """A matrix of unknowns within bounds: one for all, or one each."""
        symbol = ca.MX.sym(name, rows, columns)
        self.unknowns.append(ca.vec(symbol))
        self.guess.append(np.asarray(guess, dtype=float).reshape(rows, columns).ravel(order="F"))
        self.low.append(np.broadcast_to(low, (rows, columns)).ravel(order="F"))
        self.high.append(np.broadcast_to(high, (rows, columns)).ravel(order="F"))
        return symbol

    def constrain(self, expression: Any, low: float, high: float) -> None:
        """`low <= expression <= high`, element by element."""
        column = ca.vec(expression)
        self.g.append(column)
        self.g_low.append(np.full(column.numel(), low))
        self.g_high.append(np.full(column.numel(), high))


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


def control_points(x: Any, pieces: Pieces) -> list[Any]:
    """Position control points of the pieces per axis, (6, m) expressions: sparse linear maps of x."""
    m, size = len(pieces.start), x.shape[0]
    rows = np.repeat(np.arange(6 * m), 6)
    out = []
    for axis in range(3):
        columns = np.repeat(pieces.columns[:, axis::3], 6, axis=0).ravel()
        matrix = triplets(rows, columns, pieces.maps.reshape(-1), (6 * m, size))
        out.append(ca.reshape(matrix @ x, 6, m))
    return out


def triplets(rows: NDArray[Any], columns: NDArray[Any], values: Array, shape: tuple[int, int]) -> Any:
    """A CasADi sparse matrix; explicit zeros are kept."""
    return ca.DM.triplet([int(r) for r in rows], [int(c) for c in columns], ca.DM(values), *shape)


def linear(x: Any, r: Any, blocks: list[Block], size: int) -> tuple[Any, Array]:
    """Expressions of blocks of rows and their right-hand sides."""
    matrix, rhs = stack(blocks, size)
    coo = matrix.tocoo()
    dm = triplets(coo.row, coo.col, coo.data, coo.shape)
    return dm @ ca.vertcat(x, r), rhs


def pose_limits(program: Program, task: Problem, grid: Grid, x: Any) -> Any:
    """Limits of all segments by the mapped stage function; returns the cost of smoothness."""
    derivatives, cost = stage()
    total = ca.MX(0)
    for d, times in enumerate(grid.times):
        n = len(times)
        knots = ca.reshape(x[grid.offsets[d] : grid.offsets[d] + KNOT * n], KNOT, n)
        h = ca.DM(np.diff(times)).T
        speed, acceleration = derivatives.map(n - 1)(knots[:, :-1], knots[:, 1:], h)
        v, a = task.v_max * (1 - 1e-5), task.a_max * (1 - 1e-5)
        program.constrain(speed, -v, v)
        program.constrain(acceleration, -a, a)
        total += ca.sum2(cost.map(n - 1)(knots[:, :-1], knots[:, 1:], h))
    return total


def pose_obstacles(program: Program, w: near.Watch, x: Any, margin: Any, now: Array) -> None:
    """Each posed piece beyond a convex combination of an obstacle's faces by `margin`."""
    index = np.flatnonzero(w.posed)
    if len(index) == 0:
        return
    pieces, n = w.pieces[0].take(index), len(w.faces)
    face = near.outside_margin(w, now)[1][index]
    guess = np.full((n, len(index)), 0.1 / n)
    guess[face, np.arange(len(index))] += 0.9
    mix = program.unknown("mix", n, len(index), guess, 0.0, 1.0)
    program.constrain(ca.sum1(mix), 1.0, 1.0)
    normal = w.faces[:, :3].T @ mix
    offset = w.faces[:, 3:].T @ mix
    points = control_points(x, pieces)
    reach = sum(points[k] * ca.repmat(normal[k, :], 6, 1) for k in range(3))
    program.constrain(reach - ca.repmat(offset, 6, 1) - margin, 0.0, np.inf)


def pose_pairs(
    program: Program, w: near.Watch, x: Any, margin: Any, now: Array, tube: float, level: float
) -> None:
    """Each posed piece of a pair apart by `margin` along a vector of at most unit length.

    With the margin at `level` it is what the tube asks.
    """
    index = np.flatnonzero(w.posed)
    if len(index) == 0:
        return
    normals = near.apart_margin(w, now)[1][index]
    asked = near.pair_least(w, now, tube)[index]
    extra = np.maximum(near.TUBE_EASE * asked - level, 0.0)
    along = program.unknown("along", 3, len(index), normals.T, -1.0, 1.0)
    program.constrain(ca.sum1(along**2), 0.0, 1.0)
    one, two = (control_points(x, p.take(index)) for p in w.pieces)
    gap = sum((one[k] - two[k]) * ca.repmat(along[k, :], 6, 1) for k in range(3))
    program.constrain(gap - ca.repmat(ca.DM(w.value + extra).T, 6, 1) - margin, 0.0, np.inf)


def pose_rest(
    program: Program, task: Problem, grid: Grid, x: Any, r: Any, level: float, parameters: Any
) -> None:
    """Smooth robustness of every part without a normal form at least its share of r, `GUIDE` apart.

    They guide the solver; the verdict is the exact robustness at T_s, which the result is certified on.
    """
    if not task.spec.rest:
        return
    step = max(1, round(GUIDE / task.sample)) * task.sample
    times = np.arange(round(task.horizon / step) + 1).astype(np.float64) * step
    positions = {n: sampled(grid, x, d, times) for d, n in enumerate(task.ids)}
    walk = Smooth(positions, task.regions, step, Symbols(Score.SOUND, parameters[2]))
    for part in task.spec.rest:
        column = walk.conjuncts(part.formula)
        program.smoothed |= ca.depends_on(column, parameters)
        program.constrain(column - share(task, part.clause, r, level), 0.0, np.inf)


def share(task: Problem, clause: str, r: Any, level: float) -> Any:
    """The margin that the slack `r` asks of a clause: by its weight, and the tube with r at `level`."""
    weight = task.weight(clause)
    return weight * r + float(added(weight, task.tube, level))


def sampled(grid: Grid, x: Any, drone: int, times: Array) -> Any:
    """Positions (n, 3) at `times` (n,) [s] as sparse linear maps of x."""
    knots = grid.times[drone]
    seg = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    h = np.diff(knots)[seg]
    s = np.clip((times - knots[seg]) / h, 0.0, 1.0)[:, None, None]
    maps = hermite(h)
    for _ in range(5):
        maps = maps[:, :-1] * (1 - s) + maps[:, 1:] * s
    rows = np.repeat(np.arange(len(times)), 6)
    axes = []
    for axis in range(3):
        columns = grid.offsets[drone] + KNOT * seg[:, None] + 3 * np.arange(6)[None, :] + axis
        axes.append(triplets(rows, columns.ravel(), maps[:, 0].ravel(), (len(times), x.shape[0])) @ x)
    return ca.horzcat(*axes)


def build(steps: Steps, now: Array, margins: Margins, level: float) -> tuple[Program, Any, Any]:
    """The program around the trajectory `now`, its objective and its parameters (weight, hold, c)."""
    task, grid = steps.setup.problem, steps.setup.grid
    program, size = Program(), grid.size
    x = program.unknown("x", size, 1, now, -np.inf, np.inf)
    r = program.unknown("r", 1, 1, np.array([min(margins.r, steps.setup.bound)]), -np.inf, steps.setup.bound)
    p = ca.MX.sym("p", 3)
    same, value = linear(x, r, steps.setup.equal, size)
    program.constrain(same - value, 0.0, 0.0)
    visits, value = linear(x, r, steps.visits(level), size)
    program.constrain(visits - value, -np.inf, 0.0)
    inside = [
        b for w in steps.within
        for b in steps.asked(w.clause, near.inside_rows(w, now, steps.setup.bound), level)
    ]  # fmt: skip
    if inside:
        rows, value = linear(x, r, inside, size)
        program.constrain(rows - value, -np.inf, 0.0)
    cost = pose_limits(program, task, grid, x)
    for w in steps.beyond:
        pose_obstacles(program, w, x, share(task, w.clause, r, level), now)
    for w in steps.apart:
        weight = task.weight(w.clause)
        pose_pairs(program, w, x, weight * r, now, task.tube, weight * level)
    pose_rest(program, task, grid, x, r, level, p)
    program.constrain(r - p[1], 0.0, np.inf)
    return program, -r + p[0] * cost, p


def solve(
    steps: Steps,
    now: Array,
    margins: Margins,
    hold: float | None,
    patience: float,
    tell: Callable[[], None] | None = None,
) -> Array | None:
    """One solve, sharpening smooth robustness if there is any; None unless IPOPT succeeded.

    `tell` is called after every iteration, and what it raises ends the solve.
    """
    task = steps.setup.problem
    program, objective, p = build(steps, now, margins, steps.setup.bound if hold is None else hold)
    statement = {"x": ca.vertcat(*program.unknowns), "f": objective, "g": ca.vertcat(*program.g), "p": p}
    options: dict[str, Any] = {
        "ipopt": {
            "linear_solver": "mumps",
            "max_iter": task.max_iterations,
            "tol": task.tolerance,
            "constr_viol_tol": 1e-7,
            "acceptable_iter": 0,
            "mu_strategy": "adaptive",
            # Smooth robustness over many samples makes a dense and indefinite Hessian.
            "hessian_approximation": "limited-memory" if task.spec.rest else "exact",
            **({"max_cpu_time": max(patience, 0.01)} if task.spec.rest else {}),
            "print_level": 0,
            "sb": "yes",
        },
        "print_time": False,
    }
    sizes = (statement["x"].numel(), statement["g"].numel(), p.numel())
    options["iteration_callback"] = listener = Listener("listener", sizes)
    solver = ca.nlpsol("plan", "ipopt", statement, options)
    guess, began = np.concatenate(program.guess), time.process_time()
    for factor in SHARPER if program.smoothed else (1.0,):
        if task.spec.rest and time.process_time() - began > patience:
            return None
        weight = SOFT if hold is None else 1.0
        parameters = [weight, -1e3 if hold is None else hold, factor * task.c]
        with listener.listening(tell):
            found = solver(
                x0=guess,
                p=parameters,
                lbx=np.concatenate(program.low),
                ubx=np.concatenate(program.high),
                lbg=np.concatenate(program.g_low),
                ubg=np.concatenate(program.g_high),
            )
        if solver.stats()["return_status"] != "Solve_Succeeded":
            return None
        guess = np.asarray(found["x"]).ravel()
    return guess[: steps.setup.grid.size]


def optimise(
    setup: Setup,
    start: Array | None = None,
    progress: Progress | None = None,
    patience: float = PATIENCE,
) -> tuple[Array, Margins, int]:
    """Maximise r, then minimise energy at the r reached, from the warm start or from `start`."""
    steps = Steps.of(setup)
    best = warm_start(setup) if start is None else start
    top, count, began = steps.margins(best), 0, time.process_time()
    for hold in (False, True):
        # Quasi-Newton steps hardly get anywhere on energy; `SOFT` has kept the flight smooth already.
        if hold and (not usable(top) or setup.problem.spec.rest):
            break
        level = top.r - GIVEN_UP if hold else None
        x, last = best, top
        for _ in range(ROUNDS):
            steps.rows(x, setup.bound if level is None else level)
            tell = None if progress is None else partial(progress, "nlp", top.r)
            found = solve(steps, best, top, level, patience - (time.process_time() - began), tell)
            count += 1
            if found is None:
                break
            now = steps.margins(found)
            good = now.share <= 1 and now.r >= level - MEASURED if level is not None else better(now, top)
            done = now.r >= (setup.bound - TOLERANCE if level is None else level - MEASURED)
            if good:
                best, top = found, now
            if done or abs(now.r - last.r) < TOLERANCE:
                break
            x, last = found, now
    return best, top, count


def usable(margins: Margins) -> bool:
    """Whether limits and the margins of the tube are kept, as far as they are measured."""
    return margins.share <= 1 and margins.tube >= -MEASURED
