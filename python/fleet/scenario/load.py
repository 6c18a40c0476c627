"""Loading a scenario: read, build the geometry, check everything, and only then hand it out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fleet.errors import ScenarioError
from fleet.scenario import check, placement
from fleet.scenario.model import Drone, Scenario, Target
from fleet.scenario.placement import Placement
from fleet.scenario.polyhedron import GeometryError
from fleet.scenario.read import Problems, Tables, read
from fleet.scenario.region import Region
from fleet.scenario.tables import Shape


def load(path: str | Path) -> Scenario:
    """Loads a scenario file; its name is the file's without `.toml`.

    Raises:
        ScenarioError: with all problems of the file at once, each with field, value and what is legal.
    """
    tables, problems = read(Path(path))
    placed = _place(tables, problems)
    check.check(tables, problems)
    placement.check(placed, tables.limits, problems)
    if problems.found:
        raise ScenarioError(problems.found)
    return _scenario(Path(path).stem, tables, placed)


def _place(tables: Tables, problems: Problems) -> Placement:
    """Builds every region that can be built."""
    placed = Placement()
    if tables.workspace is not None:
        placed.workspace = _region("workspace", "workspace", tables.workspace, problems)
    for i, obstacle in tables.obstacles.items():
        region = _region(f"obstacle[{i}]", obstacle.name, obstacle, problems)
        if region is not None:
            placed.obstacles[f"obstacle[{i}].{obstacle.kind}"] = region
    for i, target in tables.targets.items():
        region = _region(f"target[{i}]", target.name, target, problems)
        if region is not None:
            placed.targets[f"target[{i}].{target.kind}"] = Target.of(region, target.heading)
    for i, named in tables.regions.items():
        region = _region(f"region[{i}]", named.name, named, problems)
        if region is not None:
            placed.named[f"region[{i}].{named.kind}"] = region
    for i, drone in tables.drones.items():
        home = _region(f"drone[{i}].home", f"home.{drone.id}", drone.home, problems)
        if home is not None:
            start = np.array(drone.start, dtype=float) if drone.start is not None else home.center
            pad = np.array(drone.pad, dtype=float)
            placed.drones[f"drone[{i}]"] = Drone(drone.id, home, pad, drone.heading, start)
    return placed


def _region(place: str, name: str, shape: Shape, problems: Problems) -> Region | None:
    try:
        region = shape.region(name)
        region.vertices.setflags(write=False)  # computed here, so that a bad shape is found now
    except GeometryError as error:
        problems.add("geometry", f"{place}.{shape.kind}", str(error))
        return None
    return region


def _scenario(name: str, tables: Tables, placed: Placement) -> Scenario:
    # Without problems every table has been read; the assertions tell mypy so.
    assert tables.mission and placed.workspace and tables.limits and tables.replan
    assert tables.planner and tables.wind
    return Scenario(
        name=name,
        mission=tables.mission,
        workspace=placed.workspace,
        limits=tables.limits,
        replan=tables.replan,
        planner=tables.planner,
        energy=tables.energy,
        obstacles=list(placed.obstacles.values()),
        targets=list(placed.targets.values()),
        named=list(placed.named.values()),
        drones=list(placed.drones.values()),
        disturbances=list(tables.disturbances.values()),
        gusts=list(tables.gusts.values()),
        wind=tables.wind,
        assignment=tables.assignment,
    )
