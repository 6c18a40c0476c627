"""Missions of fleet as stlpy states them; runs in the peers' environment, where fleet is not installed.

The signal is y = (p of drone 1, p of drone 2, ...), three axes each. Regions are half-spaces a.p <= b, so
that inside is a conjunction and outside a disjunction of linear predicates. A pair distance is not linear:
`dist(a, b) >= d` becomes "some axis differs by d", which is stricter (it implies the distance).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from stlpy.STL import LinearPredicate
from stlpy.systems import LinearSystem


def fleet_system(drones: int, dt: float) -> LinearSystem:
    """Double integrators, exact over steps of `dt` [s] with constant acceleration; y is all positions."""
    n = 3 * drones
    one, zero = np.eye(n), np.zeros((n, n))
    a, b = np.block([[one, dt * one], [zero, one]]), np.vstack([dt**2 / 2 * one, dt * one])
    return LinearSystem(a, b, np.hstack([one, zero]), zero)


class Translator:
    """Formula dicts of fleet to formulas of stlpy; windows are cut to whole steps of `dt` [s]."""

    def __init__(self, mission: dict[str, Any]) -> None:
        self.drones: list[str] = mission["drones"]
        self.shapes = {r["name"]: r["shape"] for r in mission["regions"]}
        self.dt: float = mission["dt"]

    def row(self, drone: str, a: Any, b: float) -> LinearPredicate:
        """a . p_drone >= b."""
        out = np.zeros((1, 3 * len(self.drones)))
        k = 3 * self.drones.index(drone)
        out[0, k : k + 3] = a
        return LinearPredicate(out, b)

    def steps(self, f: dict[str, Any]) -> tuple[int, int]:
        """First and last step inside the window of f."""
        return math.ceil(f["from"] / self.dt - 1e-9), math.floor(f["to"] / self.dt + 1e-9)

    def formula(self, f: dict[str, Any]) -> Any:
        """The formula of stlpy.

        Raises ValueError for what it cannot state.
        """
        op = f["op"]
        if op in ("and", "or"):
            parts = [self.formula(g) for g in f["fs"]]
            whole = parts[0]
            for part in parts[1:]:
                whole = whole & part if op == "and" else whole | part
            return whole
        if op in ("in", "outside"):
            rows = self.shapes[f["region"]]
            sign = -1.0 if op == "in" else 1.0
            parts = [self.row(f["drone"], sign * np.array(r["a"]), sign * r["b"]) for r in rows]
            whole = parts[0]
            for part in parts[1:]:
                whole = whole & part if op == "in" else whole | part
            return whole
        if op == "dist" and f["cmp"] == "ge":
            return self.apart(f["a"], f["b"], f["value"])
        if op in ("always", "eventually"):
            first, last = self.steps(f)
            inner = self.formula(f["f"])
            return inner.always(first, last) if op == "always" else inner.eventually(first, last)
        if op == "until":
            first, last = self.steps(f)
            return self.formula(f["left"]).until(self.formula(f["right"]), first, last)
        raise ValueError(f"{op} has no linear form in stlpy")

    def apart(self, one: str, two: str, value: float) -> Any:
        """Some axis differs by `value` [m]."""
        parts = []
        for axis in range(3):
            for sign in (1.0, -1.0):
                a = np.zeros((1, 3 * len(self.drones)))
                a[0, 3 * self.drones.index(one) + axis] = sign
                a[0, 3 * self.drones.index(two) + axis] = -sign
                parts.append(LinearPredicate(a, value))
        whole = parts[0]
        for part in parts[1:]:
            whole = whole | part
        return whole
