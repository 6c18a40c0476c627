"""Whether the numbers and names of a scenario fit together; the geometry is in `placement`."""

from __future__ import annotations

from collections.abc import Iterator

from fleet.errors import FormulaError
from fleet.scenario.read import Problems, Tables
from fleet.scenario.tables import Energy, Limits, Mission, Planner, Replan
from fleet.stl import RESERVED, Vocabulary, default_formula, is_name, parse
from fleet.stl.extent import decided, too_large

MAX_DRONES = 64
"""Fleet size that is accepted; MAVLink's system ids end at 255 (mavlink.md)."""
MAX_SEGMENTS = 512
"""Segments of one trajectory that the wire carries (design.md, Wire)."""
_NAMES = "legal: a letter, then up to 31 letters, digits or _"


def check(tables: Tables, problems: Problems) -> None:
    """Notes every problem that shows without geometry."""
    count = tables.entries("drone")
    if not 1 <= count <= MAX_DRONES:
        problems.add("value", "drone", f"{count} drones; must be 1 to {MAX_DRONES}, each a [[drone]] table")
    if tables.limits is not None:
        _limits(tables.limits, problems)
    if tables.mission is not None:
        _mission(tables.mission, tables.planner, problems)
        if tables.replan is not None:
            _replan(tables.replan, tables.mission, problems)
    if tables.energy is not None and tables.limits is not None:
        _energy(tables.energy, tables.limits, problems)
    _disturbances(tables, problems)
    _assignment(tables, problems)
    if _names(tables, problems):
        _formula(tables, problems)


def _limits(limits: Limits, problems: Problems) -> None:
    """Distances must leave room for the tube (design.md, Tube)."""
    least = 2 * limits.tube
    if limits.delta_min <= least:
        message = f"{limits.delta_min:g} m is not legal; must be more than two tubes, {least:g} m"
        problems.add("value", "limits.delta_min", message)


def _mission(mission: Mission, planner: Planner | None, problems: Problems) -> None:
    if not _divides(mission.T_s, mission.T):
        message = f"{mission.T_s:g} s is not legal; must divide T = {mission.T:g} s"
        problems.add("value", "mission.T_s", message)
    # Half of the wire's segments are left for the times of events.
    least = 2 * mission.T / MAX_SEGMENTS
    if planner is not None and planner.segment < least:
        message = (
            f"{mission.T:g} s is not legal with planner.segment = {planner.segment:g} s; must be at most "
            f"{planner.segment * MAX_SEGMENTS / 2:g} s, or segments at least {least:g} s long (at most 10 s)"
        )
        problems.add("value", "mission.T", message)


def _replan(replan: Replan, mission: Mission, problems: Problems) -> None:
    for key, period in (("T_e", replan.T_e), ("T_g", replan.T_g)):
        if not _divides(mission.T_s, period):
            message = f"{period:g} s is not legal; must be a multiple of mission.T_s = {mission.T_s:g} s"
            problems.add("value", f"replan.{key}", message)
    if replan.T_g <= replan.T_e:
        message = f"{replan.T_g:g} s is not legal; must be longer than T_e = {replan.T_e:g} s"
        problems.add("value", "replan.T_g", message)


def _energy(energy: Energy, limits: Limits, problems: Problems) -> None:
    """Robustness below the tube would not hold in flight."""
    if energy.floor is not None and energy.floor < limits.tube:
        message = f"{energy.floor:g} m is not legal; must be at least limits.tube = {limits.tube:g} m"
        problems.add("value", "energy.floor", message)


def _divides(period: float, whole: float) -> bool:
    count = whole / period
    return round(count) >= 1 and abs(count - round(count)) < 1e-6


def _names(tables: Tables, problems: Problems) -> bool:
    """Whether every name can stand in a formula and is used once."""
    before = len(problems.found)
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
    return len(problems.found) == before


def _all_names(tables: Tables) -> Iterator[tuple[str, str]]:
    yield from ((f"obstacle[{i}].name", table.name) for i, table in tables.obstacles.items())
    yield from ((f"target[{i}].name", table.name) for i, table in tables.targets.items())
    yield from ((f"region[{i}].name", table.name) for i, table in tables.regions.items())
    yield from ((f"drone[{i}].id", table.id) for i, table in tables.drones.items())


def _formula(tables: Tables, problems: Problems) -> None:
    """Reads the formula, if everything that it may speak of could be read."""
    mission, limits = tables.mission, tables.limits
    if mission is None or limits is None or not tables.drones or not tables.complete:
        return
    vocabulary = Vocabulary(
        drones=tuple(table.id for table in tables.drones.values()),
        obstacles=tuple(table.name for table in tables.obstacles.values()),
        targets=tuple(table.name for table in tables.targets.values()),
        T=mission.T,
        T_s=mission.T_s,
        delta_min=limits.delta_min,
        regions=tuple(table.name for table in tables.regions.values()),
    )
    text = mission.formula if mission.formula is not None else default_formula(vocabulary)
    try:
        clauses = parse(text, vocabulary)
    except FormulaError as error:
        problems.add(error.code, "mission.formula", str(error))
        return
    large = too_large(clauses, len(vocabulary.drones), mission.T, mission.T_s)
    if large is not None:
        problems.add("value", "mission.T_s", f"{mission.T_s:g} s is not legal; {large}")
        return
    for clause in clauses:
        known = decided(clause, mission.T_s)
        if known is not None:
            always = "holds" if known else "fails"
            message = f"clause {clause.id} {always} whatever is flown: it looks back beyond mission time 0"
            problems.add("formula", "mission.formula", f"{message}, where no window has any samples")


def _disturbances(tables: Tables, problems: Problems) -> None:
    known = [table.id for table in tables.drones.values()]
    for i, entry in tables.disturbances.items():
        if entry.drone not in known:
            message = f"{entry.drone!r} is not a drone; legal: {', '.join(known)}"
            problems.add("reference", f"disturbance[{i}].drone", message)
        if tables.mission is not None and entry.t > tables.mission.T:
            message = f"{entry.t:g} s is not legal; must be from 0 to T = {tables.mission.T:g} s"
            problems.add("value", f"disturbance[{i}].t", message)
    for i, gust in tables.gusts.items():
        if tables.mission is not None and gust.t > tables.mission.T:
            message = f"{gust.t:g} s is not legal; must be from 0 to T = {tables.mission.T:g} s"
            problems.add("value", f"gust[{i}].t", message)


def _assignment(tables: Tables, problems: Problems) -> None:
    """Drones and targets must exist, each target be assigned once and, for the paper's mission, all."""
    if tables.assignment is None:
        return
    drones = [table.id for table in tables.drones.values()]
    targets = [table.name for table in tables.targets.values()]
    owner: dict[str, str] = {}
    for drone, visits in tables.assignment.items():
        field = f"assignment.{drone}"
        if drone not in drones:
            problems.add("reference", field, f"{drone!r} is not a drone; legal: {', '.join(drones)}")
        for target in visits:
            if target not in targets:
                problems.add("reference", field, f"{target!r} is not a target; legal: {', '.join(targets)}")
            elif target in owner:
                problems.add("reference", field, f"{target!r} is already assigned to {owner[target]}")
            owner.setdefault(target, drone)
    missing = [target for target in targets if target not in owner]
    if missing and tables.mission is not None and tables.mission.formula is None:
        message = f"assigns nobody to {', '.join(missing)}; the mission visits every target"
        problems.add("reference", "assignment", message)
