"""The planner from end to end: scenario to certified plan, and to better ones while there is time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from fleet import _core
from fleet.assign import EXACT
from fleet.errors import InfeasibleError, InputError

from . import convex, groups
from .baseline import BASELINES
from .ceiling import rho_bound, slack_bound
from .conflict import Court
from .problem import Problem, problem
from .result import PlanResult, result
from .schedule import Itinerary, schedules
from .sketch import sketched
from .timing import raised

if TYPE_CHECKING:
    from fleet.scenario import Scenario

#: Called with the stage and the robustness reached in it [m]; what it raises ends the planning.
Progress = Callable[[str, float], None]

#: Planning methods by name.
METHODS: dict[str, groups.Method] = {"convex": groups.steps, "nlp": groups.nonlinear}
#: Clearance that is worth while when no clause bounds rho [m].
WIDEST = 5.0


@dataclass(frozen=True)
class Attempt:
    """One thing to try: an itinerary of a problem, how to fly it, and the name of that method."""

    task: Problem
    way: Itinerary
    method: str
    run: groups.Method


@dataclass(frozen=True)
class Certified:
    """A plan that satisfies the mission, the attempt that made it, and its trajectories."""

    result: PlanResult
    attempt: Attempt
    tracks: list[_core.Trajectory]


@dataclass
class Watch:
    """Where the time went [s]; `mark` is the end of the last part."""

    spent: dict[str, float] = field(
        default_factory=lambda: (
            {"process": time.process_time()} | dict.fromkeys(("route", "build", "solve", "certify"), 0.0)
        )
    )
    mark: float = field(default_factory=time.perf_counter)

    def lap(self, part: str) -> None:
        """Count the time since the last lap for `part`."""
        now = time.perf_counter()
        self.spent[part] += now - self.mark
        self.mark = now

    def move(self, seconds: float, one: str, other: str) -> None:
        """Count some of the time of `one` for `other`."""
        self.spent[one] -= seconds
        self.spent[other] += seconds


def plan(scenario: Scenario, *, progress: Progress | None = None, method: str = "auto") -> PlanResult:
    """Plan a scenario: assign, route, optimise, certify; the first plan that satisfies it.

    `method` is "convex" (sequential convex steps), "nlp" (the nonlinear program, IPOPT) or "auto":
    convex, then the nonlinear program where that fails; or a baseline, "rrt" or "paper", whose plan
    is returned even if it violates the mission. `progress(stage, rho)` is called at every stage. The
    same scenario gives the same bytes.

    Raises InfeasibleError, naming a clause, when the mission cannot hold or nothing was found that
    keeps the tube's margins; InputError when the plan is too large for the wire; ValueError for an
    unknown method.
    """
    return next(improving(scenario, progress=progress, method=method))


def improving(
    scenario: Scenario, *, progress: Progress | None = None, method: str = "auto"
) -> Iterator[PlanResult]:
    """Certified plans, each better than the one before; the first is the one of `plan`.

    Raises as `plan` does.
    """
    if method not in ("auto", *METHODS, *BASELINES):
        raise ValueError(f"method is {method!r}; legal are {', '.join(('auto', *METHODS, *BASELINES))}")
    watch = Watch()
    court = Court(scenario, problem(scenario))
    try:
        yield from search(court, progress or (lambda stage, rho: None), method, watch)
    except InfeasibleError as error:
        raise court.verdict(error) from None


def search(court: Court, tell: Progress, method: str, watch: Watch) -> Iterator[PlanResult]:
    """The plans of `improving`.

    Raises InfeasibleError at the first sign of trouble if a conflict is proved, and when nothing was found.
    """
    scenario, task = court.scenario, court.task
    if len(task.spec.visits) > EXACT:
        court.refuse_proved()  # before the whole map is surveyed in vain
    bound = rho_bound(task)
    tell("route", bound)
    ways, refusal = itineraries(task, wanted(task))
    watch.lap("route")
    if method in BASELINES:
        yield baseline(scenario, task, ways[0], method, bound, watch, tell)
        return
    best: Certified | None = None
    for one in attempts(task, ways, method):
        try:
            found = attempt(scenario, one, bound, watch, tell)
        except InfeasibleError as error:
            refusal = refusal or error
            if best is None:
                court.refuse_proved()
            continue
        except InputError:
            if best is None:
                raise
            continue  # a further plan that the wire does not carry
        if best is None or better(found.result, best.result):
            best = found
            yield found.result
    if best is None:
        assert refusal is not None, "there is always an attempt, or schedules raises"
        raise refusal


def baseline(
    scenario: Scenario, task: Problem, way: Itinerary, method: str, bound: float, watch: Watch, tell: Progress
) -> PlanResult:
    """The plan of a baseline, certified or violated."""
    flown = BASELINES[method](scenario, task, way, tell)
    watch.lap("solve")
    watch.move(flown.build_s, "solve", "build")
    watch.spent["solve"] -= flown.aside_s
    out = result(
        scenario,
        task,
        flown.way,
        flown.tracks,
        bound=bound,
        method=method,
        int_a2=flown.int_a2,
        timings=watch.spent,
    )
    watch.lap("certify")
    return replace(out, timings=dict(watch.spent), notes=flown.notes)


def better(a: PlanResult, b: PlanResult) -> bool:
    """Whether plan a is better than plan b: by status, weighted rho to 1 mm, then the integral of |a|^2."""
    ranks = ("violated", "certified", "optimal")
    one, other = ((ranks.index(p.status), round(weighted_rho(p), 3), -p.int_a2) for p in (a, b))
    return one > other


def weighted_rho(found: PlanResult) -> float:
    """Least robustness [m] of a clause of a plan over its weight, the heaviest counted as 1."""
    clauses = found.plan["clauses"]
    heaviest = max(c["weight"] for c in clauses)
    return float(min(c["result"]["rho"] * heaviest / c["weight"] for c in clauses))


def wanted(task: Problem) -> float:
    """The largest common slack r that is worth while [m]."""
    return min(slack_bound(task), WIDEST)


def itineraries(task: Problem, bound: float) -> tuple[list[Itinerary], InfeasibleError | None]:
    """Itineraries that keep clauses without a normal form too, or those without them and why.

    Raises InfeasibleError when not even the other clauses have an itinerary.
    """
    try:
        return list(schedules(sketched(task, bound), bound)), None
    except InfeasibleError as error:
        return list(schedules(task, bound)), error


def attempts(task: Problem, ways: list[Itinerary], method: str) -> Iterator[Attempt]:
    """Itineraries and methods in the order in which they are tried."""
    name = "convex" if method == "auto" else method
    yield from (Attempt(task, way, name, METHODS[name]) for way in ways)
    if method == "auto":
        yield Attempt(task, ways[0], "nlp", groups.last_resort)


def attempt(scenario: Scenario, one: Attempt, bound: float, watch: Watch, tell: Progress) -> Certified:
    """Fly one attempt and certify it.

    Raises InfeasibleError when limits or margins are not kept or a clause is not proved; InputError when
    the plan is too large for the wire.
    """
    tell("build", bound)
    moving = raised if one.method == "convex" else None
    flight = groups.fly(one.task, one.way, wanted(one.task), one.run, tell, moving)
    one = replace(one, way=flight.way)
    watch.lap("solve")
    watch.move(flight.build_s, "solve", "build")
    refuse(one.task, flight.margins)
    tell("certify", flight.margins.r)
    out = result(
        scenario,
        one.task,
        one.way,
        flight.tracks,
        bound=bound,
        method=one.method,
        int_a2=flight.int_a2,
        timings=watch.spent,
    )
    watch.lap("certify")
    refuse_broken(out)
    return Certified(replace(out, timings=dict(watch.spent)), one, flight.tracks)


def refuse(task: Problem, margins: convex.Margins) -> None:
    """Raises InfeasibleError when limits or the margins of the tube are not kept."""
    if margins.share > 1:
        limits = f"v_max = {task.v_max:g} m/s and a_max = {task.a_max:g} m/s^2"
        text = f"{limits} cannot be kept: the best found passes one by {100 * (margins.share - 1):.1f} %"
        raise InfeasibleError(text, clause=margins.clause)
    if margins.tube < -1e-6:
        asked = f"{task.tube:g} m (pairs {2 * task.tube:g} m and more with closing speed)"
        text = f"the best margin found is {margins.tube + task.tube:.2f} m, and the tube asks for {asked}"
        raise InfeasibleError(text, clause=margins.short)


def refuse_broken(found: PlanResult) -> None:
    """Raises InfeasibleError when a plan keeps limits and margins but a clause of it is not proved.

    The margins of clauses without a normal form are those of chosen witnesses; the certificate decides.
    """
    worst = min(found.plan["clauses"], key=lambda clause: clause["result"]["rho_lower"])
    rho = float(worst["result"]["rho_lower"])
    if rho <= 0:
        text = f"the best robustness found is {rho:.2f} m, and the mission asks for more than 0"
        raise InfeasibleError(text, clause=worst["id"])
