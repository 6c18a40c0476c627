"""Which drone visits which target, in which order: exact for small fleets.

Earliest-arrival dynamic programming over subsets (Held and Karp 1962, with time windows: a drone may
wait, so arriving earlier is never worse), then over drones: least makespan first, then least total time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Largest number of events that is assigned exactly.
EXACT = 12


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


def tours(legs: Legs, drone: int) -> dict[int, tuple[float, tuple[int, ...]]]:
    """For every set of events (bit mask) that `drone` can serve: earliest time at home [s] and the order."""
    n = legs.first.shape[1]
    state: dict[tuple[int, int], tuple[float, tuple[int, ...]]] = {}
    for e in range(n):
        t = arrive(0.0, float(legs.first[drone, e]), legs, e)
        if np.isfinite(t):
            state[1 << e, e] = (t, (e,))
    best: dict[int, tuple[float, tuple[int, ...]]] = {0: (float(legs.idle[drone]), ())}
    layer = dict(state)
    while layer:
        grown: dict[tuple[int, int], tuple[float, tuple[int, ...]]] = {}
        for (mask, at), (t, order) in layer.items():
            home = t + float(legs.last[drone, at])
            if home <= legs.horizon + 1e-9 and home < best.get(mask, (np.inf, ()))[0] - 1e-9:
                best[mask] = (home, order)
            for e in range(n):
                if mask >> e & 1:
                    continue
                then = arrive(t, float(legs.between[drone, at, e]), legs, e)
                key = (mask | 1 << e, e)
                if then < grown.get(key, (np.inf, ()))[0] - 1e-9:
                    grown[key] = (then, (*order, e))
        layer = grown
    return best


def arrive(t: float, leg: float, legs: Legs, event: int) -> float:
    """Time [s] at which `event` is done when left for at `t`; infinite when too late."""
    at = max(t + leg, float(legs.windows[event, 0]))
    return at + float(legs.dwell[event]) if at <= legs.windows[event, 1] + 1e-9 else np.inf


def partition(options: Sequence[dict[int, float]], full: int) -> list[int] | None:
    """One mask a drone, disjoint, together `full`: least maximum, then least sum; None if there is none."""

    def solve(join: Callable[[float, float], float], cap: float) -> tuple[float, list[int]] | None:
        table: dict[int, tuple[float, list[int]]] = {0: (0.0, [])}
        for option in options:
            grown: dict[int, tuple[float, list[int]]] = {}
            for used, (cost, chosen) in table.items():
                for mask, time in option.items():
                    if mask & used or time > cap:
                        continue
                    total = join(cost, time)
                    if total < grown.get(used | mask, (np.inf, []))[0] - 1e-9:
                        grown[used | mask] = (total, [*chosen, mask])
            table = grown
        return table.get(full)

    least = solve(max, np.inf)
    if least is None:
        return None
    best = solve(lambda a, b: a + b, least[0] + 1e-6)
    return best[1] if best else None


def assign(legs: Legs) -> list[tuple[int, ...]] | None:
    """Events of every drone in order; None when no assignment meets the windows.

    Exact up to `EXACT` events. Larger problems fall into the groups of drones and events that finite
    legs connect; each group is exact on its own (least makespan of the group) up to `EXACT` events, and
    assigned by cheapest insertion, which may miss a feasible assignment, above that.
    """
    drones, n = legs.first.shape
    if n <= EXACT:
        return exact(legs)
    orders: list[tuple[int, ...]] = [() for _ in range(drones)]
    served = 0
    for who, events in components(legs):
        part = Legs(
            legs.first[np.ix_(who, events)],
            legs.between[np.ix_(who, events, events)],
            legs.last[np.ix_(who, events)],
            legs.idle[who],
            legs.windows[events],
            legs.dwell[events],
            legs.horizon,
        )
        found = exact(part) if len(events) <= EXACT else insert(part)
        if found is None:
            return None
        for d, order in zip(who, found, strict=True):
            orders[d] = tuple(int(events[e]) for e in order)
        served += len(events)
    return orders if served == n else None


def components(legs: Legs) -> list[tuple[Ints, Ints]]:
    """Drones and events that finite legs from the start or between events connect, group by group."""
    drones, n = legs.first.shape
    linked = np.zeros((drones + n, drones + n), dtype=bool)
    linked[:drones, drones:] = np.isfinite(legs.first)
    linked[drones:, drones:] = np.isfinite(legs.between).any(axis=0)
    count, label = connected_components(sparse.csr_matrix(linked), directed=False)
    groups = [
        (np.flatnonzero(label[:drones] == k), np.flatnonzero(label[drones:] == k)) for k in range(count)
    ]
    return [(who, events) for who, events in groups if len(who)]


def exact(legs: Legs) -> list[tuple[int, ...]] | None:
    """The assignment of least makespan, then least total time."""
    drones, n = legs.first.shape
    table = [tours(legs, d) for d in range(drones)]
    masks = partition([{m: t for m, (t, _) in options.items()} for options in table], (1 << n) - 1)
    return None if masks is None else [table[d][m][1] for d, m in enumerate(masks)]


def tour_time(legs: Legs, drone: int, order: Sequence[int]) -> float:
    """Earliest time at home [s] of one order; infinite when a window or the horizon is missed."""
    if not order:
        return float(legs.idle[drone])
    t = arrive(0.0, float(legs.first[drone, order[0]]), legs, order[0])
    for a, b in pairwise(order):
        t = arrive(t, float(legs.between[drone, a, b]), legs, b)
    home = t + float(legs.last[drone, order[-1]])
    return home if home <= legs.horizon + 1e-9 else np.inf


def insert(legs: Legs) -> list[tuple[int, ...]] | None:
    """Cheapest insertion, most urgent event first: for fleets too large for the exact search."""
    drones, n = legs.first.shape
    orders: list[tuple[int, ...]] = [() for _ in range(drones)]
    times = [tour_time(legs, d, ()) for d in range(drones)]
    for e in sorted(range(n), key=lambda k: (float(legs.windows[k, 1]), -float(legs.first[:, k].min()), k)):
        best: tuple[float, float, int, tuple[int, ...]] | None = None
        for d in range(drones):
            others = max((times[k] for k in range(drones) if k != d), default=0.0)
            for place in range(len(orders[d]) + 1):
                order = (*orders[d][:place], e, *orders[d][place:])
                t = tour_time(legs, d, order)
                trial = (max(t, others), t - times[d], d, order)
                if np.isfinite(t) and (best is None or trial < best):
                    best = trial
        if best is None:
            return None
        orders[best[2]], times[best[2]] = best[3], tour_time(legs, best[2], best[3])
    return orders
