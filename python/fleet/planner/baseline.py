"""Methods of others, for comparison: what they find is certified, and shown even if it is violated."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fleet import _core

from .problem import Problem
from .result import squared_acceleration, trajectory
from .schedule import Itinerary

if TYPE_CHECKING:
    from fleet.scenario import Scenario

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Flown:
    """Trajectories of all drones, the itinerary at the times that they keep, integral of |a|^2 [m^2/s^3].

    `build_s` time to build a program [s]; `aside_s` time of attempts that were not kept, which do not count
    as planning, where there are any [s]; `notes` in words what people should know.
    """

    tracks: list[_core.Trajectory]
    way: Itinerary
    int_a2: float
    build_s: float = 0.0
    aside_s: float | None = None
    notes: tuple[str, ...] = ()


#: A baseline: from a scenario, its problem and the itinerary to start from to trajectories.
Baseline = Callable[["Scenario", Problem, Itinerary, Progress], Flown]


def kinodynamic_rrt(scenario: Scenario, task: Problem, way: Itinerary, progress: Progress) -> Flown:
    """Kinodynamic RRT* (rrt.py), drone after drone, with the scenario's seed."""
    from . import rrt

    grid, x, made = rrt.fly(task, way, scenario.mission.seed, lambda stage: progress(stage, math.nan))
    tracks = [trajectory(task, made, grid, x, d) for d in range(len(task.ids))]
    return Flown(tracks, made, squared_acceleration(grid, x))


def log_sum_exp(scenario: Scenario, task: Problem, way: Itinerary, progress: Progress) -> Flown:
    """The paper's formulation (paper.py); of its two solves only the time of the better one counts."""
    from . import paper

    formulas = [clause.formula for clause in scenario.clauses()]
    grid, x, made, kept, others = paper.fly(task, formulas, way, progress)
    tracks = [trajectory(task, made, grid, x, d) for d in range(len(task.ids))]
    aside = sum(other.optimum.build_s + other.solve_s for other in others)
    notes = (f"kept, {kept.describe()}", *(f"not kept, {other.describe()}" for other in others))
    return Flown(tracks, made, squared_acceleration(grid, x), kept.optimum.build_s, aside, notes)


#: Baselines by name of their method.
BASELINES: dict[str, Baseline] = {"rrt": kinodynamic_rrt, "paper": log_sum_exp}
