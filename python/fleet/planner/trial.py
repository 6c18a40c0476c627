"""Bounded planning of parts of a mission: is there a plan at all, never mind how good?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from fleet.assign import EXACT
from fleet.errors import InfeasibleError, Need

from . import convex, groups
from .ceiling import rho_bound
from .choices import ambiguous
from .knots import Array
from .leg_times import leg_times
from .problem import Problem
from .progress import Progress, silent
from .reach import Reach, needs
from .result import trajectory
from .schedule import FEW, Itinerary, schedules
from .setup import Setup, warm_start
from .shortfall import shortfalls
from .sketch import sketched
from .subset import subset
from .survey import survey

#: Margin above the tube at which a trial is content [m].
CONTENT = 0.02
#: Unknowns times convex steps that all trials of one search may take; 5 to 10 s on a processor of 2020.
BUDGET = 150_000
#: What routing costs a trial, in the same measure.
ROUTING = 1_000
#: Clearance at which routes are sought when nothing bounds it [m].
WIDEST = 5.0
#: Places that are surveyed as a whole for the words of a refusal.
SURVEYED = 40


class ExhaustedError(Exception):
    """The trials have taken all the steps that they may."""


class ShortError(Exception):
    """Trajectories of a part of the fleet that do not keep limits or the tube's margins."""

    def __init__(self, stage: Setup, x: Array, margins: convex.Margins) -> None:
        super().__init__(f"margin {margins.tube:.3f} m over the tube")
        self.stage, self.x, self.margins = stage, x, margins

    def why(self) -> str:
        """What falls short, in words."""
        task, way, grid = self.stage.problem, self.stage.itinerary, self.stage.grid
        tracks = [trajectory(task, way, grid, self.x, d) for d in range(len(task.ids))]
        return shortfalls(task, way, tracks, self.margins)

    def clauses(self) -> frozenset[str]:
        """The clauses whose visits the drones of this part make."""
        return frozenset(s.visit.clause for stops in self.stage.itinerary.stops for s in stops)


def kept(margins: convex.Margins) -> bool:
    """Whether limits and the tube's margins are kept."""
    return margins.share <= 1 and margins.tube >= -1e-6


@dataclass
class Trials:
    """Trials of parts of one mission within a common budget; answers are kept.

    `failing` has the clauses whose visits are made by the drones that fell short last.
    """

    task: Problem
    left: int = BUDGET
    tell: Progress = silent
    exhausted: bool = False
    known: dict[tuple[str, ...], str | None] = field(default_factory=dict)
    failing: frozenset[str] = frozenset()

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

    def succeeds(self, task: Problem) -> bool:
        """Whether a plan was found for a problem; not once the budget is spent."""
        try:
            return not self.exhausted and self.attempt(task) is None
        except ExhaustedError:
            self.exhausted = True
            return False

    def why(self, clauses: tuple[str, ...]) -> str | None:
        """Why no plan was found for these clauses; None if one was, or they were not tried."""
        return self.known.get(clauses)

    def attempt(self, task: Problem) -> str | None:
        """Plan a part, weights aside: None when that worked, else why it did not."""
        task = replace(task, weights={})
        self.left -= ROUTING
        self.tell("explain", np.nan)
        try:
            bound = min(rho_bound(task), WIDEST)
            ways = routed(task, bound)
        except InfeasibleError as error:
            return error.problems[0].message
        if not task.spec.changing(task.horizon):
            ways = [*ways[:1], *ways[3:]]  # visits that are only earlier or later help where rules change
        why = None
        for way in ways:
            try:
                groups.fly(task, way, min(bound, task.tube + CONTENT), self.enough)
            except ShortError as short:
                why = why or short.why()
                self.failing = short.clauses()
            else:
                return None
        return why

    def enough(self, stage: Setup, progress: groups.Progress | None) -> tuple[Array, convex.Margins]:
        """Convex steps until limits and the tube's margins are kept.

        Raises ShortError when they are not: the other parts of the fleet need not be looked at.
        """
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
            if kept(best[1]) or not convex.blames_pair(best):
                break
        assert best is not None, "there is always a first lift"
        if not kept(best[1]):
            raise ShortError(stage, best[0], best[1])
        return best[:2]

    def times(self, task: Problem) -> Iterator[Need]:
        """Times at which the visits of a part can be made along the ways that were found."""
        n = len(task.spec.visits)
        if not 0 < n <= EXACT or n + len(task.ids) > SURVEYED or any(map(ambiguous, task.spec.visits)):
            return
        world = survey(task, task.tube, local=len(task.ids) > FEW)
        reach = Reach(task, tuple(task.spec.visits), leg_times(task, world, None))
        yield from (m for m in needs(reach) if m.region not in task.homes or m.needs_s > m.by_s + 1e-9)


def routed(task: Problem, bound: float) -> list[Itinerary]:
    """Itineraries of a part, with the visits that its `rest` needs if that works; large fleets locally.

    Raises InfeasibleError when there is none.
    """
    if task.spec.rest:
        try:
            return list(schedules(sketched(task, bound), bound, whole=False))
        except InfeasibleError:
            pass  # the convex steps may still find a way that the sketch did not
    return list(schedules(task, bound, whole=False))
