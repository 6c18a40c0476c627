"""Clauses without a normal form as rows: the duties of the trajectory at hand, chosen anew at every step."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from . import clearance as near
from .duty import Duty
from .knots import Array, Grid, Pieces, cut, merge, refine
from .problem import Problem
from .rows import Block, half_spaces, joined, separation
from .signals import Signals, positions
from .spec import Invariant, Specification, predicate
from .weights import added, slack_of, weighed
from .witness import choose

#: Tilts of the planes that keep a pair together, about a quarter turn's third around the line between them.
TILTS = 0.45 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
#: Robustness above the wanted one counts as equal only beyond this [m]: choices look a little further.
BEYOND = 0.2


@dataclass
class Together:
    """A pair within `value` [m]: planes across the line between them, and some tilted ones."""

    clause: str
    one: Pieces
    two: Pieces
    value: float

    def between(self, x: Array) -> Array:
        """Differences of control points (m, 6, 3) [m]."""
        return self.one.points(x) - self.two.points(x)

    def margin(self, x: Array) -> float:
        """Least margin: a norm is convex, so control points bound it over continuous time."""
        return float(self.value - np.linalg.norm(self.between(x), axis=2).max())

    def rows(self, x: Array) -> Iterator[Block]:
        """Rows by tangent planes of the ball."""
        gap = self.between(x)
        mean = gap.mean(axis=1)
        size = np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
        ways = [gap[:, k] for k in range(6)] + [mean / size + tilt for tilt in TILTS]
        for way in ways:
            norm = np.linalg.norm(way, axis=1, keepdims=True)
            normals = np.where(norm > 1e-6, way / np.maximum(norm, 1e-9), [0.0, 0.0, 1.0])
            yield separation(self.one, self.two, -normals, np.full(len(normals), -self.value))


@dataclass
class Sum:
    """A linear predicate over several drones: the sum of `factors . p` and `constant` is at least r."""

    clause: str
    pieces: tuple[Pieces, ...]
    factors: Array
    constant: float

    def margin(self, x: Array) -> float:
        """Least margin over all control points."""
        parts = [p.points(x) @ n for p, n in zip(self.pieces, self.factors, strict=True)]
        return float(sum(parts).min() + self.constant)

    def rows(self, x: Array) -> Iterator[Block]:
        """Rows that hold whatever the trajectory is now."""
        m = len(self.pieces[0].start)
        parts = [
            half_spaces(p, np.tile(n, (m, 1)), np.zeros(m))
            for p, n in zip(self.pieces, self.factors, strict=True)
        ]
        rows = len(parts[0].vals)
        yield joined(parts, np.full(rows, self.constant), np.ones(rows))


@dataclass
class Posed:
    """Duties of one trajectory, sorted by how they are posed."""

    within: list[near.Watch] = field(default_factory=list)
    beyond: list[near.Watch] = field(default_factory=list)
    apart: list[near.Watch] = field(default_factory=list)
    together: list[Together] = field(default_factory=list)
    sums: list[Sum] = field(default_factory=list)


@dataclass
class Duties:
    """The duties of the mission's `rest` on a grid of knots."""

    problem: Problem
    grid: Grid
    enough: float
    last: tuple[bytes, Posed] | None = None

    def at(self, x: Array) -> Posed:
        """Duties chosen by the exact robustness of the trajectory `x`."""
        if not self.problem.spec.rest:
            return Posed()
        mark = x.tobytes()
        if self.last is None or self.last[0] != mark:
            signals = Signals.of(self.problem, positions(self.problem, self.grid, x))
            posed = Posed()
            for duty in choose(self.problem.spec.rest, signals, self.enough + BEYOND):
                self.pose(posed, duty)
            self.last = (mark, posed)
        return self.last[1]

    def rows(self, x: Array, wanted: float, level: float) -> Iterator[Block]:
        """Rows that keep the duties of `x`."""
        posed, tube = self.at(x), self.problem.tube
        for w in posed.within:
            yield from self.asked(w.clause, near.inside_rows(w, x, wanted), tube, level)
        for w in posed.beyond:
            yield from self.asked(w.clause, near.outside_rows(w, x, wanted), tube, level)
        for w in posed.apart:
            weight = self.problem.weight(w.clause)
            yield from weighed(near.apart_rows(w, x, wanted, weight * level, tube), weight)
        for pair in posed.together:
            yield from self.asked(pair.clause, pair.rows(x), 2 * tube, level)
        for total in posed.sums:
            yield from self.asked(total.clause, total.rows(x), tube, level)

    def asked(self, clause: str, blocks: Iterable[Block], least: float, level: float) -> Iterator[Block]:
        """Rows of a clause that ask for its share of r, and for `least` [m] with r at `level`."""
        weight = self.problem.weight(clause)
        return weighed(blocks, weight, float(added(weight, least, level)))

    def margins(self, x: Array, wanted: float) -> Iterator[tuple[float, float, str]]:
        """Slack r, margin over what the tube asks [m], and clause of every duty of `x`."""
        posed, tube, weight = self.at(x), self.problem.tube, self.problem.weight
        found = [(float(near.inside_margin(w, x).min()), tube, w.clause) for w in posed.within]
        found += [(near.outside_least(w, x, wanted), tube, w.clause) for w in posed.beyond]
        found += [(pair.margin(x), 2 * tube, pair.clause) for pair in posed.together]
        found += [(total.margin(x), tube, total.clause) for total in posed.sums]
        for margin, least, clause in found:
            yield slack_of(margin, weight(clause), least, wanted), margin - least, clause
        for w in posed.apart:
            each, asked = near.apart_margin(w, x)[0], near.pair_least(w, x, tube)
            most = float((each - added(weight(w.clause), asked, wanted)).min())
            yield most / weight(w.clause), float((each - asked).min()), w.clause

    def pose(self, posed: Posed, duty: Duty) -> None:
        """Add one duty in the form of its predicate."""
        f, T_s = duty.predicate, self.problem.sample
        start, end = duty.first * T_s, min(duty.last * T_s, self.problem.horizon)
        if f["op"] == "dist" and f["cmp"] == "le":
            one, two = self.pieces((f["a"], f["b"]), start, end)
            posed.together.append(Together(duty.clause, one, two, f["value"]))
            return
        found = Specification()
        predicate(found, duty.clause, f, (start, end))
        if not found.invariants:
            drones = tuple(dict.fromkeys(t["drone"] for t in f["terms"]))
            factors = np.zeros((len(drones), 3))
            for t in f["terms"]:
                factors[drones.index(t["drone"]), "xyz".index(t["axis"])] += t["coef"]
            posed.sums.append(
                Sum(duty.clause, self.pieces(drones, start, end), factors, float(f["constant"]))
            )
            return
        self.watch(posed, found.invariants[0])

    def watch(self, posed: Posed, inv: Invariant) -> None:
        """Add a duty of the form of an invariant, over its window; all of its pieces are posed."""
        start, end = inv.window
        if inv.kind == "apart" and end - start < self.problem.sample:
            # The closing speed, which the tube asks about, is that of an interval.
            end = min(start + self.problem.sample, self.problem.horizon)
            start = end - self.problem.sample
        parts = near.PARTS if inv.kind == "outside" else 1
        pieces = self.pieces(inv.drones, start, end, parts)
        numbers = tuple(self.problem.number(d) for d in inv.drones)
        faces = np.array([[-inv.row[0], -inv.row[1], -inv.row[2], inv.row[3]]])
        faces = faces if inv.kind in ("linear", "apart") else self.problem.regions[inv.region]
        kind = {"outside": posed.beyond, "apart": posed.apart}.get(inv.kind, posed.within)
        count = len(pieces[0].start)
        seen = np.ones(count if inv.kind in ("outside", "apart") else (count, len(faces)), dtype=bool)
        normals = np.zeros((count, 3))
        kind.append(near.Watch(inv.clause, numbers, seen, pieces, faces, inv.value, normals))

    def pieces(self, drones: tuple[str, ...], start: float, end: float, parts: int = 1) -> tuple[Pieces, ...]:
        """Pieces of some drones over the same times: the common refinement of their knots, or one instant."""
        numbers = [self.problem.number(d) for d in drones]
        if end - start < 1e-9:
            return tuple(cut(self.grid, d, np.array([start, start])) for d in numbers)
        knots = merge(*(self.grid.times[d] for d in numbers))
        inner = knots[(knots > start + 1e-6) & (knots < end - 1e-6)]
        times = refine(np.concatenate([[start], inner, [end]]), parts)
        return tuple(cut(self.grid, d, times) for d in numbers)
