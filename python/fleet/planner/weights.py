"""Weights of clauses: how the common slack r becomes the margin that is asked of each clause.

Every clause is posed as rho_k >= weight_k * r, and r is maximised; what the tube asks of rho_k holds
whatever the weight (design.md, Tube), so that a light clause is posed with that much added.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fleet.stl.vocabulary import Clause

from .rows import Block


def shares(clauses: Sequence[Clause]) -> dict[str, float]:
    """Weight of every clause by its id, the heaviest 1: only ratios matter, and r is a margin in metres."""
    heaviest = max((c.weight for c in clauses), default=1.0)
    return {c.id: c.weight / heaviest for c in clauses}


def added(weight: float, asked: Any, level: float) -> Any:
    """What `weight * r` lacks at r = `level` of the margin `asked` (a number or an array) [m]."""
    return np.maximum(asked - weight * level, 0.0)


def weighed(blocks: Iterable[Block], weight: float, extra: float = 0.0) -> Iterator[Block]:
    """Rows that ask for a margin of r, asking for `weight * r + extra` [m] instead."""
    for b in blocks:
        plain = weight == 1.0 and extra == 0.0
        yield b if plain else replace(b, rhs=b.rhs - extra * b.rho, rho=weight * b.rho)


def slack_of(margin: float, weight: float, asked: float, level: float) -> float:
    """The common slack r that a margin [m] leaves, under rows that ask for `asked` [m] at r = `level`."""
    return float((margin - added(weight, asked, level)) / weight)
