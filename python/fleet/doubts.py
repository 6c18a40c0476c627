"""What a mission formula says in vain: clauses that cannot hold, hold in any case, or repeat others.

Only what can be told for certain from regions, start positions, limits and the other clauses is said;
silence is no promise that a plan exists.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fleet.planner.conflict import Court
from fleet.planner.judge import Judge
from fleet.planner.problem import problem
from fleet.planner.spec import Specification, Visit, negation_normal, specification
from fleet.planner.subset import irreducible

if TYPE_CHECKING:
    from fleet.scenario import Scenario
    from fleet.stl import Clause


@dataclass(frozen=True)
class Doubt:
    """A clause and what is wrong with it.

    `code` is "contradictory" (it cannot hold, with `others` if it takes them), "vacuous" (it holds
    whatever is flown) or "implied" (it holds where `others` do).
    """

    clause: str
    code: str
    message: str
    others: tuple[str, ...] = ()


def doubts(scenario: Scenario) -> list[Doubt]:
    """Clauses of a scenario that cannot hold, or that say nothing, in the order of the formula."""
    clauses = scenario.clauses()
    form = specification(clauses, float(scenario.mission.T))
    found = {d.clause: d for d in (*contradictory(scenario, clauses, form), *idle(scenario, clauses, form))}
    if not any(d.code == "contradictory" for d in found.values()):
        found |= {d.clause: d for d in conflicting(scenario)}
    return [found[c.id] for c in clauses if c.id in found]


def contradictory(scenario: Scenario, clauses: list[Clause], form: Specification) -> Iterator[Doubt]:
    """Clauses that are false whatever is flown that keeps the others."""
    judge = Judge(scenario, form.invariants)
    for clause in clauses:
        sure = judge.over(negation_normal(clause.formula), 0.0, 0.0)
        if sure is not None and not sure.true:
            others = tuple(c for c in sure.by if c != clause.id)
            yield Doubt(clause.id, "contradictory", sure.why, others)


def idle(scenario: Scenario, clauses: list[Clause], form: Specification) -> Iterator[Doubt]:
    """Clauses that are true whatever is flown, or that is flown to keep others; of two alike, the later."""
    bare = Judge(scenario, [])
    kept = {c.id for c in clauses}
    for clause in reversed(clauses):
        formula = negation_normal(clause.formula)
        sure = bare.over(formula, 0.0, 0.0)
        if sure is not None and sure.true:
            kept.discard(clause.id)
            yield Doubt(clause.id, "vacuous", sure.why)
            continue
        rest = kept - {clause.id}
        given = [i for i in form.invariants if i.clause in rest]
        sure = Judge(scenario, given, trusting=True).over(formula, 0.0, 0.0)
        if sure is not None and sure.true:
            kept.discard(clause.id)
            yield Doubt(clause.id, "implied", sure.why, sure.by)
            continue
        twin = next((c for c in clauses if c.id in rest and c.formula == clause.formula), None)
        if twin is not None:
            kept.discard(clause.id)
            yield Doubt(clause.id, "implied", f"@{twin.id} says the same", (twin.id,))
            continue
        visits = repeated_visits(scenario, clause.id, form, rest)
        if visits:
            kept.discard(clause.id)
            others = tuple(dict.fromkeys(v.clause for v in visits))
            names = " and ".join(f"@{c}" for c in others)
            what = "the visit" if len(others) == 1 else "the visits"
            yield Doubt(clause.id, "implied", f"{what} of {names} will do", others)


def repeated_visits(scenario: Scenario, clause: str, form: Specification, rest: set[str]) -> list[Visit]:
    """Visits of the clauses `rest` that make all visits of a clause that asks for nothing else; or none."""
    own = [v for v in form.visits if v.clause == clause]
    others = {p.clause for parts in (form.homes, form.invariants, form.rest) for p in parts}
    if not own or clause in others:
        return []
    regions = {r.name: r for r in scenario.every_region}

    def does(visit: Visit, wish: Visit) -> bool:
        """Whether whoever makes `visit` makes the wished one."""
        in_time = wish.window[0] <= visit.window[0] and visit.window[1] <= wish.window[1]
        return (
            in_time
            and visit.dwell >= wish.dwell
            and all(
                any(d == other and regions[r].covers(regions[region]) for other, r in wish.options)
                for d, region in visit.options
            )
        )

    made = [v for v in form.visits if v.clause in rest]
    found = [next((v for v in made if does(v, wish)), None) for wish in own]
    return [v for v in found if v is not None] if None not in found else []


def conflicting(scenario: Scenario) -> Iterator[Doubt]:
    """A smallest set of clauses that no flight within the limits can hold together."""
    task = problem(scenario)
    court = Court(scenario, task)
    found = next(court.impossible(task), None)
    if found is None or not found.clauses:
        return
    least = irreducible(found.clauses, court.hopeless)
    if least:
        *others, last = least
        again = " together with " + " and ".join(f"@{c}" for c in others) if others else ""
        yield Doubt(last, "contradictory", f"it cannot hold{again}: {found.why}", tuple(others))
