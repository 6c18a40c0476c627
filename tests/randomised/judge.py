"""The independent check of a plan: rtamt on 100 Hz samples, limits, obstacles, distances, ends."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

import numpy as np

from .flown import Array, Flown, flown
from .temporal import Trace, robustness

#: Limits may be passed by rounding alone.
ROUNDING = 1e-6


def faults(plan: Mapping[str, Any]) -> list[str]:
    """Everything that is wrong with a plan, in words; none when it does what its clauses and limits say."""
    regions = {r["name"]: np.array([[*f["a"], f["b"]] for f in r["shape"]]) for r in plan["regions"]}
    tracks = {d["id"]: flown(d["trajectory"]) for d in plan["drones"]}
    trace = Trace({name: track.p for name, track in tracks.items()}, regions)
    out = list(robust(plan, trace))
    for drone in plan["drones"]:
        out += [f"{drone['id']}: {text}" for text in flight(plan, drone, tracks[drone["id"]], regions)]
    for (a, one), (b, two) in combinations(tracks.items(), 2):
        least = float(np.linalg.norm(one.p - two.p, axis=1).min())
        if least < plan["limits"]["delta_min"]:
            out.append(f"{a} and {b} come within {least:.3f} m")
    return out


def robust(plan: Mapping[str, Any], trace: Trace) -> Iterator[str]:
    """Clauses that rtamt finds violated, or below what the plan says of continuous time."""
    for clause in plan["clauses"]:
        rho = robustness(clause["formula"], trace)
        claimed = clause["result"]["rho_lower"]
        if rho <= 0:
            yield f"clause {clause['id']}: rtamt finds {rho:.4f} m"
        if rho < claimed - ROUNDING:
            yield f"clause {clause['id']}: rtamt finds {rho:.4f} m, and the plan claims {claimed:.4f} m"


def flight(
    plan: Mapping[str, Any], drone: Mapping[str, Any], track: Flown, regions: Mapping[str, Array]
) -> Iterator[str]:
    """Where one drone breaks a limit, touches something, or does not begin and end as it must."""
    limits = plan["limits"]
    for name, values, limit in (("v", track.v, limits["v_max"]), ("a", track.a, limits["a_max"])):
        if np.abs(values).max() > limit * (1 + ROUNDING):
            yield f"|{name}| reaches {np.abs(values).max():.4f}, limit {limit:g}"
    if np.abs(track.psi_rate).max() > limits["psi_rate_max"] * (1 + ROUNDING):
        yield f"heading rate reaches {np.abs(track.psi_rate).max():.4f} rad/s"
    for name in plan["obstacles"]:
        faces = regions[name]
        if (track.p @ faces[:, :3].T - faces[:, 3]).max(axis=1).min() <= 0:
            yield f"is inside {name}"
    for name, k in (("workspace", slice(None)), (drone["home"], slice(-1, None))):
        faces = regions[name]
        if (track.p[k] @ faces[:, :3].T - faces[:, 3]).max() >= 0:
            yield f"is not inside {name}" + (" at the end" if k.start else "")
    for k, word in ((0, "start"), (-1, "end")):
        if max(np.abs(track.v[k]).max(), np.abs(track.a[k]).max()) > ROUNDING:
            yield f"is not at rest at the {word}"
    pad = np.array(drone["pad"]["p"])
    if np.abs(track.p[0, :2] - pad[:2]).max() > ROUNDING:
        yield "does not start above its pad"
