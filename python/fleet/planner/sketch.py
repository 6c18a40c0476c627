"""A first guess for clauses without a normal form: the visits that would keep them, to route and to time.

The convex steps only move a trajectory a little at a time. Here the duties of the routed trajectory
become further visits (or narrower windows of visits that there are), the itinerary is made again, and so
on until nothing changes. What comes out is a warm start, never a proof.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from fleet.errors import InfeasibleError
from fleet.route import leg_time

from .duty import Anchor, Duty
from .problem import Problem
from .schedule import Itinerary, schedules
from .setup import setup, warm_start
from .signals import Signals, positions
from .spec import Visit
from .witness import choose

#: Itineraries made in turn at most.
ROUNDS = 12
#: Share of the room left by which a meeting, or the end of an order, moves later when it was out of reach.
LATER = 0.25
#: Robustness that stands for "a visit forbids it" [m].
FORBIDDEN = -1e3


@dataclass
class Sketch:
    """What was learned so far: `pins` sample of each shared witness, `avoided` branches out of reach."""

    problem: Problem
    bound: float
    pins: dict[str, float] = field(default_factory=dict)
    avoided: set[tuple[str, int]] = field(default_factory=set)

    def duties(self, way: Itinerary) -> tuple[list[Duty], Signals]:
        """Duties of the routed trajectory; what its visits need counts as given."""
        stage = setup(self.problem, way, self.bound)
        signals = Signals.of(self.problem, positions(self.problem, stage.grid, warm_start(stage)))
        found = given(self.problem, way, signals, self.bound)
        return choose(self.problem.spec.rest, found, self.bound, avoided=self.avoided, sketch=True), found

    def visits(self, duties: list[Duty], signals: Signals) -> list[Visit]:
        """The mission's visits, with those that the duties need put in."""
        T_s, visits = self.problem.sample, list(self.problem.spec.visits)
        groups: dict[str, list[Duty]] = {}
        for duty in duties:
            if duty.anchor is not None:
                groups.setdefault(duty.anchor.key, []).append(duty)
        for key, group in groups.items():
            for duty in group:
                if duty.predicate["op"] == "outside" and self.postpone(visits, duty, key):
                    self.pins.setdefault(f"{key} ends", duty.last)
        placed: set[tuple[str, str, int]] = set()
        for duty in duties:
            f = duty.predicate
            if f["op"] != "in" or f["region"] == self.problem.workspace:
                continue
            if duty.anchor is not None:
                # Nobody is sent to two places at once; where regions overlap the convex steps see to it.
                mark = (duty.anchor.key, f["drone"], duty.first)
                if mark in placed:
                    continue
                placed.add(mark)
            dwell = (duty.last - duty.first) * T_s
            if duty.anchor is None:
                if signals.of_part(f)[duty.first : duty.last + 1].min() > 0:
                    continue
                window = (duty.first * T_s, duty.first * T_s)
            else:
                low, high = self.room(duty.anchor)
                window = (
                    (low + duty.first - duty.anchor.at) * T_s,
                    (high + duty.first - duty.anchor.at) * T_s,
                )
            option = (f["drone"], f["region"])
            wish = Visit(duty.clause, (option,), (round(window[0], 9), round(window[1], 9)), dwell)
            put_in(visits, wish, self.problem.weight)
        return visits

    def room(self, anchor: Anchor) -> tuple[float, float]:
        """Where a witness may be [samples]: one place once its drones have a common time."""
        if anchor.key in self.pins:
            return self.pins[anchor.key], self.pins[anchor.key]
        return anchor.low, min(anchor.high, max(self.pins.get(f"{anchor.key} ends", np.inf), anchor.low))

    def postpone(self, visits: list[Visit], duty: Duty, key: str) -> bool:
        """Put visits that an order forbids at first after its witness; whether there were any."""
        T_s = self.problem.sample
        end = self.pins.get(f"{key} ends", duty.last) * T_s
        after = end + leg_time(2 * self.bound, self.problem.v_max, self.problem.a_max)
        after = float(np.ceil(after / T_s) * T_s)
        option, changed = (duty.predicate["drone"], duty.predicate["region"]), False
        for k, v in enumerate(visits):
            if option in v.options and duty.first * T_s <= v.window[0] < after < v.window[1]:
                visits[k] = replace(v, window=(round(after, 9), v.window[1]))
                changed = True
        return changed

    def meet(self, way: Itinerary, duties: list[Duty]) -> None:
        """Pin witnesses that several visits share to the time at which the last of them can be there."""
        groups: dict[str, list[Duty]] = {}
        for duty in duties:
            if duty.anchor is not None and duty.predicate["op"] == "in":
                groups.setdefault(duty.anchor.key, []).append(duty)
        for key, group in groups.items():
            if len(group) < 2 or key in self.pins:
                continue
            times = [t - (d.first - d.anchor.at) for d in group if d.anchor for t in self.reached(way, d)]
            if times:
                anchor = group[0].anchor
                assert anchor is not None, "groups are of anchored duties"
                self.pins[key] = float(np.clip(max(times), anchor.low, anchor.high))

    def reached(self, way: Itinerary, duty: Duty) -> Iterator[float]:
        """Sample of the stop that keeps a duty, if there is one within its room."""
        f = duty.predicate
        assert duty.anchor is not None, "only anchored duties are asked for"
        low, high = self.room(duty.anchor)
        for stop in way.stops[self.problem.number(f["drone"])]:
            at = stop.t / self.problem.sample
            if stop.region == f["region"] and low - 1 <= at - (duty.first - duty.anchor.at) <= high + 1:
                yield float(round(at))
                return

    def learn(self, error: InfeasibleError, duties: list[Duty]) -> bool:
        """Try shared witnesses later, then other branches; whether anything is left to try."""
        mine = [d for d in duties if d.clause == error.clause] or duties
        for duty in mine:
            for key in (duty.anchor.key, f"{duty.anchor.key} ends") if duty.anchor else ():
                if key in self.pins and duty.anchor and self.pins[key] < duty.anchor.high - 1:
                    step = max(1.0, LATER * (duty.anchor.high - self.pins[key]))
                    self.pins[key] = float(np.ceil(self.pins[key] + step))
                    return True
        fresh = {b for d in mine for b in d.branches if b not in self.avoided}
        if not fresh:
            return False
        self.avoided |= fresh
        self.pins.clear()
        return True


