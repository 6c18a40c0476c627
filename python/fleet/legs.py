"""Times of the legs between starts, events and homes, and the tours that they make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Legs:
    """Leg times [s], infinite where a drone may not or cannot go.

    `first` (d, n) start to event, `between` (d, n, n) event to event, `last` (d, n) event to home,
    `idle` (d,) start to home; `windows` (n, 2), `dwell` (n,) stay at an event [s]; `horizon` latest return.
    `turn` (d, n + 1, n) time that turning takes from the heading of an event, or in the last row of the
    start, to that of an event, whatever comes between; nan where the event has no heading; None without any.
    """

    first: Array
    between: Array
    last: Array
    idle: Array
    windows: Array
    dwell: Array
    horizon: float
    turn: Array | None = None

    def turning(self, drone: int, facing: int, event: int) -> float | None:
        """Time to turn from the heading of event `facing` (-1 the start) to that of `event`; None without."""
        time = np.nan if self.turn is None else float(self.turn[drone, facing, event])
        return None if np.isnan(time) else time


@dataclass(frozen=True)
class Tour:
    """A tour so far: done at `t`, looking as event `facing` (-1 the start) wants since `since` [s]."""

    t: float
    order: tuple[int, ...] = ()
    facing: int = -1
    since: float = 0.0


def extended(tour: Tour, legs: Legs, drone: int, event: int) -> Tour:
    """A tour with one more event; its time is infinite when that comes too late."""
    before = tour.order[-1] if tour.order else -1
    leg = float(legs.first[drone, event] if before < 0 else legs.between[drone, before, event])
    turn = legs.turning(drone, tour.facing, event)
    done = arrive(max(tour.t + leg, tour.since + (turn or 0.0)), 0.0, legs, event)
    facing, since = (tour.facing, tour.since) if turn is None else (event, done)
    return Tour(done, (*tour.order, event), facing, since)


def arrive(t: float, leg: float, legs: Legs, event: int) -> float:
    """Time [s] at which `event` is done when left for at `t`; infinite when too late."""
    at = max(t + leg, float(legs.windows[event, 0]))
    return at + float(legs.dwell[event]) if at <= legs.windows[event, 1] + 1e-9 else np.inf


def tour_time(legs: Legs, drone: int, order: Sequence[int]) -> float:
    """Earliest time at home [s] of one order; infinite when a window or the horizon is missed."""
    if not order:
        return float(legs.idle[drone])
    tour = Tour(0.0)
    for e in order:
        tour = extended(tour, legs, drone, e)
    home = tour.t + float(legs.last[drone, order[-1]])
    return home if home <= legs.horizon + 1e-9 else np.inf


def cost(legs: Legs, orders: Sequence[Sequence[int]]) -> tuple[float, float]:
    """Makespan and total time [s] of an assignment; infinite when it misses a window."""
    times = [tour_time(legs, d, order) for d, order in enumerate(orders)]
    return max(times), sum(times)
