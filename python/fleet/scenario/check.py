"""What no single table can tell: whether the parts of a scenario fit together."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from fleet.scenario.model import Drone, Target
from fleet.scenario.read import Problems, Tables
from fleet.scenario.region import Region
from fleet.scenario.tables import Disturbance, Limits, Mission, Replan
from fleet.stl import RESERVED, is_name

MAX_DRONES = 64
"""Fleet size that is accepted; MAVLink's system ids end at 255 (mavlink.md)."""
MAX_SEGMENTS = 512
"""Segments of one trajectory that the wire carries (design.md, Wire)."""
PAD_OFFSET = 0.5
"""How far a pad may be from below its start [m]; take-off and landing are vertical."""


class Named:
    """The geometry that could be built, each with its field in the file."""

    def __init__(self) -> None:
        self.workspace: Region | None = None
        self.obstacles: dict[str, Region] = {}
        self.targets: dict[str, Target] = {}
        self.drones: dict[str, Drone] = {}


def names(tables: Tables, problems: Problems) -> None:
    """Names that cannot stand in a formula, are reserved, or are used twice."""
    first: dict[str, str] = {}
    if tables.mission is not None and not is_name(tables.mission.fleet):
        problems.add("name", "mission.fleet", f"{tables.mission.fleet!r} is not a name; {_NAMES}")
    for field, name in _all_names(tables):
        if not is_name(name):
            problems.add("name", field, f"{name!r} is not a name; {_NAMES}")
        elif name in RESERVED:
            problems.add("name", field, f"{name!r} is a reserved word of formulas; choose another name")
        elif name in first:
            problems.add("name", field, f"{name!r} is also the name of {first[name]}; names must differ")
        first.setdefault(name, field.rsplit(".", 1)[0])


_NAMES = "legal: a letter, then up to 31 letters, digits or _"


def _all_names(tables: Tables) -> Iterator[tuple[str, str]]:
    yield from ((f"obstacle[{i}].name", table.name) for i, table in tables.obstacles.items())
    yield from ((f"target[{i}].name", table.name) for i, table in tables.targets.items())
    yield from ((f"drone[{i}].id", table.id) for i, table in tables.drones.items())


def times(mission: Mission, replan: Replan | None, segment: float | None, problems: Problems) -> None:
    """Periods that must divide one another."""
    if not _divides(mission.T_s, mission.T):
        problems.add(
            "value",
            "mission.T_s",
            f"{mission.T_s:g} s does not divide T = {mission.T:g} s; must go into it a whole number of times",
        )
    if segment is not None and mission.T / segment > MAX_SEGMENTS / 2:
        least = 2 * mission.T / MAX_SEGMENTS
        problems.add(
            "value",
            "planner.segment",
            f"{segment:g} s is too short for T = {mission.T:g} s; must be at least {least:g} s",
        )
    if replan is None:
        return
    for key, period in (("T_e", replan.T_e), ("T_g", replan.T_g)):
        if not _divides(mission.T_s, period):
            problems.add(
                "value",
                f"replan.{key}",
                f"{period:g} s must be a multiple of mission.T_s = {mission.T_s:g} s",
            )
    if replan.T_g <= replan.T_e:
        problems.add(
            "value", "replan.T_g", f"{replan.T_g:g} s must be longer than replan.T_e = {replan.T_e:g} s"
        )


def _divides(period: float, whole: float) -> bool:
    count = whole / period
    return round(count) >= 1 and abs(count - round(count)) < 1e-6


def limits(limits: Limits, problems: Problems) -> None:
    """Distances that leave room for the tube (design.md, Tube)."""
    if limits.delta_min <= 2 * limits.tube:
        problems.add(
            "value",
            "limits.delta_min",
            f"{limits.delta_min:g} m must be more than two tubes, {2 * limits.tube:g} m",
        )


def regions(found: Named, tube: float, problems: Problems) -> None:
    """Regions that are too small, buried in obstacles or outside the workspace."""
    homes = {f"{field}.home": drone.home for field, drone in found.drones.items()}
    for field, region in {"workspace": found.workspace, **found.targets, **homes}.items():
        if region is not None and region.inradius <= tube:
            message = f"{region.name} is too small: a ball of {region.inradius:.3g} m fits, must be more than the tube, {tube:g} m"
            problems.add("geometry", field, message)
    for field, target in found.targets.items():
        _free(field, f"target {target.name}", target, found, problems)
    for field, home in homes.items():
        for obstacle in found.obstacles.values():
            if home.overlaps(obstacle):
                problems.add(
                    "geometry", field, f"{home.name} overlaps obstacle {obstacle.name}; move one of them"
                )
    for (field, home), (other_field, other) in combinations(homes.items(), 2):
        if home.overlaps(other):
            problems.add(
                "geometry", other_field, f"{other.name} overlaps {home.name} ({field}); homes must be apart"
            )


