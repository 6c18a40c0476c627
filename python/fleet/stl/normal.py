"""The planner's view of a mission: events to time, invariants to keep, and the rest.

Only shapes that mean exactly the same are taken apart; whatever is not recognised stays in `rest`
as it is, so that nothing of the mission is lost (design.md, The planner, step 1).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fleet.stl.vocabulary import Clause, Formula


@dataclass(frozen=True)
class Visit:
    """One drone inside one region at one time."""

    drone: str
    region: str


@dataclass(frozen=True)
class Event:
    """At some time in `window` [s], closed, at least one of `choices` holds, from then on for `dwell` [s]."""

    clause: str
    window: tuple[float, float]
    choices: tuple[Visit, ...]
    dwell: float = 0.0


@dataclass(frozen=True)
class Gather:
    """At some time in `window` [s], closed, all of `visits` hold at once; all drones home, say."""

    clause: str
    window: tuple[float, float]
    visits: tuple[Visit, ...]


@dataclass(frozen=True)
class Invariant:
    """A predicate (`in`, `outside`, `dist` or `linear`) that holds all the time from 0 to T."""

    clause: str
    predicate: Formula


@dataclass(frozen=True)
class Rest:
    """A conjunct of another shape."""

    clause: str
    formula: Formula


@dataclass(frozen=True)
class NormalForm:
    """A mission that holds exactly when all of its parts hold; each part in order of the clauses."""

    events: tuple[Event, ...]
    gathers: tuple[Gather, ...]
    invariants: tuple[Invariant, ...]
    rest: tuple[Rest, ...]


def normal_form(clauses: Iterable[Clause], T: float) -> NormalForm:
    """Takes the clauses apart, for a mission of T seconds."""
    parts = [part for clause in clauses for part in _parts(clause.id, clause.formula, T)]
    return NormalForm(
        tuple(part for part in parts if isinstance(part, Event)),
        tuple(part for part in parts if isinstance(part, Gather)),
        tuple(part for part in parts if isinstance(part, Invariant)),
        tuple(part for part in parts if isinstance(part, Rest)),
    )


def drones_of(formula: Formula) -> list[str]:
    """The drones that a formula speaks of, in order of first appearance."""
    return list(dict.fromkeys(_mentions(formula)))


def places_of(formula: Formula) -> list[Visit]:
    """The drones inside regions that a formula speaks of, in order of first appearance."""
    if formula["op"] == "in":
        return [Visit(formula["drone"], formula["region"])]
    return list(dict.fromkeys(place for child in children(formula) for place in places_of(child)))


def _mentions(formula: Formula) -> Iterator[str]:
    op = formula["op"]
    if op in {"in", "outside"}:
        yield formula["drone"]
    elif op == "dist":
        yield from (formula["a"], formula["b"])
    elif op == "linear":
        yield from (term["drone"] for term in formula["terms"])
    else:
        for child in children(formula):
            yield from _mentions(child)


def children(formula: Formula) -> list[Formula]:
    """The operands of a formula, left to right; none for a predicate."""
    if "fs" in formula:
        return list(formula["fs"])
    if "f" in formula:
        return [formula["f"]]
    return [formula[side] for side in ("left", "right") if side in formula]


def _parts(clause: str, formula: Formula, T: float) -> Iterator[Event | Gather | Invariant | Rest]:
    conjuncts = _flat(formula, "and")
    if len(conjuncts) > 1:
        for conjunct in conjuncts:
            yield from _parts(clause, conjunct, T)
    elif formula["op"] == "always":
        yield from _always(clause, formula, T)
    elif (event := _event(clause, formula)) is not None:
        yield event
    else:
        yield Rest(clause, formula)


def _always(clause: str, formula: Formula, T: float) -> Iterator[Event | Gather | Invariant | Rest]:
    """`always` distributes over `and`; what is then a predicate over all of [0, T] is an invariant."""
    whole = formula["from"] <= 0 and formula["to"] >= T - 1e-9
    for part in _flat(formula["f"], "and"):
        if whole and part["op"] in {"in", "outside", "dist", "linear"}:
            yield Invariant(clause, part)
        else:
            yield Rest(clause, {**formula, "f": part})


def _event(clause: str, formula: Formula) -> Event | Gather | None:
    """`eventually` of visits or stays, or such over one window in a disjunction (`some d: eventually`)."""
    branches = _flat(formula, "or")
    if any(branch["op"] != "eventually" for branch in branches):
        return None
    windows = {(branch["from"], branch["to"]) for branch in branches}
    if len(windows) != 1:
        return None
    window = windows.pop()
    stays = [_stay(part) for branch in branches for part in _flat(branch["f"], "or")]
    dwells = {stay[1] for stay in stays if stay is not None}
    if None not in stays and len(dwells) == 1:
        return Event(clause, window, tuple(stay[0] for stay in stays if stay is not None), dwells.pop())
    together = [_visit(part) for part in _flat(formula["f"], "and")] if len(branches) == 1 else [None]
    if None not in together:
        return Gather(clause, window, tuple(visit for visit in together if visit is not None))
    return None


def _stay(formula: Formula) -> tuple[Visit, float] | None:
    """A visit and how long it lasts [s]: `in`, or `always[0,D]` of it."""
    stays = formula["op"] == "always" and formula["from"] <= 0
    visit = _visit(formula["f"] if stays else formula)
    return None if visit is None else (visit, float(formula["to"]) if stays else 0.0)


def _visit(formula: Formula) -> Visit | None:
    return Visit(formula["drone"], formula["region"]) if formula["op"] == "in" else None


def _flat(formula: Formula, op: str) -> list[Formula]:
    """The operands of nested `op`s in one list; the formula itself when it is none."""
    if formula["op"] != op:
        return [formula]
    return [part for f in formula["fs"] for part in _flat(f, op)]
