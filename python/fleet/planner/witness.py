"""Witnesses and branches: the part of a formula that one trajectory keeps, or is nearest to keeping.

Along the path of argmax and argmin through the exact robustness, `eventually` and `until` become one
time, `or` one branch at each time, and what is left is a conjunction of predicates over intervals of
time: `Duty`. Keeping all duties keeps the formula; on the trajectory that they were chosen by, their
least robustness is that of the formula.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from fleet.stl.vocabulary import Formula

from . import hindsight
from .duty import Anchor, Duty, middle_of_best
from .knots import Array
from .signals import PAST, PREDICATES, Signals
from .spec import Rest, negation_normal

#: Witnesses in a row fill at most this share of the longest legal gap between them.
FILLED = 0.85
#: Robustness taken off a branch that turned out to be out of reach [m]: more than any distance on site.
OUT_OF_REACH = 1e4


@dataclass
class Choice:
    """Walks the parts of one clause after the other and collects their duties.

    `enough` [m]: robustness above it counts as equal. `avoided` names branches not to take. A `sketch`
    depends on the trajectory as little as may be: the first of equal branches, evenly spaced witnesses.
    """

    signals: Signals
    enough: float
    avoided: frozenset[tuple[str, int]] = frozenset()
    sketch: bool = False
    duties: list[Duty] = field(default_factory=list)
    clause: str = ""

    def pose(
        self,
        f: Formula,
        first: int,
        last: int,
        key: str,
        anchor: Anchor | None = None,
        branches: tuple[tuple[str, int], ...] = (),
    ) -> None:
        """Duties that make `f` hold at all samples from `first` to `last`."""
        op = f["op"]
        if op in PREDICATES:
            self.duties.append(Duty(self.clause, f, first, last, anchor, branches))
        elif op == "and":
            for k, g in enumerate(f["fs"]):
                self.pose(g, first, last, f"{key}.{k}", anchor, branches)
        elif op == "or":
            for k, start, end in self.runs(f["fs"], first, last, key):
                self.pose(f["fs"][k], start, end, f"{key}.{k}", anchor, (*branches, (key, k)))
        elif op == "always":
            a, b = self.signals.index(f["from"]), self.signals.index(f["to"])
            self.pose(f["f"], first + a, last + b, f"{key}.f", anchor, branches)
        elif op in PAST or (op == "not" and f["f"]["op"] in PAST):
            hindsight.pose(self, f, first, last, key, anchor, branches)
        elif op == "not":
            self.release(f["f"], first, last, key, branches)
        else:
            self.chain(f, first, last, key, branches)

    def clipped(self, f: Formula) -> Array:
        """Robustness, above `enough` cut off."""
        return np.minimum(self.signals.of_part(f), self.enough)

    def runs(self, fs: list[Formula], first: int, last: int, key: str) -> list[tuple[int, int, int]]:
        """(branch, start, end) that cover the samples, each the best branch there; neighbours share one."""
        table = np.stack([self.clipped(g)[first : last + 1] for g in fs])
        for k in range(len(fs)):
            table[k] -= OUT_OF_REACH if (key, k) in self.avoided else 0.0
        out, now, start = [], int(table[:, 0].argmax()), 0
        for s in range(1, table.shape[1]):
            then = int(table[:, s].argmax())
            if then == now or (not self.sketch and table[now, s] >= table[then, s]):
                continue
            # In between is continuous time: both branches hold at the sample that they share.
            shared = s if table[[now, then], s].min() >= table[[now, then], s - 1].min() else s - 1
            out.append((now, first + start, first + max(shared, start)))
            now, start = then, shared
        out.append((now, first + start, last))
        return out

    def chain(
        self, f: Formula, first: int, last: int, key: str, branches: tuple[tuple[str, int], ...]
    ) -> None:
        """Witnesses of `eventually` or `until`: one in every window of the samples first to last."""
        a, b = self.signals.index(f["from"]), self.signals.index(f["to"])
        g = f["f"] if "f" in f else f["right"]
        reached = self.clipped(g)
        if "left" in f:
            held = np.minimum.accumulate(self.clipped(f["left"])[first : last + b + 1])
            reached = reached.copy()
            reached[first : first + len(held)] = np.minimum(reached[first : first + len(held)], held)
        if a == b:
            windows = [(first + a, last + a)]
            self.pose(g, first + a, last + a, f"{key}.f", None, branches)
        elif first < last and not self.sketch and self.signals.of_part(f)[first : last + 1].min() > 0:
            windows = self.found(reached, first, last, a, b)
        else:
            windows = spaced(first, last, a, b)
        best = first
        for k, (low, high) in enumerate(windows if a != b else []):
            best = middle_of_best(reached, low, high)
            name = f"{key}#{k}"
            self.pose(g, best, best, f"{name}.f", Anchor(name, best, low, high), branches)
        if "left" in f:
            end = best if a != b else last + a
            whole = Anchor(f"{key}#0", end, first + a, first + b) if len(windows) == 1 and a != b else None
            self.pose(f["left"], first, end, f"{key}.left", whole, branches)

    @staticmethod
    def found(reached: Array, first: int, last: int, a: int, b: int) -> list[tuple[int, int]]:
        """As few witnesses as do, each the latest that is as good as the worst window allows."""
        floor = min(reached[t + a : t + b + 1].max() for t in range(first, last + 1))
        out: list[tuple[int, int]] = []
        low, high = first + a, first + b
        while not out or out[-1][0] < last + a:
            good = low + np.flatnonzero(reached[low : high + 1] >= floor)
            at = int(good[-1]) if len(good) else low + int(reached[low : high + 1].argmax())
            out.append((at, at))
            low, high = at + 1, min(at + b - a, last + b)
        return out

    def release(
        self, f: Formula, first: int, last: int, key: str, branches: tuple[tuple[str, int], ...]
    ) -> None:
        """Not (l until r): `not r` all the time, or up to a time at which `not l` holds.

        Over more than one sample only the first way is posed, which is enough but not necessary.
        """
        a, b = self.signals.index(f["from"]), self.signals.index(f["to"])
        left, right = (negation_normal(f[side], False) for side in ("left", "right"))
        freed, kept = self.clipped(left), self.clipped(right)
        end = None
        if first == last:
            ends = np.arange(first, first + b + 1)
            before = [kept[first + a : t + 1].min(initial=np.inf) for t in ends]
            value = np.minimum(freed[ends], before)
            if value.max() > kept[first + a : first + b + 1].min():
                end = first + middle_of_best(value, 0, b)
        if end is None:
            self.pose(right, first + a, last + b, f"{key}.right", None, branches)
            return
        freeing = Anchor(f"{key}#0", end, first, first + b)
        self.pose(left, end, end, f"{key}#0.f", freeing, branches)
        if end >= first + a:
            self.pose(right, first + a, end, f"{key}.right", freeing, branches)


def spaced(first: int, last: int, a: int, b: int) -> list[tuple[int, int]]:
    """Windows of evenly spaced witnesses: wherever in them they are, every window [t + a, t + b] has one."""
    span, gap = (last + a) - (first + b), b - a
    if span <= 0:
        return [(last + a, first + b)]
    steps = int(np.ceil(span / (FILLED * gap)))
    slack = (gap - span / steps) / (1 + 1 / steps)
    if slack < 2:
        # Too short for room on a grid of samples: a witness at the end of every gap.
        return [(t, t) for t in (*range(first + b, last + a, gap), last + a)]
    middles = first + b - slack / 2 + (span + slack) / steps * np.arange(steps + 1)
    return [(int(np.ceil(m - slack / 2 - 1e-6)), int(np.floor(m + slack / 2 + 1e-6))) for m in middles]


def choose(
    rest: list[Rest],
    signals: Signals,
    enough: float,
    *,
    avoided: Iterable[tuple[str, int]] = (),
    sketch: bool = False,
) -> list[Duty]:
    """Duties of all parts at time 0, chosen by the exact robustness of one trace (see `Choice`)."""
    walk = Choice(signals, enough, frozenset(avoided), sketch)
    for k, part in enumerate(rest):
        walk.clause = part.clause
        walk.pose(part.formula, 0, 0, f"{part.clause}/{k}")
    return walk.duties
