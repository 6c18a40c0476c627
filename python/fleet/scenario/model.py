"""A checked scenario, as every later step reads it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from fleet.scenario.polyhedron import Array
from fleet.scenario.region import Region
from fleet.scenario.tables import Disturbance, Energy, Gust, Limits, Mission, Planner, Replan, Wind
from fleet.stl import Clause, Vocabulary, default_formula, parse


class Target(Region):
    """A region to visit; `heading` [rad] is where to look there, None for any."""

    heading: float | None = None

    @classmethod
    def of(cls, region: Region, heading: float | None) -> Target:
        """The region as a target."""
        target = cls(
            region.name, region.A, region.b, ball=(region.center, region.inradius), vertices=region.vertices
        )
        target.heading = heading
        return target


@dataclass(frozen=True, eq=False)
class Drone:
    """A drone: where it lives, stands and starts.

    Attributes:
        id: unique name.
        home: region `home.ID`.
        pad: vehicle centre at rest, shape (3,) [m; scenario frame].
        pad_heading: heading at rest [rad], counter-clockwise from east.
        start: where it hovers at mission time 0, shape (3,) [m]; inside home.
    """

    id: str
    home: Region
    pad: Array
    pad_heading: float
    start: Array


@dataclass(frozen=True, eq=False)
class Scenario:
    """A mission with its world and its fleet; made by `load`, never by hand.

    `named` are the regions that are neither obstacles nor targets.
    """

    name: str
    mission: Mission
    workspace: Region
    limits: Limits
    replan: Replan
    planner: Planner
    energy: Energy | None
    obstacles: list[Region]
    targets: list[Target]
    named: list[Region]
    drones: list[Drone]
    disturbances: list[Disturbance]
    gusts: list[Gust]
    wind: Wind
    assignment: dict[str, list[str]] | None

    def regions(self) -> list[dict[str, Any]]:
        """All regions as the plan carries them: workspace, obstacles, targets, named ones, homes."""
        return [region.wire() for region in self.every_region]

    @cached_property
    def every_region(self) -> tuple[Region, ...]:
        """Workspace, obstacles, targets, named regions and homes; no two have one name."""
        homes = [drone.home for drone in self.drones]
        return (self.workspace, *self.obstacles, *self.targets, *self.named, *homes)

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """What the mission formula may speak of."""
        return Vocabulary(
            drones=tuple(drone.id for drone in self.drones),
            obstacles=tuple(obstacle.name for obstacle in self.obstacles),
            targets=tuple(target.name for target in self.targets),
            T=self.mission.T,
            T_s=self.mission.T_s,
            delta_min=self.limits.delta_min,
            regions=tuple(region.name for region in self.named),
        )

    @cached_property
    def formula(self) -> str:
        """The mission formula as text: the scenario's own, or the paper's where it has none."""
        return self.mission.formula if self.mission.formula is not None else default_formula(self.vocabulary)

    def clauses(self) -> list[Clause]:
        """The mission formula, clause by clause."""
        return list(self._clauses)

    @cached_property
    def _clauses(self) -> list[Clause]:
        return parse(self.formula, self.vocabulary)
