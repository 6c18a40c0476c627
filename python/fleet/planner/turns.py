"""Headings and the times of visits: a turn may take longer than the legs on which it is made."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fleet.legs import Legs
from fleet.route import turn_time

from .knots import Array
from .problem import Problem


def shortest_turn(a: float, b: float) -> float:
    """Angle [rad] from heading a to b the short way, in (-pi, pi]; half turns go counter-clockwise."""
    turn = (b - a) % (2 * np.pi)
    return float(turn - 2 * np.pi if turn > np.pi + 1e-9 else turn)


def turn_times(problem: Problem) -> Array | None:
    """Times (d, n + 1, n) [s] of the turns between visits, as `Legs.turn`; None without headings."""
    visits = problem.spec.visits
    options = [dict(v.options) for v in visits]
    out = np.full((len(problem.ids), len(visits) + 1, len(visits)), np.nan)
    for d, name in enumerate(problem.ids):
        wanted = [problem.headings.get(o[name]) if name in o else None for o in options]
        for e, heading in enumerate(wanted):
            for k, now in enumerate((*wanted, float(problem.psi[d]))):
                if heading is not None and now is not None:
                    out[d, k, e] = turn_time(shortest_turn(now, heading), problem.heading_rate)
    return None if np.isnan(out).all() else out


def least_legs(legs: Legs, drone: int, order: tuple[int, ...], sample: float) -> Array:
    """Least times (n + 1,) [s] from visit to visit and home, dwells included, long enough for the turns.

    A turn that takes longer than its legs together makes the last one of them longer: what comes before
    it has no heading and need not wait.
    """
    least = [legs.first[drone, order[0]]]
    least += [legs.between[drone, a, b] + legs.dwell[a] for a, b in pairwise(order)]
    out = np.array([*least, legs.last[drone, order[-1]] + legs.dwell[order[-1]]], dtype=float)
    facing, since = -1, 0
    for k, e in enumerate(order):
        turn = legs.turning(drone, facing, e)
        if turn is None:
            continue
        # Times are rounded to samples, at either end.
        turn += (legs.dwell[facing] if facing >= 0 else 0.0) + 2 * sample
        out[k] += max(0.0, turn - out[since : k + 1].sum())
        facing, since = e, k + 1
    return out
