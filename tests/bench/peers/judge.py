"""What a peer's trajectory is worth: the robustness of fleet's core, at samples and in continuous time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fleet import _core
from fleet.certificate import Proof, prove
from fleet.planner.rounding import Cubics

SAMPLE = 0.05


def judged(regions: Any, clauses: Any, drones: Sequence[str], tracks: list[_core.Trajectory]) -> Proof:
    """Exact rho every `SAMPLE` and the bound between samples; windows end with the tracks."""
    return prove(drones, regions, clauses, tracks, tracks[0].end, SAMPLE)


def straight(x: np.ndarray, height: float) -> list[_core.Trajectory]:
    """A flat path (4, n: p, v) of stlpy's unit-step double integrator, flown at `height` [m].

    Its step is p + v, so that the way between samples is a straight line.
    """
    n = x.shape[1]
    rows = np.zeros((n, 13))
    rows[:, 0], rows[:, 1:3], rows[:, 3] = np.arange(n), x[:2].T, height
    return [_core.Trajectory(rows)]


def driven(x: np.ndarray, dt: float) -> list[_core.Trajectory]:
    """Ways (6 d, n: all p, all v) of double integrators with an acceleration a step of `dt` [s].

    Steps of acceleration are rounded over 0.06 s, as a plan has none: it moves the way by less than 1 mm.
    """
    half, n = x.shape[0] // 2, x.shape[1]
    out = []
    for d in range(half // 3):
        state = np.vstack([x[3 * d : 3 * d + 3], x[half + 3 * d : half + 3 * d + 3]]).T
        times, knots = Cubics(np.arange(n) * dt, state).knots(np.zeros(0))
        rows = np.column_stack([times, knots.reshape(len(times), 9), np.zeros((len(times), 3))])
        out.append(_core.Trajectory(rows.astype(np.float64)))
    return out
