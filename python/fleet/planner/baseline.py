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
    """Trajectories of all drones, the itinerary at the times that they keep, integral of |a|^2 [m^2/s^3]."""

    tracks: list[_core.Trajectory]
    way: Itinerary
    int_a2: float


#: A baseline: from a scenario, its problem and the itinerary to start from to trajectories.
Baseline = Callable[["Scenario", Problem, Itinerary, Progress], Flown]


def kinodynamic_rrt(scenario: Scenario, task: Problem, way: Itinerary, progress: Progress) -> Flown:
    """Kinodynamic RRT* (rrt.py), drone after drone, with the scenario's seed."""
    from . import rrt

    grid, x, made = rrt.fly(task, way, scenario.mission.seed, lambda stage: progress(stage, math.nan))
    tracks = [trajectory(task, made, grid, x, d) for d in range(len(task.ids))]
    return Flown(tracks, made, squared_acceleration(grid, x))


#: Baselines by name of their method.
BASELINES: dict[str, Baseline] = {"rrt": kinodynamic_rrt}
