"""Fewer knots for trajectories of dense samples: those go first that the quintics reproduce best."""

from __future__ import annotations

import numpy as np

from .knots import KNOT, Array, Ints, difference, hermite

#: Share of what could go in one round that goes; the next round judges what is left anew.
BATCH = 0.5


def thinned(samples: Array, step: float, wanted: set[int], most: int, longest: float) -> Ints:
    """Indices of at most `most` + 1 samples (n, 9: p, v, a) that `step` [s] lie apart, both ends among them.

    `wanted` indices stay, and no two left are further than `longest` [s] apart. In rounds, those go whose
    acceleration the quintic between their neighbours misses least.
    """
    chosen = np.arange(len(samples))
    stays = np.isin(chosen, [0, len(samples) - 1, *wanted])
    while len(chosen) > most + 1:
        before, at, after = chosen[:-2], chosen[1:-1], chosen[2:]
        missed = np.full(len(chosen), np.inf)
        missed[1:-1] = np.abs(between(samples, step, before, at, after) - samples[at, 6:]).max(axis=1)
        missed[1:-1][stays[at] | ((after - before) * step > longest + 1e-9)] = np.inf
        # No two neighbours go in one round.
        least = 1 + np.flatnonzero((missed[1:-1] <= missed[:-2]) & (missed[1:-1] < missed[2:]))
        if len(least) == 0:
            raise ValueError(f"{len(chosen)} knots are wanted, {most + 1} are possible")
        count = min(int(np.ceil(BATCH * len(least))), len(chosen) - most - 1)
        chosen = np.delete(chosen, least[np.argsort(missed[least], kind="stable")[:count]])
    return chosen


def between(samples: Array, step: float, before: Ints, at: Ints, after: Ints) -> Array:
    """Acceleration (m, 3) [m/s^2] at samples `at` of the quintics from `before` to `after`."""
    h = np.asarray((after - before) * step, dtype=np.float64)
    ends = np.stack([samples[before], samples[after]], axis=1).reshape(len(h), 2 * KNOT // 3, 3)
    points: Array = difference(2) @ (hermite(h) @ ends) / (h**2)[:, None, None]
    u = ((at - before) / (after - before))[:, None, None]
    for _ in range(3):
        points = points[:, :-1] * (1 - u) + points[:, 1:] * u
    return np.asarray(points[:, 0])
