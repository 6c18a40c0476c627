"""The map of a mission: every place that a leg can start or end at, and the ways between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from fleet.route import Network, bounding_boxes, cropped, network

from .knots import Array, Ints
from .problem import Problem

#: Shares of the wanted clearance at which routes are sought, the widest first; never less than the tube.
CLEARANCE = (1.0, 0.8, 0.6, 0.4, 0.0)

#: Places within this time at v_max of each other are near, where a fleet is too large to route all legs [s].
NEARBY = 7.0
#: Room for detours around a group of near places [m].
DETOUR = 10.0


@dataclass(frozen=True)
class Map:
    """Every place that a leg can start or end at, numbered, and the ways between them.

    `start` and `home` (d,), `place[d][e]` number of the region in which drone d would do visit e, or -1.
    """

    ways: Network
    points: Array
    names: tuple[str, ...]
    start: tuple[int, ...]
    home: tuple[int, ...]
    place: tuple[tuple[int, ...], ...]


def survey(problem: Problem, bound: float, *, local: bool = False) -> Map:
    """Ways between all places at the widest clearance, at least the tube, that connects all visits.

    With `local` there are ways within groups of places near each other only (`neighbourhoods`).
    """
    n = len(problem.ids)
    regions = sorted({r for v in problem.spec.visits for _, r in v.options} | set(problem.homes))
    points = np.vstack([problem.starts, *(problem.centers[r][None] for r in regions)])
    number = {r: n + k for k, r in enumerate(regions)}
    place = places(problem, number)
    home = tuple(number[r] for r in problem.homes)
    names = (*(f"start of {d}" for d in problem.ids), *regions)
    if local:
        paths: dict[tuple[int, int], Array] = {}
        boxes = bounding_boxes([problem.regions[o] for o in problem.obstacles])
        for members in neighbourhoods(problem, points, home, number):
            low, high = points[members].min(axis=0) - DETOUR, points[members].max(axis=0) + DETOUR
            near = np.flatnonzero(((boxes[0] <= high) & (boxes[1] >= low)).all(axis=1))
            room = cropped(problem.regions[problem.workspace], low, high)
            paths |= routes(problem, points, members, near, room, place, home, bound)
        return Map(Network(paths), points, names, tuple(range(n)), home, place)
    everywhere, every = np.arange(len(points)), np.arange(len(problem.obstacles))
    room = problem.regions[problem.workspace]
    paths = routes(problem, points, everywhere, every, room, place, home, bound)
    return Map(Network(paths), points, names, tuple(range(n)), home, place)


def places(problem: Problem, number: Mapping[str, int]) -> tuple[tuple[int, ...], ...]:
    """`Map.place` for numbered regions; of several regions of one drone the last (see choices.py)."""
    options = [dict(v.options) for v in problem.spec.visits]
    return tuple(tuple(number[o[name]] if name in o else -1 for o in options) for name in problem.ids)


def routes(
    problem: Problem,
    points: Array,
    members: Ints,
    near: Ints,
    room: Array,
    place: tuple[tuple[int, ...], ...],
    home: tuple[int, ...],
    bound: float,
) -> dict[tuple[int, int], Array]:
    """Ways in `room` between the points of `members` past the obstacles of `near`."""
    obstacles = [problem.regions[problem.obstacles[k]] for k in near]
    inside = {int(p): k for k, p in enumerate(members)}
    drones = [d for d in range(len(problem.ids)) if d in inside]
    needed = {(inside[d], inside[p]) for d in drones for p in (*place[d], home[d]) if p in inside}
    for share in CLEARANCE:
        ways = network(points[members], room, obstacles, max(share * bound, problem.tube))
        if all(ways.path(d, p) is not None for d, p in needed):
            break
    return {(int(members[i]), int(members[j])): path for (i, j), path in ways.paths.items()}


def neighbourhoods(
    problem: Problem, points: Array, home: tuple[int, ...], number: Mapping[str, int]
) -> list[Ints]:
    """Groups of places, joined where near each other; a drone is with its home and given targets.

    A group without a drone joins the nearest one that has some.
    """
    n = len(problem.ids)
    gap = np.linalg.norm(points[:, None] - points[None], axis=2)
    joined = gap <= NEARBY * problem.v_max
    joined[np.arange(n), list(home)] = True
    for name, order in (problem.given or {}).items():
        for region in order:
            joined[problem.number(name), number[region]] = True
    for region, name in problem.split.items():
        if region in number:
            joined[problem.number(name), number[region]] = True
    count, label = connected_components(sparse.csr_matrix(joined), directed=False)
    for k in range(count):
        mine = np.flatnonzero(label == k)
        if len(mine) and mine.min() >= n:
            label[mine] = label[gap[mine][:, :n].min(axis=0).argmin()]
    return [np.flatnonzero(label == k) for k in np.unique(label)]
