"""Is a refused scenario really infeasible? What simple bounds and a mixed-integer program say."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from fleet import _core
from fleet.certificate import prove
from fleet.scenario import Scenario

from .flown import Array
from .mip import Oracle, World


@dataclass(frozen=True)
class Opinion:
    """`verdict` plan (certified), unproved or none; the least bound of its clauses [m]; CPU time [s]."""

    verdict: str
    rho_lower: float
    seconds: float


def world_of(scenario: Scenario) -> World:
    """The scenario as the program reads it."""
    regions = (scenario.workspace, *scenario.obstacles, *scenario.targets, *(d.home for d in scenario.drones))
    faces = {r.name: np.column_stack([r.A, r.b]) for r in regions}
    limits = scenario.limits
    return World(
        drones=tuple(d.id for d in scenario.drones),
        starts={d.id: np.asarray(d.start) for d in scenario.drones},
        psi={d.id: float(d.pad_heading) for d in scenario.drones},
        regions=faces,
        headings={t.name: t.heading for t in scenario.targets},
        horizon=float(scenario.mission.T),
        v_max=float(limits.v_max) * (1 - 1e-6),
        a_max=float(limits.a_max) * (1 - 1e-6),
        psi_rate=float(limits.heading_rate),
        tube=float(limits.tube) + 1e-5,
        clauses=[(c.id, c.formula) for c in scenario.clauses()],
    )


def opinion(scenario: Scenario, seconds: float, step: float = 1.0) -> Opinion:
    """What the mixed-integer program says within `seconds`."""
    began = time.process_time()
    oracle = Oracle(world_of(scenario), step)
    x = oracle.search(seconds)
    if x is None:
        return Opinion("none", -np.inf, time.process_time() - began)
    least = certified(scenario, oracle.trajectories(x))
    return Opinion("plan" if least > 0 else "unproved", least, time.process_time() - began)


def certified(scenario: Scenario, knots: list[Array]) -> float:
    """The least bound [m] that the certificate gives these knots; limits and ends are checked too."""
    tracks = [_core.Trajectory(np.ascontiguousarray(k)) for k in knots]
    for track in tracks:
        speed, acceleration = track.bounds()
        assert speed.max() <= scenario.limits.v_max * (1 + 1e-3)
        assert acceleration.max() <= scenario.limits.a_max * (1 + 1e-3)
    clauses = [(c.id, c.formula) for c in scenario.clauses()]
    ids = [d.id for d in scenario.drones]
    mission = scenario.mission
    proof = prove(ids, scenario.regions(), clauses, tracks, float(mission.T), float(mission.T_s))
    return proof.rho_lower
