"""What no flight can do: proofs that clauses cannot hold together, from regions, limits and times alone.

Nothing here is routed or optimised. Every time is a lower bound (per axis, through free space, into the
part of a region that leaves the tube's margin), every margin an upper bound. So what is refused here
cannot hold, and what is not refused may still have no plan.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from fleet.route import inflated, vertices
from fleet.stl.vocabulary import Formula

from .ceiling import ceilings
from .knots import Array
from .problem import Problem
from .spec import Invariant, Visit

#: Rounding in margins [m].
EXACT_TO = 1e-6


@dataclass(frozen=True)
class Impossible:
    """Clauses that cannot hold together with the limits of flight, and why in words."""

    clauses: tuple[str, ...]
    why: str


@dataclass(frozen=True)
class Geometry:
    """Where drones can be at all when the clauses of a problem hold with the tube's margin."""

    problem: Problem

    @cached_property
    def corners(self) -> dict[str, Array]:
        """Corners (k, 3) [m] of the part of each visited region that is deeper inside than the tube."""
        spec, homes = self.problem.spec, self.problem.homes
        names = {r for v in spec.visits for _, r in v.options} | set(homes)
        names |= {
            place["region"] for r in spec.rest for g in gatherings(r.formula, 0.0, 0.0) for place in g[0]
        }
        return {n: self.core((self.problem.regions[n],)) for n in sorted(names)}

    def core(self, shapes: Sequence[Array]) -> Array:
        """Corners (k, 3) [m] of what is inside all of the polyhedra by the tube; none when it is empty."""
        return vertices(inflated(np.vstack(shapes), EXACT_TO - self.problem.tube))[0]

    @cached_property
    def invariants(self) -> dict[str, list[Invariant]]:
        """Invariants of every drone that bind it to regions or half-spaces, those of little reach last."""
        found: dict[str, list[Invariant]] = {d: [] for d in self.problem.ids}
        for inv in self.problem.spec.invariants:
            if inv.kind != "apart":
                found[inv.drones[0]].append(inv)
        return found

    def barred(self, drone: str, region: str, window: tuple[float, float]) -> Invariant | None:
        """An invariant that keeps the drone out of the region, by the tube, all through the window [s]."""
        if len(self.corners[region]) == 0:
            return None
        # Drones of a fleet mostly have the same invariants: each set of them is looked at once.
        key = (self.alike[drone], region, window)
        if key not in self.first_barring:
            self.first_barring[key] = next(
                (
                    k
                    for k, inv in enumerate(self.invariants[drone])
                    if inv.window[0] <= window[0] + 1e-9
                    and inv.window[1] >= window[1] - 1e-9
                    and not self.admits(inv, region)
                ),
                None,
            )
        found = self.first_barring[key]
        return None if found is None else self.invariants[drone][found]

    @cached_property
    def alike(self) -> dict[str, int]:
        """A number for every drone, the same for those with the same invariants."""
        numbers: dict[tuple[object, ...], int] = {}
        return {
            d: numbers.setdefault(tuple((i.kind, i.region, i.row, i.window) for i in mine), len(numbers))
            for d, mine in self.invariants.items()
        }

    @cached_property
    def first_barring(self) -> dict[tuple[int, str, tuple[float, float]], int | None]:
        """Answers of `barred` so far, as places in the invariants of a drone."""
        return {}

    def admits(self, inv: Invariant, region: str) -> bool:
        """Whether some point of the region, the tube's margin inside, keeps the invariant by the tube."""
        key = (inv.kind, inv.region, region, inv.row)
        if key not in self.known:
            points, asked = self.corners[region], self.problem.tube - EXACT_TO
            if inv.kind == "linear":
                ok = (points @ np.array(inv.row[:3]) + inv.row[3]).max() >= asked
            else:
                faces = self.problem.regions[inv.region]
                beyond = points @ faces[:, :3].T - faces[:, 3]
                if inv.kind == "outside":
                    ok = beyond.max() >= asked
                else:
                    # A corner inside will do; if there is none, whether the two have anything in common.
                    ok = (beyond.max(axis=1) <= -asked).any()
                    ok = ok or len(self.core((self.problem.regions[region], faces))) > 0
            self.known[key] = bool(ok)
        return self.known[key]

    @cached_property
    def known(self) -> dict[tuple[object, ...], bool]:
        """Answers of `admits` so far."""
        return {}

    def widest(self, one: str, other: str) -> float:
        """Largest distance [m] between two drones, each inside its region by the tube."""
        a, b = self.corners[one], self.corners[other]
        return float(np.linalg.norm(a[:, None] - b[None], axis=2).max())


def gatherings(f: Formula, first: float, last: float) -> Iterator[tuple[list[Formula], float, float]]:
    """The `in` that must hold at once, at some time from `first` to `last` [s], and from when to when."""
    op = f["op"]
    if op in ("in", "and"):
        fs = f["fs"] if op == "and" else [f]
        yield [g for g in fs if g["op"] == "in"], first, last
        for g in fs:
            if g["op"] not in ("in", "or"):
                yield from gatherings(g, first, last)
    elif op in ("always", "eventually"):
        yield from gatherings(f["f"], first + f["from"], last + f["to"])
    elif op == "until":
        yield from gatherings(f["right"], first + f["from"], last + f["to"])


