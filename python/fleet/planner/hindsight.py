"""Duties of past operators: as those of until and eventually, in windows that end at sample 0.

A window without samples needs nothing of `historically`, and can give nothing to `once` or `since`: then
nothing is posed, and the exact robustness of the plan refuses it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fleet.stl.vocabulary import Formula

from .duty import Anchor, middle_of_best
from .knots import Array
from .spec import negation_normal

if TYPE_CHECKING:
    from .witness import Choice

Branches = tuple[tuple[str, int], ...]


def pose(
    walk: Choice, f: Formula, first: int, last: int, key: str, anchor: Anchor | None, branches: Branches
) -> None:
    """Duties that make `f` (once, historically, since, or since under not) hold from `first` to `last`."""
    if f["op"] == "not":
        trigger(walk, f["f"], first, last, key, branches)
        return
    a, b = walk.signals.index(f["from"]), walk.signals.index(f["to"])
    if f["op"] == "historically":
        if last >= a:
            walk.pose(f["f"], max(0, first - b), last - a, f"{key}.f", anchor, branches)
        return
    g = f["f"] if "f" in f else f["right"]
    reached = walk.clipped(g)
    if "left" in f:
        # What has been kept from there on, as seen from the last sample that is asked for.
        kept = walk.clipped(f["left"])[: last + 1]
        held = np.minimum.accumulate(kept[::-1])[::-1][: len(reached)]
        reached = np.append(np.minimum(reached[: len(held)], held), reached[len(held) :])
    earliest = last
    for k, (low, high) in enumerate(windows(reached, first, last, a, b, sketch=walk.sketch)):
        best = middle_of_best(reached, low, high)
        name = f"{key}#{k}"
        walk.pose(g, best, best, f"{name}.f", Anchor(name, best, low, high), branches)
        earliest = min(earliest, best)
    if "left" in f:
        walk.pose(f["left"], earliest, last, f"{key}.left", None, branches)


def windows(reached: Array, first: int, last: int, a: int, b: int, *, sketch: bool) -> list[tuple[int, int]]:
    """Where witnesses may be so that every [t - b, t - a] has one, each covering as many t as it can.

    Without `sketch` a witness is the latest that is as good as the worst window allows.
    """
    times = range(max(first, a), last + 1)
    floor = min((reached[max(0, t - b) : t - a + 1].max() for t in times), default=0.0)
    out: list[tuple[int, int]] = []
    t = times.start
    while t <= last:
        low, high = max(0, t - b), t - a
        if not sketch and first < last:
            good = low + np.flatnonzero(reached[low : high + 1] >= floor)
            low = high = int(good[-1])
        out.append((low, high))
        t = low + b + 1
    return out


def trigger(walk: Choice, f: Formula, first: int, last: int, key: str, branches: Branches) -> None:
    """Not (l since r): `not r` all the time of the window, or only after a time at which `not l` held.

    Over more than one sample only the first way is posed, which is enough but not necessary.
    """
    a, b = walk.signals.index(f["from"]), walk.signals.index(f["to"])
    if last < a:
        return
    left, right = (negation_normal(f[side], False) for side in ("left", "right"))
    low, high = max(0, first - b), last - a
    if first == last:
        freed, kept = walk.clipped(left), walk.clipped(right)
        after = np.array([kept[s : high + 1].min(initial=np.inf) for s in range(low, last + 1)])
        value = np.minimum(freed[low : last + 1], after)
        if value.max() > kept[low : high + 1].min():
            at = low + middle_of_best(value, 0, last - low)
            freeing = Anchor(f"{key}#0", at, low, last)
            walk.pose(left, at, at, f"{key}#0.f", freeing, branches)
            if at <= high:
                walk.pose(right, at, high, f"{key}.right", freeing, branches)
            return
    walk.pose(right, low, high, f"{key}.right", None, branches)
