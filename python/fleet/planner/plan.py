"""The planner from end to end: scenario to certified plan, and to better ones while there is time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fleet.assign import EXACT
from fleet.errors import InfeasibleError, InputError

from . import convex, groups
from .attempts import METHODS, attempts
from .baseline import BASELINES
from .ceiling import rho_bound, slack_bound
from .conflict import Court
from .improve import Attempt, Certified, Lead, improvements
from .problem import Problem, problem
from .progress import Progress, TimeUp, silent
from .relax import relaxed
from .result import AT_BOUND, PlanResult, result
from .schedule import Itinerary, schedules
from .sketch import sketched
from .watch import Watch
from .ways import Ways

if TYPE_CHECKING:
    from fleet.scenario import Scenario

#: Clearance that is worth while when no clause bounds rho [m].
WIDEST = 5.0
#: Share of energy whose saving makes a plan a better one.
WORTH = 1e-3


def plan(
    scenario: Scenario, *, progress: Progress | None = None, method: str = "auto", relax: bool = False
) -> PlanResult:
    """Plan a scenario: assign, route, optimise, certify; the first plan that satisfies it.

    `method` is "convex" (sequential convex steps), "nlp" (the nonlinear program, IPOPT) or "auto":
    convex, then the nonlinear program where that fails; or a baseline, "rrt" or "paper", whose plan
    is returned even if it violates the mission. Where the scenario says so robustness is then spent on
    energy (saving.py). With `relax` a mission that cannot hold gets the plan of least violation
    (relax.py), which says what gave way. `progress(stage, rho)` is called at every stage. The same
    scenario gives the same bytes.

    Raises InfeasibleError, naming a clause, when the mission cannot hold or nothing was found that
    keeps the tube's margins; InputError when the plan is too large for the wire; ValueError for an
    unknown method.
    """
    *_, last = improving(scenario, progress=progress, method=method, further=False, relax=relax)
    return last


def improving(
    scenario: Scenario,
    *,
    progress: Progress | None = None,
    method: str = "auto",
    further: bool = True,
    relax: bool = False,
) -> Iterator[PlanResult]:
    """Certified plans, each better than the one before; the first is the one of `plan`.

    With `further` attempts go on where those of `plan` end. Where the scenario says so the last plan, and
    then the one of `plan`, is the one that spends robustness on energy, and no others are looked for.
    With `relax` a mission that cannot hold has one plan, of least violation. Raises as `plan` does, and
    what `progress` raises.
    """
    if method not in ("auto", *METHODS, *BASELINES):
        raise ValueError(f"method is {method!r}; legal are {', '.join(('auto', *METHODS, *BASELINES))}")
    watch = Watch()
    tell = progress or silent
    court = Court(scenario, problem(scenario), tell)
    goal = None if method in BASELINES else scenario.energy
    try:
        for found in search(court, tell, method, watch, further=further and goal is None):
            yield found
    except InfeasibleError as error:
        refusal = court.verdict(error)
        if not relax:
            raise refusal from None
        yield relaxed(court, refusal, lambda part: next(search(part, tell, method, watch, further=False)))
        return
    if goal is not None:
        from .saving import frugal  # few scenarios need it, and it needs this module

        thrifty = frugal(scenario, found, goal, tell)
        if thrifty is not found:
            yield thrifty


def search(court: Court, tell: Progress, method: str, watch: Watch, *, further: bool) -> Iterator[PlanResult]:
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
    lead = Lead()
    seed = scenario.mission.seed if further else None
    for one in tries(task, ways, wanted(task), method, lead, seed):
        try:
            found = attempt(scenario, one, bound, watch, tell, lead)
        except InfeasibleError as error:
            refusal = refusal or error
            if lead.best is None:
                court.refuse_proved()
            continue
        except InputError:
            if lead.best is None:
                raise
            continue  # a further plan that the wire does not carry
        except TimeUp as end:
            end.refusal = refusal
            raise
        if lead.best is None or better(found.result, lead.best.result):
            lead.best = found
            yield found.result
    if lead.best is None:
        assert refusal is not None, "there is always an attempt, or schedules raises"
        raise refusal


def baseline(
    scenario: Scenario, task: Problem, way: Itinerary, method: str, bound: float, watch: Watch, tell: Progress
) -> PlanResult:
    """The plan of a baseline, certified or violated."""
    flown = BASELINES[method](scenario, task, way, tell)
    watch.lap("solve")
    watch.move(flown.build_s, "solve", "build")
    if flown.aside_s is not None:
        watch.spent["aside"] = 0.0
        watch.move(flown.aside_s, "solve", "aside")
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


def tries(
    task: Problem, ways: Sequence[Itinerary], bound: float, method: str, lead: Lead, seed: int | None
) -> Iterator[Attempt]:
    """The attempts of `plan` until one leads, then with a `seed` those that may beat it."""
    for one in attempts(task, ways, method, lead):
        yield one
        if lead.best is not None:
            break
    if seed is not None:
        yield from improvements(task, ways, bound, method, lead, seed)


def better(a: PlanResult, b: PlanResult) -> bool:
    """Whether plan a is better than plan b: by status, weighted rho to 1 mm, then the integral of |a|^2.

    Less than `WORTH` of energy does not count.
    """
    ranks = ("violated", "certified", "optimal")
    one, other = ((ranks.index(p.status), round(worth_rho(p), 3)) for p in (a, b))
    return one > other or (one == other and a.int_a2 < (1 - WORTH) * b.int_a2)


def worth_rho(found: PlanResult) -> float:
    """The weighted robustness [m] that plans are compared by: nothing above what energy is saved at."""
    rho = weighted_rho(found)
    return min(rho, found.rho_bound - convex.GIVEN_UP) if rho == found.rho else rho


def weighted_rho(found: PlanResult) -> float:
    """Least robustness [m] of a clause of a plan over its weight, the heaviest counted as 1."""
    clauses = found.plan["clauses"]
    heaviest = max(c["weight"] for c in clauses)
    return float(min(c["result"]["rho"] * heaviest / c["weight"] for c in clauses))


def wanted(task: Problem) -> float:
    """The largest common slack r that is worth while [m]."""
    return min(slack_bound(task), WIDEST)


def itineraries(task: Problem, bound: float) -> tuple[Ways, InfeasibleError | None]:
    """Itineraries that keep clauses without a normal form too, or those without them and why.

    Raises InfeasibleError when not even the other clauses have an itinerary.
    """
    try:
        return Ways(schedules(sketched(task, bound), bound)), None
    except InfeasibleError as error:
        return Ways(schedules(task, bound)), error


def attempt(
    scenario: Scenario, one: Attempt, bound: float, watch: Watch, tell: Progress, lead: Lead
) -> Certified:
    """Fly one attempt and certify it; `lead` notes how near it came.

    Raises InfeasibleError when limits or margins are not kept or a clause is not proved; InputError when
    the plan is too large for the wire.
    """
    tell("build", bound)
    flight = flown(one, tell)
    one = replace(one, way=flight.way)
    lead.tried.append((one, flight.margins))
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
    refuse_broken(out, one.task.excused)
    return Certified(replace(out, timings=dict(watch.spent)), one, flight.tracks)


def flown(one: Attempt, tell: Progress) -> groups.Flight:
    """The trajectories of an attempt: by weights only where not all clauses can have the best margin."""
    plain = replace(one.task, weights={})
    if one.task.weights != plain.weights:
        flight = groups.fly(plain, one.way, wanted(plain), one.run, tell, one.timing)
        if flight.margins.share <= 1 and flight.margins.r >= wanted(plain) - AT_BOUND:
            return flight
    return groups.fly(one.task, one.way, wanted(one.task), one.run, tell, one.timing)


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


def refuse_broken(found: PlanResult, excused: frozenset[str] = frozenset()) -> None:
    """Raises InfeasibleError when a plan keeps limits and margins but a clause not `excused` is not proved.

    The margins of clauses without a normal form are those of chosen witnesses; the certificate decides.
    """
    clauses = [clause for clause in found.plan["clauses"] if clause["id"] not in excused]
    if not clauses:
        return
    worst = min(clauses, key=lambda clause: clause["result"]["rho_lower"])
    rho = float(worst["result"]["rho_lower"])
    if rho <= 0:
        text = f"the best robustness found is {rho:.2f} m, and the mission asks for more than 0"
        raise InfeasibleError(text, clause=worst["id"])
