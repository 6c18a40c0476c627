"""Shortest paths among convex polyhedra, and the timing of a drone's legs along them.

The route is a warm start and a time estimate, never a certificate: paths run on a visibility graph
over points of the edges of the inflated obstacles (the shortest path among polyhedra bends on edges;
Sharir and Schorr 1986), so their length is exact up to the spacing of those points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Distance between graph points on an edge [m]; it costs at most about 1 % of length at this scale.
SPACING = 1.5
#: Segments that are looked at together: bounds memory.
CHUNK = 200_000
#: Polyhedra whose vertices are kept.
KEPT = 4096
#: A point nearer to a face than this counts as on it [m].
TOUCH = 1e-6


def vertices(faces: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Vertices (k, 3) of the polyhedron with faces (n, 4: normal, offset), and the faces (k, n) at each.

    Both are shared by all who ask about the same polyhedron, and cannot be written to.
    """
    return corners(np.ascontiguousarray(faces, dtype=float).tobytes())


@lru_cache(maxsize=KEPT)
def corners(polyhedron: bytes) -> tuple[Array, NDArray[np.bool_]]:
    """`vertices` by the bytes of the faces."""
    points, touch = found_corners(np.frombuffer(polyhedron).reshape(-1, 4))
    points.flags.writeable = touch.flags.writeable = False
    return points, touch


def found_corners(faces: Array) -> tuple[Array, NDArray[np.bool_]]:
    """`vertices`, computed: the points of three faces each that lie in no other face's outside."""
    index = np.array(list(combinations(range(len(faces)), 3)))
    normals, offsets = faces[index][:, :, :3], faces[index][:, :, 3]
    regular = np.abs(np.linalg.det(normals)) > 1e-9
    points = np.linalg.solve(normals[regular], offsets[regular][:, :, None])[:, :, 0]
    gap = points @ faces[:, :3].T - faces[:, 3]
    points, gap = points[(gap <= TOUCH).all(axis=1)], gap[(gap <= TOUCH).all(axis=1)]
    if len(points) == 0:
        return points, np.zeros((0, len(faces)), dtype=bool)
    _, first = np.unique(np.round(points, 6), axis=0, return_index=True)
    return points[first], np.abs(gap[first]) <= 10 * TOUCH


def edge_points(faces: Array, spacing: float = SPACING) -> Array:
    """Points (k, 3) on the edges of a polyhedron, corners included, at most `spacing` apart [m]."""
    corners, touch = vertices(faces)
    if len(corners) == 0:
        return corners
    shared = touch.astype(int) @ touch.astype(int).T
    found = [corners]
    for i, j in combinations(range(len(corners)), 2):
        if shared[i, j] >= 2:
            count = int(np.ceil(np.linalg.norm(corners[j] - corners[i]) / spacing))
            s = np.arange(1, count)[:, None] / max(count, 1)
            found.append(corners[i] + s * (corners[j] - corners[i]))
    return np.concatenate(found)


def inflated(faces: Array, margin: float) -> Array:
    """Faces moved outwards by `margin` [m] (inwards when negative)."""
    return np.column_stack([faces[:, :3], faces[:, 3] + margin])


def cropped(faces: Array, low: Array, high: Array) -> Array:
    """Faces of the part of a polyhedron inside the box from `low` to `high` (3,) [m]."""
    one = np.eye(3)
    return np.vstack([faces, np.column_stack([one, high]), np.column_stack([-one, -low])])


def bounding_boxes(obstacles: Sequence[Array]) -> Array:
    """Boxes (2, n, 3: low, high) [m] around polyhedra."""
    corners = [vertices(faces)[0] for faces in obstacles]
    low, high = [c.min(axis=0) for c in corners], [c.max(axis=0) for c in corners]
    return np.array([low, high]).reshape(2, len(obstacles), 3)


