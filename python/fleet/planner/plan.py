"""The planner from end to end: scenario to certified plan."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from fleet.errors import InfeasibleError

from . import convex, groups
from .ceiling import rho_bound
from .problem import Problem, problem
from .result import PlanResult, result
from .schedule import Itinerary, schedules
from .sketch import sketched

if TYPE_CHECKING:
    from fleet.scenario import Scenario

Progress = Callable[[str, float], None]

#: Planning methods by name.
METHODS: dict[str, groups.Method] = {"convex": groups.steps, "nlp": groups.nonlinear}
#: Clearance that is worth while when no clause bounds rho [m].
WIDEST = 5.0


def plan(scenario: Scenario, *, progress: Progress | None = None, method: str = "auto") -> PlanResult:
    """Plan a scenario: assign, route, optimise, certify.

    `method` is "convex" (sequential convex steps), "nlp" (the nonlinear program, IPOPT) or "auto":
    convex, then the nonlinear program where that fails. `progress(stage, rho)` is called at every
    stage. The same scenario gives the same bytes.

    Raises InfeasibleError, naming a clause, when the mission cannot hold or nothing was found that
    keeps the tube's margins; InputError when the plan is too large for the wire; ValueError for an
    unknown method.
    """
    if method not in ("auto", "convex", "nlp"):
        raise ValueError(f"method is {method!r}; legal are auto, convex and nlp")
    tell = progress or (lambda stage, rho: None)
    timings = {"process": time.process_time()}
    mark = time.perf_counter()
    task = problem(scenario)
    bound = rho_bound(task)
    timings |= dict.fromkeys(("route", "build", "solve", "certify"), 0.0)
    tell("route", bound)
    ways, refusal = itineraries(task, min(bound, WIDEST))
    timings["route"], mark = lap(mark, timings["route"])
    for way, used in attempts(task, ways, method):
        tell("build", bound)
        flight = groups.fly(task, way, min(bound, WIDEST), METHODS[used], progress)
        timings["build"] += flight.build_s
        timings["solve"], mark = lap(mark, timings["solve"] - flight.build_s)
        margins = flight.margins
        why = refuse(task, margins)
        if why is not None:
            refusal = refusal or why
            continue
        tell("certify", margins.r)
        energy, tracks = flight.int_a2, flight.tracks
        out = result(scenario, task, way, tracks, bound=bound, method=used, int_a2=energy, timings=timings)
        timings["certify"], mark = lap(mark, timings["certify"])
        why = broken(out)
        if why is None:
            return out
        refusal = refusal or why
    assert refusal is not None, "there is always an attempt, or schedules raises"
    raise refusal


def itineraries(task: Problem, bound: float) -> tuple[list[Itinerary], InfeasibleError | None]:
    """Itineraries that keep clauses without a normal form too, or those without them and why.

    Raises InfeasibleError when not even the other clauses have an itinerary.
    """
    try:
        return list(schedules(sketched(task, bound), bound)), None
    except InfeasibleError as error:
        return list(schedules(task, bound)), error


def attempts(task: Problem, ways: list[Itinerary], method: str) -> Iterator[tuple[Itinerary, str]]:
    """Itineraries and methods in the order in which they are tried."""
    if method != "auto":
        yield from ((way, method) for way in ways)
    else:
        yield from ((way, "convex") for way in ways)
        yield ways[0], "nlp"


def lap(mark: float, spent: float) -> tuple[float, float]:
    """`spent` and the seconds since `mark`, and the new mark."""
    now = time.perf_counter()
    return spent + now - mark, now


def refuse(task: Problem, margins: convex.Margins) -> InfeasibleError | None:
    """Why trajectories do not do: limits or the margins of the tube are not kept; None when they are."""
    if margins.share > 1:
        limits = f"v_max = {task.v_max:g} m/s and a_max = {task.a_max:g} m/s^2"
        text = f"{limits} cannot be kept: the best found passes one by {100 * (margins.share - 1):.1f} %"
        return InfeasibleError(text, clause=margins.clause)
    if margins.tube < -1e-6:
        asked = f"{task.tube:g} m (pairs {2 * task.tube:g} m and more with closing speed)"
        text = f"the best margin found is {margins.tube + task.tube:.2f} m, and the tube asks for {asked}"
        return InfeasibleError(text, clause=margins.short)
    return None


def broken(found: PlanResult) -> InfeasibleError | None:
    """Why a plan does not do although it keeps limits and margins: a clause of it is not proved.

    The margins of clauses without a normal form are those of chosen witnesses; the certificate decides.
    """
    worst = min(found.plan["clauses"], key=lambda clause: clause["result"]["rho_lower"])
    rho = float(worst["result"]["rho_lower"])
    if rho > 0:
        return None
    text = f"the best robustness found is {rho:.2f} m, and the mission asks for more than 0"
    return InfeasibleError(text, clause=worst["id"])
