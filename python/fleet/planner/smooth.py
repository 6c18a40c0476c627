"""Smooth robustness for formulas without a normal form, never above the exact one.

The minimum is -(1/c) log sum exp(-c r) (paper, Def. 2), shifted by its largest term so that it does not
overflow; it lies below the minimum. The maximum is the exponentially weighted mean, which lies below the
maximum, where the paper's log-sum-exp lies above it and makes a violated formula look satisfied.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from fleet.stl.vocabulary import Formula

from .knots import Array
from .spec import negation_normal

#: Rounds the tip of the norm [m]: sqrt(s + e^2) - e is below sqrt(s) and smooth at 0.
TIP = 1e-3


def soft_min(values: Any, c: Any) -> Any:
    """Smooth minimum of a column, not above the true one."""
    if values.numel() == 1:
        return values
    least = ca.mmin(values)
    return least - ca.log(ca.sum1(ca.exp(c * (least - values)))) / c


def soft_max(values: Any, c: Any) -> Any:
    """Smooth maximum of a column, not above the true one."""
    if values.numel() == 1:
        return values
    weight = ca.exp(c * (values - ca.mmax(values)))
    return ca.dot(weight, values) / ca.sum1(weight)


@dataclass(frozen=True)
class Smooth:
    """Walks a formula over expressions of the positions.

    `positions` per drone (n, 3) at k T_s [m]; `regions` faces (k, 4); `c` sharpness [1/m].
    """

    positions: Mapping[str, Any]
    regions: Mapping[str, Array]
    sample: float
    c: Any

    def conjuncts(self, formula: Formula) -> Any:
        """Column of values whose true minimum is the robustness at time 0 [m].

        Conjunctions and `always` on the outside need no smoothing: each sample is a row of its own, and
        rows that touch few knots keep the program sparse.
        """
        f, first, last = negation_normal(formula), 0, 0
        while f["op"] == "always":
            first, last, f = first + self.index(f["from"]), last + self.index(f["to"]), f["f"]
        if f["op"] == "and" and first == last == 0:
            return ca.vertcat(*(self.conjuncts(g) for g in f["fs"]))
        return self.signal(f, first, last)

    def at_start(self, formula: Formula) -> Any:
        """Smooth robustness at time 0 (scalar expression) [m]."""
        return self.signal(negation_normal(formula), 0, 0)

    def signal(self, f: Formula, first: int, last: int) -> Any:
        """Column of smooth robustness at samples first to last of a formula in negation normal form."""
        op = f["op"]
        if op in ("in", "outside", "dist", "linear"):
            return self.predicate(f, slice(first, last + 1))
        if op in ("and", "or"):
            parts = ca.horzcat(*(self.signal(g, first, last) for g in f["fs"]))
            return self.rows(parts, soft_min if op == "and" else soft_max)
        if op == "not":
            return self.until(f["f"], first, last, dual=True)
        if op == "until":
            return self.until(f, first, last, dual=False)
        a, b = self.index(f["from"]), self.index(f["to"])
        inner = self.signal(f["f"], first + a, last + b)
        fold = soft_min if op == "always" else soft_max
        return ca.vertcat(*(fold(inner[k : k + b - a + 1], self.c) for k in range(last - first + 1)))

    def index(self, t: float) -> int:
        """Sample number of a time [s]."""
        return round(t / self.sample)

    def rows(self, table: Any, fold: Any) -> Any:
        """Folds every row of a table into one value: a stage function, mapped."""
        if table.shape[1] == 1:
            return table
        row, c = ca.MX.sym("row", table.shape[1]), ca.MX.sym("c")
        stage = ca.Function("fold", [row, c], [fold(row, c)])
        return stage.map(table.shape[0])(table.T, self.c).T

    def predicate(self, f: Formula, at: slice) -> Any:
        """Column of a predicate's robustness at the samples `at`."""
        op = f["op"]
        if op in ("in", "outside"):
            faces = self.regions[f["region"]]
            gap = self.positions[f["drone"]][at, :] @ faces[:, :3].T
            inside = ca.repmat(ca.DM(faces[:, 3]).T, gap.shape[0], 1) - gap
            return self.rows(inside, soft_min) if op == "in" else self.rows(-inside, soft_max)
        if op == "dist":
            between = self.positions[f["a"]][at, :] - self.positions[f["b"]][at, :]
            # Under either comparison the rounded tip errs on the low side of the robustness.
            norm = ca.sqrt(ca.sum2(between**2) + TIP**2)
            return norm - TIP - f["value"] if f["cmp"] == "ge" else f["value"] - norm
        total = sum(t["coef"] * self.positions[t["drone"]][at, "xyz".index(t["axis"])] for t in f["terms"])
        return total + f["constant"]

    def until(self, f: Formula, first: int, last: int, *, dual: bool) -> Any:
        """`left until[a, b] right` at samples first to last, or its negation when `dual`.

        max over t' of min(right(t'), min over [t, t'] of left); the dual swaps min and max and negates.
        """
        a, b = self.index(f["from"]), self.index(f["to"])
        left, right = (negation_normal(f[side], not dual) for side in ("left", "right"))
        held = self.signal(left, first, last + b)
        met = self.signal(right, first + a, last + b)
        inner, outer = (soft_max, soft_min) if dual else (soft_min, soft_max)
        out = []
        for k in range(last - first + 1):
            options, run = [], held[k]
            for step in range(b + 1):
                if step > 0:
                    run = inner(ca.vertcat(run, held[k + step]), self.c)
                if step >= a:
                    options.append(inner(ca.vertcat(met[k + step - a], run), self.c))
            out.append(outer(ca.vertcat(*options), self.c))
        return ca.vertcat(*out)


def smooth_robustness(
    formula: Formula,
    drones: Sequence[str],
    positions: Array,
    regions: Mapping[str, Array],
    sample: float,
    c: float,
) -> float:
    """Smooth robustness at time 0 of a trace (d, n, 3) [m]: the evaluator at numbers, for checks."""
    columns = {name: ca.MX(ca.DM(positions[d])) for d, name in enumerate(drones)}
    value = Smooth(columns, regions, sample, ca.MX(c)).at_start(formula)
    return float(np.asarray(ca.evalf(value)).item())
