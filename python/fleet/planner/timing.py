"""Event times as variables: visits move inside their windows so that slack is used.

The value of a convex step's quadratic program is taken as a function of the visit times, the knots
between them stretched in proportion (at_times.py). To save energy, a descent with BFGS curvature and a line
search follows its slope, that of the Lagrangian (slopes.py). To raise r, which is a minimum of many and has
kinks, the rows are linearised in the times too and r is raised over both within a trust region. Windows,
order, dwell and turns are kept (events.py). Every value counts only if the trajectory keeps exact margins.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .at_times import Aim, Trial, carried, clock, laid, row_changes, solved
from .convex import LIFTS, SOFT, TOLERANCE, Margins, Progress, Steps, better, climb, polish
from .events import Events, events, moved, snapped
from .knots import Array
from .rows import Block, energy, stack
from .setup import SMOOTH, Setup, setup
from .solver import solve

#: Most times of events tried to save energy, and to raise r.
ENERGY_TRIALS, RISE_TRIALS = 80, 30
#: Trials of one line search, and the factor from one to the next.
LINE, SHORTER = 4, 0.35
#: Share of the slope that a step must gain (Armijo), and of the gain that a linearisation promises.
ARMIJO, HONEST = 1e-4, 0.1
#: Gain that ends the descent, as a share of the value.
ENOUGH = 1e-5
#: First step as a share of the mean time between events.
FIRST = 0.1
#: A leg keeps at least this share of its duration in one step.
SHRINK = 0.5


@dataclass(frozen=True)
class Retimed:
    """A setup with moved visits, its trajectory, its margins, and how many times were tried."""

    stage: Setup
    x: Array
    margins: Margins
    trials: int


def retime(
    stage: Setup,
    x: Array,
    *,
    hold: float,
    weights: Mapping[int, float] = SMOOTH,
    trials: int = ENERGY_TRIALS,
    progress: Progress | None = None,
) -> Retimed:
    """Minimise energy over trajectory and visit times at r >= `hold`, from a trajectory that keeps it.

    `weights` by order of derivative: {2: 1.0} is the integral of |a|^2 [m^2/s^3]. The result is never
    worse than `x` with times as they are; its visit times are multiples of T_s and its knots those of
    `setup`. The same input gives the same result.
    """
    return best_times(stage, x, Aim(hold, weights), trials, progress)


def raised(
    stage: Setup, x: Array, margins: Margins, progress: Progress | None = None
) -> tuple[Setup, Array, Margins]:
    """Move visits until r reaches its bound, where it does not at the times as they are.

    Nothing is moved when `margins`, those of the trajectory `x`, are at the bound. Otherwise the better of
    both, polished; its visit times are multiples of T_s. Times that leave a turn of the heading too little
    room are mended first, where they can be. What `progress` raises ends it.
    """
    found = events(stage.problem, stage.itinerary)
    legal = snapped(found, found.t)
    if len(found.who) == 0 or legal is None:
        return stage, x, margins
    same = np.array_equal(legal, np.round(found.t))
    if same and margins.share <= 1 and margins.r >= stage.bound - 10 * TOLERANCE:
        return stage, x, margins
    begin = stage if same else setup(stage.problem, moved(stage.itinerary, found, legal), stage.bound)
    y = x if same else carried(stage, x, begin)
    best = best_times(begin, y, Aim(None, SMOOTH), RISE_TRIALS, progress)
    if best.stage is stage:
        return stage, x, margins
    steps = Steps.of(best.stage)
    y, now, _ = climb(steps, best.x, LIFTS[0])
    if now.share <= 1:
        y, now, _ = polish(steps, y, now)
    return (best.stage, y, now) if not same or better(now, margins) else (stage, x, margins)


def best_times(stage: Setup, x: Array, aim: Aim, trials: int, progress: Progress | None = None) -> Retimed:
    """The search over the visit times from legal ones, with the result at whole samples."""
    first = solved(stage, x, aim)
    if first is None:
        return Retimed(stage, x, Steps.of(stage).margins(x), 1)
    found = events(stage.problem, stage.itinerary)
    search = lift if aim.hold is None else descend
    last, used = search(found, first, aim, trials, progress)
    ends = [settled(stage, first, aim)]
    whole = snapped(found, clock(last.stage))
    if last is not first and whole is not None:
        way = moved(stage.itinerary, found, whole)
        ends.append(settled(setup(stage.problem, way, stage.bound), last, aim))
    chosen = min((t for t in ends if t is not None), key=lambda t: t.value, default=first)
    return Retimed(chosen.stage, chosen.x, chosen.margins, used)


def settled(stage: Setup, near: Trial, aim: Aim) -> Trial | None:
    """Steps at the fixed visit times of `stage`, with planes found anew until the value stands."""
    best = solved(stage, carried(near.stage, near.x, stage), aim)
    for _ in range(LINE):
        if best is None:
            break
        then = solved(stage, best.x, aim)
        if then is None or then.value >= best.value - ENOUGH * abs(best.value):
            break
        best = then
    return best


def lift(found: Events, first: Trial, aim: Aim, trials: int, progress: Progress | None) -> tuple[Trial, int]:
    """Raise r over trajectory and visit times in turns of at most `trials` trials; their number."""
    now, radius, used = first, FIRST * mean_leg(first), 1
    while used < trials and now.margins.r < now.stage.bound - TOLERANCE and radius >= 0.5:
        if progress is not None:
            progress("times", now.margins.r)
        planned = joint(found, now, radius)
        if planned is None or planned[1] <= TOLERANCE:
            break
        stage = laid(now, found, clock(now.stage) + planned[0])
        then, used = solved(stage, carried(now.stage, now.x, stage), aim), used + 1
        if then is not None and now.value - then.value >= HONEST * planned[1]:
            now, radius = then, 2 * radius
        else:
            radius *= SHORTER
    return now, used


def joint(found: Events, now: Trial, radius: float) -> tuple[Array, float] | None:
    """Moves (n,) of visits within `radius` [samples] that raise r the most, and by how much the value falls.

    The rows of the step are linear in the trajectory; their change with the times is linearised at it.
    """
    stage, n = now.stage, len(found.who)
    size = stage.grid.size
    top = Block(np.ones((1, 1)), np.array([[size]]), np.array([stage.bound]), np.zeros(1))
    matrix, rhs = stack([*now.below, top], size)
    by_time = sparse.csc_matrix(np.vstack([row_changes(now), np.zeros((1, n))]))
    moves, room = legal_moves(found, now)
    near = sparse.vstack([moves, sparse.identity(n), -sparse.identity(n)])
    idle = sparse.csc_matrix((near.shape[0], size + 1))
    below = sparse.vstack([sparse.hstack([matrix, by_time]), sparse.hstack([idle, near])], format="csc")
    above = np.concatenate([rhs, room, np.full(2 * n, radius)])
    equal, value = stack(stage.equal, size)
    equal = sparse.hstack([equal, sparse.csc_matrix((len(value), n))], format="csc")
    smooth = energy(stage.grid, {k: SOFT * w for k, w in SMOOTH.items()})
    quadratic = sparse.csc_matrix(sparse.block_diag([smooth, sparse.csc_matrix((1 + n, 1 + n))]))
    linear = np.zeros(size + 1 + n)
    linear[size] = -1.0
    step = solve(quadratic, linear, (equal, value), (below, above))
    return None if step is None else (step.x[size + 1 :], now.value - step.value)


def descend(
    found: Events, first: Trial, aim: Aim, trials: int, progress: Progress | None
) -> tuple[Trial, int]:
    """The best of up to `trials` trials, and how many there were."""
    now, curvature, used = first, None, 1
    while used < trials and len(found.who):
        if progress is not None:
            progress("times", now.margins.r)
        fresh = curvature is None
        if curvature is None:
            curvature = first_curvature(now)
        move = direction(found, now, curvature)
        gain = 0.0 if move is None else -float(now.slope @ move)
        if move is None or gain <= ENOUGH * now.value:
            break
        then, tried = line_search(found, now, move, gain, aim)
        used += tried
        if then is None:
            if fresh:
                break
            curvature = None
            continue
        step, bend = clock(then.stage) - clock(now.stage), then.slope - now.slope
        curvature = updated(curvature, step, bend, fresh)
        now = then
    return now, used


def line_search(found: Events, now: Trial, move: Array, gain: float, aim: Aim) -> tuple[Trial | None, int]:
    """The first trial along `move` that gains enough, and the number of trials."""
    start, share = clock(now.stage), 1.0
    for count in range(1, LINE + 1):
        stage = laid(now, found, start + share * move)
        then = solved(stage, carried(now.stage, now.x, stage), aim)
        if then is not None and then.value <= now.value - ARMIJO * share * gain:
            return then, count
        share *= SHORTER
    return None, LINE


def mean_leg(now: Trial) -> float:
    """Mean time between the events of a drone [samples]."""
    task, way = now.stage.problem, now.stage.itinerary
    legs = sum(len(stops) + 1 for stops in way.stops)
    return len(way.stops) * task.horizon / task.sample / legs


def first_curvature(now: Trial) -> Array:
    """A multiple of the identity whose first step is `FIRST` of the mean time between events."""
    steepest = max(float(np.abs(now.slope).max()), 1e-12)
    return np.eye(len(now.slope)) * steepest / (FIRST * mean_leg(now))


def updated(curvature: Array, step: Array, bend: Array, fresh: bool) -> Array:
    """Damped BFGS update, scaled first (Nocedal and Wright, procedure 18.2 and equation 6.20)."""
    along = float(step @ bend)
    if fresh and along > 0:
        curvature = np.eye(len(step)) * float(bend @ bend) / along
    pushed = curvature @ step
    size = float(step @ pushed)
    if size <= 0:
        return curvature
    share = 1.0 if along >= 0.2 * size else 0.8 * size / (size - along)
    mixed = share * bend + (1 - share) * pushed
    return np.asarray(
        curvature - np.outer(pushed, pushed) / size + np.outer(mixed, mixed) / float(step @ mixed)
    )


def direction(found: Events, now: Trial, curvature: Array) -> Array | None:
    """The step (n,) [samples] of the quadratic model within windows and links."""
    none = sparse.csc_matrix((0, len(found.who))), np.zeros(0)
    # In units of the largest slope: the solver's tolerances are absolute.
    scale = max(float(np.abs(now.slope).max()), 1e-300)
    step = solve(sparse.csc_matrix(curvature / scale), now.slope / scale, none, legal_moves(found, now))
    return None if step is None else step.x


def legal_moves(found: Events, now: Trial) -> tuple[sparse.csc_matrix, Array]:
    """Rows (m, n) and room (m,) of moves [samples] that keep windows and links and shrink no leg too much."""
    t, one = clock(now.stage), np.eye(len(found.who))
    rows, room = [*one, *-one], [*(found.high - t), *(t - found.low)]
    for i, j, gap in found.links:
        rows.append(one[i] - one[j])
        room.append(t[j] - t[i] - gap)
    for row, leg in leg_rows(found, now, t):
        rows.append(row)
        room.append((1 - SHRINK) * leg)
    return sparse.csc_matrix(np.array(rows)), np.maximum(np.array(room), 0.0)


def leg_rows(found: Events, now: Trial, t: Array) -> list[tuple[Array, float]]:
    """What a step takes from every leg as a row (n,), and the leg's duration [samples]."""
    end = now.stage.problem.horizon / found.sample
    out = []
    for e, (d, k) in enumerate(found.who):
        stops = now.stage.itinerary.stops[d]
        row = np.zeros(len(t))
        row[e] = -1.0
        left = 0.0
        if k > 0:
            row[e - 1] = 1.0
            left = t[e - 1] + stops[k - 1].visit.dwell / found.sample
        out.append((row, float(t[e] - left)))
        if k == len(stops) - 1:
            row = np.zeros(len(t))
            row[e] = 1.0
            out.append((row, float(end - t[e] - stops[k].visit.dwell / found.sample)))
    return out
