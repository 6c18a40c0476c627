"""The part of a formula that decides its robustness, told by boxes around the drones.

In a fleet along a line most predicates cannot matter: a tower far off, two drones that never meet. Dropping
from a conjunction what is at least `CUT` everywhere, and from a disjunction what is nowhere positive, changes
no value strictly between 0 and `CUT`: min, max, infimum and supremum all commute with clamping to [0, CUT].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet import _core

Array = NDArray[np.float64]
Formula = Mapping[str, Any]

#: Robustness [m] up to which the reduced formula tells the value.
CUT = 2.0


class Boxes:
    """Boxes (2, 3: low, high) that hold the whole trajectory of every drone, and the regions around."""

    def __init__(
        self,
        drones: Sequence[str],
        regions: Sequence[Mapping[str, Any]],
        tracks: Sequence[_core.Trajectory],
    ) -> None:
        self.boxes = {name: hull(track.knots) for name, track in zip(drones, tracks, strict=True)}
        self.regions = {
            r["name"]: np.array([[*f["a"], f["b"]] for f in r["shape"]], dtype=float) for r in regions
        }

    def reduced(self, f: Formula) -> Formula:
        """The formula without what cannot decide a value between 0 and `CUT`."""
        op = f["op"]
        if op in ("always", "eventually"):
            return {**f, "f": self.reduced(f["f"])}
        if op not in ("and", "or"):
            return f
        parts = [self.reduced(g) for g in flat(f, op)]
        ranges = [self.range(g) for g in parts]
        if op == "and":
            least = min(range(len(parts)), key=lambda k: ranges[k][0])
            kept = [g for k, g in enumerate(parts) if ranges[k][0] < CUT or k == least]
        else:
            most = max(range(len(parts)), key=lambda k: ranges[k][1])
            kept = [g for k, g in enumerate(parts) if ranges[k][1] > 0 or k == most]
        return kept[0] if len(kept) == 1 else {"op": op, "fs": kept}

    def range(self, f: Formula) -> tuple[float, float]:
        """Bounds [m] of a predicate's value wherever in their boxes the drones are; infinite for the rest."""
        if f["op"] in ("in", "outside"):
            faces, (low, high) = self.regions[f["region"]], self.boxes[f["drone"]]
            middle, half = (low + high) / 2, (high - low) / 2
            away = faces[:, :3] @ middle - faces[:, 3]
            reach = np.abs(faces[:, :3]) @ half
            # Outside is the largest distance beyond a face; inside is its negative.
            least, most = float((away - reach).max()), float((away + reach).max())
            return (least, most) if f["op"] == "outside" else (-most, -least)
        if f["op"] == "dist" and f["cmp"] == "ge":
            (low_a, high_a), (low_b, high_b) = self.boxes[f["a"]], self.boxes[f["b"]]
            gap = np.maximum(np.maximum(low_a - high_b, low_b - high_a), 0.0)
            return float(np.linalg.norm(gap)) - f["value"], np.inf
        return -np.inf, np.inf


def hull(knots: Array) -> Array:
    """Box (2, 3) of all Bernstein control points of knots (n, 13), which hold the curve."""
    p, v, a = knots[:, 1:4], knots[:, 4:7], knots[:, 7:10]
    h = np.diff(knots[:, 0])[:, None]
    points = [
        p,
        p[:-1] + h / 5 * v[:-1],
        p[:-1] + 0.4 * h * v[:-1] + h**2 / 20 * a[:-1],
        p[1:] - h / 5 * v[1:],
        p[1:] - 0.4 * h * v[1:] + h**2 / 20 * a[1:],
    ]
    every = np.concatenate(points)
    return np.stack([every.min(axis=0), every.max(axis=0)])


def flat(f: Formula, op: str) -> list[Formula]:
    """The operands of nested `op`s in one list."""
    return [part for g in f["fs"] for part in flat(g, op)] if f["op"] == op else [f]