def _free(field: str, what: str, region: Region, found: Named, problems: Problems) -> None:
    """A region to fly to must have its centre in the workspace and out of every obstacle."""
    center = _point(region.center)
    if found.workspace is not None and found.workspace.depth(region.center) <= 0:
        problems.add(
            "geometry", field, f"{what} is outside the workspace: its centre {center}; move it inside"
        )
    for obstacle in found.obstacles.values():
        if obstacle.covers(region):
            problems.add(
                "geometry",
                field,
                f"{what} is wholly inside obstacle {obstacle.name}; nothing of it can be reached",
            )
        elif obstacle.depth(region.center) >= 0:
            problems.add(
                "geometry",
                field,
                f"{what} has its centre {center} inside obstacle {obstacle.name}; move it out",
            )


def drones(found: Named, delta_min: float | None, problems: Problems) -> None:
    """Starts and pads that are not safe, or too close to one another."""
    for field, drone in found.drones.items():
        _start(field, drone, found, problems)
        _pad(field, drone, found, problems)
    if delta_min is None:
        return
    for (field, drone), (other_field, other) in combinations(found.drones.items(), 2):
        for what, a, b in (("start", drone.start, other.start), ("pad", drone.pad, other.pad)):
            distance = float(np.linalg.norm(a - b))
            if distance < delta_min:
                key = "home" if what == "start" else what
                message = f"the {what}s of {drone.id} ({field}) and {other.id} are {distance:.3g} m apart; must be at least delta_min = {delta_min:g} m"
                problems.add("geometry", f"{other_field}.{key}", message)


def _start(field: str, drone: Drone, found: Named, problems: Problems) -> None:
    if drone.home.depth(drone.start) <= 0:
        problems.add("geometry", f"{field}.start", f"{_point(drone.start)} is outside home; must be inside")
    if found.workspace is not None and found.workspace.depth(drone.start) <= 0:
        problems.add(
            "geometry",
            f"{field}.home",
            f"the start {_point(drone.start)} is outside the workspace; move home inside",
        )


def _pad(field: str, drone: Drone, found: Named, problems: Problems) -> None:
    pad = _point(drone.pad)
    for obstacle in found.obstacles.values():
        if obstacle.depth(drone.pad) >= 0:
            problems.add("geometry", f"{field}.pad", f"{pad} is inside obstacle {obstacle.name}; move it out")
    offset = float(np.linalg.norm(drone.pad[:2] - drone.start[:2]))
    if offset > PAD_OFFSET or drone.pad[2] >= drone.start[2]:
        below = f"must be below the start {_point(drone.start)}, at most {PAD_OFFSET:g} m aside"
        problems.add("geometry", f"{field}.pad", f"{pad} is {offset:.3g} m aside; {below}")
    if found.workspace is not None:
        # The floor does not count: a vehicle on its pad stands on it (design.md, Start).
        walls = found.workspace.A[:, 2] > -0.99
        room = found.workspace.b[walls] - found.workspace.A[walls] @ drone.pad
        if np.any(room <= 0):
            problems.add("geometry", f"{field}.pad", f"{pad} is outside the workspace; move it inside")


def disturbances(
    entries: dict[int, Disturbance], mission: Mission | None, known: list[str], problems: Problems
) -> None:
    """Pulses on unknown drones or after the mission."""
    for i, entry in entries.items():
        if entry.drone not in known:
            problems.add(
                "reference",
                f"disturbance[{i}].drone",
                f"{entry.drone!r} is not a drone; legal: {', '.join(known)}",
            )
        if mission is not None and entry.t > mission.T:
            problems.add(
                "value",
                f"disturbance[{i}].t",
                f"{entry.t:g} s is after the mission; must be from 0 to T = {mission.T:g}",
            )


def assignment(given: dict[str, list[str]], tables: Tables, problems: Problems) -> None:
    """Assigned drones and targets that do not exist; targets that are assigned twice or not at all."""
    drone_ids = [table.id for table in tables.drones.values()]
    targets = [table.name for table in tables.targets.values()]
    owner: dict[str, str] = {}
    for drone, visits in given.items():
        field = f"assignment.{drone}"
        if drone not in drone_ids:
            problems.add("reference", field, f"{drone!r} is not a drone; legal: {', '.join(drone_ids)}")
        for target in visits:
            if target not in targets:
                problems.add("reference", field, f"{target!r} is not a target; legal: {', '.join(targets)}")
            elif target in owner:
                problems.add(
                    "reference", field, f"{target!r} is already assigned to {owner[target]}; assign it once"
                )
            owner.setdefault(target, drone)
    missing = [target for target in targets if target not in owner]
    if missing and tables.mission is not None and tables.mission.formula is None:
        problems.add(
            "reference",
            "assignment",
            f"assigns no drone to {', '.join(missing)}; the mission visits every target",
        )


def _point(point: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return "(" + ", ".join(f"{x:g}" for x in point) + ")"


def fleet_size(tables: Tables, problems: Problems) -> None:
    """No drones, or more than can be addressed."""
    count = tables.entries("drone")
    if not 1 <= count <= MAX_DRONES:
        problems.add(
            "value", "drone", f"{count} drones; must be 1 to {MAX_DRONES}, each in a [[drone]] table"
        )
