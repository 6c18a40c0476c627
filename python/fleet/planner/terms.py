"""Terms of the nonlinear program: what of a mission is its shape, and what are numbers."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from . import clearance as near
from . import stages
from .algebra import Score, Symbols
from .knots import KNOT, Array, Grid, Pieces, hermite
from .problem import Problem
from .rows import Block, stack
from .smooth import Smooth
from .stages import Given, Pattern, Posed
from .weights import added

#: Distance of the samples of smooth robustness [s]; windows are rounded to them.
GUIDE = 0.5


def empty() -> Array:
    """No numbers."""
    return np.zeros(0)


@dataclass(frozen=True)
class Term:
    """Constraints `low <= pose(given, *shape) <= high`, with `numbers` as parameters.

    `low` and `high` have an entry for each constraint, or one for all. `guess` are the first values of the
    term's own unknowns, which lie between `own_low` and `own_high`.
    Terms with equal `pose` and `shape` have the same expressions.
    """

    pose: Callable[..., Posed]
    shape: tuple[Hashable, ...]
    numbers: Array
    low: Array
    high: Array
    guess: Array = field(default_factory=empty)
    own_low: float = 0.0
    own_high: float = 0.0


def linear(blocks: list[Block], size: int, low: float) -> Term:
    """Rows `vals . x + rho r <= rhs`, and at least `low` less than that."""
    matrix, rhs = stack(blocks, size)
    matrix.sort_indices()
    numbers = np.concatenate([matrix.data, rhs])
    ends = np.full(len(rhs), low), np.zeros(len(rhs))
    return Term(stages.linear, (Pattern.of(matrix),), numbers, *ends)


def limits(task: Problem, grid: Grid, drone: int) -> Term:
    """Limits of velocity and acceleration of one drone."""
    h = np.diff(grid.times[drone])
    v, a = task.v_max * (1 - 1e-5), task.a_max * (1 - 1e-5)
    most = np.concatenate([np.full(15 * len(h), v), np.full(12 * len(h), a)])
    return Term(stages.limits, (grid.offsets[drone], len(h) + 1), h, -most, most)


def share(task: Problem, clause: str, level: float) -> Array:
    """What r asks of a clause, as numbers of `Given.margin`: its weight, and the tube with r at `level`."""
    weight = task.weight(clause)
    return np.array([weight, float(added(weight, task.tube, level))])


def axes_of(pieces: Pieces, size: int) -> tuple[tuple[Pattern, ...], Array]:
    """Patterns per axis of the matrices from all knots to control points (6 m,), and their numbers."""
    rows = np.repeat(np.arange(6 * len(pieces.start)), 6)
    shape = (6 * len(pieces.start), size)
    found = []
    for axis in range(3):
        columns = np.repeat(pieces.columns[:, axis::3], 6, axis=0).ravel()
        found.append(stages.matrix_of(rows, columns, pieces.maps.reshape(-1), shape))
    return tuple(Pattern.of(matrix) for matrix in found), found[0].data


def outside(task: Problem, w: near.Watch, size: int, now: Array, level: float) -> Term | None:
    """Each posed piece beyond a convex combination of an obstacle's faces; None when none is posed."""
    index = np.flatnonzero(w.posed)
    if len(index) == 0:
        return None
    axes, maps = axes_of(w.pieces[0].take(index), size)
    n, m = len(w.faces), len(index)
    guess = np.full((n, m), 0.1 / n)
    guess[near.outside_margin(w, now)[1][index], np.arange(m)] += 0.9
    numbers = np.concatenate([maps, w.faces.ravel(order="F"), share(task, w.clause, level)])
    low = np.concatenate([np.ones(m), np.zeros(6 * m)])
    high = np.concatenate([np.ones(m), np.full(6 * m, np.inf)])
    return Term(stages.outside, (axes, n), numbers, low, high, guess.ravel(order="F"), 0.0, 1.0)


