"""Electrical power over time, planned and flown, by the power model of crates/core (still air)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fleet import _core

Array = NDArray[np.float64]

#: Distance of samples [s]: flown velocities are differentiated over it.
STEP = 0.05


def sample_times(horizon: float) -> Array:
    """Times (n,) [s] over [0, horizon], at most `STEP` apart."""
    return np.linspace(0.0, horizon, int(np.ceil(horizon / STEP - 1e-9)) + 1)


def planned_power(trajectory: _core.Trajectory, times: Array) -> Array:
    """Power (n,) [W] of flying a trajectory, at `times` (n,) [s]."""
    states = trajectory.sample(times)
    return _core.flight_power(np.ascontiguousarray(states[:, 3:6]), np.ascontiguousarray(states[:, 6:9]))


def flown_power(track: Array, times: Array) -> Array:
    """Power (n,) [W] at `times` (n,) [s] of what was flown: rows `t, p(3), v(3), ...` of a log.

    Accelerations are differences of the logged velocities.
    """
    velocities = np.column_stack([np.interp(times, track[:, 0], track[:, 4 + axis]) for axis in range(3)])
    return _core.flight_power(velocities, np.gradient(velocities, times, axis=0))


def flown_energy(track: Array, horizon: float) -> float | None:
    """Energy [J] of what was flown over [0, horizon] [s]; None when the log does not cover it."""
    if not len(track) or track[0, 0] > STEP or track[-1, 0] < horizon - STEP:
        return None
    times = sample_times(horizon)
    return float(np.trapezoid(flown_power(track, times), times))
