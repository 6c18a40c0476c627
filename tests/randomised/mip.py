"""An oracle for refusals: a mixed-integer program finds a plan with the tube's margins, or does not.

Every axis of every drone has an acceleration that is linear between knots, so that positions between
knots are cubics whose four Bernstein points are linear in the unknowns: what holds for the points holds
in continuous time, and the quintics of a plan file are these cubics. Operators over time and disjunctions
are binaries; obstacles and pairs of drones are posed where a solution came too near. Whatever is found
is a plan; what is not found may still exist.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from .flown import Array
from .program import Linear, Program, along, plus

Formula = Mapping[str, Any]
#: Longest distance of knots [s].
STEP = 1.0
#: Directions in which two drones may be apart: faces, edges and corners of a cube.
WAYS = np.array([w for w in np.ndindex(3, 3, 3) if w != (1, 1, 1)], dtype=float) - 1
WAYS /= np.linalg.norm(WAYS, axis=1, keepdims=True)
#: Share of a ball's radius at which planes across `ROUND` directions cut off a body within the ball.
WITHIN = 0.93
#: Closing speed assumed for the margin of pairs, in v_max [-]; 0.02 s of it are asked (docs/design.md, Tube).
CLOSING = 0.02 * 2
#: Share of the heading rate that a chain of quintic turns at rest in every knot keeps its peak within.
TURNS = 8 / 15
#: Nothing is unknown by more than this [m] or [rad].
FAR = 100.0


def around(count: int) -> Array:
    """Directions spread evenly over the sphere (Fibonacci)."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])


ROUND = around(80)


@dataclass(frozen=True)
class World:
    """What the program needs of a scenario; names as in formulas, SI units, faces (n, 4)."""

    drones: tuple[str, ...]
    starts: Mapping[str, Array]
    psi: Mapping[str, float]
    regions: Mapping[str, Array]
    headings: Mapping[str, float | None]
    horizon: float
    v_max: float
    a_max: float
    psi_rate: float
    tube: float
    clauses: Sequence[tuple[str, Formula]]


def negated(f: Formula) -> Formula:
    """not f, for f without until."""
    dual = {"and": "or", "or": "and", "always": "eventually", "eventually": "always"}
    swap = {"in": "outside", "outside": "in"}
    match f["op"]:
        case "and" | "or":
            return {"op": dual[f["op"]], "fs": [negated(g) for g in f["fs"]]}
        case "always" | "eventually":
            return {**f, "op": dual[f["op"]], "f": negated(f["f"])}
        case "not":
            return f["f"]
        case "implies":
            return {"op": "and", "fs": [f["left"], negated(f["right"])]}
        case "in" | "outside":
            return {**f, "op": swap[f["op"]]}
        case "dist":
            return {**f, "cmp": "le" if f["cmp"] == "ge" else "ge"}
        case "linear":
            terms = [{**t, "coef": -t["coef"]} for t in f["terms"]]
            return {**f, "terms": terms, "constant": -f["constant"]}
    raise AssertionError(f["op"])


