"""Energy-aware planning: robustness is spent, down to a floor, on flying with less energy.

Lexicographic: rho is maximised, then the integral of |a|^2 is made small over trajectories and visit times at
rho of at least a floor. Weighted (Silano et al. 2021, section III-E): see tradeoff.py. Squared acceleration
is a proxy: what the battery gives is electrical energy, nearly all of it hovering, which a plan that saves
acceleration may even raise a little, by ending higher for example. So a row keeps electrical energy, linear
around the last trajectory, at or below that of the plan that does not save.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fleet import _core
from fleet.errors import InfeasibleError

from . import groups
from .convex import Margins, Steps, program
from .knots import Array, Grid
from .plan import itineraries, refuse, refuse_broken, wanted
from .problem import Problem, problem
from .progress import Progress
from .result import PlanResult, result, trajectory
from .rows import Block, derivative_maps
from .schedule import Itinerary, schedules
from .setup import Setup
from .timing import retime
from .tradeoff import bernstein, price, traded

if TYPE_CHECKING:
    from fleet.scenario import Scenario
    from fleet.scenario.tables import Energy

#: Squared acceleration alone, by order of derivative.
WEIGHTS = {2: 1.0}
#: Robustness above the floor that rounding may take [m].
HAIR = 1e-5
#: Share of electrical energy below its bound that is aimed at: the bound is linear.
AIMED = 2e-7
#: Most convex steps to keep the bound on electrical energy.
STEPS = 8
#: Differences of velocity [m/s] and acceleration [m/s^2] for the slope of power: power is smooth.
NUDGE = 1e-4


def frugal(scenario: Scenario, found: PlanResult, goal: Energy, tell: Progress) -> PlanResult:
    """The energy-aware plan of a scenario, or `found`, its plan without, where no energy can be saved.

    Visits are made in the order of `found` and in the reverse one, drone by drone: a closed tour is as long
    backwards, but windows make one direction the gentler one. Electrical energy is never above that of
    `found`, and robustness never below the floor, or that of `found` where this is less.
    """
    mark = time.perf_counter()
    task = problem(scenario)
    best, least = found, cost(goal, task, found)
    for forward in itineraries(task, wanted(task))[0]:
        known: list[tuple[Itinerary, groups.Flight]] = []
        certified: list[PlanResult] = []
        for way in directions(task, forward, known):
            flight = groups.fly(task, way, wanted(task), groups.steps, tell, saver(goal, found.energies))
            known.append((way, flight))
            try:
                certified.append(proved(scenario, task, flight, found, tell))
            except InfeasibleError:
                continue  # another direction may do, and `found` does
        for out in certified:
            worth = cost(goal, task, out)
            if worth < least and out.energy <= found.energy:
                best, least = out, worth
        if certified:
            break  # further itineraries are for missions that this one cannot keep
    if best is found:
        return found
    spent = dict(found.timings)
    spent["solve"] += time.perf_counter() - mark
    return replace(best, timings=spent)


def proved(
    scenario: Scenario, task: Problem, flight: groups.Flight, found: PlanResult, tell: Progress
) -> PlanResult:
    """The certified plan of a flight; InfeasibleError where it breaks limits, margins or a clause."""
    refuse(task, flight.margins)
    tell("certify", flight.margins.r)
    out = result(
        scenario,
        task,
        flight.way,
        flight.tracks,
        bound=found.rho_bound,
        method=found.method,
        int_a2=flight.int_a2,
        timings=found.timings,
    )
    refuse_broken(out)
    return out


def cost(goal: Energy, task: Problem, found: PlanResult) -> float:
    """What the objective makes small: the integral of |a|^2 [m^2/s^3], or eps' Q eps - rho [m]."""
    if goal.objective == "lexicographic":
        return found.int_a2
    tracks = [_core.Trajectory.from_list(drone["trajectory"]) for drone in found.plan["drones"]]
    return price(goal, task, found.rho, tracks)


def directions(
    task: Problem, forward: Itinerary, known: list[tuple[Itinerary, groups.Flight]]
) -> Iterator[Itinerary]:
    """The itinerary, all its tours backwards, and each drone's better direction; `known` is what was flown.

    Only the itinerary where the order is given by hand or by a clause, or windows allow no other.
    """
    yield forward
    back = reordered(task, {d: tuple(reversed(stops)) for d, stops in enumerate(forward.stops)})
    if back is None:
        return
    yield back
    one, two = (squared(flight) for _, flight in known)
    better = np.array(two) < np.array(one)
    if better.any() and not better.all():
        mixed = [(back if b else forward).stops[d] for d, b in enumerate(better)]
        way = reordered(task, dict(enumerate(mixed)))
        if way is not None:
            yield way


