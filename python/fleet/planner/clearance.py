"""Safety as half-spaces: the best separating plane of every piece, its rows and its margin.

A piece of trajectory lies in the hull of its six control points, so a plane that has them all on its
far side separates the whole piece, in continuous time. Margins are those of crates/core: to a region
along its faces, between drones Euclidean.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .knots import Array, Grid, Ints, Pieces, cut, merge, refine, restriction
from .problem import CLOSING, Problem
from .rows import Block, derivative_points, half_spaces, limits, separation
from .spec import Invariant

#: Pieces of a segment that may lie beyond different faces of one obstacle.
PARTS = 2
#: Factor on the tube's margin of pairs: closing speeds change from step to step.
TUBE_EASE = 1.02
#: Parts into which a piece is cut to measure its margin.
FINE = 16
#: Rows are posed where the clearance is within this of the wanted one [m]; the rest is checked after.
NEAR = 1.5
#: Limits are posed where a control point passes this share of them; the rest is checked after.
BUSY = 0.6
#: Steps of Gilbert's algorithm for the best plane between two pieces.
GILBERT = 60


@dataclass
class Watch:
    """One constraint, its pieces, and which of them (m,), or of their faces (m, n), are posed so far."""

    clause: str
    drones: tuple[int, ...]
    posed: NDArray[np.bool_]
    pieces: tuple[Pieces, ...]
    faces: Array
    value: float = 0.0
    normals: Array = field(default_factory=lambda: np.zeros((0, 3)))
    last: tuple[Array, Array, Array] | None = None


def window_cuts(times: Array, window: tuple[float, float]) -> Array:
    """The break points within a window; its ends are knots."""
    return times[(times >= window[0] - 1e-6) & (times <= window[1] + 1e-6)]


def watches(problem: Problem, grid: Grid) -> tuple[list[Watch], list[Watch], list[Watch]]:
    """Constraints of kind inside (and linear), outside, and apart."""
    within: list[Watch] = []
    beyond: list[Watch] = []
    apart: list[Watch] = []
    for inv in problem.spec.invariants:
        if inv.kind == "apart":
            continue
        d = problem.number(inv.drones[0])
        times = window_cuts(grid.times[d], inv.window)
        if len(times) < 2:
            continue
        pieces = cut(grid, d, refine(times, PARTS) if inv.kind == "outside" else times)
        posed = np.zeros(len(pieces.start), dtype=bool)
        faces = np.array([[-inv.row[0], -inv.row[1], -inv.row[2], inv.row[3]]])
        faces = faces if inv.kind == "linear" else problem.regions[inv.region]
        if inv.kind == "outside":
            beyond.append(Watch(inv.clause, (d,), posed, (pieces,), faces))
        else:
            each = np.zeros((len(posed), len(faces)), dtype=bool)
            within.append(Watch(inv.clause, (d,), each, (pieces,), faces))
    for a, b, inv in problem.pairs():
        apart.append(pair_watch(grid, a, b, inv))
    return within, beyond, apart


def pair_watch(grid: Grid, a: int, b: int, inv: Invariant) -> Watch:
    """The pair constraint on the common refinement of both drones' knots."""
    times = window_cuts(merge(grid.times[a], grid.times[b]), inv.window)
    one, two = cut(grid, a, times), cut(grid, b, times)
    posed = np.zeros(len(one.start), dtype=bool)
    return Watch(
        inv.clause, (a, b), posed, (one, two), np.zeros((0, 4)), inv.value, np.zeros((len(posed), 3))
    )


def inside_margin(w: Watch, x: Array) -> Array:
    """Margin (m, n) of each piece inside each face."""
    points = w.pieces[0].points(x)
    return np.asarray((w.faces[:, 3] - points @ w.faces[:, :3].T).min(axis=1))


def inside_rows(w: Watch, x: Array, wanted: float) -> Iterator[Block]:
    """Rows of the pieces that come near a face, by that face."""
    w.posed |= inside_margin(w, x) < wanted + NEAR
    piece, face = np.nonzero(w.posed)
    if len(piece):
        yield half_spaces(w.pieces[0].take(piece), -w.faces[face, :3], -w.faces[face, 3])


def outside_margin(w: Watch, x: Array) -> tuple[Array, Ints]:
    """Margin (m,) of each piece beyond its best face, and that face (m,)."""
    points = w.pieces[0].points(x)
    least = (points @ w.faces[:, :3].T - w.faces[:, 3]).min(axis=1)
    face = least.argmax(axis=1)
    return least[np.arange(len(face)), face], face


def outside_least(w: Watch, x: Array, wanted: float) -> float:
    """Least margin over all pieces, those short of `wanted` cut finer: they may lie round a corner."""
    margin, _ = outside_margin(w, x)
    short = np.flatnonzero(margin < wanted)
    if len(short) == 0:
        return float(margin.min())
    s = np.arange(FINE) / FINE
    points = w.pieces[0].take(short).points(x)[:, None]
    parts = restriction(s, s + 1 / FINE)[None] @ points
    fine = (parts @ w.faces[:, :3].T - w.faces[:, 3]).min(axis=2).max(axis=2)
    return float(min(fine.min(), np.delete(margin, short).min(initial=np.inf)))


