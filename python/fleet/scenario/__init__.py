"""Scenario files: one TOML a mission, checked as a whole before anything else reads it."""

from fleet.scenario.load import load
from fleet.scenario.model import Drone, Scenario, Target
from fleet.scenario.region import Region
from fleet.scenario.tables import Disturbance, Limits, Mission, Planner, Replan, Wind

__all__ = [
    "Disturbance",
    "Drone",
    "Limits",
    "Mission",
    "Planner",
    "Region",
    "Replan",
    "Scenario",
    "Target",
    "Wind",
    "load",
]