def apart(task: Problem, w: near.Watch, size: int, now: Array, level: float) -> Term | None:
    """Each posed piece of a pair apart; with r at `level` as far as the tube asks.

    None when none is posed.
    """
    index = np.flatnonzero(w.posed)
    if len(index) == 0:
        return None
    weight, m = task.weight(w.clause), len(index)
    asked = near.pair_least(w, now, task.tube)[index]
    extra = np.maximum(near.TUBE_EASE * asked - weight * level, 0.0)
    (one, first), (two, second) = (axes_of(p.take(index), size) for p in w.pieces)
    numbers = np.concatenate([first, second, w.value + extra, [weight, 0.0]])
    low = np.zeros(7 * m)
    high = np.concatenate([np.ones(m), np.full(6 * m, np.inf)])
    guess = near.apart_margin(w, now)[1][index].ravel()
    return Term(stages.apart, (one, two), numbers, low, high, guess, -1.0, 1.0)


def held(hold: float) -> Term:
    """r at least `hold`."""
    return Term(stages.held, (), np.array([hold]), np.zeros(1), np.full(1, np.inf))


@dataclass(frozen=True)
class Part:
    """A part without a normal form, all that its smooth robustness depends on: formula, regions, samples.

    Positions at the samples are sparse maps of the knots, `maps[drone][axis]` their pattern and numbers.
    """

    formula: str
    regions: tuple[tuple[str, bytes], ...]
    step: float
    maps: tuple[tuple[str, tuple[tuple[Pattern, bytes], ...]], ...]


def rest(task: Problem, grid: Grid, level: float) -> list[Term]:
    """Smooth robustness of every part without a normal form at least its share of r, `GUIDE` apart.

    They guide the solver; the verdict is the exact robustness at T_s, which the result is certified on.
    """
    if not task.spec.rest:
        return []
    step = max(1, round(GUIDE / task.sample)) * task.sample
    times = np.arange(round(task.horizon / step) + 1).astype(np.float64) * step
    maps = tuple((name, sampled(grid, d, times)) for d, name in enumerate(task.ids))
    regions = tuple((name, np.ascontiguousarray(faces).tobytes()) for name, faces in task.regions.items())
    found = []
    for part in task.spec.rest:
        whole = Part(json.dumps(part.formula), regions, step, maps)
        numbers = share(task, part.clause, level)
        found.append(Term(smooth, (whole,), numbers, np.zeros(1), np.full(1, np.inf)))
    return found


def smooth(given: Given, part: Part) -> Posed:
    """Conjuncts of the smooth robustness of a part, less its margin."""
    return Posed([conjuncts(part, given.x, given.c) - given.margin()])


def conjuncts(part: Part, x: Any, c: Any) -> Any:
    """Column whose true minimum is the robustness of a part [m]."""
    positions = {}
    for name, axes in part.maps:
        positions[name] = ca.horzcat(*(p.filled(ca.DM(np.frombuffer(data))) @ x for p, data in axes))
    regions = {name: np.frombuffer(data).reshape(-1, 4) for name, data in part.regions}
    walk = Smooth(positions, regions, part.step, Symbols(Score.SOUND, c))
    return walk.conjuncts(json.loads(part.formula))


def sampled(grid: Grid, drone: int, times: Array) -> tuple[tuple[Pattern, bytes], ...]:
    """Positions at `times` (n,) [s] as sparse linear maps of all knots, one an axis."""
    knots = grid.times[drone]
    seg = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    h = np.diff(knots)[seg]
    s = np.clip((times - knots[seg]) / h, 0.0, 1.0)[:, None, None]
    maps = hermite(h)
    for _ in range(5):
        maps = maps[:, :-1] * (1 - s) + maps[:, 1:] * s
    rows = np.repeat(np.arange(len(times)), 6)
    found = []
    for axis in range(3):
        columns = grid.offsets[drone] + KNOT * seg[:, None] + 3 * np.arange(6)[None, :] + axis
        matrix = stages.matrix_of(rows, columns.ravel(), maps[:, 0].ravel(), (len(times), grid.size))
        found.append((Pattern.of(matrix), matrix.data.tobytes()))
    return tuple(found)