class Oracle:
    """The program of one scenario."""

    def __init__(self, world: World, step: float = STEP) -> None:
        self.world, self.program = world, Program()
        self.times = knot_times(world, step)
        box = world.regions["workspace"]
        self.high = np.array([box[box[:, axis] > 0.99][0, 3] for axis in range(3)])
        self.low = np.array([-box[box[:, axis] < -0.99][0, 3] for axis in range(3)])
        self.p, self.v, self.a, self.psi = {}, {}, {}, {}
        for name in world.drones:
            self.fly(name)
        self.turned: dict[tuple[str, str], int] = {}
        self.lazy: list[tuple[Formula, float, float]] = []
        self.posed: set[tuple[int, int]] = set()
        for _, f in world.clauses:
            self.clause(f)

    # -- motion ----------------------------------------------------------------------------------

    def fly(self, name: str) -> None:
        """States at the knots of one drone, at rest at both ends, and its heading."""
        w, n, one = self.world, len(self.times), self.program
        self.p[name] = [[one.unknown(self.low[x], self.high[x]) for x in range(3)] for _ in range(n)]
        self.v[name] = [[one.unknown(-w.v_max, w.v_max) for _ in range(3)] for _ in range(n)]
        self.a[name] = [[one.unknown(-w.a_max, w.a_max) for _ in range(3)] for _ in range(n)]
        self.psi[name] = [one.unknown(-FAR, FAR) for _ in range(n)]
        for k, (start, end) in enumerate(pairwise(self.times)):
            h = float(end - start)
            for x in range(3):
                p, v, a = (([s[name][k + i][x] for i in (0, 1)]) for s in (self.p, self.v, self.a))
                one.row(({v[1]: 1, v[0]: -1, a[0]: -h / 2, a[1]: -h / 2}, 0.0), 0.0, 0.0)
                step = {p[1]: 1, p[0]: -1, v[0]: -h, a[0]: -(h**2) / 3, a[1]: -(h**2) / 6}
                one.row((step, 0.0), 0.0, 0.0)
                one.row(({v[0]: 1, a[0]: h / 2}, 0.0), -w.v_max, w.v_max)
                speed = one.unknown(0.0, w.v_max, cost=h)
                one.row(({speed: 1, v[0]: -1}, 0.0), 0.0, np.inf)
                one.row(({speed: 1, v[0]: 1}, 0.0), 0.0, np.inf)
            turn = TURNS * w.psi_rate * h
            one.row(({self.psi[name][k]: 1, self.psi[name][k + 1]: -1}, 0.0), -turn, turn)
        for k in (0, n - 1):
            for x in range(3):
                for state in (self.v, self.a):
                    one.row(({state[name][k][x]: 1}, 0.0), 0.0, 0.0)
        for x in range(3):
            one.row(({self.p[name][0][x]: 1}, 0.0), float(w.starts[name][x]), float(w.starts[name][x]))
        one.row(({self.psi[name][0]: 1}, 0.0), w.psi[name], w.psi[name])
        for face in w.regions[f"home.{name}"]:
            one.positive(self.inside(name, face, n - 1, over=False)[0], None)

    def points(self, name: str, k: int, over: bool) -> list[list[Linear]]:
        """The position at knot k, or the four Bernstein points of the segment after it."""
        p, v = self.p[name], self.v[name]
        first: list[Linear] = [({p[k][x]: 1.0}, 0.0) for x in range(3)]
        if not over:
            return [first]
        h = float(self.times[k + 1] - self.times[k]) / 3
        second: list[Linear] = [({p[k][x]: 1.0, v[k][x]: h}, 0.0) for x in range(3)]
        third: list[Linear] = [({p[k + 1][x]: 1.0, v[k + 1][x]: -h}, 0.0) for x in range(3)]
        return [first, second, third, [({p[k + 1][x]: 1.0}, 0.0) for x in range(3)]]

    def inside(self, name: str, face: Array, k: int, over: bool) -> list[Linear]:
        """What is left of one face beyond the tube, of each point."""
        room = float(face[3]) - self.world.tube
        return [plus(({}, room), along(face[:3], p), -1.0) for p in self.points(name, k, over)]

    # -- formulas --------------------------------------------------------------------------------

    def clause(self, f: Formula) -> None:
        """One clause; what must hold of single points over a part of the mission waits until it is needed."""
        if f["op"] == "and":
            for g in f["fs"]:
                self.clause(g)
        elif f["op"] == "always" and f["f"]["op"] == "and":
            for g in f["f"]["fs"]:
                self.clause({**f, "f": g})
        elif f["op"] == "always" and (f["f"]["op"] == "outside" or f["f"].get("cmp") == "ge"):
            self.lazy.append((f["f"], f["from"], f["to"]))
        else:
            self.post(f, 0, False, None)

    def knots(self, low: float, high: float) -> list[int]:
        """Knots within [low, high]."""
        inside = (self.times >= low - 1e-6) & (self.times <= high + 1e-6)
        return [int(k) for k in np.flatnonzero(inside)]

    def segments(self, low: float, high: float) -> list[int]:
        """Segments that share more than an end with [low, high]."""
        touched = (self.times[1:] > low + 1e-6) & (self.times[:-1] < high - 1e-6)
        return [int(k) for k in np.flatnonzero(touched)]

    def post(self, f: Formula, k: int, over: bool, guard: int | None) -> None:
        """f holds at knot k, or `over` all of the segment after it, wherever `guard` is 1."""
        match f["op"]:
            case "and":
                for g in f["fs"]:
                    self.post(g, k, over, guard)
            case "or":
                self.either([(g, k, over) for g in f["fs"]], guard)
            case "implies":
                self.post({"op": "or", "fs": [negated(f["left"]), f["right"]]}, k, over, guard)
            case "not":
                self.post(negated(f["f"]), k, over, guard)
            case "always":
                low, high = self.times[k] + f["from"], self.times[k + over] + f["to"]
                if high <= low + 1e-6:
                    self.post(f["f"], self.knots(low, high)[0], False, guard)
                for i in self.segments(low, high):
                    self.post(f["f"], i, True, guard)
            case "eventually":
                low, high = self.times[k + over] + f["from"], self.times[k] + f["to"]
                self.either([(f["f"], i, False) for i in self.knots(low, high)], guard)
            case "until":
                self.until(f, k, over, guard)
            case _:
                self.predicate(f, k, over, guard)

    def either(self, parts: list[tuple[Formula, int, bool]], guard: int | None) -> None:
        """At least one of some formulas holds, each at its place."""
        choices = [self.program.binary() for _ in parts]
        self.program.some(choices, guard)
        for (g, k, over), choice in zip(parts, choices, strict=True):
            self.post(g, k, over, choice)

    def until(self, f: Formula, k: int, over: bool, guard: int | None) -> None:
        """A witness of the right side; the left side over all segments up to it."""
        places = self.knots(self.times[k + over] + f["from"], self.times[k] + f["to"])
        choices = [self.program.binary() for _ in places]
        self.program.some(choices, guard)
        for place, choice in zip(places, choices, strict=True):
            self.post(f["right"], place, False, choice)
        for i in range(k, places[-1] if places else k):
            later = [c for place, c in zip(places, choices, strict=True) if place > i]
            held = self.program.binary()
            for choice in later:
                self.program.row(({held: 1.0, choice: -1.0}, 0.0), 0.0, np.inf)
            self.post(f["left"], i, True, held)
        for place, choice in zip(places, choices, strict=True):
            self.post(f["left"], place, False, choice)

    def predicate(self, f: Formula, k: int, over: bool, guard: int | None) -> None:
        """A predicate with the tube's margin."""
        one, tube = self.program, self.world.tube
        if f["op"] == "in":
            for face in self.world.regions[f["region"]]:
                for left in self.inside(f["drone"], face, k, over):
                    one.positive(left, guard)
            self.look(f["drone"], f["region"], [k, k + 1] if over else [k], guard)
        elif f["op"] == "outside":
            faces = self.world.regions[f["region"]]
            choices = [one.binary() for _ in faces]
            one.some(choices, guard)
            for face, choice in zip(faces, choices, strict=True):
                for left in self.inside(f["drone"], face, k, over):
                    # inside() keeps a tube within; beyond the face by a tube is 2 tubes less.
                    one.positive(plus(({}, -2 * tube), left, -1.0), choice)
        elif f["op"] == "linear":
            self.linear(f, k, over, guard)
        else:
            self.distance(f, k, over, guard)

    def linear(self, f: Formula, k: int, over: bool, guard: int | None) -> None:
        """A linear predicate at each point."""
        each = {t["drone"]: self.points(t["drone"], k, over) for t in f["terms"]}
        for i in range(4 if over else 1):
            value: Linear = ({}, f["constant"] - self.world.tube)
            for t in f["terms"]:
                value = plus(value, each[t["drone"]][i]["xyz".index(t["axis"])], t["coef"])
            self.program.positive(value, guard)

    def distance(self, f: Formula, k: int, over: bool, guard: int | None) -> None:
        """Two drones apart along one of `WAYS`, or within planes across `ROUND`."""
        one, w = self.program, self.world
        pairs = zip(self.points(f["a"], k, over), self.points(f["b"], k, over), strict=True)
        gaps = [[plus(a, b, -1.0) for a, b in zip(p, q, strict=True)] for p, q in pairs]
        if f["cmp"] == "le":
            far = WITHIN * (f["value"] - 2 * w.tube)
            for way in ROUND:
                for gap in gaps:
                    one.positive(plus(({}, far), along(way, gap), -1.0), guard)
            return
        asked = f["value"] + 2 * w.tube + CLOSING * w.v_max
        choices = [one.binary() for _ in WAYS]
        one.some(choices, guard)
        for way, choice in zip(WAYS, choices, strict=True):
            for gap in gaps:
                one.positive(plus(({}, -asked), along(way, gap)), choice)

    def look(self, name: str, region: str, places: list[int], guard: int | None) -> None:
        """The heading that a target wants, up to whole turns."""
        wanted = self.world.headings.get(region)
        if wanted is None:
            return
        key = (name, region)
        if key not in self.turned:
            self.turned[key] = self.program.unknown(-2.0, 2.0, whole=True)
        for k in places:
            off: Linear = ({self.psi[name][k]: 1.0, self.turned[key]: -2 * np.pi}, -wanted)
            self.program.positive(off, guard)
            self.program.positive(plus(({}, 0.0), off, -1.0), guard)

    # -- solving ---------------------------------------------------------------------------------

    def search(self, seconds: float, rounds: int = 25) -> Array | None:
        """Unknowns that keep everything, or None; `seconds` for each round of at most `rounds`."""
        began = time.monotonic()
        for _ in range(rounds):
            left = seconds - (time.monotonic() - began)
            if left <= 0:
                return None
            x = self.program.solve(left)
            if x is None:
                return None
            missed = self.missed(x)
            if not missed:
                return x
            for number, k in missed:
                f, low, high = self.lazy[number]
                self.posed.add((number, k))
                self.post(f, k, high > low, None)
        return None

    def missed(self, x: Array) -> list[tuple[int, int]]:
        """Waiting predicates that a solution does not keep, and where."""
        out = []
        for number, (f, low, high) in enumerate(self.lazy):
            for k in self.segments(low, high) if high > low else self.knots(low, high)[:1]:
                if (number, k) not in self.posed and not self.kept(f, k, x, high > low):
                    out.append((number, k))
        return out

    def kept(self, f: Formula, k: int, x: Array, over: bool) -> bool:
        """Whether a solution keeps `outside` or `dist >=` at a place."""

        def value(points: list[list[Linear]]) -> Array:
            return np.array([[sum(c * x[i] for i, c in e[0].items()) + e[1] for e in p] for p in points])

        if f["op"] == "outside":
            faces, points = self.world.regions[f["region"]], value(self.points(f["drone"], k, over))
            return bool((points @ faces[:, :3].T - faces[:, 3]).min(axis=0).max() >= self.world.tube - 1e-7)
        gap = value(self.points(f["a"], k, over)) - value(self.points(f["b"], k, over))
        asked = f["value"] + 2 * self.world.tube + CLOSING * self.world.v_max
        return bool((gap @ WAYS.T).min(axis=0).max() >= asked - 1e-7)

    def trajectories(self, x: Array) -> list[Array]:
        """Knots (n, 13) of every drone: t, p, v, a, and a heading at rest in every knot."""
        out = []
        for name in self.world.drones:
            state = np.hstack([x[np.array(s[name])] for s in (self.p, self.v, self.a)])
            psi = x[np.array(self.psi[name])]
            nothing = np.zeros((len(psi), 2))
            out.append(np.column_stack([self.times, state, psi, nothing]))
        return out


def knot_times(world: World, step: float) -> Array:
    """Knots at the ends of all windows and at most `step` apart."""
    marks = {0.0, world.horizon}

    def collect(f: Formula, offsets: tuple[float, ...]) -> None:
        ends = tuple(o + f[key] for o in offsets for key in ("from", "to") if key in f) or offsets
        marks.update(e for e in ends if e <= world.horizon)
        for g in [f[key] for key in ("f", "left", "right") if key in f] + list(f.get("fs", [])):
            collect(g, ends)

    for _, f in world.clauses:
        collect(f, (0.0,))
    fixed = sorted({round(t, 6) for t in marks})
    parts = [
        np.linspace(a, b, int(np.ceil((b - a) / step - 1e-9)), endpoint=False) for a, b in pairwise(fixed)
    ]
    return np.append(np.concatenate(parts), world.horizon)
