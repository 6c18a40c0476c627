"""Bounded planning of parts of a mission: is there a plan at all, never mind how good?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from fleet.assign import EXACT
from fleet.errors import InfeasibleError, Need

from . import convex, groups
from .ceiling import rho_bound
from .knots import Array
from .problem import Problem
from .reach import Reach, needs
from .schedule import Itinerary, leg_times, schedules, survey
from .setup import Setup, warm_start
from .shortfall import shortfalls
from .sketch import sketched
from .subset import subset

#: Margin above the tube at which a trial is content [m].
CONTENT = 0.02
#: Unknowns times convex steps that all trials of one search may take; about 5 s on a 2020s processor.
BUDGET = 4_000_000
#: Clearance at which routes are sought when nothing bounds it [m].
WIDEST = 5.0
#: Places that are surveyed as a whole for the words of a refusal.
SURVEYED = 40


class ExhaustedError(Exception):
    """The trials have taken all the steps that they may."""


@dataclass
class Trials:
    """Trials of parts of one mission within a common budget; answers are kept."""

    task: Problem
    left: int = BUDGET
    exhausted: bool = False
    known: dict[tuple[str, ...], str | None] = field(default_factory=dict)

    def plans(self, clauses: tuple[str, ...]) -> bool:
        """Whether a plan was found for these clauses; taken for granted once the budget is spent."""
        key = tuple(c for c in self.task.spec.kinds if c in clauses)
        if key not in self.known:
            if self.exhausted:
                return True
            try:
                self.known[key] = self.attempt(subset(self.task, key))
            except ExhaustedError:
                self.exhausted = True
                return True
        return self.known[key] is None

    def why(self, clauses: tuple[str, ...]) -> str | None:
        """Why no plan was found for these clauses; None if one was, or they were not tried."""
        return self.known.get(clauses)

    def attempt(self, task: Problem) -> str | None:
        """Plan a part, weights aside: None when that worked, else why it did not."""
        task = replace(task, weights={})
        try:
            bound = min(rho_bound(task), WIDEST)
            ways = routed(task, bound)
        except InfeasibleError as error:
            return error.problems[0].message
        why = None
        for way in ways:
            flight = groups.fly(task, way, min(bound, task.tube + CONTENT), self.enough)
            if flight.margins.share <= 1 and flight.margins.tube >= -1e-6:
                return None
            why = why or shortfalls(task, way, flight)
        return why

    def enough(self, stage: Setup, progress: groups.Progress | None) -> tuple[Array, convex.Margins]:
        """Convex steps until limits and the tube's margins are kept."""
        best: tuple[Array, convex.Margins, convex.Steps] | None = None
        start = warm_start(stage)
        for lift in convex.LIFTS:
            if self.left <= 0:
                raise ExhaustedError
            steps = convex.Steps.of(stage)
            x, margins, count = convex.climb(steps, start, lift)
            self.left -= count * stage.grid.size
            if best is None or convex.better(margins, best[1]):
                best = (x, margins, steps)
            if (best[1].share <= 1 and best[1].tube >= -1e-6) or not convex.blames_pair(best):
                break
        assert best is not None, "there is always a first lift"
        return best[:2]

    def times(self, task: Problem) -> Iterator[Need]:
        """Times at which the visits of a part can be made along the ways that were found."""
        n = len(task.spec.visits)
        if not 0 < n <= EXACT or n + len(task.ids) > SURVEYED:
            return
        world = survey(task, task.tube)
        reach = Reach(task, tuple(task.spec.visits), leg_times(task, world, None))
        yield from (m for m in needs(reach) if m.region not in task.homes or m.needs_s > m.by_s + 1e-9)


def routed(task: Problem, bound: float) -> list[Itinerary]:
    """Itineraries of a part, with the visits that its `rest` needs if that works.

    Raises InfeasibleError when there is none.
    """
    if task.spec.rest:
        try:
            return list(schedules(sketched(task, bound), bound))
        except InfeasibleError:
            pass  # the convex steps may still find a way that the sketch did not
    return list(schedules(task, bound))
