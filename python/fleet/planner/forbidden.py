"""Where a drone that is planned alone may not be: obstacles, and the corridors of the drones before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fleet.route import bounding_boxes, cropped

from . import connection
from .knots import Array
from .problem import CLOSING, Problem

#: Longest part of a connection that one face of an obstacle has to hold off [s].
PART = 0.25
#: Distance of the instants at which corridors are looked at [s].
INSTANT = 0.05
#: Room for the rounding of corners (rounding.py) [m].
ROUNDED = 1e-3


@dataclass(frozen=True)
class Connections:
    """Connections to be tried: states (n, 6), durations (n,) [s], and when they begin (n,) [s]."""

    start: Array
    end: Array
    tau: Array
    begin: Array


@dataclass(frozen=True)
class Forbidden:
    """What one drone must keep clear of on one leg, with the margins of the tube.

    `room` (n, 4) faces to stay inside, `obstacles` faces of each one to stay outside, all moved by the
    margin; `corridors` (k, n, 3) positions of earlier drones every `INSTANT`, `apart` (k,) least distances
    to them [m].
    """

    room: Array
    obstacles: tuple[Array, ...]
    corridors: Array
    apart: Array

    def crossed(self, tried: Connections) -> NDArray[np.bool_]:
        """Which connections leave the room, enter an obstacle, or come too near to an earlier drone."""
        return self.blocked(tried) | self.meets(tried)

    def blocked(self, tried: Connections) -> NDArray[np.bool_]:
        """Which connections leave the room or enter an obstacle, at any time.

        Control points hold their curve, and every part must lie beyond one face of each obstacle.
        """
        a0, jerk = connection.inputs(tried.start, tried.end, tried.tau)
        count = np.ceil(tried.tau / PART).astype(int)
        owner = np.repeat(np.arange(len(count)), count)
        length = (tried.tau / count)[owner]
        begin = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)) * length
        points = connection.pieces(tried.start[owner], a0[owner], jerk[owner], begin, length)
        bad = (points @ self.room[:, :3].T > self.room[:, 3]).any(axis=(1, 2))
        for faces in self.obstacles:
            nearest = (points @ faces[:, :3].T).min(axis=1) - faces[:, 3]
            bad |= nearest.max(axis=1) < 0
        out = np.zeros(len(count), dtype=bool)
        np.logical_or.at(out, owner, bad)
        return out

    def meets(self, tried: Connections) -> NDArray[np.bool_]:
        """Which connections come too near to an earlier drone.

        Half an instant of closing is added to the distance, so that nothing is missed between instants.
        """
        out = np.zeros(len(tried.tau), dtype=bool)
        if len(self.apart) == 0:
            return out
        a0, jerk = connection.inputs(tried.start, tried.end, tried.tau)
        count = np.ceil(tried.tau / INSTANT).astype(int) + 1
        owner = np.repeat(np.arange(len(count)), count)
        step = (tried.tau / (count - 1))[owner]
        t = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)) * step
        p, v, _ = connection.states(tried.start[owner], a0[owner], jerk[owner], t)
        clock = (tried.begin[owner] + t) / INSTANT
        last = self.corridors.shape[1] - 1
        k = np.clip(clock.astype(int), 0, last - 1)
        share = np.clip(clock - k, 0.0, 1.0)[:, None]
        for corridor, least in zip(self.corridors, self.apart, strict=True):
            gap = p - corridor[k] * (1 - share) - corridor[k + 1] * share
            speed = v - np.where(clock[:, None] < last, (corridor[k + 1] - corridor[k]) / INSTANT, 0.0)
            asked = least + np.linalg.norm(speed, axis=1) * (CLOSING + INSTANT / 2)
            np.logical_or.at(out, owner, np.linalg.norm(gap, axis=1) < asked)
        return out


def forbidden(problem: Problem, drone: int, earlier: dict[int, Array], low: Array, high: Array) -> Forbidden:
    """What `drone` must keep clear of in the box from `low` to `high` (3,) [m].

    `earlier` positions (n, 3) of the drones before it, every `INSTANT` of the mission. Invariants over a
    part of the mission count for all of it: the tree knows no windows.
    """
    mine = [i for i in problem.spec.invariants if problem.ids[drone] in i.drones]
    margin = problem.tube + ROUNDED
    room = cropped(problem.regions[problem.workspace], low, high)
    names = list(dict.fromkeys(i.region for i in mine if i.kind == "outside"))
    solid = [problem.regions[n] for n in names]
    if solid:
        boxes = bounding_boxes(solid) + np.array([-margin, margin])[:, None, None]
        near = ((boxes[0] <= high) & (boxes[1] >= low)).all(axis=1)
        solid = [f for f, here in zip(solid, near, strict=True) if here]
    inner = [problem.regions[i.region] for i in mine if i.kind == "inside"]
    inner += [np.array([[-i.row[0], -i.row[1], -i.row[2], i.row[3]]]) for i in mine if i.kind == "linear"]
    walls = np.vstack([np.column_stack([f[:, :3], f[:, 3] - margin]) for f in [room, *inner]])
    corridors, apart = [], []
    for other, path in earlier.items():
        least = [i.value for a, b, i in problem.pairs() if {a, b} == {drone, other}]
        if least:
            corridors.append(path)
            apart.append(max(least) + 2 * problem.tube + 2 * ROUNDED)
    outer = tuple(np.column_stack([f[:, :3], f[:, 3] + margin]) for f in solid)
    held = np.stack(corridors) if corridors else np.zeros((0, 1, 3))
    return Forbidden(walls, outer, held, np.array(apart))
