"""Which drone visits which target, in which order: exact for small fleets, local search for large ones.

Earliest-arrival dynamic programming over subsets (Held and Karp 1962, with time windows: a drone may
wait, so arriving earlier is never worse), then over drones: least makespan first, then least total time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from .legs import Ints, Legs, Tour, extended, tour_time

#: Largest number of events that is assigned exactly.
EXACT = 12


def tours(legs: Legs, drone: int) -> dict[int, tuple[float, tuple[int, ...]]]:
    """For every set of events (bit mask) that `drone` can serve: earliest time at home [s] and the order."""
    n = legs.first.shape[1]
    best: dict[int, tuple[float, tuple[int, ...]]] = {0: (float(legs.idle[drone]), ())}
    layer: dict[tuple[int, int, int], Tour] = {(0, -1, -1): Tour(0.0)}
    while layer:
        grown: dict[tuple[int, int, int], Tour] = {}
        for (mask, at, _), tour in layer.items():
            home = tour.t + float(legs.last[drone, at]) if mask else np.inf
            if home <= legs.horizon + 1e-9 and home < best.get(mask, (np.inf, ()))[0] - 1e-9:
                best[mask] = (home, tour.order)
            for e in range(n):
                if mask >> e & 1:
                    continue
                then = extended(tour, legs, drone, e)
                key = (mask | 1 << e, e, then.facing)
                if then.t < (grown[key].t if key in grown else np.inf) - 1e-9:
                    grown[key] = then
        layer = grown
    return best


def partition(options: Sequence[dict[int, float]], full: int) -> list[int] | None:
    """One mask a drone, disjoint, together `full`: least maximum, then least sum; None if there is none."""

    def solve(join: Callable[[float, float], float], cap: float) -> tuple[float, list[int]] | None:
        table: dict[int, tuple[float, list[int]]] = {0: (0.0, [])}
        for option in options:
            legal = [(mask, time) for mask, time in option.items() if time <= cap]
            masks = np.array([mask for mask, _ in legal], dtype=np.int64)
            grown: dict[int, tuple[float, list[int]]] = {}
            for used, (cost, chosen) in table.items():
                for k in np.flatnonzero(masks & used == 0).tolist():
                    mask, time = legal[k]
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


def assign(legs: Legs, *, proved: bool = False) -> list[tuple[int, ...]] | None:
    """Events of every drone in order; None when no assignment meets the windows.

    Exact up to `EXACT` events. Larger problems fall into the groups of drones and events that finite
    legs connect; each group is exact on its own (least makespan of the group) up to `EXACT` events. Above
    that cheapest insertion, or a complete search where it finds nothing, is improved by local search; with
    `proved` a complete search finds the best one, however long that takes.
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
            None if legs.turn is None else legs.turn[np.ix_(who, [*events, n], events)],
        )
        found = exact(part) if len(events) <= EXACT else large(part, proved)
        if found is None:
            return None
        for d, order in zip(who, found, strict=True):
            orders[d] = tuple(int(events[e]) for e in order)
        served += len(events)
    return orders if served == n else None


def large(legs: Legs, proved: bool) -> list[tuple[int, ...]] | None:
    """An assignment of more events than subsets can be listed of; None when there is none, or none found."""
    from . import exchange, vehicles

    start = insert(legs)
    if proved:
        return vehicles.optimal(legs, start)
    start = start or vehicles.feasible(legs)
    return None if start is None else exchange.improved(legs, start)


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
