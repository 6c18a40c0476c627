"""The result: the plan as the wire has it, with its certificate and what it took to make it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet import _core
from fleet.certificate import LOOSE, Proof, prove
from fleet.errors import InputError
from fleet.errors import Problem as Fault
from fleet.stl.normal import drones_of

from .heading import headings
from .knots import Array, Grid
from .problem import Problem
from .rows import derivative_maps, gram
from .schedule import Itinerary

if TYPE_CHECKING:
    from fleet.scenario import Scenario

    from .relax import GaveWay


class Status(StrEnum):
    """How planning ended; the values of `PlanStatus` in crates/core."""

    OPTIMAL = "optimal"
    CERTIFIED = "certified"
    VIOLATED = "violated"


#: Distance of rho to its upper bound that still counts as reaching it [m].
AT_BOUND = 0.01


@dataclass(frozen=True)
class PlanResult:
    """A plan with its certificate.

    `plan` is the dict of `Plan`, `data` its bytes and `hash` their SHA-256; `rho`, `rho_lower`,
    `rho_bound` [m]; `timings` [s] of process, route, build, solve, certify; `int_a2` the integral of
    |a|^2 over the fleet [m^2/s^3]; `energies` electrical energy of every drone, and of hovering for as
    long [J] (crates/core, power); `assignment` targets of every drone in order; `events` one entry
    {drone, region, t, window, slack_s} a visit; `notes` of a baseline, in words, whose
    `timings` may have `aside`, of attempts that do not count.
    """

    plan: dict[str, Any]
    data: bytes
    hash: str
    status: Status
    method: str
    rho: float
    rho_lower: float
    rho_bound: float
    timings: dict[str, float]
    int_a2: float
    assignment: dict[str, list[str]]
    events: list[dict[str, Any]]
    energies: dict[str, tuple[float, float]]
    notes: tuple[str, ...] = ()
    relaxed: tuple[GaveWay, ...] = ()

    @property
    def energy(self) -> float:
        """Electrical energy of the fleet [J]."""
        return sum(total for total, _ in self.energies.values())

    @property
    def hover_share(self) -> float:
        """Energy of hovering for as long over that of the plan; above 1 where flying is cheaper."""
        return sum(hover for _, hover in self.energies.values()) / self.energy

    @property
    def bytes(self) -> bytes:
        """The plan file."""
        return self.data


def trajectory(problem: Problem, itinerary: Itinerary, grid: Grid, x: Array, drone: int) -> _core.Trajectory:
    """The trajectory of one drone, heading included, in the core's own form."""
    times, knots = grid.times[drone], grid.knots(x, drone)
    psi = headings(problem, itinerary, drone, times)
    rows = np.column_stack([times, knots.reshape(len(times), 9), psi])
    # Rounded far below any tolerance, so that the plan does not carry the noise of the last bits.
    return _core.Trajectory(np.round(rows, 12).astype(np.float64) + 0.0)


def squared_acceleration(grid: Grid, x: Array) -> float:
    """Integral of |a|^2 over all drones [m^2/s^3], exact."""
    total = 0.0
    for d, times in enumerate(grid.times):
        h = np.diff(times)
        knots = grid.knots(x, d)
        local = np.concatenate([knots[:-1], knots[1:]], axis=1)
        points = derivative_maps(h, 2) @ local
        total += float(np.einsum("m,mia,ij,mja->", h, points, gram(3), points))
    return total


def topics(horizon: float, period: float, visits: list[float]) -> list[float]:
    """Topic waypoints [s]: multiples of T_g and the visit times (design.md, Replan)."""
    marks = [k * period for k in range(int(horizon / period + 1e-9) + 1)]
    out: list[float] = []
    for t in sorted(round(t, 9) for t in (*marks, *visits)):
        if not out or t > out[-1] + 1e-6:
            out.append(t)
    return out


def drone_plan(
    scenario: Scenario, problem: Problem, itinerary: Itinerary, d: int, track: _core.Trajectory
) -> dict[str, Any]:
    """`DronePlan` of the wire."""
    drone = scenario.drones[d]
    visits = [
        {
            "region": stop.region,
            "t": stop.t,
            "window": [float(w) for w in stop.visit.window],
            "psi": problem.headings.get(stop.region),
        }
        for stop in itinerary.stops[d]
    ]
    return {
        "id": drone.id,
        "pad": {"p": [float(c) for c in drone.pad], "psi": float(drone.pad_heading)},
        "home": problem.homes[d],
        "trajectory": track.to_list(),
        "visits": visits,
        "topics": topics(problem.horizon, scenario.replan.T_g, [s.t for s in itinerary.stops[d]]),
    }


