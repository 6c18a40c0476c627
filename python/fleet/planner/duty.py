"""Duties, and the witnesses that they hang on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fleet.stl.vocabulary import Formula

from .knots import Array


@dataclass(frozen=True)
class Anchor:
    """A witness: the place `key` of its operator, its sample `at`, and from where to where it may move."""

    key: str
    at: int
    low: int
    high: int


@dataclass(frozen=True)
class Duty:
    """A predicate that must hold at all samples from `first` to `last`; `branches` led to it."""

    clause: str
    predicate: Formula
    first: int
    last: int
    anchor: Anchor | None = None
    branches: tuple[tuple[str, int], ...] = ()


def middle_of_best(values: Array, low: int, high: int) -> int:
    """The middle one of the samples from low to high at which `values` is largest."""
    best = np.flatnonzero(values[low : high + 1] >= values[low : high + 1].max() - 1e-9)
    return low + int(best[len(best) // 2])
