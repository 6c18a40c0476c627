"""The paper's planner as a baseline: log-sum-exp robustness over samples, maximised by IPOPT.

The mission is the same formula, with every choice of a drone for a target settled by the assignment, as
the paper's clusters settle it. It starts where our own steps start: assigned, routed and timed. It is
solved twice, with exact second derivatives and with quasi-Newton ones; the better result by exact
robustness counts. Knots of the plan are samples: all of them, or as many as the wire carries (thinning.py).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fleet import _core
from fleet.errors import InfeasibleError, InputError
from fleet.errors import Problem as Fault
from fleet.stl.vocabulary import Formula

from .knots import KNOT, Array, Grid
from .problem import Problem
from .progress import TimeUp
from .result import trajectory
from .samples import Hessian, Optimum, maximise
from .schedule import Itinerary, Stop
from .setup import MOST_SEGMENTS, setup, warm_start
from .signals import wire_regions
from .smooth import leaves
from .spec import negation_normal
from .thinning import thinned

Tell = Callable[[str, float], None]

#: Largest residual of the dynamics of a result that counts [m, m/s]: IPOPT's own tolerance of constraints.
RESIDUAL = 1e-4
#: Iterations between two looks at the exact robustness, which takes a while.
OFTEN = 10
#: Most predicate values of a mission: 1 GB of memory at 0.5 GB a million, measured on `multi_line`.
LARGEST = 2_000_000
#: Difference of exact robustness that decides between two results [m]; below it, iterations do.
SAME = 1e-3


@dataclass(frozen=True)
class Found:
    """One solve: which derivatives, what came out, exact robustness at its samples [m], time [s]."""

    hessian: Hessian
    optimum: Optimum
    rho: float
    solve_s: float

    def describe(self) -> str:
        """In words."""
        o = self.optimum
        spent = f"{o.iterations} iterations, {o.build_s + self.solve_s:.1f} s"
        return f"{self.hessian} Hessian: rho {self.rho:.3f} m, score {o.score:.3f} m, {spent} ({o.status})"


def fly(
    task: Problem, formulas: list[Formula], way: Itinerary, tell: Tell
) -> tuple[Grid, Array, Itinerary, Found, list[Found]]:
    """Knots of all drones, the itinerary at the times kept, the solve that made them, and the others.

    Where the time is up after the first solve, that is all. Raises InfeasibleError when neither solve ends
    with trajectories, InputError for too large a mission.
    """
    refuse_size(task, formulas)
    mission = settled({"op": "and", "fs": [negation_normal(f) for f in formulas]}, visited(task, way))
    warm = sampled(task, way)
    found: list[Found] = []
    for hessian in Hessian:
        try:
            found.append(solve(task, mission, formulas, warm, hessian, tell))
        except TimeUp:
            if not found:
                raise
    good = [f for f in found if f.optimum.residual <= RESIDUAL]
    if not good:
        raise InfeasibleError("the paper's program was not solved; " + "; ".join(f.describe() for f in found))
    kept = min(good, key=lambda f: (-round(f.rho / SAME), f.optimum.iterations))
    others = [f for f in found if f is not kept]
    made = retimed(task, way, kept.optimum.samples)
    grid, x = knots(task, made, kept.optimum.samples)
    return grid, x, made, kept, others


def refuse_size(task: Problem, formulas: list[Formula]) -> None:
    """Raises InputError for a mission whose program would take more memory than a laptop has."""
    count = sum(leaves(f, task.regions, task.sample) for f in formulas)
    if count > LARGEST:
        text = f"paper poses every sample: {count} predicate values, at most {LARGEST} are legal"
        text = f"{text}; plan fewer drones, or with a longer T_s"
        raise InputError(text, problems=[Fault("size", "", "--method", text)])


def solve(
    task: Problem, mission: Formula, formulas: list[Formula], warm: Array, hessian: Hessian, tell: Tell
) -> Found:
    """One solve from samples `warm` (d, n, 9), judged by the formulas as they were written."""

    judge = _core.Fleet(list(task.ids), wire_regions(task.regions))

    def exact(positions: Array) -> float:
        trace = np.ascontiguousarray(positions)
        return min(judge.evaluate(f, trace, task.sample)[0] for f in formulas)

    rho = -math.inf

    def watch(iteration: int, positions: Array) -> None:
        nonlocal rho
        if iteration % OFTEN == 0:
            rho = exact(positions)
        tell(f"{hessian} Hessian, iteration {iteration}", rho)

    begin = time.perf_counter()
    optimum = maximise(task, mission, warm, hessian, watch)
    spent = time.perf_counter() - begin - optimum.build_s
    return Found(hessian, optimum, exact(optimum.samples[:, :, :3]), spent)


def visited(task: Problem, way: Itinerary) -> set[tuple[str, str]]:
    """Drone and region of every visit of an itinerary."""
    return {(task.ids[d], s.region) for d, stops in enumerate(way.stops) for s in stops}


def settled(f: Formula, assigned: set[tuple[str, str]]) -> Formula:
    """The formula (in negation normal form) with every choice of a drone made as assigned.

    `some d: d in tr1` becomes `d2 in tr1` when tr1 is assigned to d2; other disjunctions stay.
    """
    if f["op"] == "or":
        kept = [g for g in f["fs"] if place(g) in assigned]
        if kept:
            return kept[0] if len(kept) == 1 else {"op": "and", "fs": kept}
    out = dict(f)
    if "fs" in f:
        out["fs"] = [settled(g, assigned) for g in f["fs"]]
    for key in ("f", "left", "right"):
        if key in f and f["op"] != "not":
            out[key] = settled(f[key], assigned)
    return out


def place(f: Formula) -> tuple[str, str] | None:
    """Drone and region of "is there" or "is there at some time, or for some time"; else None."""
    while f["op"] in ("always", "eventually"):
        f = f["f"]
    return (f["drone"], f["region"]) if f["op"] == "in" else None


def sampled(task: Problem, way: Itinerary) -> Array:
    """Samples (d, n, 9) at k T_s of the warm start of our own steps."""
    stage = setup(task, way, np.inf)
    x = warm_start(stage)
    times = instants(task)
    tracks = [trajectory(task, way, stage.grid, x, d) for d in range(len(task.ids))]
    return np.stack([track.sample(times)[:, :KNOT] for track in tracks])


def instants(task: Problem) -> Array:
    """Times of the samples (n,) [s]."""
    return np.arange(round(task.horizon / task.sample) + 1).astype(np.float64) * task.sample


def retimed(task: Problem, way: Itinerary, samples: Array) -> Itinerary:
    """The itinerary with every visit where it is deepest in its region within its window."""
    stops = [
        tuple(sorted((deepest(task, s, samples[d]) for s in stops), key=lambda s: s.t))
        for d, stops in enumerate(way.stops)
    ]
    return Itinerary(tuple(stops), way.paths)


def deepest(task: Problem, stop: Stop, samples: Array) -> Stop:
    """A visit at the sample of its window at which its least margin, over its dwell, is largest."""
    faces = task.regions[stop.region]
    margin = (faces[:, 3] - samples[:, :3] @ faces[:, :3].T).min(axis=1)
    stay = round(stop.visit.dwell / task.sample) + 1
    held = np.lib.stride_tricks.sliding_window_view(margin, stay).min(axis=1)
    first, last = (round(t / task.sample) for t in stop.visit.window)
    at = first + int(held[first : last + 1].argmax())
    return replace(stop, t=round(at * task.sample, 9))


def knots(task: Problem, way: Itinerary, samples: Array) -> tuple[Grid, Array]:
    """Samples as knots, those of visits among them, as many as the wire carries."""
    longest = max(task.segment, 2 * task.horizon / MOST_SEGMENTS)
    times, values = [], []
    for d, stops in enumerate(way.stops):
        marks = {round(t / task.sample) for s in stops for t in (s.t, s.t + s.visit.dwell)}
        chosen = thinned(samples[d], task.sample, marks, MOST_SEGMENTS, longest)
        times.append(np.round(chosen * task.sample, 9))
        values.append(samples[d, chosen].ravel())
    return Grid(tuple(times)), np.concatenate(values)
