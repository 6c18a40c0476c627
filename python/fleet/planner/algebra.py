"""What a walk over a formula needs of its values: the same on numbers and on CasADi symbols.

Columns hold one value a sample, tables one row a sample. Two ways to soften minima and maxima:

- the paper's (its Def. 2, log-sum-exp): max ~ (1/c) log sum exp(c r), min ~ -(1/c) log sum exp(-c r). Both
  err outwards, by at most log(m)/c over m values, so that the score of a violated formula can be positive;
- the sound one: the same minimum, which lies below the true one, and as maximum the mean weighted with
  exp(c r), which lies below the true one too (Gilpin, Kurtz and Lin, L-CSS 2021).

Every exponent is shifted by the largest, so that nothing overflows at any c.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Any, Protocol

import casadi as ca
import numpy as np

from .knots import Array

#: Rounds the tip of the norm of symbols [m]: sqrt(s + e^2) - e is below sqrt(s) and smooth at 0.
TIP = 1e-3
#: Widest row whose soft minimum is written out in scalars, which evaluates faster.
NARROW = 32


class Score(StrEnum):
    """How minima and maxima are softened."""

    PAPER = "paper"
    SOUND = "sound"


class Algebra(Protocol):
    """Operations on columns and tables of values, softening included."""

    def margins(self, points: Any, faces: Array) -> Any:
        """Distances (n, k) [m] of points (n, 3) inside of each of the faces (k, 4)."""

    def norm(self, rows: Any, *, above: bool) -> Any:
        """Length of every row, rounded up or down where it is rounded."""

    def beside(self, columns: Sequence[Any]) -> Any:
        """The table of some columns."""

    def below(self, columns: Sequence[Any]) -> Any:
        """One column of several, one after the other."""

    def windows(self, column: Any, count: int, width: int) -> Any:
        """Table (count, width) of the windows of a column that start at its first `count` values."""

    def least(self, table: Any) -> Any:
        """Soft minimum of every row."""

    def most(self, table: Any) -> Any:
        """Soft maximum of every row."""


class Numbers:
    """On arrays; columns are (n,)."""

    def __init__(self, score: Score, c: float) -> None:
        """`c` sharpness [1/m]."""
        self._score, self._c = score, c

    def margins(self, points: Array, faces: Array) -> Array:
        """See `Algebra`."""
        return np.asarray(faces[:, 3] - points @ faces[:, :3].T)

    def norm(self, rows: Array, *, above: bool) -> Array:
        """See `Algebra`; exact."""
        return np.asarray(np.linalg.norm(rows, axis=1))

    def beside(self, columns: Sequence[Array]) -> Array:
        """See `Algebra`."""
        return np.stack(columns, axis=1)

    def below(self, columns: Sequence[Array]) -> Array:
        """See `Algebra`."""
        return np.concatenate(columns)

    def windows(self, column: Array, count: int, width: int) -> Array:
        """See `Algebra`."""
        return np.lib.stride_tricks.sliding_window_view(column, width)[:count]

    def least(self, table: Array) -> Array:
        """See `Algebra`."""
        return -self._log_sum(-table)

    def most(self, table: Array) -> Array:
        """See `Algebra`."""
        if self._score is Score.PAPER:
            return self._log_sum(table)
        top = table.max(axis=1, keepdims=True)
        weight = np.exp(self._c * (table - top))
        return np.asarray(top[:, 0] + (weight * (table - top)).sum(axis=1) / weight.sum(axis=1))

    def _log_sum(self, table: Array) -> Array:
        top = table.max(axis=1, keepdims=True)
        return np.asarray(top[:, 0] + np.log(np.exp(self._c * (table - top)).sum(axis=1)) / self._c)


def soft_min(values: Any, c: Any) -> Any:
    """Log-sum-exp minimum of a column of symbols, not above the true one."""
    least = ca.mmin(values)
    return least - ca.log(ca.sum1(ca.exp(c * (least - values)))) / c


def soft_max(values: Any, c: Any) -> Any:
    """Exponentially weighted mean of a column of symbols, not above the true maximum."""
    top = ca.mmax(values)
    weight = ca.exp(c * (values - top))
    return top + ca.dot(weight, values - top) / ca.sum1(weight)


def log_sum(values: Any, c: Any) -> Any:
    """Log-sum-exp maximum of a column of symbols, not below the true one."""
    return -soft_min(-values, c)


class Symbols:
    """On CasADi expressions; columns are (n, 1). Rows are folded by stage functions, mapped."""

    def __init__(self, score: Score, c: Any) -> None:
        """`c` sharpness [1/m], a number or an expression."""
        self._c = c
        self._most = log_sum if score is Score.PAPER else soft_max
        self._stages: dict[tuple[Callable[[Any, Any], Any], int], Any] = {}

    def margins(self, points: Any, faces: Array) -> Any:
        """See `Algebra`."""
        return ca.repmat(ca.DM(faces[:, 3]).T, points.shape[0], 1) - points @ faces[:, :3].T

    def norm(self, rows: Any, *, above: bool) -> Any:
        """See `Algebra`; at most `TIP` off."""
        norm = ca.sqrt(ca.sum2(rows**2) + TIP**2)
        return norm if above else norm - TIP

    def beside(self, columns: Sequence[Any]) -> Any:
        """See `Algebra`."""
        return ca.horzcat(*columns)

    def below(self, columns: Sequence[Any]) -> Any:
        """See `Algebra`."""
        return ca.vertcat(*columns)

    def windows(self, column: Any, count: int, width: int) -> Any:
        """See `Algebra`."""
        if count < width:
            return ca.vertcat(*(column[k : k + width].T for k in range(count)))
        return ca.horzcat(*(column[k : k + count] for k in range(width)))

    def least(self, table: Any) -> Any:
        """See `Algebra`."""
        return self._fold(table, soft_min)

    def most(self, table: Any) -> Any:
        """See `Algebra`."""
        return self._fold(table, self._most)

    def _fold(self, table: Any, fold: Callable[[Any, Any], Any]) -> Any:
        count, width = table.shape
        if width == 1:
            return table
        if (fold, width) not in self._stages:
            row, c = ca.MX.sym("row", width), ca.MX.sym("c")
            stage = ca.Function("fold", [row, c], [fold(row, c)])
            self._stages[fold, width] = stage.expand() if width <= NARROW else stage
        return self._stages[fold, width].map(count)(table.T, self._c).T
