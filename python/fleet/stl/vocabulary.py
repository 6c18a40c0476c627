"""The names and numbers that a formula text may use."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

Formula = dict[str, Any]
"""A formula in the serde form of `crates/core/src/formula/tree.rs`: `{"op": "always", "from": ...}`."""

_OPERATORS = ("always", "eventually", "until", "release", "G", "F", "U", "not", "and", "or", "all", "some")
_MORE = ("once", "historically", "since", "stay")
_PREDICATES = ("in", "outside", "dist", "workspace", "obstacles", "home", "T", "delta_min")
RESERVED = frozenset((*_OPERATORS, *_MORE, *_PREDICATES))
"""Words with a meaning of their own in formulas; nothing else may be called so."""

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")


def is_name(name: str) -> bool:
    """Whether `name` may stand in a formula and a key: a letter, then up to 31 letters, digits or _."""
    return _NAME.fullmatch(name) is not None and name.isascii()


@dataclass(frozen=True)
class Clause:
    """A named conjunct of the mission: its id, its source text and its tree, evaluated at time 0.

    `weight` scales the margin that the planner asks of the clause: with a common slack r it poses
    rho >= weight * r; the verdict is never weighted. When a mission cannot hold, clauses of smaller
    `priority` give way first.
    """

    id: str
    text: str
    formula: Formula
    weight: float = 1.0
    priority: int = 0


@dataclass(frozen=True)
class Vocabulary:
    """What a formula may speak of: drones, regions, T and T_s [s], delta_min [m].

    `regions` are those that are neither obstacles nor targets.
    """

    drones: tuple[str, ...]
    obstacles: tuple[str, ...]
    targets: tuple[str, ...]
    T: float
    T_s: float
    delta_min: float
    regions: tuple[str, ...] = ()

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the regions that a formula may name, but for the reserved ones."""
        return (*self.targets, *self.obstacles, *self.regions)

    def floor(self, time: float) -> float:
        """The last multiple of T_s that is not after `time` [s] (design.md, Windows).

        2T/3 at T = 110 and T_s = 0.05 gives 73.3. Applying it twice changes nothing.
        """
        return round(math.floor(time / self.T_s + 1e-6) * self.T_s, 9)