def outside_rows(w: Watch, x: Array, wanted: float) -> Iterator[Block]:
    """Rows that keep every near piece beyond the face it is farthest beyond now."""
    margin, face = outside_margin(w, x)
    w.posed |= margin < wanted + NEAR
    index = np.flatnonzero(w.posed)
    if len(index):
        chosen = w.faces[face[index]]
        yield half_spaces(w.pieces[0].take(index), chosen[:, :3], chosen[:, 3])


def gilbert(points: Array) -> Array:
    """Point (m, 3) of least norm in the hulls of `points` (m, k, 3) (Gilbert 1966)."""
    x = points.mean(axis=1)
    rows = np.arange(len(points))
    for _ in range(GILBERT):
        far = points[rows, np.einsum("mka,ma->mk", points, x).argmin(axis=1)]
        step = far - x
        length = np.maximum((step**2).sum(axis=1), 1e-18)
        x = x + np.clip(-(x * step).sum(axis=1) / length, 0.0, 1.0)[:, None] * step
    return np.asarray(x)


def apart_margin(w: Watch, x: Array) -> tuple[Array, Array]:
    """Margin (m,) over the threshold of each piece, and the best plane's normal (m, 3), from b to a.

    The answer for the last `x` is kept: rows are wanted where margins were.
    """
    if w.last is not None and np.array_equal(w.last[0], x):
        return w.last[1], w.last[2]
    between = w.pieces[0].points(x) - w.pieces[1].points(x)
    nearest = gilbert(between)
    norm = np.linalg.norm(nearest, axis=1)
    flat = norm < 1e-6
    normals = np.where(flat[:, None], [0.0, 0.0, 1.0], nearest / np.maximum(norm, 1e-12)[:, None])
    margin = np.einsum("mka,ma->mk", between, normals).min(axis=1) - w.value
    w.last = (x.copy(), margin, normals)
    return margin, normals


def pair_least(w: Watch, x: Array, tube: float) -> Array:
    """Margin (m,) that the tube asks of each piece: 2 tube + 0.02 s times the closing speed (design.md)."""
    points = w.pieces[0].points(x) - w.pieces[1].points(x)
    h = (w.pieces[0].end - w.pieces[0].start)[:, None, None]
    speed = np.linalg.norm(5 * np.diff(points, axis=1) / h, axis=2).max(axis=1)
    return np.asarray(2 * tube + CLOSING * speed)


def apart_rows(
    w: Watch, x: Array, wanted: float, level: float, tube: float, lift: Array | None = None
) -> Iterator[Block]:
    """Rows that keep near pieces on both sides of the best plane now.

    With r at `level` the margin is raised to what the tube asks. `lift` (3,) tilts the planes of pieces
    in conflict, to try another way past each other.
    """
    margin, normals = apart_margin(w, x)
    w.posed |= margin < wanted + 2 * NEAR
    if lift is not None:
        clash = margin < wanted
        mean = (w.pieces[0].points(x) - w.pieces[1].points(x)).mean(axis=1)
        tilted = mean + lift * (w.value + wanted)
        normals = np.where(clash[:, None], tilted / np.linalg.norm(tilted, axis=1, keepdims=True), normals)
    w.normals = normals
    extra = np.maximum(TUBE_EASE * pair_least(w, x, tube) - level, 0.0)
    index = np.flatnonzero(w.posed)
    if len(index):
        one, two = (p.take(index) for p in w.pieces)
        yield separation(one, two, normals[index], w.value + extra[index])


@dataclass
class Bounds:
    """Velocity and acceleration limits; `posed[order][drone]` (segments,) tells which have rows."""

    problem: Problem
    grid: Grid
    posed: dict[int, list[NDArray[np.bool_]]]

    @classmethod
    def none_posed(cls, problem: Problem, grid: Grid) -> Bounds:
        """Nothing posed yet."""
        return cls(problem, grid, {k: [np.zeros(len(t) - 1, dtype=bool) for t in grid.times] for k in (1, 2)})

    def share(self, x: Array, drone: int, order: int) -> Array:
        """Largest share (segments,) of the limit that a control point reaches."""
        bound = self.problem.v_max if order == 1 else self.problem.a_max
        return np.asarray(np.abs(derivative_points(self.grid, x, drone, order)).max(axis=(1, 2)) / bound)

    def rows(self, x: Array) -> Iterator[Block]:
        """Rows of busy segments."""
        for order, masks in self.posed.items():
            bound = self.problem.v_max if order == 1 else self.problem.a_max
            for d, posed in enumerate(masks):
                posed[self.share(x, d, order) > BUSY] = True
                if posed.any():
                    # A hair inside, so that solver tolerance and rounding stay within the limit.
                    yield limits(self.grid, d, np.flatnonzero(posed), order, bound * (1 - 1e-5))

    def worst(self, x: Array) -> float:
        """Largest share of a limit anywhere."""
        drones = range(len(self.grid.times))
        return max(float(self.share(x, d, k).max()) for d in drones for k in self.posed)
