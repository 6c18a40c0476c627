"""Why there is no plan: the smallest set of clauses found that cannot hold together, in words.

Cheap proofs come first: margins that no place offers, times that no drone can make (necessary.py,
reach.py). Where nothing is proved, parts of the mission are planned for, in a bounded number of convex
steps, until no clause can be left out of a part without a plan; that is a search without result and is
called one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING

from fleet.errors import Conflict, InfeasibleError, Need

from .judge import Judge
from .necessary import Geometry, Impossible, impossible_margins
from .problem import Problem
from .progress import Progress, TimeUp, silent
from .reach import least_times, misfits, needs
from .spec import negation_normal
from .subset import irreducible, subset
from .trial import Trials

if TYPE_CHECKING:
    from fleet.scenario import Scenario

#: Clauses that are looked at one by one before a conflict of several is told.
FEW = 24


@dataclass
class Court:
    """A mission that has no plan, and what it takes to find out why."""

    scenario: Scenario
    task: Problem
    tell: Progress = silent

    def verdict(self, error: InfeasibleError) -> InfeasibleError:
        """The error with a conflict: as it is if it has one, else proved, else searched for."""
        if error.conflict is not None:
            return error
        try:
            return self.proof or self.search(error)
        except TimeUp as end:
            end.refusal = error
            raise

    def refuse_proved(self) -> None:
        """Raises InfeasibleError if a conflict is proved; asked again, it costs nothing."""
        if self.proof is not None:
            raise self.proof

    @cached_property
    def proof(self) -> InfeasibleError | None:
        """The error that says which clauses cannot hold, with a proof; None when nothing is proved."""
        found = next(self.impossible(self.task), None)
        if found is None:
            return None
        least = self.hopeless_alone or irreducible(found.clauses, self.hopeless)
        part = subset(self.task, least)
        again = next(self.impossible(part), found)
        # The clauses that are left may be forbidden by another proof than all of them were.
        times = tuple(reached(part, least))
        minimal = self.freed(least)
        return refusal(self.task, Conflict(least, True, minimal, again.why, times))

    @property
    def hopeless_alone(self) -> tuple[str, ...]:
        """A clause that no plan can keep whatever the others say, if there is one: the smallest conflict."""
        clauses = tuple(self.task.spec.kinds)
        alone = (c for c in clauses if len(clauses) <= FEW and self.hopeless((c,)))
        return tuple(islice(alone, 1))

    def hopeless(self, clauses: tuple[str, ...]) -> bool:
        """Whether these clauses are proved to be impossible together."""
        return next(self.impossible(subset(self.task, clauses)), None) is not None

    def impossible(self, task: Problem) -> Iterator[Impossible]:
        """Proofs that a mission cannot hold."""
        yield from impossible_margins(task)
        yield from impossible_times(task)
        yield from self.impossible_formulas(task)

    def impossible_formulas(self, task: Problem) -> Iterator[Impossible]:
        """Clauses that are false by regions, reach and the mission's own invariants alone."""
        judge = Judge(self.scenario, task.spec.invariants)
        for clause in self.scenario.clauses():
            # The windows of visits are those of the problem, not of the text: a deadline may have given way.
            if task.spec.kinds.get(clause.id) in ("rest", "invariant"):
                found = judge.over(negation_normal(clause.formula), 0.0, 0.0)
                if found is not None and not found.true:
                    supporting = [i.clause for i in task.spec.invariants]
                    yield Impossible(tuple(dict.fromkeys([clause.id, *supporting])), found.why)

    def freed(self, clauses: tuple[str, ...]) -> bool:
        """Whether a plan is found without any one of the clauses, within the trials' bounds."""
        trials = Trials(self.task, tell=self.tell)
        return all(trials.plans(tuple(c for c in clauses if c != left_out)) for left_out in clauses)

    def search(self, error: InfeasibleError) -> InfeasibleError:
        """The error that names a least set of clauses for which no plan was found."""
        trials = Trials(self.task, tell=self.tell)
        clauses = tuple(self.task.spec.kinds)
        if trials.plans(clauses):
            # The bounded trial kept all margins, and yet no plan was certified: those words are best.
            text = error.problems[0].message
            return refusal(self.task, Conflict((error.clause,) if error.clause else (), False, False, text))
        least = irreducible(clauses, lambda kept: not trials.plans(kept))
        why = trials.why(least) or str(error)
        part = subset(self.task, least)
        times = tuple(trials.times(part))
        return refusal(self.task, Conflict(least, False, not trials.exhausted, why, times), trials.exhausted)


def impossible_times(task: Problem) -> Iterator[Impossible]:
    """Visits that no drones can make in their windows and be home at T."""
    geometry = Geometry(task)
    reach = least_times(task, geometry)
    for index in misfits(reach):
        late = [need for need in needs(reach.part(index)) if need.needs_s > need.by_s + 1e-9]
        visits = [reach.visits[e] for e in index]
        names = " and ".join(dict.fromkeys(v.options[0][1] for v in visits))
        why = "; ".join(map(str, late)) or f"no drone can make the visit of {names}"
        barring = [
            inv.clause
            for v in visits
            for d, region in v.options
            if (inv := geometry.barred(d, region, v.window)) is not None
        ]
        yield Impossible(tuple(dict.fromkeys([*(v.clause for v in visits), *barring])), why)


def reached(task: Problem, clauses: tuple[str, ...]) -> list[Need]:
    """Earliest times of the visits of a mission, and of coming home where that is what comes too late."""
    reach = least_times(task, Geometry(task))
    visits = [e for e, v in enumerate(reach.visits) if v.clause in clauses]
    return told(task, needs(reach.part(visits))) if visits else []


def told(task: Problem, times: list[Need]) -> list[Need]:
    """Times without those of coming home in time, which say nothing."""
    return [n for n in times if n.region not in task.homes or n.needs_s > n.by_s + 1e-9]


def refusal(task: Problem, conflict: Conflict, exhausted: bool = False) -> InfeasibleError:
    """The error of a conflict: verdict, reason, and the conditions of flight, which hold in any case."""
    verdict = "cannot hold (proved)" if conflict.proved else "no plan was found"
    if len(conflict.clauses) > 1:
        verdict = "cannot hold together (proved)" if conflict.proved else "no plan was found for all of them"
    limits = f"v_max = {task.v_max:g} m/s, a_max = {task.a_max:g} m/s^2"
    flight = f"from rest at the start to rest at home at T = {task.horizon:g} s"
    orders = ", the assignment made by hand" if task.given else ""
    given = f"given {limits}, a tube of {task.tube:g} m, flight {flight}{orders}"
    rest = "; whether fewer clauses conflict was not examined to the end" if exhausted else ""
    error = InfeasibleError(f"{verdict}: {conflict.text} ({given}{rest})", conflict=conflict)
    for need in conflict.times:
        if str(need) not in conflict.text:
            error.add_note(f"  {need}")
    return error
