"""Loading a scenario: read, build the geometry, check everything, and only then hand it out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fleet.errors import FormulaError, ScenarioError
from fleet.scenario import check
from fleet.scenario.model import Drone, Scenario, Target
from fleet.scenario.read import Problems, Tables, read
from fleet.scenario.region import GeometryError, Region
from fleet.scenario.tables import Shape


def load(path: str | Path) -> Scenario:
    """Loads a scenario file; its name is the file's without `.toml`.

    Raises:
        ScenarioError: with all problems of the file at once, each with field, value and what is legal.
    """
    tables, problems = read(Path(path))
    found = _geometry(tables, problems)
    _check(tables, found, problems)
    if problems.found:
        raise ScenarioError(problems.found)
    scenario = _scenario(Path(path).stem, tables, found)
    try:
        scenario.clauses()
    except FormulaError as error:
        problems.add(error.code, "mission.formula", str(error))
        raise ScenarioError(problems.found) from None
    return scenario


def _geometry(tables: Tables, problems: Problems) -> check.Named:
    found = check.Named()
    if tables.workspace is not None:
        found.workspace = _region("workspace", "workspace", tables.workspace, problems)
    for i, obstacle in tables.obstacles.items():
        region = _region(f"obstacle[{i}]", obstacle.name, obstacle, problems)
        if region is not None:
            found.obstacles[f"obstacle[{i}]"] = region
    for i, target in tables.targets.items():
        region = _region(f"target[{i}]", target.name, target, problems)
        if region is not None:
            found.targets[f"target[{i}].{target.kind}"] = Target.of(region, target.heading)
    for i, drone in tables.drones.items():
        home = _region(f"drone[{i}].home", f"home.{drone.id}", drone.home, problems)
        if home is not None:
            start = np.array(drone.start, dtype=float) if drone.start is not None else home.center
            pad = np.array(drone.pad, dtype=float)
            found.drones[f"drone[{i}]"] = Drone(drone.id, home, pad, drone.heading, start)
    return found


def _region(field: str, name: str, shape: Shape, problems: Problems) -> Region | None:
    try:
        region = shape.region(name)
        region.vertices.setflags(write=False)  # computed here, so that a bad shape is found now
    except GeometryError as error:
        problems.add("geometry", f"{field}.{shape.kind}", str(error))
        return None
    return region


def _check(tables: Tables, found: check.Named, problems: Problems) -> None:
    check.names(tables, problems)
    if tables.mission is not None:
        segment = tables.planner.segment if tables.planner is not None else None
        check.times(tables.mission, tables.replan, segment, problems)
    if tables.limits is not None:
        check.limits(tables.limits, problems)
        check.regions(found, tables.limits.tube, problems)
    check.drones(found, tables.limits.delta_min if tables.limits is not None else None, problems)
    known = [drone.id for drone in tables.drones.values()]
    check.disturbances(tables.disturbances, tables.mission, known, problems)
    if tables.assignment is not None:
        check.assignment(tables.assignment, tables, problems)
    check.fleet_size(tables, problems)


def _scenario(name: str, tables: Tables, found: check.Named) -> Scenario:
    # Without problems every table has been read; the assertions tell mypy so.
    assert tables.mission and found.workspace and tables.limits and tables.replan
    assert tables.planner and tables.wind
    return Scenario(
        name=name,
        mission=tables.mission,
        workspace=found.workspace,
        limits=tables.limits,
        replan=tables.replan,
        planner=tables.planner,
        obstacles=list(found.obstacles.values()),
        targets=list(found.targets.values()),
        drones=list(found.drones.values()),
        disturbances=list(tables.disturbances.values()),
        wind=tables.wind,
        assignment=tables.assignment,
    )
