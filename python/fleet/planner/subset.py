"""Parts of a mission: the problem of some of its clauses, and the least part that something is true of."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

from .problem import Problem
from .spec import Specification


def subset(problem: Problem, kept: Collection[str]) -> Problem:
    """The problem whose mission is the clauses in `kept`; limits, starts, horizon and homes stay."""
    spec = problem.spec
    return replace(
        problem,
        spec=Specification(
            visits=[v for v in spec.visits if v.clause in kept],
            homes=[h for h in spec.homes if h.clause in kept],
            invariants=[i for i in spec.invariants if i.clause in kept],
            rest=[r for r in spec.rest if r.clause in kept],
            kinds={clause: kind for clause, kind in spec.kinds.items() if clause in kept},
        ),
    )


def irreducible(items: tuple[str, ...], bad: Callable[[tuple[str, ...]], bool]) -> tuple[str, ...]:
    """A least part of `items` that is still bad (QuickXplain; Junker 2004), given that all of them are.

    `bad` must be monotone: what contains a bad part is bad.
    """

    def least(given: tuple[str, ...], grown: bool, open_: tuple[str, ...]) -> tuple[str, ...]:
        if grown and bad(given):
            return ()
        if len(open_) == 1:
            return open_
        one, other = open_[: len(open_) // 2], open_[len(open_) // 2 :]
        second = least((*given, *one), True, other)
        first = least((*given, *second), bool(second), one)
        return (*first, *second)

    if not items or bad(()):
        return ()
    found = set(least((), False, items))
    return tuple(item for item in items if item in found)
