"""Simple proofs that a mission is infeasible: visits that cannot all be reached in time even in free space.

Nothing but what every plan must keep is used: each axis starts at rest, keeps v_max and a_max and ends at
rest, the heading keeps its rate, and clauses that close a region to a drone. Obstacles and other drones
are left out, so that "impossible" is a proof and "possible" says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import linprog

from .flown import Array
from .mip import Formula, World


@dataclass(frozen=True)
class Visit:
    """One of `options` (drone, region) at a time of `window`, for `dwell` [s]."""

    options: tuple[tuple[str, str], ...]
    window: tuple[float, float]
    dwell: float


def visits(f: Formula) -> list[Visit]:
    """What a clause asks for in the form of visits; none where it has another form."""
    if f["op"] == "and":
        return [v for g in f["fs"] for v in visits(g)]
    branches = f["fs"] if f["op"] == "or" else [f]
    if any(g["op"] != "eventually" for g in branches):
        return []
    if len({(g["from"], g["to"]) for g in branches}) > 1:
        return []
    window = (branches[0]["from"], branches[0]["to"])
    found = [option for g in branches for option in places(g["f"])]
    if len(branches) == 1 and branches[0]["f"]["op"] == "and":
        return [Visit((place,), window, 0.0) for place, _ in found]
    if not found or len({dwell for _, dwell in found}) > 1:
        return []
    return [Visit(tuple(place for place, _ in found), window, found[0][1])]


def places(f: Formula) -> list[tuple[tuple[str, str], float]]:
    """(drone, region) and dwell [s] of a visit, or of each of several."""
    if f["op"] in ("or", "and"):
        return [place for g in f["fs"] for place in places(g)]
    if f["op"] == "always" and f["from"] == 0 and f["f"]["op"] == "in":
        return [((f["f"]["drone"], f["f"]["region"]), f["to"])]
    return [((f["drone"], f["region"]), 0.0)] if f["op"] == "in" else []


def extent(faces: Array, tube: float, workspace: Array) -> Array | None:
    """Box (2, 3: low, high) of the part of a region in the workspace, both less the tube; None if empty."""
    both = np.vstack([faces, workspace])
    A, b = both[:, :3], both[:, 3] - tube
    out = np.zeros((2, 3))
    for axis in range(3):
        for k, sign in ((0, 1.0), (1, -1.0)):
            found = linprog(sign * np.eye(3)[axis], A_ub=A, b_ub=b, bounds=(None, None))
            if found.x is None:
                return None
            out[k, axis] = found.x[axis]
    return out


class Tours:
    """Soonest times between places, and the search for any tour that keeps the windows."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.asked = [v for _, f in world.clauses for v in visits(f)]
        names = {r for v in self.asked for _, r in v.options} | {f"home.{d}" for d in world.drones}
        room = world.regions["workspace"]
        self.boxes = {n: extent(world.regions[n], world.tube, room) for n in sorted(names)}
        self.closed = [(f["f"], f["from"], f["to"]) for _, f in world.clauses if closes(f)]

    def leg(self, a: Array, b: Array, rests: int) -> float:
        """Least time [s] between boxes (2, 3) of the slowest axis, at rest at `rests` of its ends."""
        w = self.world
        far = float(np.maximum(np.maximum(b[0] - a[1], a[0] - b[1]), 0.0).max())
        speed_up = w.v_max**2 / (2 * w.a_max)
        if rests == 0:
            return far / w.v_max
        if rests == 1:
            return (
                far / w.v_max + w.v_max / (2 * w.a_max)
                if far > speed_up
                else float(np.sqrt(2 * far / w.a_max))
            )
        if far > 2 * speed_up:
            return far / w.v_max + w.v_max / w.a_max
        return 2 * float(np.sqrt(far / w.a_max))

    def open_at(self, drone: str, region: str, t: float, dwell: float) -> float:
        """The first time from t on at which the region is open to the drone for `dwell`."""
        for f, low, high in sorted(self.closed, key=lambda c: c[1]):
            if (f["drone"], f["region"]) == (drone, region) and t < high and t + dwell > low:
                t = high
        return t

    def possible(self) -> bool:
        """Whether visits can be shared out and ordered such that free space allows all of them."""
        if any(box is None for box in self.boxes.values()):
            return False
        full = (1 << len(self.asked)) - 1
        reached = {0}
        for drone in self.world.drones:
            mine = self.sets(drone)
            reached = {a | b for a in reached for b in mine}
        return full in reached

    def sets(self, drone: str) -> set[int]:
        """Sets of visits (bit masks) that one drone could do on its own and be home at T."""
        w, out = self.world, set()
        start = np.stack([w.starts[drone], w.starts[drone]])
        home = self.boxes[f"home.{drone}"]
        assert home is not None
        best: dict[tuple[int, int, int], list[tuple[float, float]]] = {}

        @cache
        def turn(a: float, b: float) -> float:
            off = (b - a + np.pi) % (2 * np.pi) - np.pi
            return abs(off) / w.psi_rate

        def grow(mask: int, at: int, t: float, looked: float, psi: float) -> None:
            box = start if at < 0 else self.box(drone, at)
            if t + self.leg(box, home, 2 if at < 0 else 1) <= w.horizon + 1e-6:
                out.add(mask)
            for e, visit in enumerate(self.asked):
                region = dict(visit.options).get(drone)
                if region is None or mask >> e & 1:
                    continue
                wanted = w.headings.get(region)
                soon = t + self.leg(box, self.box(drone, e), 1 if at < 0 else 0)
                if wanted is not None:
                    soon = max(soon, looked + turn(psi, wanted))
                soon = self.open_at(drone, region, max(soon, visit.window[0]), visit.dwell)
                if soon > visit.window[1] + 1e-6:
                    continue
                done = soon + visit.dwell
                facing = (psi, looked) if wanted is None else (wanted, done)
                # Facing away for longer is never worse: the smaller time since which it may turn.
                key = (mask | 1 << e, e, hash(facing[0]))
                known = best.setdefault(key, [])
                if any(a <= done and b <= facing[1] for a, b in known):
                    continue
                known.append((done, facing[1]))
                grow(mask | 1 << e, e, done, facing[1], facing[0])

        grow(0, -1, 0.0, 0.0, w.psi[drone])
        return out

    def box(self, drone: str, e: int) -> Array:
        """The box of the region in which a drone would do visit e."""
        found = self.boxes[dict(self.asked[e].options)[drone]]
        assert found is not None
        return found


def closes(f: Formula) -> bool:
    """Whether a clause closes a region to a drone for a time."""
    return bool(f["op"] == "always" and f["f"]["op"] == "outside")


def impossible(world: World) -> bool:
    """Whether no plan can keep the visits, whatever else the mission asks."""
    return not Tours(world).possible()
