"""Smooth robustness of a formula: one walk, on numbers or symbols, softened as `Algebra` says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fleet.stl.vocabulary import Formula

from .algebra import Algebra, Numbers, Score
from .knots import Array
from .spec import DUAL, negation_normal

#: Robustness that stands for the infinite one of past operators over an empty window [m].
NEVER = 1e4


@dataclass(frozen=True)
class Smooth:
    """Walks a formula over positions.

    `positions` per drone (n, 3) at k T_s [m]; `regions` faces (k, 4); `sample` T_s [s].
    """

    positions: Mapping[str, Any]
    regions: Mapping[str, Array]
    sample: float
    algebra: Algebra

    def conjuncts(self, formula: Formula) -> Any:
        """Column of values whose true minimum is the robustness at time 0 [m].

        Conjunctions and `always` on the outside need no smoothing: each sample is a row of its own, and
        rows that touch few knots keep the program sparse.
        """
        f, first, last = negation_normal(formula), 0, 0
        while f["op"] == "always":
            first, last, f = first + self.index(f["from"]), last + self.index(f["to"]), f["f"]
        if f["op"] == "and" and first == last == 0:
            return self.algebra.below([self.conjuncts(g) for g in f["fs"]])
        return self.signal(f, first, last)

    def at_start(self, formula: Formula) -> Any:
        """Smooth robustness at time 0 (column of one) [m]."""
        return self.signal(negation_normal(formula), 0, 0)

    def signal(self, f: Formula, first: int, last: int) -> Any:
        """Column of smooth robustness at samples first to last of a formula in negation normal form."""
        op = f["op"]
        if op in ("in", "outside", "dist", "linear"):
            return self.predicate(f, slice(first, last + 1))
        if op in ("and", "or"):
            parts = self.algebra.beside([self.signal(g, first, last) for g in f["fs"]])
            return self.algebra.least(parts) if op == "and" else self.algebra.most(parts)
        if op == "not":
            binary = self.since if f["f"]["op"] == "since" else self.until
            return binary(f["f"], first, last, dual=True)
        if op in ("until", "since"):
            return (self.since if op == "since" else self.until)(f, first, last, dual=False)
        if op not in DUAL:
            raise ValueError(f"smooth robustness has no operator {op!r}")
        a, b = self.index(f["from"]), self.index(f["to"])
        if op in ("always", "eventually"):
            inner = self.signal(f["f"], first + a, last + b)
        else:
            inner = self.padded(f["f"], first - b, last - a, NEVER if op == "historically" else -NEVER)
        windows = self.algebra.windows(inner, last - first + 1, b - a + 1)
        return self.algebra.least(windows) if op in ("always", "historically") else self.algebra.most(windows)

    def index(self, t: float) -> int:
        """Sample number of a time [s]."""
        return round(t / self.sample)

    def predicate(self, f: Formula, at: slice) -> Any:
        """Column of a predicate's robustness at the samples `at`."""
        op = f["op"]
        if op in ("in", "outside"):
            inside = self.algebra.margins(self.positions[f["drone"]][at, :], self.regions[f["region"]])
            return self.algebra.least(inside) if op == "in" else self.algebra.most(-inside)
        if op == "dist":
            between = self.positions[f["a"]][at, :] - self.positions[f["b"]][at, :]
            # Where it is rounded, it is on the low side of the robustness.
            if f["cmp"] == "ge":
                return self.algebra.norm(between, above=False) - f["value"]
            return f["value"] - self.algebra.norm(between, above=True)
        total = sum(t["coef"] * self.positions[t["drone"]][at, "xyz".index(t["axis"])] for t in f["terms"])
        return total + f["constant"]

    def until(self, f: Formula, first: int, last: int, *, dual: bool) -> Any:
        """`left until[a, b] right` at samples first to last, or its negation when `dual`.

        max over t' of min(right(t'), min over [t, t'] of left); the dual swaps min and max and negates.
        """
        a, b, n = self.index(f["from"]), self.index(f["to"]), last - first + 1
        left, right = (negation_normal(f[side], not dual) for side in ("left", "right"))
        held = self.signal(left, first, last + b)
        met = self.signal(right, first + a, last + b)
        folds = (self.algebra.least, self.algebra.most)
        inner, outer = folds[::-1] if dual else folds
        options, run = [], held[:n]
        for step in range(b + 1):
            if step > 0:
                run = inner(self.algebra.beside([run, held[step : step + n]]))
            if step >= a:
                options.append(inner(self.algebra.beside([met[step - a : step - a + n], run])))
        return outer(self.algebra.beside(options))

    def since(self, f: Formula, first: int, last: int, *, dual: bool) -> Any:
        """`left since[a, b] right` at samples first to last, or its negation when `dual`; as `until`."""
        a, b, n = self.index(f["from"]), self.index(f["to"]), last - first + 1
        left, right = (negation_normal(f[side], not dual) for side in ("left", "right"))
        never = NEVER if dual else -NEVER
        held, met = self.padded(left, first - b, last, never), self.padded(right, first - b, last - a, never)
        folds = (self.algebra.least, self.algebra.most)
        inner, outer = folds[::-1] if dual else folds
        options, run = [], held[b : b + n]
        for step in range(b + 1):
            then = slice(b - step, b - step + n)
            if step > 0:
                run = inner(self.algebra.beside([run, held[then]]))
            if step >= a:
                options.append(inner(self.algebra.beside([met[then], run])))
        return outer(self.algebra.beside(options))

    def padded(self, f: Formula, first: int, last: int, before: float) -> Any:
        """`signal` at samples first to last, `before` at those before sample 0."""
        pad = np.full(min(0, last + 1) - first, before) if first < 0 else np.zeros(0)
        if last < 0:
            return pad
        known = self.signal(f, max(0, first), last)
        return self.algebra.below([pad, known]) if len(pad) else known


def leaves(formula: Formula, regions: Mapping[str, Array], sample: float) -> int:
    """Number of predicate values (faces of regions apart) below the unrolled tree of a formula.

    Log-sum-exp over a tree with m leaves errs by at most log(m)/c, up or down: a node over children with
    m_i leaves errs by log(sum of m_i)/c, if its children do by log(m_i)/c.
    """
    return _leaves(negation_normal(formula), regions, sample)


def _leaves(f: Formula, regions: Mapping[str, Array], sample: float) -> int:
    op = f["op"]
    if op in ("in", "outside"):
        return len(regions[f["region"]])
    if op in ("dist", "linear"):
        return 1
    if op in ("and", "or"):
        return sum(_leaves(g, regions, sample) for g in f["fs"])
    if op == "not":
        return _leaves(f["f"], regions, sample)
    a, b = round(f["from"] / sample), round(f["to"] / sample)
    if op in DUAL:
        return int(b - a + 1) * _leaves(f["f"], regions, sample)
    if op not in ("until", "since"):
        raise ValueError(f"smooth robustness has no operator {op!r}")
    left, right = (_leaves(negation_normal(f[side]), regions, sample) for side in ("left", "right"))
    return int(sum(right + (step + 1) * left for step in range(a, b + 1)))


def smooth_robustness(
    formula: Formula,
    drones: Sequence[str],
    positions: Array,
    regions: Mapping[str, Array],
    sample: float,
    c: float,
    score: Score = Score.SOUND,
) -> float:
    """Smooth robustness at time 0 of a trace (d, n, 3) [m], sharpness `c` [1/m]."""
    columns = {name: positions[d] for d, name in enumerate(drones)}
    return float(Smooth(columns, regions, sample, Numbers(score, c)).at_start(formula)[0])
