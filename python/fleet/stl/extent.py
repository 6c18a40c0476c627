"""How much a formula asks to be evaluated, and whether it is decided before anything is flown."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fleet import _core
from fleet.stl.normal import children, drones_of
from fleet.stl.vocabulary import Clause, Formula

MAX_POSITIONS = 8_000_000
"""Positions, samples times drones, that are held at once; 24 bytes each, and twice in all."""
MAX_VALUES = 400_000_000
"""Values of predicates, samples times predicates, that proving a plan computes."""
PAST = frozenset(("once", "historically", "since"))


def predicates_of(formula: Formula) -> int:
    """Number of predicates in a formula, quantifiers expanded."""
    below = children(formula)
    return sum(map(predicates_of, below)) if below else 1


def too_large(clauses: list[Clause], drones: int, T: float, T_s: float) -> str | None:
    """Why a mission of T [s] is not evaluated at samples of T_s [s]; None when it can be."""
    samples = round(T / T_s) + 1
    values = samples * sum(predicates_of(clause.formula) for clause in clauses)
    asked = f"T = {T:g} s holds {samples} samples, with {drones} drones"
    if samples * drones > MAX_POSITIONS:
        most = f"at most {MAX_POSITIONS} are legal"
        return f"{asked} {samples * drones} positions, and {most}; choose a longer T_s"
    if values > MAX_VALUES:
        most = f"at most {MAX_VALUES} are legal"
        return f"{asked} and the formula {values} values of predicates, and {most}; choose a longer T_s"
    return None


def decided(clause: Clause, T_s: float) -> bool | None:
    """Whether a clause is true, or false, whatever is flown; None where it depends on the flight.

    Only windows that look back beyond mission time 0 decide so: they give robustness without bound,
    and any flight shows it.
    """
    if not PAST & set(_operators(clause.formula)):
        return None
    fleet = _core.Fleet(drones_of(clause.formula), _anywhere(clause.formula))
    samples = round(fleet.check(clause.formula, T_s) / T_s) + 1
    rho, _ = fleet.evaluate(clause.formula, np.zeros((len(fleet.drones), samples, 3)), T_s)
    return None if np.isfinite(rho) else rho > 0


def _operators(formula: Formula) -> Iterator[str]:
    yield formula["op"]
    for child in children(formula):
        yield from _operators(child)


def _anywhere(formula: Formula) -> list[dict[str, object]]:
    """A region of some shape for every name."""
    faces = [{"a": [float(s * (i == k)) for k in range(3)], "b": 1.0} for i in range(3) for s in (1, -1)]
    return [{"name": name, "shape": faces} for name in sorted(set(_regions(formula)))]


def _regions(formula: Formula) -> Iterator[str]:
    if "region" in formula:
        yield formula["region"]
    for child in children(formula):
        yield from _regions(child)