def given(problem: Problem, way: Itinerary, signals: Signals, bound: float) -> Signals:
    """Signals under which staying out of a region is hopeless around its visits, and no matter otherwise."""
    # No more than it takes to fly in and out again: the convex steps may hasten a slow warm start.
    reach = signals.index(leg_time(2 * bound, problem.v_max, problem.a_max))
    for d, stops in enumerate(way.stops):
        for stop in stops:
            values = signals.forced.setdefault(
                (problem.ids[d], stop.region), np.full(signals.trace.shape[1], bound)
            )
            start, end = signals.index(stop.t), signals.index(stop.t + stop.visit.dwell)
            values[max(0, start - reach) : end + reach + 1] = FORBIDDEN
    return signals


def put_in(visits: list[Visit], wish: Visit, weight: Callable[[str], float]) -> None:
    """Narrow a visit that can serve the wish as well (for the heavier clause of the two), or add the wish."""
    for k, v in enumerate(visits):
        low, high = max(v.window[0], wish.window[0]), min(v.window[1], wish.window[1])
        if wish.options[0] in v.options and low <= high + 1e-9:
            clause = v.clause if weight(v.clause) > weight(wish.clause) else wish.clause
            visits[k] = Visit(clause, wish.options, (low, max(low, high)), max(v.dwell, wish.dwell))
            return
    visits.append(wish)


def sketched(problem: Problem, bound: float) -> Problem:
    """The problem with the visits that its `rest` needs, as far as they can be told.

    Raises InfeasibleError, naming the clause, when the visits of every branch tried are out of reach.
    """
    if not problem.spec.rest:
        return problem
    sketch = Sketch(problem, bound)
    way = next(iter(schedules(problem, bound)))
    task, duties = problem, list[Duty]()
    for _ in range(ROUNDS):
        duties, signals = sketch.duties(way)
        visits = sketch.visits(duties, signals)
        if visits == task.spec.visits:
            break
        refused: InfeasibleError | None = None
        trial = replace(problem, spec=replace(problem.spec, visits=visits))
        try:
            way = next(iter(schedules(trial, bound)))
        except InfeasibleError as error:
            refused = error
        if refused is None:
            task = trial
            sketch.meet(way, duties)
        elif not sketch.learn(refused, duties):
            raise refused
    return task
