"""A plan file's trajectories sampled from their knots by formulas of their own: nothing of the core."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Samples a second of everything that is judged.
HZ = 100


@dataclass(frozen=True)
class Flown:
    """Samples k / HZ from 0 on: positions, velocities, accelerations (n, 3) [SI], heading rate (n,)."""

    p: Array
    v: Array
    a: Array
    psi_rate: Array


def flown(knots: Sequence[Mapping[str, Any]]) -> Flown:
    """The quintic of every segment through the values, rates and second rates of both of its knots."""
    t = np.array([k["t"] for k in knots])
    ends = [np.column_stack([[k[x] for k in knots], [k[y] for k in knots]]) for x, y in NAMES]
    values, rates, seconds = (e.reshape(len(t), -1) for e in ends)
    times = np.arange(round(t[-1] * HZ) + 1) / HZ
    segment = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    h, tau = np.diff(t), times - t[segment]
    rows = np.stack([values[:-1], rates[:-1], seconds[:-1], values[1:], rates[1:], seconds[1:]], axis=1)
    coefficients = np.stack([solved(length, row) for length, row in zip(h, rows, strict=True)])[segment]
    powers = [derivative(tau, order) for order in range(3)]
    p, v, a = (np.einsum("nk,nkx->nx", power, coefficients) for power in powers)
    return Flown(p[:, :3], v[:, :3], a[:, :3], v[:, 3])


#: Position with heading, and their first and second rates, as a knot names them.
NAMES = (("p", "psi"), ("v", "psi_rate"), ("a", "psi_acc"))


def solved(h: float, row: Array) -> Array:
    """Coefficients (6, columns) of the powers of time that meet value, rate and second rate at 0 and h."""
    both = np.vstack([derivative(np.array([x]), order) for x in (0.0, h) for order in range(3)])
    return np.linalg.solve(both, row)


def derivative(x: Array, order: int) -> Array:
    """Derivatives (n, 6) of 1, x, ..., x^5."""
    out = np.zeros((len(x), 6))
    for k in range(order, 6):
        factor = np.prod([k - j for j in range(order)])
        out[:, k] = factor * x ** (k - order)
    return out
