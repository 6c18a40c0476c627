"""The upper bound of rho: the least of what each clause could reach alone, weighted and not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fleet.errors import InfeasibleError

from .problem import Problem


@dataclass(frozen=True)
class Ceiling:
    """What one clause could reach alone [m], and in words why no more; `fixed` if the tube applies twice."""

    rho: float
    clause: str
    why: str
    pair: bool = False


def ceilings(problem: Problem) -> Iterator[Ceiling]:
    """What each clause could reach alone: from the size of its regions and the start state."""
    for visit in problem.spec.visits:
        region = max((r for _, r in visit.options), key=lambda r: problem.inradii[r])
        yield Ceiling(problem.inradii[region], visit.clause, f"the largest ball inside {region}")
    for home in problem.spec.homes:
        yield Ceiling(problem.inradii[home.region], home.clause, f"the largest ball inside {home.region}")
    for inv in problem.spec.invariants:
        d = problem.number(inv.drones[0])
        p = problem.starts[d]
        at_start = inv.window[0] <= 0
        if inv.kind == "inside":
            yield Ceiling(problem.inradii[inv.region], inv.clause, f"the largest ball inside {inv.region}")
        if inv.kind == "inside" and at_start:
            faces = problem.regions[inv.region]
            rho = float((faces[:, 3] - faces[:, :3] @ p).min())
            yield Ceiling(rho, inv.clause, f"the start of {inv.drones[0]} inside {inv.region}")
        if inv.kind == "outside" and at_start:
            faces = problem.regions[inv.region]
            rho = float((faces[:, :3] @ p - faces[:, 3]).max())
            yield Ceiling(rho, inv.clause, f"the start of {inv.drones[0]} outside {inv.region}")
        if inv.kind == "linear" and at_start:
            rho = float(np.dot(inv.row[:3], p) + inv.row[3])
            yield Ceiling(rho, inv.clause, f"the start of {inv.drones[0]}")
    for a, b, inv in problem.pairs():
        if inv.window[0] <= 0:
            rho = float(np.linalg.norm(problem.starts[a] - problem.starts[b])) - inv.value
            why = f"the starts of {problem.ids[a]} and {problem.ids[b]}, at least {inv.value:g} m apart"
            yield Ceiling(rho, inv.clause, why, pair=True)


def rho_bound(problem: Problem) -> float:
    """The least ceiling [m], whatever the weights; infinite for a mission of `rest` alone.

    Raises InfeasibleError when a clause cannot reach what the tube asks (design.md, Tube).
    """
    found = list(ceilings(problem))
    for c in found:
        asked = 2 * problem.tube if c.pair else problem.tube
        if c.rho < asked - 1e-9:
            margin = "2 x tube" if c.pair else "tube"
            text = f"{c.why}: margin {c.rho:.2f} m, and {margin} asks for {asked:.2f} m"
            raise InfeasibleError(text, clause=c.clause)
    return min((c.rho for c in found), default=np.inf)


def slack_bound(problem: Problem) -> float:
    """Upper bound of the common slack r: the least ceiling over its clause's weight (weights.py)."""
    return min((c.rho / problem.weight(c.clause) for c in ceilings(problem)), default=np.inf)
