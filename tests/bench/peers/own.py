"""stlpy's own benchmark scenarios with the parameters of its examples."""

from __future__ import annotations

from typing import Any

import numpy as np
from stlpy.benchmarks import DoorPuzzle, EitherOr, NarrowPassage, RandomMultitarget, ReachAvoid


def scenario(name: str) -> tuple[Any, int, list[float], list[float]]:
    """A scenario, its steps, the initial state, and the size of its workspace."""
    if name == "reach_avoid":
        return ReachAvoid((7, 8, 8, 9), (3, 5, 4, 6), 15), 15, [1.0, 2.0, 0, 0], [10.0, 10.0]
    if name == "either_or":
        found = EitherOr((7, 8, 8, 9), (1, 2, 6, 7), (7, 8, 4.5, 5.5), (3, 5, 4, 6), 25, 5)
        return found, 25, [2.0, 2.0, 0, 0], [10.0, 10.0]
    if name == "narrow_passage":
        return NarrowPassage(25), 25, [3.0, 3.6, 0, 0], [10.0, 10.0]
    if name == "random_multitarget":
        return RandomMultitarget(1, 5, 2, 15, seed=0), 15, [5.0, 2.0, 0, 0], [10.0, 10.0]
    if name == "door_puzzle":
        return DoorPuzzle(30, 2), 30, [6.0, 1.0, 0, 0], [15.0, 10.0]
    raise ValueError(f"{name} is not a scenario of stlpy")


def limits(size: list[float]) -> dict[str, np.ndarray]:
    """Bounds of states and inputs as in its examples: |v| <= 1, |u| <= 0.5."""
    return {
        "x_min": np.array([0.0, 0.0, -1.0, -1.0]),
        "x_max": np.array([*size, 1.0, 1.0]),
        "u_min": np.array([-0.5, -0.5]),
        "u_max": np.array([0.5, 0.5]),
    }
