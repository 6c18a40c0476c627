"""Fleets in parts: drones that cannot meet are planned on their own, past the obstacles on their way only.

Every drone is given a box around its route. Pairs and obstacles that boxes keep apart pose nothing. A
trajectory that leaves its box makes the box grow, and whatever then comes near is planned again, so that in
the end the boxes, which hold all control points, prove what was left out.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from fleet import _core

from . import convex
from .convex import Margins
from .knots import Array, Grid, cut
from .problem import CLOSING, Problem
from .result import squared_acceleration, trajectory
from .schedule import Itinerary
from .setup import Setup, setup
from .spec import Invariant

Progress = Callable[[str, float], None]
#: One method: trajectories of a setup and their margins.
Method = Callable[[Setup, Progress | None], tuple[Array, Margins]]
#: What may move the visits of a setup for the sake of its trajectories: setup, trajectories and margins.
Timing = Callable[[Setup, Array, Margins, Progress | None], tuple[Setup, Array, Margins]]

#: Room around a route that its trajectory hardly ever leaves [m].
ROOM = 2.0


@dataclass(frozen=True)
class Flight:
    """Trajectories of all drones, margins over everything, integral of |a|^2 [m^2/s^3], time to build [s].

    `way` is the itinerary that they fly.
    """

    way: Itinerary
    tracks: list[_core.Trajectory]
    margins: Margins
    int_a2: float
    build_s: float


@dataclass(frozen=True)
class Solved:
    """One part: its trajectories, the boxes (2, k, 3) that hold them, margins, energy, time to build [s]."""

    way: Itinerary
    tracks: list[_core.Trajectory]
    boxes: Array
    margins: Margins
    int_a2: float
    build_s: float


def fly(
    task: Problem,
    way: Itinerary,
    bound: float,
    method: Method,
    progress: Progress | None = None,
    timing: Timing | None = None,
) -> Flight:
    """Trajectories of an itinerary, part by part; a mission with `rest` is one part.

    `timing`, if given, has the last word on the visit times of each part.
    """
    boxes = route_boxes(way)
    known: dict[tuple[tuple[int, ...], tuple[Invariant, ...]], Solved] = {}
    while True:
        found: dict[tuple[int, ...], Solved] = {}
        for members, kept in parts(task, boxes, bound):
            if (members, kept) not in known:
                tell = lowest(progress, [s.margins.r for s in found.values()])
                known[members, kept] = solve(task, way, members, kept, bound, method, tell, timing)
            found[members] = known[members, kept]
        real = np.zeros_like(boxes)
        for members, solved in found.items():
            real[:, list(members)] = solved.boxes
        if (real[0] >= boxes[0]).all() and (real[1] <= boxes[1]).all():
            break
        boxes = np.stack([np.minimum(boxes[0], real[0]), np.maximum(boxes[1], real[1])])
    margins = [solved.margins for solved in found.values()]
    worst = min(margins, key=lambda m: m.r)
    tight, share = min(margins, key=lambda m: m.tube), max(m.share for m in margins)
    whole = Margins(worst.r, worst.clause, share, tight.tube, tight.short)
    tracks = {d: t for members, s in found.items() for d, t in zip(members, s.tracks, strict=True)}
    energy, build = sum(s.int_a2 for s in found.values()), sum(s.build_s for s in known.values())
    stops = {d: s for members, p in found.items() for d, s in zip(members, p.way.stops, strict=True)}
    flown = replace(way, stops=tuple(stops[d] for d in range(len(task.ids))))
    return Flight(flown, [tracks[d] for d in range(len(task.ids))], blamed(whole, margins), energy, build)


def blamed(whole: Margins, margins: list[Margins]) -> Margins:
    """The whole with the clause of the part that breaks limits, where one does."""
    bad = [m for m in margins if m.share > 1]
    return replace(whole, clause=bad[0].clause) if bad else whole


def lowest(progress: Progress | None, done: list[float]) -> Progress | None:
    """Progress that tells the least r of the parts so far."""
    if progress is None:
        return None
    return lambda stage, r: progress(stage, min([r, *done]))


def parts(task: Problem, boxes: Array, bound: float) -> list[tuple[tuple[int, ...], tuple[Invariant, ...]]]:
    """Groups of drones that may meet, and the invariants that their boxes (2, d, 3) do not prove."""
    drones = len(task.ids)
    number = {name: d for d, name in enumerate(task.ids)}
    if task.spec.rest:
        return [(tuple(range(drones)), tuple(task.spec.invariants))]
    clear = {o: clearance(boxes, task.regions[o]) for o in {i.region for i in task.spec.invariants} if o}
    apart = gaps(boxes)
    fastest = 2 * np.sqrt(3) * task.v_max
    far = max(bound, 2 * task.tube + CLOSING * fastest)
    kept: list[Invariant] = []
    meet = np.zeros((drones, drones), dtype=bool)
    for inv in task.spec.invariants:
        mine = [number[d] for d in inv.drones]
        if inv.kind == "outside" and clear[inv.region][mine[0]] >= bound:
            continue
        if inv.kind == "apart":
            if apart[mine[0], mine[1]] >= inv.value + far:
                continue
            meet[mine[0], mine[1]] = True
        kept.append(inv)
    count, label = connected_components(sparse.csr_matrix(meet), directed=False)
    of: list[list[Invariant]] = [[] for _ in range(count)]
    for inv in kept:
        of[label[number[inv.drones[0]]]].append(inv)
    groups = [tuple(int(d) for d in np.flatnonzero(label == k)) for k in range(count)]
    return [(members, tuple(of[k])) for k, members in enumerate(groups)]


def route_boxes(way: Itinerary) -> Array:
    """Boxes (2, d, 3: low, high) around the routes, with `ROOM`."""
    lines = [np.concatenate(paths) for paths in way.paths]
    return np.stack([[p.min(axis=0) - ROOM for p in lines], [p.max(axis=0) + ROOM for p in lines]])


def gaps(boxes: Array) -> Array:
    """Distance (d, d) between boxes (2, d, 3)."""
    low, high = boxes
    between = np.maximum(low[:, None] - high[None], low[None] - high[:, None])
    return np.asarray(np.linalg.norm(np.maximum(between, 0.0), axis=2))


def clearance(boxes: Array, faces: Array) -> Array:
    """Least clearance (d,) along its faces to a polyhedron of anything in boxes (2, d, 3)."""
    middle, half = (boxes[0] + boxes[1]) / 2, (boxes[1] - boxes[0]) / 2
    nearest = middle @ faces[:, :3].T - half @ np.abs(faces[:, :3]).T - faces[:, 3]
    return np.asarray(nearest.max(axis=1))


def solve(
    task: Problem,
    way: Itinerary,
    members: tuple[int, ...],
    kept: tuple[Invariant, ...],
    bound: float,
    method: Method,
    progress: Progress | None,
    timing: Timing | None,
) -> Solved:
    """One part, planned alone."""
    begin = time.perf_counter()
    part = restricted(task, members, kept)
    own = Itinerary(tuple(way.stops[d] for d in members), tuple(way.paths[d] for d in members))
    stage = setup(part, own, bound)
    build = time.perf_counter() - begin
    x, margins = method(stage, progress)
    if timing is not None:
        stage, x, margins = timing(stage, x, margins, progress)
    own = stage.itinerary
    tracks = [trajectory(part, own, stage.grid, x, d) for d in range(len(members))]
    boxes = hulls(stage.grid, x)
    return Solved(own, tracks, boxes, margins, squared_acceleration(stage.grid, x), build)


def restricted(task: Problem, members: tuple[int, ...], kept: tuple[Invariant, ...]) -> Problem:
    """The problem of some drones alone, with the invariants that matter to them."""
    ids = tuple(task.ids[d] for d in members)
    spec = replace(task.spec, homes=[h for h in task.spec.homes if h.drone in ids], invariants=list(kept))
    homes, index = tuple(task.homes[d] for d in members), list(members)
    return replace(task, ids=ids, starts=task.starts[index], psi=task.psi[index], homes=homes, spec=spec)


def hulls(grid: Grid, x: Array) -> Array:
    """Boxes (2, d, 3) of the control points of every drone."""
    points = [cut(grid, d, times).points(x).reshape(-1, 3) for d, times in enumerate(grid.times)]
    return np.stack([[p.min(axis=0) for p in points], [p.max(axis=0) for p in points]])


def steps(stage: Setup, progress: Progress | None) -> tuple[Array, Margins]:
    """The method of convex steps."""
    x, margins, _ = convex.optimise(stage, progress)
    return x, margins


def nonlinear(stage: Setup, progress: Progress | None) -> tuple[Array, Margins]:
    """The method of the nonlinear program."""
    from . import nlp

    x, margins, _ = nlp.optimise(stage, None, progress)
    return x, margins


@dataclass
class Fallback:
    """The nonlinear program as the last resort: only for the parts in which convex steps fell short."""

    kept: dict[tuple[object, ...], tuple[Array, Margins]] = field(default_factory=dict)

    @staticmethod
    def key(stage: Setup) -> tuple[object, ...]:
        """What tells one part from another: its drones, what they keep, and the times of their visits."""
        times = tuple(s.t for stops in stage.itinerary.stops for s in stops)
        return (stage.problem.ids, tuple(stage.problem.spec.invariants), times, stage.grid.size)

    def steps(self, stage: Setup, progress: Progress | None) -> tuple[Array, Margins]:
        """The method of convex steps; remembers the parts that keep limits and the tube's margins."""
        x, margins = steps(stage, progress)
        if margins.share <= 1 and margins.tube >= -1e-6:
            self.kept[self.key(stage)] = (x, margins)
        return x, margins

    def last_resort(self, stage: Setup, progress: Progress | None) -> tuple[Array, Margins]:
        """What convex steps have found, or the nonlinear program with less effort."""
        known = self.kept.get(self.key(stage))
        if known is not None and not stage.problem.spec.rest:
            return known
        from . import nlp

        x, margins, _ = nlp.optimise(stage, None, progress, nlp.LAST_EFFORT)
        return x, margins
