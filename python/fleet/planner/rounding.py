"""From cubics between nodes, whose acceleration jumps, to the knots of a plan, where it cannot.

Around each node the cubics on both sides are replaced by the one quintic that meets them `HALF` before and
after. It passes the larger acceleration by at most 16.3 % of half the jump (the quintic through a step;
maximum of 9/4 s - 5/4 s^3 at s = sqrt(0.6)), for which `LIMIT` leaves room.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .connection import inputs, states
from .knots import Array

#: Half the time over which a corner is rounded [s]; segments last at least 0.05 s (design.md, Wire).
HALF = 0.03
#: Longest segment of a plan [s] (design.md, Wire).
LONGEST = 10.0
#: Share of the acceleration limit that cubics may use.
LIMIT = 1 / 1.2
#: Speed that rounding may add, as a share of a_max [s]: 3/16 of half the jump, times HALF.
FASTER = 0.25 * HALF


@dataclass(frozen=True)
class Cubics:
    """A way as cubics one after the other: `time` (n + 1,) [s] and the state (n + 1, 6) at each node."""

    time: Array
    state: Array

    def knots(self, marks: Array) -> tuple[Array, Array]:
        """Times (m,) [s] and knots (m, 3, 3: derivative, axis): beside all inner nodes, and at `marks`.

        `marks` stay clear of the nodes; the way begins and ends with a stay.
        """
        beside = np.concatenate([self.time[1:-1] - HALF, self.time[1:-1] + HALF])
        times = np.unique(np.round(np.concatenate([self.time[[0, -1]], beside, marks]), 9))
        parts = [
            np.linspace(a, b, int(np.ceil((b - a) / LONGEST)), endpoint=False) for a, b in pairwise(times)
        ]
        times = np.append(np.concatenate(parts), times[-1])
        k = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, len(self.time) - 2)
        a0, jerk = inputs(self.state[k], self.state[k + 1], np.diff(self.time)[k])
        return times, np.stack(states(self.state[k], a0, jerk, times - self.time[k]), axis=1)
