"""The verdict on a flown mission: exact robustness of every clause on what was really flown."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet import _core
from fleet.consumption import flown_energy
from fleet.log.flight import DroneLog, Flight

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClauseVerdict:
    """One clause: what the plan promised and what the flight gave; robustness in metres."""

    id: str
    text: str
    kind: str
    drones: list[str]
    rho_planned: float
    rho_lower: float
    rho_flown: float | None
    t_tightest: float | None


@dataclass(frozen=True)
class DroneVerdict:
    """One drone's tracking and safety.

    `rmse_m`, `max_m`: truth against the committed reference over [0, T]; `rmse_plan_m`, `max_plan_m`: against
    the fleet plan. `min_clearance_m`: least signed distance to any obstacle from take-off to landing.
    `energy_J`: electrical energy of what was flown over [0, T]. `gap_max_ms`: longest pause between two
    setpoints in flight. `end`: last mode the drone reported, `landed` when it came down and disarmed.
    """

    id: str
    rmse_m: float | None
    max_m: float | None
    rmse_plan_m: float | None
    max_plan_m: float | None
    replans: int
    end: str
    energy_J: float | None  # noqa: N815  (key of the published JSON)
    min_clearance_m: float | None
    gap_max_ms: float | None


@dataclass(frozen=True)
class Verdict:
    """The judgement of one flight.

    `source` is `truth` (the simulator's own) or `estimate` (the vehicles'). `problems` says why a mission
    counts as violated beyond its clauses: a drone that did not land, a log that does not cover [0, T], an
    obstacle touched or a pair too close in take-off or landing.
    """

    source: str
    satisfied: bool
    rho_planned: float
    rho_flown: float | None
    min_pair_m: float | None
    clauses: list[ClauseVerdict]
    drones: list[DroneVerdict]
    problems: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def judge(flight: Flight) -> Verdict:
    """Judge a flight on ground truth where it was logged, else on the vehicles' estimates."""
    plan = flight.plan
    source = "truth" if all(len(d.truth) for d in flight.drones.values()) else "estimate"
    tracks = {i: d.truth if source == "truth" else d.state for i, d in flight.drones.items()}
    problems = _coverage(plan, tracks)
    covered = not problems
    clauses = _clauses(plan, tracks if covered else None)
    drones = [_drone(plan, i, flight, tracks[i]) for i in tracks]
    problems += [f"{d.id} did not land: its last mode is {d.end}" for d in drones if d.end != "landed"]
    problems += _outside_mission(plan, flight, tracks)
    flown = [c.rho_flown for c in clauses if c.rho_flown is not None]
    rho_flown = min(flown) if covered and flown else None
    satisfied = rho_flown is not None and rho_flown > 0.0 and not problems
    return Verdict(
        source=source,
        satisfied=satisfied,
        rho_planned=plan["rho"],
        rho_flown=rho_flown,
        min_pair_m=_min_pair(plan, tracks) if covered else None,
        clauses=clauses,
        drones=drones,
        problems=problems,
    )


def mission_times(plan: _core.Plan) -> Array:
    """Sample times k T_s over [0, T] [s], shape (n,)."""
    count = round(plan["horizon"] / plan["sample"])
    return np.arange(count + 1, dtype=np.float64) * float(plan["sample"])


def positions_at(track: Array, times: Array) -> Array:
    """Positions of a track (n, 14) at `times` (m,), linear between its rows (100 Hz); shape (m, 3)."""
    return np.column_stack([np.interp(times, track[:, 0], track[:, 1 + axis]) for axis in range(3)])


def plan_positions(plan: _core.Plan, drone: str, times: Array) -> Array:
    """Planned positions of a drone at `times` (m,); shape (m, 3)."""
    part = next(d for d in plan["drones"] if d["id"] == drone)
    return _core.Trajectory.from_list(part["trajectory"]).sample(times)[:, :3]


def airborne(log: DroneLog) -> tuple[float, float] | None:
    """Mission times of take-off and touchdown, as the modes tell [s]; none when it never took off."""
    start = next((t for t, mode, _ in log.modes if mode == "takeoff"), None)
    if start is None:
        return None
    end = next((t for t, mode, _ in log.modes if t > start and mode == "idle"), np.inf)
    return start, end


def _coverage(plan: _core.Plan, tracks: dict[str, Array]) -> list[str]:
    problems = []
    for i, track in tracks.items():
        if not len(track):
            problems.append(f"the log holds no position of {i}")
        elif track[0, 0] > 0.02 or track[-1, 0] < plan["horizon"] - 0.02:
            problems.append(
                f"the log of {i} covers {track[0, 0]:.1f} to {track[-1, 0]:.1f} s, "
                f"not the whole mission 0 to {plan['horizon']:.1f} s"
            )
    return problems


