"""A plan is a certificate: everything that it claims is recomputed from the plan alone, in milliseconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet import _core
from fleet.relevance import CUT, Boxes
from fleet.stl.normal import places_of

#: Difference between a plan's number and the recomputed one that is rounding [m].
SAME = 1e-6
#: Share by which limits may be passed: that of `Trajectory.bounds`, whose bound is loose by 0.01 %.
LOOSE = 1e-3


@dataclass(frozen=True)
class Proof:
    """Robustness per clause as `ClauseResult` {rho, rho_lower, t_tightest}, and the least of each [m]."""

    clauses: dict[str, dict[str, float]]
    rho: float
    rho_lower: float


@dataclass(frozen=True)
class VerifyResult:
    """What a plan really is: `ok` when it holds and says so truly; `problems` in words; the proof."""

    ok: bool
    problems: list[str]
    clauses: dict[str, dict[str, float]]
    rho: float
    rho_lower: float
    hash: str = ""
    claimed: dict[str, float] = field(default_factory=dict)


def prove(
    drones: Sequence[str],
    regions: Sequence[Mapping[str, Any]],
    clauses: Sequence[tuple[str, Mapping[str, Any]]],
    tracks: Sequence[_core.Trajectory],
    horizon: float,
    sample: float,
) -> Proof:
    """Exact robustness at k T_s and the continuous-time lower bound of every clause, by the core."""
    fleet = _core.Fleet(list(drones), list(regions))
    times = np.arange(round(horizon / sample) + 1).astype(np.float64) * sample
    positions = np.stack([np.ascontiguousarray(t.sample(times)[:, :3]) for t in tracks])
    boxes = Boxes(drones, regions, tracks)
    found: dict[str, dict[str, float]] = {}
    for name, formula in clauses:
        decisive = boxes.reduced(formula)
        rho, at = fleet.evaluate(decisive, positions, sample)
        lower, _ = fleet.lower_bound(decisive, list(tracks), sample)
        if not 0 < lower <= rho < CUT:
            # What was left out may decide.
            rho, at = fleet.evaluate(formula, positions, sample)
            lower, _ = fleet.lower_bound(formula, list(tracks), sample)
        found[name] = {"rho": rho, "rho_lower": min(lower, rho), "t_tightest": at}
    return Proof(
        found,
        min(c["rho"] for c in found.values()),
        min(c["rho_lower"] for c in found.values()),
    )


def verify(plan: bytes | Mapping[str, Any]) -> VerifyResult:
    """Recompute a plan's robustness, bounds, limits and ends from the plan alone.

    `plan` is a plan file's bytes or its dict. ValueError when it is not a plan at all.
    """
    data = plan if isinstance(plan, bytes) else _core.encode_plan(plan)
    content: Mapping[str, Any] = _core.decode_plan(data)
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in content["drones"]]
    ids = [d["id"] for d in content["drones"]]
    clauses = [(c["id"], c["formula"]) for c in content["clauses"]]
    proof = prove(ids, content["regions"], clauses, tracks, content["horizon"], content["sample"])
    problems = claims(content, proof)
    for drone, track in zip(content["drones"], tracks, strict=True):
        problems += [f"{drone['id']}: {p}" for p in flight(content, drone, track)]
    problems += [f"clause {n}: rho is {c['rho']:.3f} m" for n, c in proof.clauses.items() if c["rho"] <= 0]
    problems += [
        f"clause {n}: holds at the samples but the bound between them is {c['rho_lower']:.3f} m"
        for n, c in proof.clauses.items()
        if c["rho"] > 0 >= c["rho_lower"]
    ]
    said = {k: content[k] for k in ("rho", "rho_lower", "rho_bound")}
    return VerifyResult(
        not problems, problems, proof.clauses, proof.rho, proof.rho_lower, _core.plan_hash(data), said
    )


def claims(content: Mapping[str, Any], proof: Proof) -> list[str]:
    """Where the plan's own numbers are better than the recomputed ones."""
    out = []
    for c in content["clauses"]:
        for key in ("rho", "rho_lower"):
            said, true = c["result"][key], proof.clauses[c["id"]][key]
            if said > true + SAME:
                out.append(f"clause {c['id']}: claims {key} {said:.6f} m, is {true:.6f} m")
    for key, true in (("rho", proof.rho), ("rho_lower", proof.rho_lower)):
        if content[key] > true + SAME:
            out.append(f"claims {key} {content[key]:.6f} m, is {true:.6f} m")
    if content["status"] != "violated" and proof.rho_lower <= 0:
        out.append(f"claims to be {content['status']} with a lower bound of {proof.rho_lower:.3f} m")
    return out