def impossible_margins(problem: Problem) -> Iterator[Impossible]:
    """Clauses that cannot reach the margin that the tube asks, from sizes, starts and regions."""
    for c in ceilings(problem):
        asked = 2 * problem.tube if c.pair else problem.tube
        if c.rho < asked - 1e-9:
            margin = "2 x tube" if c.pair else "tube"
            why = f"{c.why}: margin {c.rho:.2f} m, and {margin} asks for {asked:.2f} m"
            yield Impossible((c.clause,) if c.clause in problem.spec.kinds else (), why)
    geometry = Geometry(problem)
    for d, region in zip(problem.ids, problem.homes, strict=True):
        inv = geometry.barred(d, region, (problem.horizon, problem.horizon))
        if inv is not None:
            yield Impossible((inv.clause,), f"{d} must end in {region}, but {forbids(problem, inv, region)}")
    for visit in problem.spec.visits:
        blocks = [geometry.barred(d, region, visit.window) for d, region in visit.options]
        bars = [b for b in blocks if b is not None]
        if len(bars) == len(blocks):
            why = "; ".join(dict.fromkeys(reasons(problem, visit, bars)))
            yield Impossible(tuple(dict.fromkeys([visit.clause, *(b.clause for b in bars)])), why)
    yield from impossible_meetings(problem, geometry)


def reasons(problem: Problem, visit: Visit, bars: list[Invariant]) -> Iterator[str]:
    """Why each option of a visit is barred."""
    for (drone, region), inv in zip(visit.options, bars, strict=True):
        who = "" if inv.region in problem.obstacles else f" by {drone}"
        yield f"{region} cannot be visited{who}: {forbids(problem, inv, region)}"


def forbids(problem: Problem, inv: Invariant, region: str) -> str:
    """How an invariant keeps a drone out of a region, with the best margin that both leave."""
    best = common_margin(problem, inv, region)
    asked = f"the tube asks for {problem.tube:.2f} m"
    if inv.kind == "linear":
        return f"@{inv.clause} leaves a margin of at most {best:.2f} m there; {asked}"
    side = "inside" if inv.kind == "inside" else "outside"
    return f"inside {region} and {side} {inv.region} the margin is at most {best:.2f} m; {asked}"


def common_margin(problem: Problem, inv: Invariant, region: str) -> float:
    """Largest margin [m] of being in the region and keeping the invariant: a linear program a face."""
    from scipy.optimize import linprog

    inside = problem.regions[region]
    faces = (
        problem.regions[inv.region] if inv.region else np.array([[-r for r in inv.row[:3]] + [inv.row[3]]])
    )
    choices = [np.array([[*-f[:3], -f[3]]]) for f in faces] if inv.kind == "outside" else [faces]
    best = -np.inf
    for further in choices:
        rows = np.vstack([inside, further])
        matrix = np.column_stack([rows[:, :3], np.ones(len(rows))])
        found = linprog([0, 0, 0, -1], A_ub=matrix, b_ub=rows[:, 3], bounds=[(None, None)] * 4)
        if found.x is not None:
            best = max(best, float(found.x[3]))
    return best


def impossible_meetings(problem: Problem, geometry: Geometry) -> Iterator[Impossible]:
    """Drones that must be in regions at once that are nearer to each other than they may be."""
    T = problem.horizon
    homes = [(d, r, "") for d, r in zip(problem.ids, problem.homes, strict=True)]
    meetings: list[tuple[list[tuple[str, str, str]], float, float]] = [(homes, T, T)]
    for part in problem.spec.rest:
        for fs, first, last in gatherings(part.formula, 0.0, 0.0):
            meetings.append(([(str(f["drone"]), str(f["region"]), part.clause) for f in fs], first, last))
    apart = {(a, b): inv for a, b, inv in problem.pairs()}
    for places, first, last in meetings:
        for (one, at, clause), (other, there, _) in combinations(places, 2):
            a, b = sorted((problem.number(one), problem.number(other)))
            inv = apart.get((a, b))
            if inv is None or inv.window[0] > first + 1e-9 or inv.window[1] < last - 1e-9:
                continue
            if not (len(geometry.corners[at]) and len(geometry.corners[there])):
                continue
            most, asked = geometry.widest(at, there), inv.value + 2 * problem.tube
            if most < asked - EXACT_TO:
                where = f"{one} in {at} and {other} in {there}"
                room = f"are at most {most:.2f} m apart with the tube's margin"
                why = f"{where} {room}, and {inv.value:g} m and 2 x tube ask for {asked:.2f} m"
                yield Impossible(tuple(dict.fromkeys([clause, inv.clause] if clause else [inv.clause])), why)
