"""A mixed-integer linear program that grows row by row, solved by HiGHS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from .flown import Array

#: A linear expression: coefficients of unknowns, and a constant.
Linear = tuple[dict[int, float], float]


@dataclass
class Program:
    """Unknowns with bounds and rows `low <= row <= high`, grown as they are added."""

    low: list[float] = field(default_factory=list)
    high: list[float] = field(default_factory=list)
    whole: list[int] = field(default_factory=list)
    cost: list[float] = field(default_factory=list)
    rows: list[tuple[dict[int, float], float, float]] = field(default_factory=list)

    def unknown(self, low: float, high: float, whole: bool = False, cost: float = 0.0) -> int:
        """A new unknown's number."""
        self.low.append(low)
        self.high.append(high)
        self.whole.append(int(whole))
        self.cost.append(cost)
        return len(self.low) - 1

    def binary(self) -> int:
        """A new unknown, 0 or 1."""
        return self.unknown(0.0, 1.0, whole=True)

    def row(self, expression: Linear, low: float, high: float) -> None:
        """A new row."""
        self.rows.append((expression[0], low - expression[1], high - expression[1]))

    def positive(self, expression: Linear, guard: int | None) -> None:
        """The expression is at least 0, wherever `guard` is 1."""
        if guard is None:
            self.row(expression, 0.0, np.inf)
            return
        least = expression[1] + sum(min(c * self.low[k], c * self.high[k]) for k, c in expression[0].items())
        if least < 0:
            self.row(({**expression[0], guard: least}, expression[1] - least), 0.0, np.inf)

    def some(self, choices: Sequence[int], guard: int | None) -> None:
        """At least one of some binaries is 1, wherever `guard` is."""
        coefficients = dict.fromkeys(choices, 1.0)
        if guard is not None:
            coefficients[guard] = -1.0
        self.row((coefficients, 0.0), 1.0 if guard is None else 0.0, np.inf)

    def solve(self, seconds: float) -> Array | None:
        """Values of the unknowns, or None if none were found in time."""
        entries = [(i, k, c) for i, (row, _, _) in enumerate(self.rows) for k, c in row.items()]
        i, k, c = (np.array(column) for column in zip(*entries, strict=True))
        matrix = sparse.csr_matrix((c, (i, k)), shape=(len(self.rows), len(self.low)))
        limits = LinearConstraint(matrix, [r[1] for r in self.rows], [r[2] for r in self.rows])
        options = {"time_limit": seconds, "mip_rel_gap": 0.5}
        bounds = Bounds(np.array(self.low), np.array(self.high))
        found = milp(self.cost, integrality=self.whole, bounds=bounds, constraints=limits, options=options)
        return None if found.x is None else np.asarray(found.x)


def plus(a: Linear, b: Linear, factor: float = 1.0) -> Linear:
    """a + factor b."""
    out = dict(a[0])
    for k, c in b[0].items():
        out[k] = out.get(k, 0.0) + factor * c
    return out, a[1] + factor * b[1]


def along(normal: Array, point: Sequence[Linear]) -> Linear:
    """normal . point."""
    out: Linear = ({}, 0.0)
    for c, axis in zip(normal, point, strict=True):
        if c:
            out = plus(out, axis, float(c))
    return out