def squared(flight: groups.Flight) -> list[float]:
    """Integral of |a|^2 [m^2/s^3] drone by drone, by Gauss's rule with four points a segment (exact)."""
    node, weight = gauss(4)
    out = []
    for track in flight.tracks:
        times = track.knots[:, 0]
        h = np.diff(times)[:, None]
        a = track.sample((times[:-1, None] + h * node).ravel())[:, 6:9].reshape(len(h), 4, 3)
        out.append(float((h * weight * (a**2).sum(axis=2)).sum()))
    return out


def reordered(task: Problem, orders: Mapping[int, tuple[object, ...]]) -> Itinerary | None:
    """The itinerary with visits in other orders, or None where it has no other or none that is in time."""
    if task.given is not None or task.spec.rest or all(len(stops) < 2 for stops in orders.values()):
        return None
    given = {task.ids[d]: tuple(s.region for s in stops) for d, stops in orders.items()}  # type: ignore[attr-defined]
    try:
        return next(schedules(replace(task, given=given), wanted(task)))
    except InfeasibleError:
        return None


def saver(goal: Energy, budgets: Mapping[str, tuple[float, float]]) -> groups.Timing:
    """What saves energy for one part of a fleet, whose drones have `budgets` of electrical energy [J]."""

    def save(stage: Setup, x: Array, margins: Margins, tell: Progress | None) -> tuple[Setup, Array, Margins]:
        if margins.share > 1 or margins.tube < 0:
            return stage, x, margins
        hold = held(goal, stage.problem, margins.r)
        saved = retime(stage, x, hold=hold, weights=WEIGHTS, progress=tell)
        y, r = saved.x, hold
        if goal.objective == "weighted":
            y = traded(saved.stage, saved.x, goal, hold)
            r = Steps.of(saved.stage).margins(y).r
        most = sum(budgets[name][0] for name in stage.problem.ids)
        thrifty = within_budget(saved.stage, y, r, most)
        if thrifty is None:
            return stage, x, margins
        return saved.stage, thrifty, Steps.of(saved.stage).margins(thrifty)

    return save


def held(goal: Energy, task: Problem, reached: float) -> float:
    """The least common slack r [m] that saving may go down to, from the one reached without."""
    if goal.floor is None:
        return max(reached - goal.give_up, task.tube + HAIR)
    lightest = min(task.weights.values(), default=1.0)
    return min(goal.floor / lightest + HAIR, reached)


def within_budget(stage: Setup, x: Array, hold: float, most: float) -> Array | None:
    """`x`, or near it the least squared acceleration with at most `most` [J]; None if there is none."""
    steps = Steps.of(stage)
    y = x
    for _ in range(STEPS):
        total, slope = electrical(stage, y)
        now = steps.margins(y)
        if total <= most and now.share <= 1 and now.r >= hold - HAIR and now.tube >= 0:
            return y
        size = float(np.linalg.norm(slope))
        room = np.array([(most * (1 - AIMED) - total + slope @ y) / size])
        row = Block((slope / size)[None], np.arange(stage.grid.size)[None], room, np.zeros(1))
        found = program(stage, [*steps.rows(y, hold), row], hold, WEIGHTS)
        if found is None:
            return None
        y = found.x[: stage.grid.size]
    return None


def electrical(stage: Setup, x: Array) -> tuple[float, Array]:
    """Electrical energy [J] of all drones and its slope by the unknowns (differences of the core's power)."""
    task, way, grid = stage.problem, stage.itinerary, stage.grid
    total = sum(trajectory(task, way, grid, x, d).energy()[0] for d in range(len(task.ids)))
    slope = np.zeros(grid.size)
    for d in range(len(task.ids)):
        knots = grid.knots(slope, d)
        first, second = power_slopes(grid, x, d)
        knots[:-1] += first
        knots[1:] += second
    return total, slope


def power_slopes(grid: Grid, x: Array, drone: int) -> tuple[Array, Array]:
    """Slope of a drone's energy by the first and the second knot of every segment, (m, 3, 3) each."""
    node, weight = gauss(5)
    h, knots = np.diff(grid.times[drone]), grid.knots(x, drone)
    local = np.concatenate([knots[:-1], knots[1:]], axis=1)
    maps = [bernstein(6 - order - 1, node) @ derivative_maps(h, order) for order in (1, 2)]
    states = [(m @ local).reshape(-1, 3) for m in maps]
    out = np.zeros_like(local)
    for order in (0, 1):
        for axis in range(3):
            ends = []
            for sign in (1, -1):
                moved = [s.copy() for s in states]
                moved[order][:, axis] += sign * NUDGE
                ends.append(_core.flight_power(moved[0], moved[1]))
            by = ((ends[0] - ends[1]) / (2 * NUDGE)).reshape(len(h), -1) * weight * h[:, None]
            out[:, :, axis] += np.einsum("mn,mnk->mk", by, maps[order])
    return out[:, :3], out[:, 3:]


def gauss(points: int) -> tuple[Array, Array]:
    """Nodes and weights of the Gauss-Legendre rule on [0, 1]."""
    node, weight = np.polynomial.legendre.leggauss(points)
    return (node + 1) / 2, weight / 2
