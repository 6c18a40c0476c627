"""Where trajectories fall short: which drone and region, or which pair, and how much margin is missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fleet import _core

from .convex import Margins
from .knots import Array
from .problem import Problem
from .schedule import Itinerary
from .signals import Signals
from .spec import Invariant

#: Shortfalls that are told at most.
TOLD = 3


def shortfalls(task: Problem, way: Itinerary, tracks: Sequence[_core.Trajectory], margins: Margins) -> str:
    """The largest shortfalls of trajectories against limits and the tube, in words."""
    if margins.share > 1:
        limits = f"v_max = {task.v_max:g} m/s and a_max = {task.a_max:g} m/s^2"
        return f"{limits} cannot be kept: the best found passes one by {100 * (margins.share - 1):.1f} %"
    times = np.arange(round(task.horizon / task.sample) + 1).astype(np.float64) * task.sample
    positions = np.stack([np.asarray(t.sample(times))[:, :3] for t in tracks])
    found = [
        *invariant_margins(task, times, positions),
        *visit_margins(task, way, times, positions),
        *rest_margins(task, positions),
    ]
    short = sorted((margin - asked, k, text) for k, (margin, asked, text) in enumerate(found))
    words = [text for spare, _, text in short[:TOLD] if spare < 0]
    if words:
        return "; ".join(words)
    best = margins.tube + task.tube
    return f"the best margin found is {best:.2f} m, and the tube asks for {task.tube:.2f} m"


def invariant_margins(task: Problem, times: Array, positions: Array) -> Iterator[tuple[float, float, str]]:
    """Least margin of every invariant at samples, what the tube asks [m], and both in words."""
    told: set[tuple[str, tuple[str, ...], str]] = set()
    for inv in task.spec.invariants:
        drones = tuple(sorted(inv.drones))
        if (inv.kind, drones, inv.region) in told and inv.kind == "apart":
            continue
        told.add((inv.kind, drones, inv.region))
        inside = (times >= inv.window[0] - 1e-9) & (times <= inv.window[1] + 1e-9)
        value = margin_of(task, inv, positions[:, inside])
        if not len(value):
            continue
        k = int(value.argmin())
        asked = 2 * task.tube if inv.kind == "apart" else task.tube
        yield float(value[k]), asked, words(inv, float(value[k]), asked, float(times[inside][k]))


def rest_margins(task: Problem, positions: Array) -> Iterator[tuple[float, float, str]]:
    """Robustness of the parts without a normal form, as `invariant_margins`; at most the tube is asked."""
    signals = Signals.of(task, np.ascontiguousarray(positions))
    for part in task.spec.rest:
        rho = float(signals.of_part(part.formula)[0])
        yield rho, task.tube, f"@{part.clause} holds with a margin of {rho:.2f} m only"


def margin_of(task: Problem, inv: Invariant, positions: Array) -> Array:
    """Margin (m,) [m] of an invariant at positions (d, m, 3)."""
    p = positions[task.number(inv.drones[0])]
    if inv.kind == "apart":
        return np.asarray(np.linalg.norm(p - positions[task.number(inv.drones[1])], axis=1) - inv.value)
    if inv.kind == "linear":
        return np.asarray(p @ np.array(inv.row[:3]) + inv.row[3])
    faces = task.regions[inv.region]
    beyond = (p @ faces[:, :3].T - faces[:, 3]).max(axis=1)
    return np.asarray(beyond if inv.kind == "outside" else -beyond)


def words(inv: Invariant, margin: float, asked: float, t: float) -> str:
    """A shortfall in words."""
    missing = f"{margin:.2f} m at {t:.1f} s, {asked - margin:.2f} m less than the tube asks"
    if inv.kind == "apart":
        return f"{' and '.join(inv.drones)} keep {inv.value:g} m apart with a margin of {missing}"
    where = f"{inv.kind} {inv.region}" if inv.region else "on its side"
    return f"{inv.drones[0]} stays {where} with a margin of {missing}"


def visit_margins(
    task: Problem, way: Itinerary, times: Array, positions: Array
) -> Iterator[tuple[float, float, str]]:
    """Least margin of each drone over its visits and home, as `invariant_margins`.

    They are told together: where limits are too tight, the optimiser shares what is missing among them.
    """
    for d, name in enumerate(task.ids):
        stops = [*((s.region, s.t) for s in way.stops[d]), (task.homes[d], task.horizon)]
        found = []
        for region, t in stops:
            k, faces = int(np.abs(times - t).argmin()), task.regions[region]
            found.append(float((faces[:, 3] - positions[d, k] @ faces[:, :3].T).min()))
        margin = min(found)
        at = [f"{region} at {t:.1f} s" for region, t in stops]
        where = f"{', '.join(at[:-1])} and {at[-1]}" if len(at) > 1 else at[0]
        short = f"{margin:.2f} m, {task.tube - margin:.2f} m less than the tube asks"
        yield margin, task.tube, f"{name} is in {where} with a margin of {short}"
