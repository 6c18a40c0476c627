"""The fast path: sequential convex steps, each a quadratic program with separating planes held.

Every step is an inner approximation: planes found at the last trajectory stay valid for it, so the
margin r never falls from step to step (convex-concave procedure; Lipp and Boyd 2016). First r is
maximised, then energy is minimised at the r reached.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from . import clearance as near
from .duties import Duties
from .knots import Array
from .rows import Block, energy, stack
from .setup import SMOOTH, Setup, warm_start
from .solver import Solution, solve
from .weights import added, slack_of, weighed

Progress = Callable[[str, float], None]

#: Most convex steps of one attempt.
STEPS = 14
#: r counts as at its bound, or as no longer rising, within this [m].
TOLERANCE = 1e-3
#: Clearance given up so that energy can be saved [m].
GIVEN_UP = 2e-3
#: Energy steps after r stands.
POLISH = 2
#: Share of the bound from which a start is taken to reach it.
NEARLY = 0.8
#: Weight of smoothness while r is maximised; small against one metre of r.
SOFT = 1e-4
#: Tilts of the planes of a pair in conflict that are tried: none, over, under, beside.
LIFTS = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0))


@dataclass(frozen=True)
class Margins:
    """Reached: r [m] over all, worst clause, share of limits, least margin over the tube [m], its clause."""

    r: float
    clause: str
    share: float
    tube: float
    short: str


@dataclass
class Steps:
    """The constraints of a setup and the margins they reach."""

    setup: Setup
    within: list[near.Watch]
    beyond: list[near.Watch]
    apart: list[near.Watch]
    bounds: near.Bounds
    duties: Duties

    @classmethod
    def of(cls, setup: Setup) -> Steps:
        """No rows posed yet."""
        within, beyond, apart = near.watches(setup.problem, setup.grid)
        bounds = near.Bounds.none_posed(setup.problem, setup.grid)
        duties = Duties(setup.problem, setup.grid, setup.bound)
        return cls(setup, within, beyond, apart, bounds, duties)

    def rows(self, x: Array, level: float, lift: Array | None = None) -> list[Block]:
        """Rows that can matter near the trajectory `x` when r may reach `level`.

        `lift` (3,), or (pairs, 3) one each, tilts the planes of pairs in conflict.
        """
        wanted, tube = self.setup.bound, self.setup.problem.tube
        blocks = [*self.visits(level), *self.bounds.rows(x)]
        for w in self.within:
            blocks += self.asked(w.clause, near.inside_rows(w, x, wanted), level)
        for w in self.beyond:
            blocks += self.asked(w.clause, near.outside_rows(w, x, wanted), level)
        tilts = np.broadcast_to(np.zeros(3) if lift is None else lift, (len(self.apart), 3))
        for w, tilt in zip(self.apart, tilts, strict=True):
            weight, own = self.setup.problem.weight(w.clause), None if lift is None else tilt
            blocks += weighed(near.apart_rows(w, x, wanted, weight * level, tube, own), weight)
        blocks += self.duties.rows(x, wanted, level)
        return blocks

    def visits(self, level: float) -> list[Block]:
        """Rows of the visits and of the end at home."""
        return [b for clause, block in self.setup.visits for b in self.asked(clause, [block], level)]

    def asked(self, clause: str, blocks: Iterable[Block], level: float) -> Iterator[Block]:
        """Rows of a clause that ask for its share of r, and for the tube at least with r at `level`."""
        weight = self.setup.problem.weight(clause)
        return weighed(blocks, weight, float(added(weight, self.setup.problem.tube, level)))

    def margins(self, x: Array) -> Margins:
        """Margins of the trajectory over everything, posed or not."""
        task, wanted = self.setup.problem, self.setup.bound
        single = [(float(near.inside_margin(w, x).min()), w.clause) for w in self.within]
        single += [(near.outside_least(w, x, wanted), w.clause) for w in self.beyond]
        for clause, block in self.setup.visits:
            single.append((float((block.rhs - (block.vals * x[block.cols]).sum(axis=1)).min()), clause))
        found: list[tuple[float, float, str]] = [
            (slack_of(margin, task.weight(clause), task.tube, wanted), margin - task.tube, clause)
            for margin, clause in single
        ]
        for w in self.apart:
            each, asked = near.apart_margin(w, x)[0], near.pair_least(w, x, task.tube)
            weight = task.weight(w.clause)
            least = float((each - added(weight, asked, wanted)).min()) / weight
            found.append((least, float((each - asked).min()), w.clause))
        found += self.duties.margins(x, wanted)
        r, worst = min([(wanted, ""), *((margin, clause) for margin, _, clause in found)])
        least, short = min((spare, clause) for _, spare, clause in found)
        return Margins(r, worst, self.bounds.worst(x), least, short)

    def step(
        self,
        x: Array,
        hold: float | None,
        lift: Array | None = None,
        weights: Mapping[int, float] = SMOOTH,
    ) -> Array | None:
        """One convex step from `x`: maximise r, or hold it at `hold` and minimise energy."""
        below = self.rows(x, self.setup.bound if hold is None else hold, lift)
        found = program(self.setup, below, hold, weights)
        return None if found is None else found.x[: self.setup.grid.size]


def program(
    setup: Setup,
    below: Sequence[Block],
    hold: float | None,
    weights: Mapping[int, float] = SMOOTH,
) -> Solution | None:
    """The quadratic program of one step over all knots and r, the last unknown.

    With `hold` r is at least that [m] and the energy that `weights` weigh (by order of derivative) is
    least; without, r is largest.
    """
    size = setup.grid.size
    smooth = energy(setup.grid, {k: (SOFT if hold is None else 1.0) * w for k, w in weights.items()})
    linear = np.zeros(size + 1)
    linear[size] = 0.0 if hold is not None else -1.0
    slack = np.array([[size]])
    rows = [*below, Block(np.ones((1, 1)), slack, np.array([setup.bound]), np.zeros(1))]
    if hold is not None:
        rows.append(Block(-np.ones((1, 1)), slack, np.array([-hold]), np.zeros(1)))
    quadratic = sparse.csc_matrix(sparse.block_diag([smooth, sparse.csc_matrix((1, 1))]))
    return solve(quadratic, linear, stack(setup.equal, size), stack(rows, size))


def better(a: Margins, b: Margins) -> bool:
    """Whether a is usable and has the larger r, or b is not usable."""
    return (a.share <= 1.0, a.r) > (b.share <= 1.0, b.r)


def climb(
    steps: Steps, x: Array, lift: Array | Sequence[float] = (), progress: Progress | None = None
) -> tuple[Array, Margins, int]:
    """Maximise r from `x`; returns the best trajectory, its margins, and the number of steps.

    `lift`, if there is any, tilts the planes of pairs in conflict in the first step (`Steps.rows`).
    """
    tilt = np.asarray(lift) if np.any(lift) else None
    best, top = x, steps.margins(x)
    stalled = 0
    for count in range(1, STEPS + 1):
        if progress is not None:
            progress("solve", top.r)
        moved = steps.step(x, None, tilt if count == 1 else None)
        if moved is None:
            return best, top, count
        x, now = moved, steps.margins(moved)
        stalled = 0 if now.r > top.r + TOLERANCE or top.share > 1 else stalled + 1
        if better(now, top):
            best, top = x, now
        if top.share <= 1 and (top.r >= steps.setup.bound - TOLERANCE or stalled >= 2):
            break
    return best, top, count


def polish(
    steps: Steps, x: Array, reached: Margins, progress: Progress | None = None
) -> tuple[Array, Margins, int]:
    """Minimise energy at r within `GIVEN_UP` of what was reached, pairs at least as far as the tube asks."""
    hold = reached.r - GIVEN_UP
    best, top = x, reached
    for count in range(1, POLISH + 3):
        if progress is not None:
            progress("polish", top.r)
        moved = steps.step(best, hold)
        if moved is None:
            return best, top, count
        now = steps.margins(moved)
        if now.share <= 1 and now.r >= hold - TOLERANCE and now.tube >= min(top.tube, 0.0):
            best, top = moved, now
            if count >= POLISH:
                break
        # Something that was not posed was passed: pose it too, from the trajectory that passed it.
        else:
            steps.rows(moved, hold)
    return best, top, count


def blames_pair(attempt: tuple[Array, Margins, Steps]) -> bool:
    """Whether a pair is what keeps r down, so that another way past each other could help."""
    return any(w.clause == attempt[1].clause for w in attempt[2].apart)


def at_once(
    setup: Setup, start: Array, progress: Progress | None = None
) -> tuple[Array, Margins, int] | None:
    """Energy steps at the bound of r from a start that is nearly there, which saves climbing; or None."""
    steps = Steps.of(setup)
    begin = steps.margins(start)
    if begin.share > 1 or begin.r < NEARLY * setup.bound:
        return None
    x, margins, used = polish(steps, start, replace(begin, r=setup.bound), progress)
    return None if x is start else (x, margins, used)


def optimise(setup: Setup, progress: Progress | None = None) -> tuple[Array, Margins, int]:
    """The best trajectory over the tilts of `LIFTS` (until one is at the bound), then polished."""
    start = warm_start(setup)
    easy = at_once(setup, start, progress)
    if easy is not None:
        return easy
    chosen: tuple[Array, Margins, Steps] | None = None
    count = 0
    for lift in LIFTS:
        steps = Steps.of(setup)
        x, margins, used = climb(steps, start, lift, progress)
        count += used
        if chosen is None or better(margins, chosen[1]):
            chosen = (x, margins, steps)
        if (margins.share <= 1 and margins.r >= setup.bound - 10 * TOLERANCE) or not blames_pair(chosen):
            break
    assert chosen is not None
    best, top, steps = chosen
    x, margins, used = polish(steps, best, top, progress) if top.share <= 1 else (best, top, 0)
    return x, margins, count + used
