"""Exact robustness over time of every part of a formula: what witnesses and branches are chosen by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fleet import _core
from fleet.stl.vocabulary import Formula

from .knots import Array, Grid, sample
from .problem import Problem

PREDICATES = ("in", "outside", "dist", "linear")
PAST = ("once", "historically", "since")


def positions(problem: Problem, grid: Grid, x: Array) -> Array:
    """Positions (d, n, 3) [m] of all drones at k T_s."""
    times = np.arange(round(problem.horizon / problem.sample) + 1).astype(np.float64) * problem.sample
    return np.stack([np.ascontiguousarray(sample(grid, x, d, times)) for d in range(len(problem.ids))])


def wire_regions(regions: Mapping[str, Array]) -> list[dict[str, object]]:
    """Regions of faces (n, 4) as the core reads them."""
    return [
        {"name": name, "shape": [{"a": [float(c) for c in row[:3]], "b": float(row[3])} for row in faces]}
        for name, faces in regions.items()
    ]


@dataclass
class Signals:
    """Robustness [m] at k T_s of the parts of formulas in negation normal form, on one trace.

    `trace` (d, n, 3) [m]; `forced` replaces the signal of "drone outside region". The signal of a part
    ends where its windows would pass the end of the trace.
    """

    fleet: _core.Fleet
    trace: Array
    sample: float
    known: dict[int, Array] = field(default_factory=dict)
    kept: list[Formula] = field(default_factory=list)
    forced: dict[tuple[str, str], Array] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: Problem, trace: Array) -> Signals:
        """On a trace of the drones of a problem."""
        return cls(_core.Fleet(list(problem.ids), wire_regions(problem.regions)), trace, problem.sample)

    def index(self, t: float) -> int:
        """Sample number of a time [s]."""
        return round(t / self.sample)

    def of_part(self, f: Formula) -> Array:
        """Robustness (n',) at every sample at which `f` can be evaluated."""
        if id(f) not in self.known:
            self.kept.append(f)  # an id is only unique while its object lives
            self.known[id(f)] = self._signal(f)
        return self.known[id(f)]

    def _signal(self, f: Formula) -> Array:
        op = f["op"]
        if op == "outside" and (f["drone"], f["region"]) in self.forced:
            return self.forced[f["drone"], f["region"]]
        if op in PREDICATES:
            return np.asarray(self.fleet.robustness(f, self.trace, self.sample))
        if op in ("and", "or"):
            parts = [self.of_part(g) for g in f["fs"]]
            table = np.stack([p[: min(map(len, parts))] for p in parts])
            return np.asarray(table.min(axis=0) if op == "and" else table.max(axis=0))
        if op == "not":
            return -(self._since(f["f"]) if f["f"]["op"] == "since" else self._until(f["f"]))
        if op == "until":
            return self._until(f)
        if op == "since":
            return self._since(f)
        if op in PAST:
            return self._back(f)
        a, b = self.index(f["from"]), self.index(f["to"])
        windows = sliding_window_view(self.of_part(f["f"])[a:], b - a + 1)
        return np.asarray(windows.min(axis=1) if op == "always" else windows.max(axis=1))

    def _until(self, f: Formula) -> Array:
        """max over t' in [t + a, t + b] of min(right(t'), min over [t, t'] of left)."""
        a, b = self.index(f["from"]), self.index(f["to"])
        left, right = self.of_part(f["left"]), self.of_part(f["right"])
        n = min(len(left), len(right)) - b
        run, best = np.full(n, np.inf), np.full(n, -np.inf)
        for step in range(b + 1):
            run = np.minimum(run, left[step : step + n])
            if step >= a:
                best = np.maximum(best, np.minimum(run, right[step : step + n]))
        return best

    def _back(self, f: Formula) -> Array:
        """Extremum over [t - b, t - a], cut at sample 0; infinite where nothing is left of it."""
        a, b = self.index(f["from"]), self.index(f["to"])
        nothing = -np.inf if f["op"] == "once" else np.inf
        padded = np.concatenate([np.full(b, nothing), self.of_part(f["f"])])
        windows = sliding_window_view(padded, b - a + 1)[: self.trace.shape[1]]
        return np.asarray(windows.max(axis=1) if f["op"] == "once" else windows.min(axis=1))

    def _since(self, f: Formula) -> Array:
        """max over t' in [t - b, t - a] of min(right(t'), min over [t', t] of left); t' from sample 0 on."""
        a, b = self.index(f["from"]), self.index(f["to"])
        left, right = self.of_part(f["left"]), self.of_part(f["right"])
        n = min(len(left), len(right) + a)
        run, best = np.full(n, np.inf), np.full(n, -np.inf)
        for step in range(min(b + 1, n)):
            run[step:] = np.minimum(run[step:], left[: n - step])
            if step >= a:
                best[step:] = np.maximum(best[step:], np.minimum(run[step:], right[: n - step]))
        return best
