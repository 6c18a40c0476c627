"""A nonlinear program while it is put together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from .knots import Array


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
