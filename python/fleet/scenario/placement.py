"""Whether regions, starts and pads of a scenario stand where drones can fly and stand."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from fleet.scenario.model import Drone, Target
from fleet.scenario.polyhedron import Array
from fleet.scenario.read import Problems
from fleet.scenario.region import Region
from fleet.scenario.tables import Limits

PAD_OFFSET = 0.5
"""How far a pad may be from below its start [m]; take-off and landing are vertical."""


@dataclass
class Placement:
    """The geometry that could be built, by its field in the file."""

    workspace: Region | None = None
    obstacles: dict[str, Region] = field(default_factory=dict)
    targets: dict[str, Target] = field(default_factory=dict)
    named: dict[str, Region] = field(default_factory=dict)
    drones: dict[str, Drone] = field(default_factory=dict)

    @property
    def homes(self) -> dict[str, Region]:
        """The home regions."""
        return {f"{place}.home": drone.home for place, drone in self.drones.items()}


def check(placement: Placement, limits: Limits | None, problems: Problems) -> None:
    """Notes everything that is too small, too close, buried or outside; `limits` where they could be read."""
    if limits is not None:
        _sizes(placement, limits.tube, problems)
        _distances(placement, limits.delta_min, problems)
    for place, target in placement.targets.items():
        _target(place, target, placement, problems)
    for place, region in placement.named.items():
        _named(place, region, placement, problems)
    _homes(placement, problems)
    for place, drone in placement.drones.items():
        _start(place, drone, placement, problems)
        _pad(place, drone, placement, problems)


def _sizes(placement: Placement, tube: float, problems: Problems) -> None:
    """A drone must fit into each region with its tube (design.md, Tube)."""
    regions = {**placement.targets, **placement.homes}
    if placement.workspace is not None:
        regions["workspace"] = placement.workspace
    for place, region in regions.items():
        if region.inradius <= tube:
            size = f"the largest ball inside has a radius of {region.inradius:.3g} m"
            problems.add("geometry", place, f"{region.name}: {size}; must be more than the tube, {tube:g} m")


def _target(place: str, target: Target, placement: Placement, problems: Problems) -> None:
    """The centre must be in the workspace and out of every obstacle; the planner sees to the rest."""
    center = _point(target.center)
    if placement.workspace is not None and placement.workspace.depth(target.center) <= 0:
        message = f"target {target.name} has its centre {center} outside the workspace; move it inside"
        problems.add("geometry", place, message)
    for obstacle in placement.obstacles.values():
        if obstacle.covers(target):
            message = f"target {target.name} is wholly inside obstacle {obstacle.name}; move it out"
            problems.add("geometry", place, message)
        elif obstacle.depth(target.center) >= 0:
            message = (
                f"target {target.name} has its centre {center} inside obstacle {obstacle.name}; move it out"
            )
            problems.add("geometry", place, message)


def _named(place: str, region: Region, placement: Placement, problems: Problems) -> None:
    """Some of it must be where drones may be; what the formula says of it is for `fleet spec` to judge."""
    if placement.workspace is not None and not placement.workspace.overlaps(region):
        message = f"region {region.name} is wholly outside the workspace; move it inside"
        problems.add("geometry", place, message)
    for obstacle in placement.obstacles.values():
        if obstacle.covers(region):
            message = f"region {region.name} is wholly inside obstacle {obstacle.name}; move it out"
            problems.add("geometry", place, message)


def _homes(placement: Placement, problems: Problems) -> None:
    for place, home in placement.homes.items():
        for obstacle in placement.obstacles.values():
            if home.overlaps(obstacle):
                message = f"{home.name} overlaps obstacle {obstacle.name}; move one of them"
                problems.add("geometry", place, message)
    for (first, home), (second, other) in combinations(placement.homes.items(), 2):
        if home.overlaps(other):
            message = f"{other.name} overlaps {home.name} ({first}); homes must be apart"
            problems.add("geometry", second, message)


def _start(place: str, drone: Drone, placement: Placement, problems: Problems) -> None:
    start = _point(drone.start)
    if drone.home.depth(drone.start) <= 0:
        problems.add("geometry", f"{place}.start", f"{start} is not legal; must be inside {drone.home.name}")
    if placement.workspace is not None and placement.workspace.depth(drone.start) <= 0:
        message = f"the start {start} is outside the workspace; move home inside"
        problems.add("geometry", f"{place}.home", message)


def _pad(place: str, drone: Drone, placement: Placement, problems: Problems) -> None:
    pad, start = _point(drone.pad), _point(drone.start)
    for obstacle in placement.obstacles.values():
        if obstacle.depth(drone.pad) >= 0:
            problems.add("geometry", f"{place}.pad", f"{pad} is inside obstacle {obstacle.name}; move it out")
    offset = float(np.linalg.norm(drone.pad[:2] - drone.start[:2]))
    if offset > PAD_OFFSET or drone.pad[2] >= drone.start[2]:
        message = f"{pad} is not legal; must be below the start {start}, at most {PAD_OFFSET:g} m aside"
        problems.add("geometry", f"{place}.pad", message)
    if placement.workspace is not None:
        # The floor does not count: safety holds without it on the ground (design.md, Start).
        walls = placement.workspace.A[:, 2] > -0.99
        room = placement.workspace.b[walls] - placement.workspace.A[walls] @ drone.pad
        if np.any(room <= 0):
            problems.add("geometry", f"{place}.pad", f"{pad} is outside the workspace; move it inside")


def _distances(placement: Placement, delta_min: float, problems: Problems) -> None:
    for (first, drone), (second, other) in combinations(placement.drones.items(), 2):
        for key, a, b in (("home", drone.start, other.start), ("pad", drone.pad, other.pad)):
            distance = float(np.linalg.norm(a - b))
            if distance < delta_min:
                where = "starts" if key == "home" else "pads"
                apart = f"the {where} of {drone.id} ({first}) and {other.id} are {distance:.3g} m apart"
                message = f"{apart}; must be at least delta_min = {delta_min:g} m"
                problems.add("geometry", f"{second}.{key}", message)


def _point(point: Array) -> str:
    return "(" + ", ".join(f"{x:g}" for x in point) + ")"
