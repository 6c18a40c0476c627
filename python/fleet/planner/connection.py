"""The optimal connection of two states of a double integrator, final state fixed and final time free.

Webb and van den Berg, "Kinodynamic RRT*", ICRA 2013: the cost of a connection is its duration plus the
weighted squared input, here c(tau) = tau + w * integral of |a|^2. For given tau the optimal acceleration is
linear in time, so that positions are cubic; the best tau is a root of dc/dtau, a quartic (their section
III-B). Axes share tau and are independent otherwise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .knots import Array

#: Durations of a connection that are considered [s]: the shortest leaves room to round corners.
SHORTEST, LONGEST = 0.3, 30.0
#: Durations at which the cost is compared before Newton's method; a quartic has few minima.
COMPARED = np.geomspace(SHORTEST, LONGEST, 28)
#: Newton steps on the derivative of the cost; four are enough for 1e-6 s.
NEWTON = 4


def effort(tau: Array, d: Array, e: Array, f: Array) -> Array:
    """Integral of |a|^2 [m^2/s^3] of the optimal connection within tau [s].

    `d` = |dp|^2, `e` = dp . (v0 + v1), `f` = |v0|^2 + v0 . v1 + |v1|^2.
    """
    return np.asarray((12 * d / tau**2 - 12 * e / tau + 4 * f) / tau)


def optimal(start: Array, end: Array, weight: float) -> tuple[Array, Array]:
    """Costs (n,) [s] and durations (n,) [s] of the best connections of states (n, 6: p, v).

    `start` and `end` broadcast against each other; `weight` [s^4/m^2] is that of squared acceleration.
    """
    dp, v0, v1 = end[..., :3] - start[..., :3], start[..., 3:], end[..., 3:]
    d, e = (dp**2).sum(axis=-1), (dp * (v0 + v1)).sum(axis=-1)
    f = (v0**2).sum(axis=-1) + (v0 * v1).sum(axis=-1) + (v1**2).sum(axis=-1)
    trial = COMPARED[:, None]
    least = (trial + weight * effort(trial, d, e, f)).argmin(axis=0)
    low, high = COMPARED[np.maximum(least - 1, 0)], COMPARED[np.minimum(least + 1, len(COMPARED) - 1)]
    tau = COMPARED[least]
    for _ in range(NEWTON):
        slope = 1 - weight * (36 * d / tau**2 - 24 * e / tau + 4 * f) / tau**2
        curve = weight * (144 * d / tau**2 - 72 * e / tau + 8 * f) / tau**3
        step = np.where(curve > 0, slope / np.where(curve > 0, curve, 1.0), 0.0)
        tau = np.clip(tau - step, low, high)
    return tau + weight * effort(tau, d, e, f), tau


def inputs(start: Array, end: Array, tau: Array) -> tuple[Array, Array]:
    """Acceleration at the start [m/s^2] and jerk [m/s^3], (n, 3), of connections of durations tau (n,)."""
    dp, v0, v1, h = end[..., :3] - start[..., :3], start[..., 3:], end[..., 3:], tau[..., None]
    return 6 * dp / h**2 - (4 * v0 + 2 * v1) / h, 6 * (v0 + v1) / h**2 - 12 * dp / h**3


def admissible(start: Array, end: Array, tau: Array, v_max: float, a_max: float) -> NDArray[np.bool_]:
    """Which connections keep the limits per axis all the time; velocity is quadratic, acceleration linear."""
    a0, jerk = inputs(start, end, tau)
    a1 = a0 + jerk * tau[..., None]
    gentle = (np.maximum(np.abs(a0), np.abs(a1)) <= a_max).all(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        peak = start[..., 3:] - a0**2 / (2 * jerk)
    turns = a0 * a1 < 0
    slow = (np.where(turns, np.abs(peak), 0.0) <= v_max).all(axis=-1)
    ends = np.maximum(np.abs(start[..., 3:]), np.abs(end[..., 3:]))
    return np.asarray(gentle & slow & (ends <= v_max).all(axis=-1))


def states(start: Array, a0: Array, jerk: Array, t: Array) -> tuple[Array, Array, Array]:
    """Position, velocity, acceleration (n, 3) at times `t` (n,) [s] after the start of each connection."""
    s = t[:, None]
    p = start[:, :3] + s * (start[:, 3:] + s * (a0 / 2 + s * jerk / 6))
    return p, start[:, 3:] + s * (a0 + s * jerk / 2), a0 + s * jerk


def pieces(start: Array, a0: Array, jerk: Array, begin: Array, length: Array) -> Array:
    """Bernstein control points (n, 4, 3) [m] of the cubics over [begin, begin + length] (n,) [s]."""
    p, v, a = states(start, a0, jerk, begin)
    h = length[:, None]
    second = p + v * h / 3
    third = 2 * second - p + a * h**2 / 6
    last = states(start, a0, jerk, begin + length)[0]
    return np.stack([p, second, third, last], axis=1)
