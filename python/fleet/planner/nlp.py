"""The reference: one nonlinear program over the same knots, solved by IPOPT with MUMPS.

Where a convex step holds separating planes fixed, here they are unknowns too: per piece and obstacle a
convex combination of faces, per piece and pair a vector of at most unit length. Both conditions are
smooth, hold in continuous time and never overstate the margin. Clauses without a normal form enter
through the smooth robustness of smooth.py. Solvers are built once for each shape of a program (solvers.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from . import clearance as near
from . import terms
from .convex import GIVEN_UP, SOFT, TOLERANCE, Margins, Steps, better
from .knots import Array
from .setup import Setup, warm_start
from .solvers import run, solver_for
from .terms import Term

Progress = Callable[[str, float], None]

#: Sharpness of smooth robustness [1/m] as multiples of the mission's c, one solve each.
SHARPER = (1.0, 4.0, 16.0)
#: Margins round a corner are measured on parts of a piece, up to this much too low [m].
MEASURED = 5e-3
#: Iterations times unknowns and constraints after which solves of clauses without a normal form are given
#: up, and all solves where the program is the last resort, so that a refusal does not take long. A million
#: takes 6 to 20 s of one core. No clock decides: the same scenario must give the same plan.
EFFORT, LAST_EFFORT = 6e5, 2e5
#: Solves with further pieces posed, when a solution passes what was not posed.
ROUNDS = 4


def posed(steps: Steps, now: Array, level: float, hold: float) -> list[Term]:
    """The terms of the program around the trajectory `now`; r may reach `level` and is at least `hold`."""
    task, grid, wanted = steps.setup.problem, steps.setup.grid, steps.setup.bound
    inside = [
        b for w in steps.within
        for b in steps.asked(w.clause, near.inside_rows(w, now, wanted), level)
    ]  # fmt: skip
    found: list[Term | None] = [
        terms.linear(steps.setup.equal, grid.size, 0.0),
        terms.linear(steps.visits(level), grid.size, -np.inf),
        terms.linear(inside, grid.size, -np.inf) if inside else None,
        *(terms.limits(task, grid, d) for d in range(len(grid.times))),
        *(terms.outside(task, w, grid.size, now, level) for w in steps.beyond),
        *(terms.apart(task, w, grid.size, now, level) for w in steps.apart),
        *terms.rest(task, grid, level),
        terms.held(hold),
    ]
    return [term for term in found if term is not None]


def solve(
    steps: Steps,
    now: Array,
    margins: Margins,
    hold: float | None,
    effort: Effort,
    tell: Callable[[], None] | None = None,
) -> Array | None:
    """One solve, sharpening smooth robustness if there is any; None unless IPOPT succeeded.

    `effort` is spent. `tell` is called after every iteration, and what it raises ends the solve.
    """
    task, bound = steps.setup.problem, steps.setup.bound
    weight, least = (SOFT, -1e3) if hold is None else (1.0, hold)
    parts = posed(steps, now, bound if hold is None else hold, least)
    quasi = bool(task.spec.rest)
    solver = solver_for(steps.setup.grid.size, parts, task.max_iterations, task.tolerance, quasi=quasi)
    guess = np.concatenate([now, [min(margins.r, bound)], *(t.guess for t in parts)])
    size = len(guess) + sum(solver.counts)

    def listen() -> None:
        effort.spend(size)
        if tell is not None:
            tell()

    try:
        for factor in SHARPER if solver.smoothed else (1.0,):
            found = run(solver, parts, guess, bound, weight, factor * task.c, listen)
            if found is None:
                return None
            guess = found
    except OutOfEffort:
        return None
    return guess[: steps.setup.grid.size]


class OutOfEffort(Exception):
    """Solves have taken too long."""


@dataclass
class Effort:
    """What solves may still take together: iterations times unknowns and constraints."""

    left: float

    def spend(self, size: int) -> None:
        """One iteration of a program of `size`; raises OutOfEffort when nothing is left."""
        if self.left <= 0:
            raise OutOfEffort
        self.left -= size


def optimise(
    setup: Setup,
    start: Array | None = None,
    progress: Progress | None = None,
    effort: float | None = None,
) -> tuple[Array, Margins, int]:
    """Maximise r, then minimise energy at the r reached, from the warm start or from `start`.

    `effort` bounds all solves together; None is `EFFORT` for clauses without a normal form, else no bound.
    """
    steps = Steps.of(setup)
    best = warm_start(setup) if start is None else start
    top, count = steps.margins(best), 0
    budget = Effort(effort or (EFFORT if setup.problem.spec.rest else np.inf))
    for hold in (False, True):
        # Quasi-Newton steps hardly get anywhere on energy; `SOFT` has kept the flight smooth already.
        if hold and (not usable(top) or setup.problem.spec.rest):
            break
        level = top.r - GIVEN_UP if hold else None
        x, last = best, top
        for _ in range(ROUNDS):
            steps.rows(x, setup.bound if level is None else level)
            tell = None if progress is None else partial(progress, "nlp", top.r)
            found = solve(steps, best, top, level, budget, tell)
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