def blocked(a: Array, b: Array, faces: Array) -> NDArray[np.bool_]:
    """Which segments a -> b (m, 3) cross the interior of the polyhedron (Cyrus-Beck clipping)."""
    start = a @ faces[:, :3].T - faces[:, 3]
    slope = (b - a) @ faces[:, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        hit = -start / slope
    enter = np.where(slope < -1e-12, hit, 0.0).max(axis=1, initial=0.0)
    leave = np.where(slope > 1e-12, hit, 1.0).min(axis=1, initial=1.0)
    beside = ((np.abs(slope) <= 1e-12) & (start >= 0)).any(axis=1)
    return np.asarray((leave - enter > 1e-9) & ~beside)


@dataclass(frozen=True)
class Network:
    """Shortest paths between the given points: `paths[i, j]` a polyline (k, 3), absent when there is none."""

    paths: dict[tuple[int, int], Array]

    def path(self, i: int, j: int) -> Array | None:
        """The polyline from point i to point j, or None."""
        return self.paths.get((i, j))


def visibility(nodes: Array, obstacles: Sequence[Array]) -> sparse.csr_matrix:
    """Distances between all pairs of nodes (n, 3) that see each other."""
    i, j = np.triu_indices(len(nodes), 1)
    clear = np.ones(len(i), dtype=bool)
    for begin in range(0, len(i), CHUNK):
        part = slice(begin, begin + CHUNK)
        clear[part] = unblocked(nodes, i[part], j[part], obstacles)
    i, j = i[clear], j[clear]
    length = np.maximum(np.linalg.norm(nodes[i] - nodes[j], axis=1), 1e-9)
    return sparse.csr_matrix((length, (i, j)), shape=(len(nodes), len(nodes)))


def beyond(nodes: Array, faces: Array) -> Ints:
    """Beyond which of the first 63 faces each node (n,) lies, as bits."""
    outside = nodes @ faces[:63, :3].T - faces[:63, 3] >= 0
    return np.asarray(outside @ (1 << np.arange(outside.shape[1], dtype=np.int64)))


def unblocked(nodes: Array, i: Ints, j: Ints, obstacles: Sequence[Array]) -> NDArray[np.bool_]:
    """Which segments from node i to node j (m,) cross no obstacle.

    Only those whose ends are beyond no common face are clipped.
    """
    clear = np.ones(len(i), dtype=bool)
    for faces in obstacles:
        sides = beyond(nodes, faces)
        close = np.flatnonzero(clear & (sides[i] & sides[j] == 0))
        clear[close] = ~blocked(nodes[i[close]], nodes[j[close]], faces)
    return clear


def network(points: Array, workspace: Array, obstacles: Sequence[Array], margin: float) -> Network:
    """Shortest paths between `points` (n, 3) that keep `margin` [m] to obstacles and workspace.

    Points themselves may be nearer to the workspace's faces (they are given), never inside an
    inflated obstacle: such a point has no paths.
    """
    solid = [inflated(f, margin - 10 * TOUCH) for f in obstacles]
    room = inflated(workspace, -margin)
    bends = [edge_points(np.vstack([inflated(f, margin), room])) for f in obstacles]
    extra = np.concatenate(bends) if bends else np.zeros((0, 3))
    free = np.ones(len(extra), dtype=bool)
    for faces in solid:
        free &= ((extra @ faces[:, :3].T - faces[:, 3]) >= 0).any(axis=1)
    nodes = np.vstack([points, extra[free]])
    graph = visibility(nodes, solid)
    _, before = dijkstra(graph, directed=False, indices=np.arange(len(points)), return_predecessors=True)
    paths: dict[tuple[int, int], Array] = {}
    for i in range(len(points)):
        for j in range(len(points)):
            walk = [j]
            while walk[-1] != i and before[i, walk[-1]] >= 0:
                walk.append(int(before[i, walk[-1]]))
            if walk[-1] == i:
                paths[i, j] = nodes[walk[::-1]]
    return Network(paths)


def reach(path: Array) -> float:
    """Sum over the bends of the longest axis [m]: what per-axis limits make of a polyline's length."""
    return float(np.abs(np.diff(path, axis=0)).max(axis=1, initial=0.0).sum()) if len(path) > 1 else 0.0


def leg_time(length: float, v_max: float, a_max: float, *, rest: bool = True) -> float:
    """Time [s] of `length` [m] under the limits: rest to rest (trapezoid), or flown through at v_max."""
    if not rest:
        return length / v_max
    if length * a_max < v_max**2:
        return 2 * float(np.sqrt(length / a_max))
    return length / v_max + v_max / a_max


def turn_time(angle: float, rate: float) -> float:
    """Time [s] of a quintic rest-to-rest turn whose peak rate, 15/8 of its mean, is `rate` [rad/s]."""
    return 1.875 * abs(angle) / rate


def spread(least: Array, windows: Array, horizon: float, sample: float) -> Array | None:
    """Event times (n,) [s] that use the slack: legs as slow as windows and horizon allow.

    `least` (n + 1,) [s] shortest times of the legs to every event and then home; `windows` (n, 2) [s].
    The smallest ratio of given to least time is made as large as possible, then the next smallest,
    and so on; times are multiples of `sample`. None when the windows cannot be met.
    """
    n = len(least) - 1
    late = np.append(windows[:, 1], horizon)
    early = np.append(windows[:, 0], horizon)
    times = np.zeros(n + 1)
    done, clock = 0, 0.0
    while done <= n:
        best, end = np.inf, n
        for k in range(done, n + 1):
            room, need = late[k] - clock, least[done : k + 1].sum()
            # Legs that take no time need no room: any ratio will do, as long as the window is not over.
            ratio = room / need if need > 1e-6 else (1.0 if -1e-9 <= room <= 1e-6 else room / 1e-6)
            if ratio <= best + 1e-12:
                best, end = ratio, k
        if best < 1 - 1e-9:
            return None
        for k in range(done, end + 1):
            waits = clock + best * least[k] < early[k]
            clock = max(clock + best * least[k], early[k])
            if clock > late[k] + 1e-9:
                return None
            times[k] = clock
            if waits:
                # Waiting took time that the ratio had counted on: what follows is spread anew.
                end = k
                break
        done = end + 1
    out = np.floor(times[:n] / sample + 1e-6) * sample
    out = np.maximum(out, np.ceil(windows[:, 0] / sample - 1e-6) * sample)
    gaps = np.diff(np.concatenate([[0.0], out, [horizon]]))
    return out if (gaps >= least - 2 * sample).all() else None


def follow(path: Array, s: Array) -> Array:
    """Points (m, 3) at fractions `s` (m,) of the length of a polyline."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    if length[-1] <= 0:
        return np.repeat(path[:1], len(s), axis=0)
    return np.column_stack([np.interp(s * length[-1], length, path[:, k]) for k in range(3)])