def assemble(
    scenario: Scenario, problem: Problem, drones: list[dict[str, Any]], proof: Proof
) -> dict[str, Any]:
    """`Plan` of the wire, but for status, method and rho_bound."""
    mission, limits, replan = scenario.mission, scenario.limits, scenario.replan
    clauses = [
        {
            "id": c.id,
            "text": c.text,
            "kind": problem.spec.kinds[c.id],
            "drones": list(dict.fromkeys(drones_of(c.formula))),
            "weight": float(c.weight),
            "priority": c.priority,
            "formula": c.formula,
            "result": proof.clauses[c.id],
        }
        for c in scenario.clauses()
    ]
    return {
        "schema": _core.SCHEMA,
        "scenario": scenario.name,
        "fleet": mission.fleet,
        "seed": mission.seed,
        "horizon": problem.horizon,
        "sample": problem.sample,
        "limits": {
            "v_max": limits.v_max,
            "a_max": limits.a_max,
            "psi_rate_max": limits.heading_rate,
            "delta_min": limits.delta_min,
            "tube": limits.tube,
        },
        "replan": {"t_e": replan.T_e, "t_g": replan.T_g, "eta": replan.eta, "enabled": replan.enabled},
        "regions": scenario.regions(),
        "workspace": problem.workspace,
        "obstacles": list(problem.obstacles),
        "clauses": clauses,
        "rho": proof.rho,
        "rho_lower": proof.rho_lower,
        "drones": drones,
    }


def encoded(plan: dict[str, Any]) -> bytes:
    """The plan file.

    Raises InputError when the plan, good as it may be, is larger than what the wire carries.
    """
    try:
        return _core.encode_plan(plan)
    except ValueError as error:
        if f"at most {_core.MAX_BYTES} are legal" not in str(error):
            raise
        size = f"the plan (rho {plan['rho']:.3f} m) of {len(plan['drones'])} drones is too large"
        text = f"{size} to be sent: {error}; plan fewer drones at once"
        raise InputError(text, problems=[Fault("size", "", "drone", text)]) from error


def timely(itinerary: Itinerary) -> bool:
    """Whether every visit is in its window: a drone that only passes there in time has not done it."""
    stops = [s for stops in itinerary.stops for s in stops]
    return all(s.visit.window[0] - 1e-6 <= s.t <= s.visit.window[1] + 1e-6 for s in stops)


def moderate(problem: Problem, tracks: list[_core.Trajectory]) -> bool:
    """Whether limits hold in continuous time, as `fleet verify` measures them."""
    limits = np.array([[problem.v_max], [problem.a_max]]) * (1 + LOOSE)
    return all(bool((np.stack(track.bounds()) <= limits).all()) for track in tracks)


def result(
    scenario: Scenario,
    problem: Problem,
    itinerary: Itinerary,
    tracks: list[_core.Trajectory],
    *,
    bound: float,
    method: str,
    int_a2: float,
    timings: dict[str, float],
) -> PlanResult:
    """Certify the trajectories and put everything together; the status follows from the certificate.

    Raises InputError when the plan is too large for the wire.
    """
    clauses = [(c.id, c.formula) for c in scenario.clauses()]
    proof = prove(list(problem.ids), scenario.regions(), clauses, tracks, problem.horizon, problem.sample)
    drones = [drone_plan(scenario, problem, itinerary, d, t) for d, t in enumerate(tracks)]
    plan = assemble(scenario, problem, drones, proof)
    sound = proof.rho_lower > 0 and timely(itinerary) and moderate(problem, tracks)
    status = Status.CERTIFIED if sound else Status.VIOLATED
    if status is Status.CERTIFIED and proof.rho >= bound - AT_BOUND:
        status = Status.OPTIMAL
    reached = bound if np.isfinite(bound) else proof.rho
    plan |= {"method": method, "status": status.value, "rho_bound": reached}
    data = encoded(plan)
    flown = list(zip(problem.ids, itinerary.stops, strict=True))
    events = [
        {
            "drone": name,
            "region": s.region,
            "t": s.t,
            "window": list(s.visit.window),
            "slack_s": s.visit.window[1] - s.t,
        }
        for name, stops in flown
        for s in stops
    ]
    return PlanResult(
        plan=dict(_core.decode_plan(data)),
        data=data,
        hash=_core.plan_hash(data),
        status=status,
        method=method,
        rho=proof.rho,
        rho_lower=proof.rho_lower,
        rho_bound=reached,
        timings=timings,
        int_a2=int_a2,
        energies={name: track.energy() for name, track in zip(problem.ids, tracks, strict=True)},
        assignment={name: [s.region for s in stops] for name, stops in flown},
        events=events,
    )