def _clauses(plan: _core.Plan, tracks: dict[str, Array] | None) -> list[ClauseVerdict]:
    ids = [d["id"] for d in plan["drones"]]
    fleet = _core.Fleet(ids, plan["regions"])
    positions = None
    if tracks is not None:
        times = mission_times(plan)
        positions = np.stack([positions_at(tracks[i], times) for i in ids])
    out = []
    for clause in plan["clauses"]:
        rho, t = None, None
        if positions is not None:
            rho, t = fleet.evaluate(clause["formula"], positions, plan["sample"])
        result = clause["result"]
        out.append(
            ClauseVerdict(
                clause["id"],
                clause["text"],
                clause["kind"],
                list(clause["drones"]),
                result["rho"],
                result["rho_lower"],
                rho,
                t,
            )
        )
    return out


def _drone(plan: _core.Plan, drone: str, flight: Flight, track: Array) -> DroneVerdict:
    log = flight.drones[drone]
    horizon = plan["horizon"]
    reference = log.reference[(log.reference[:, 0] >= 0.0) & (log.reference[:, 0] <= horizon)]
    rmse, worst = _error(track, reference[:, 0], reference[:, 1:4])
    inside = track[(track[:, 0] >= 0.0) & (track[:, 0] <= horizon)]
    times = inside[:, 0]
    rmse_plan, worst_plan = _error(track, times, plan_positions(plan, drone, times))
    span = airborne(log)
    return DroneVerdict(
        id=drone,
        rmse_m=rmse,
        max_m=worst,
        rmse_plan_m=rmse_plan,
        max_plan_m=worst_plan,
        replans=sum(1 for notice in log.replans if notice["outcome"] == "committed"),
        end=_end(flight, drone),
        energy_J=flown_energy(track, horizon),
        min_clearance_m=_clearance(plan, _between(track, span)) if span else None,
        gap_max_ms=_gap(log, span) if span else None,
    )


def _error(track: Array, times: Array, wanted: Array) -> tuple[float | None, float | None]:
    if not len(times) or not len(track):
        return None, None
    error = np.linalg.norm(positions_at(track, times) - wanted, axis=1)
    return float(np.sqrt(np.mean(error**2))), float(error.max())


def _between(track: Array, span: tuple[float, float]) -> Array:
    return track[(track[:, 0] >= span[0]) & (track[:, 0] <= span[1])]


def _clearance(plan: _core.Plan, track: Array) -> float | None:
    shapes = [r["shape"] for r in plan["regions"] if r["name"] in plan["obstacles"]]
    if not shapes or not len(track):
        return None
    points = np.ascontiguousarray(track[:, 1:4])
    return min(float(np.min(_core.outside(shape, points))) for shape in shapes)


def _gap(log: DroneLog, span: tuple[float, float]) -> float | None:
    # LAND hands over to the autopilot at touchdown, so the stream ends a little before the motors do.
    times = log.setpoint[(log.setpoint[:, 0] >= span[0]) & (log.setpoint[:, 0] <= span[1]), 0]
    return float(np.diff(times).max() * 1e3) if len(times) > 1 else None


def _end(flight: Flight, drone: str) -> str:
    log = flight.drones[drone]
    landed = any(d == drone and e["what"].get("event") == "landed" for _, d, e in flight.events)
    return "landed" if landed else (log.modes[-1][1] if log.modes else "unknown")


def _min_pair(plan: _core.Plan, tracks: dict[str, Array]) -> float | None:
    times = mission_times(plan)
    points = {i: positions_at(track, times) for i, track in tracks.items()}
    pairs = [np.linalg.norm(points[a] - points[b], axis=1).min() for a, b in combinations(points, 2)]
    return float(min(pairs)) if pairs else None


def _outside_mission(plan: _core.Plan, flight: Flight, tracks: dict[str, Array]) -> list[str]:
    """Safety from take-off to landing: obstacles and pairs, the floor left out (design.md, Start)."""
    problems = []
    spans = {i: airborne(log) for i, log in flight.drones.items()}
    for i, span in spans.items():
        clearance = _clearance(plan, _between(tracks[i], span)) if span else None
        if clearance is not None and clearance <= 0.0:
            problems.append(f"{i} touched an obstacle (clearance {clearance:.2f} m)")
    for a, b in combinations(spans, 2):
        span_a, span_b = spans[a], spans[b]
        if span_a is None or span_b is None:
            continue
        times = np.arange(min(span_a[0], span_b[0]), _last(tracks, a, b, span_a, span_b), plan["sample"])
        gap = np.linalg.norm(positions_at(tracks[a], times) - positions_at(tracks[b], times), axis=1)
        if len(gap) and gap.min() < plan["limits"]["delta_min"]:
            problems.append(f"{a} and {b} came within {gap.min():.2f} m of each other")
    return problems


def _last(
    tracks: dict[str, Array], a: str, b: str, span_a: tuple[float, float], span_b: tuple[float, float]
) -> float:
    return min(max(span_a[1], span_b[1]), float(tracks[a][-1, 0]), float(tracks[b][-1, 0]))
