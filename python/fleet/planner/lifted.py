"""Log-sum-exp over long rows with further unknowns, so that second derivatives are sparse.

The Hessian of a log-sum-exp over m samples is dense: 1200 samples of two drones would fill 7200 x 7200. With

    min ~ -min over s of  s + (1/c) (sum exp(c (-r - s)) - 1)
    max ~  max over w of  w . r - (1/c) w . log w,   w >= 0, sum of w = 1

(the first from convexity of exp, the second Gibbs' variational principle) and s and w as unknowns, every
sample meets only its own unknowns and a few shared ones. Scores are maximised, so that the inequalities
are tight at the optimum and the program has the maxima of the plain one.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from .algebra import Numbers, Score, Symbols
from .knots import Array
from .program import Program

#: Widest row that is folded as it stands.
PLAIN = 16
#: Least weight [-]; keeps w log w smooth.
LEAST_WEIGHT = 1e-30


class Lifted(Symbols):
    """The paper's log-sum-exp for programs that maximise it, with an exact Hessian."""

    def __init__(self, program: Program, c: float) -> None:
        """`program` receives the further unknowns; those before must have their guesses."""
        super().__init__(Score.PAPER, c)
        self._program, self._sharp, self._numbers = program, c, Numbers(Score.PAPER, c)

    def least(self, table: Any) -> Any:
        """See `Algebra`; not above it while the program's constraints hold."""
        if table.shape[1] <= PLAIN:
            return super().least(table)
        now, c = self._now(table), self._sharp
        value = self._numbers.least(now)
        t = self._program.unknown("least", len(value), 1, value, -np.inf, np.inf)
        s = self._program.unknown("shift", len(value), 1, -value, -np.inf, np.inf)
        spread = ca.exp(c * (-table - ca.repmat(s, 1, table.shape[1])))
        self._program.constrain(t + s + (ca.sum2(spread) - 1) / c, -np.inf, 0.0)
        return t

    def most(self, table: Any) -> Any:
        """See `Algebra`; not above it while the program's constraints hold."""
        if table.shape[1] <= PLAIN:
            return super().most(table)
        now, c = self._now(table), self._sharp
        value = self._numbers.most(now)
        t = self._program.unknown("most", len(value), 1, value, -np.inf, np.inf)
        share = np.maximum(np.exp(c * (now - value[:, None])), LEAST_WEIGHT)
        rows, columns = table.shape
        w = self._program.unknown("weight", rows, columns, share, LEAST_WEIGHT, np.inf)
        self._program.constrain(ca.sum2(w), 1.0, 1.0)
        self._program.constrain(t - ca.sum2(w * table) + ca.sum2(w * ca.log(w)) / c, -np.inf, 0.0)
        return t

    def _now(self, table: Any) -> Array:
        """A table at the first guess."""
        at = ca.Function("now", [ca.vertcat(*self._program.unknowns)], [table])
        return np.asarray(at(np.concatenate(self._program.guess)))