def flight(content: Mapping[str, Any], drone: Mapping[str, Any], track: _core.Trajectory) -> list[str]:
    """Where one trajectory breaks limits or does not begin and end as it must."""
    limits, horizon = content["limits"], content["horizon"]
    speed, acceleration = track.bounds()
    out = []
    for name, value, bound in (("v", speed, limits["v_max"]), ("a", acceleration, limits["a_max"])):
        if value.max() > bound * (1 + LOOSE):
            out.append(f"|{name}| reaches {value.max():.4f}, limit {bound:g}")
    knots = track.knots
    if abs(track.start) > SAME or abs(track.end - horizon) > SAME:
        out.append(f"lasts from {track.start:.3f} s to {track.end:.3f} s, not 0 to {horizon:.3f} s")
    for k, word in ((0, "start"), (-1, "end")):
        if np.abs(knots[k, 4:10]).max() > SAME:
            out.append(f"is not at rest at the {word}")
    turn = heading_rate(knots)
    if turn > limits["psi_rate_max"] * (1 + LOOSE):
        out.append(f"heading rate reaches {turn:.4f} rad/s, limit {limits['psi_rate_max']:.4f}")
    home = next(r["shape"] for r in content["regions"] if r["name"] == drone["home"])
    if _core.inside(home, np.ascontiguousarray(knots[-1:, 1:4]))[0] <= 0:
        out.append(f"does not end inside {drone['home']}")
    return out + visits(content, drone, track)


def visitors(content: Mapping[str, Any]) -> dict[str, list[tuple[str, float]]]:
    """Who makes each clause of a plan true, and when: (drone, time [s]) of its visits; empty without.

    `some d: d in tr1` speaks of every drone; the plan proves it by the one that was assigned.
    """
    found: dict[str, list[tuple[str, float]]] = {}
    for clause in content["clauses"]:
        formula = clause["formula"]
        places = {(place.drone, place.region) for place in places_of(formula)}
        window = [formula["from"], formula["to"]] if formula["op"] == "eventually" else None
        found[clause["id"]] = [
            (drone["id"], visit["t"])
            for drone in content["drones"]
            for visit in drone["visits"]
            if (drone["id"], visit["region"]) in places and window in (None, list(visit["window"]))
        ]
    return found


def heading_rate(knots: NDArray[np.float64]) -> float:
    """Largest |heading rate| [rad/s] on a grid of 16 points a segment, of knots (n, 13)."""
    track = _core.Trajectory(np.ascontiguousarray(knots))
    steps = np.linspace(0, 1, 16, endpoint=False)
    t = (knots[:-1, 0, None] + np.diff(knots[:, 0])[:, None] * steps).ravel()
    return float(np.abs(track.sample(np.append(t, knots[-1, 0]))[:, 13]).max())


def visits(content: Mapping[str, Any], drone: Mapping[str, Any], track: _core.Trajectory) -> list[str]:
    """Where a listed visit is not one: outside of its region or window, or with another heading."""
    out = []
    for v in drone["visits"]:
        shape = next(r["shape"] for r in content["regions"] if r["name"] == v["region"])
        state = track.sample(np.array([v["t"]]))
        if _core.inside(shape, np.ascontiguousarray(state[:, :3]))[0] <= 0:
            out.append(f"is not inside {v['region']} at {v['t']:.2f} s")
        if not v["window"][0] - SAME <= v["t"] <= v["window"][1] + SAME:
            out.append(f"visits {v['region']} at {v['t']:.2f} s, outside of its window {v['window']}")
        if v["psi"] is not None:
            off = (state[0, 12] - v["psi"] + np.pi) % (2 * np.pi) - np.pi
            if abs(off) > 1e-3:
                out.append(f"looks {np.degrees(off):.1f} deg away at {v['region']}")
    return out
