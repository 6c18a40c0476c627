"""Times of the legs between starts, events and homes, and the tours that they make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Legs:
    """Leg times [s], infinite where a drone may not or cannot go.

    `first` (d, n) start to event, `between` (d, n, n) event to event, `last` (d, n) event to home,
    `idle` (d,) start to home; `windows` (n, 2), `dwell` (n,) stay at an event [s]; `horizon` latest return.
    """

    first: Array
    between: Array
    last: Array
    idle: Array
    windows: Array
    dwell: Array
    horizon: float


def arrive(t: float, leg: float, legs: Legs, event: int) -> float:
    """Time [s] at which `event` is done when left for at `t`; infinite when too late."""
    at = max(t + leg, float(legs.windows[event, 0]))
    return at + float(legs.dwell[event]) if at <= legs.windows[event, 1] + 1e-9 else np.inf


def tour_time(legs: Legs, drone: int, order: Sequence[int]) -> float:
    """Earliest time at home [s] of one order; infinite when a window or the horizon is missed."""
    if not order:
        return float(legs.idle[drone])
    t = arrive(0.0, float(legs.first[drone, order[0]]), legs, order[0])
    for a, b in pairwise(order):
        t = arrive(t, float(legs.between[drone, a, b]), legs, b)
    home = t + float(legs.last[drone, order[-1]])
    return home if home <= legs.horizon + 1e-9 else np.inf
