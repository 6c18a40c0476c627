"""Event times as variables: visits move inside their windows so that slack is used.

The value of a convex step's quadratic program is taken as a function of the visit times, the knots
between them stretched in proportion. Its slope is that of the Lagrangian (slopes.py); a descent with BFGS
curvature and a line search follows it within windows, order, dwell and turns (events.py). Every value
counts only if the trajectory keeps exact margins; planes are found anew at every step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .convex import SOFT, TOLERANCE, Margins, Steps, program
from .events import GAP, Events, anchors, events, moved, off_marks, snapped
from .knots import SAME_KNOT, Array, Grid, states
from .problem import Problem
from .rows import Block
from .schedule import Itinerary
from .setup import SMOOTH, Setup, marks, on_grid, setup
from .slopes import slopes
from .solver import solve

#: Most times of events tried to save energy, and to raise r.
ENERGY_TRIALS, RISE_TRIALS = 80, 30
#: Trials of one line search, and the factor from one to the next.
LINE, SHORTER = 4, 0.35
#: Share of the slope that a step must gain (Armijo).
ARMIJO = 1e-4
#: Gain that ends the descent, as a share of the value.
ENOUGH = 1e-5
#: First step of a descent as a share of the mean time between events.
FIRST = 0.1
#: A leg keeps at least this share of its duration in one step.
SHRINK = 0.5
#: Segments stretch up to this factor before knots are placed anew.
STRETCH = 1.5
#: Further solves with rows of what was passed without being posed.
AGAIN = 3
#: Price of passing limits while r is raised, in multiples of the way flown at v_max over the mission [m].
PRICE = 3.0


@dataclass(frozen=True)
class Aim:
    """What is made small: energy by `weights` at r >= `hold` [m]; with `hold` None, -r and passed limits."""

    hold: float | None
    weights: Mapping[int, float]


@dataclass(frozen=True)
class Trial:
    """A solved step at some event times: its value, and slope (n,) by the times of events [1/sample]."""

    stage: Setup
    x: Array
    margins: Margins
    value: float
    slope: Array


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
) -> Retimed:
    """Minimise energy over trajectory and visit times at r >= `hold`, from a trajectory that keeps it.

    `weights` by order of derivative: {2: 1.0} is the integral of |a|^2 [m^2/s^3]. The result is never
    worse than `x` with times as they are; its visit times are multiples of T_s and its knots those of
    `setup`. The same input gives the same result.
    """
    return best_times(stage, x, Aim(hold, weights), trials)


def best_times(stage: Setup, x: Array, aim: Aim, trials: int) -> Retimed:
    """The descent over the visit times, with the result at whole samples."""
    first = solved(stage, x, aim)
    if first is None:
        return Retimed(stage, x, Steps.of(stage).margins(x), 1)
    found = events(stage.problem, stage.itinerary)
    last, used = descend(found, first, aim, trials)
    ends = [settled(stage, first, aim)]
    whole = snapped(found, clock(last.stage))
    if last is not first and whole is not None:
        way = moved(stage.itinerary, found, whole)
        ends.append(settled(setup(stage.problem, way, stage.bound), last, aim))
    chosen = min((t for t in ends if t is not None), key=lambda t: t.value, default=first)
    return Retimed(chosen.stage, chosen.x, chosen.margins, used)


def clock(stage: Setup) -> Array:
    """Times (n,) of all visits [samples]."""
    return np.array([s.t for stops in stage.itinerary.stops for s in stops]) / stage.problem.sample


def settled(stage: Setup, near: Trial, aim: Aim) -> Trial | None:
    """Steps at the fixed visit times of `stage`, with planes found anew until the value stands."""
    best = solved(stage, carried(near, stage), aim)
    for _ in range(LINE):
        if best is None:
            break
        then = solved(stage, best.x, aim)
        if then is None or then.value >= best.value - ENOUGH * abs(best.value):
            break
        best = then
    return best


def descend(found: Events, first: Trial, aim: Aim, trials: int) -> tuple[Trial, int]:
    """The best of up to `trials` trials, and how many there were."""
    now, curvature, used = first, None, 1
    while used < trials and len(found.who) and not reached(now, aim):
        fresh = curvature is None
        if curvature is None:
            curvature = first_curvature(now)
        move = direction(found, now, curvature)
        gain = 0.0 if move is None else -float(now.slope @ move)
        if move is None or gain <= ENOUGH * max(abs(now.value), TOLERANCE):
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


def reached(now: Trial, aim: Aim) -> bool:
    """Whether r is at its bound and limits are kept, so that there is nothing left to raise."""
    return aim.hold is None and now.margins.share <= 1 and now.margins.r >= now.stage.bound - TOLERANCE


def line_search(found: Events, now: Trial, move: Array, gain: float, aim: Aim) -> tuple[Trial | None, int]:
    """The first trial along `move` that gains enough, and the number of trials."""
    start, share = clock(now.stage), 1.0
    for count in range(1, LINE + 1):
        stage = laid(now, found, start + share * move)
        then = solved(stage, carried(now, stage), aim)
        if then is not None and then.value <= now.value - ARMIJO * share * gain:
            return then, count
        share *= SHORTER
    return None, LINE


def first_curvature(now: Trial) -> Array:
    """A multiple of the identity whose first step is `FIRST` of the mean time between events."""
    n = len(now.slope)
    legs = n + len(now.stage.problem.ids)
    mean = len(now.stage.problem.ids) * now.stage.problem.horizon / now.stage.problem.sample / legs
    return np.eye(n) * max(float(np.abs(now.slope).max()), 1e-12) / (FIRST * mean)


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
    t, n = clock(now.stage), len(found.who)
    one = np.eye(n)
    rows, rhs = [one, -one], [found.high - t, t - found.low]
    for i, j, gap in found.links:
        rows.append((one[i] - one[j])[None])
        rhs.append(np.array([t[j] - t[i] - gap]))
    for row, room in leg_rows(found, now, t):
        rows.append(row[None])
        rhs.append(np.array([(1 - SHRINK) * room]))
    below = sparse.csc_matrix(np.vstack(rows)), np.maximum(np.concatenate(rhs), 0.0)
    none = sparse.csc_matrix((0, n)), np.zeros(0)
    # In units of the largest slope: the solver's tolerances are absolute.
    scale = max(float(np.abs(now.slope).max()), 1e-300)
    step = solve(sparse.csc_matrix(curvature / scale), now.slope / scale, none, below)
    return None if step is None else step.x


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


def laid(now: Trial, found: Events, t: Array) -> Setup:
    """The setup with visits at `t` (n,) [samples]: knots stretched in proportion, or placed anew."""
    task, way, bound = now.stage.problem, now.stage.itinerary, now.stage.bound
    then = moved(way, found, off_marks(task, way, found, t))
    grids = [stretched(task, way, then, d, times) for d, times in enumerate(now.stage.grid.times)]
    known = [g for g in grids if g is not None]
    return (
        on_grid(task, then, Grid(tuple(known)), bound)
        if len(known) == len(grids)
        else setup(task, then, bound)
    )


def stretched(task: Problem, way: Itinerary, then: Itinerary, d: int, times: Array) -> Array | None:
    """Knots of a drone moved along with its visits; None where they would lie too far apart or too close."""
    old, owner = anchors(task, way, d)
    shift = np.array([s.t - w.t for s, w in zip(then.stops[d], way.stops[d], strict=True)])
    if not shift.any():
        return times
    by = np.where(owner >= 0, shift[owner], 0.0)
    new, ends = old + by, np.array(sorted(marks(task, d)))
    torn = (np.abs(old[:, None] - ends).min(axis=1) <= SAME_KNOT) & (by != 0)
    if torn.any() or np.diff(new).min() < GAP / 2:
        return None
    out = np.interp(times, old, new)
    longer = np.diff(out) > STRETCH * np.maximum(np.diff(times), task.segment)
    shorter = np.diff(out) < np.minimum(np.diff(times), task.segment / STRETCH) / STRETCH
    return None if (longer | shorter).any() else out


def carried(near: Trial, stage: Setup) -> Array:
    """The unknowns of `near` on the knots of `stage`, as much slower or faster as visit times moved."""
    out = np.zeros(stage.grid.size)
    for d, times in enumerate(stage.grid.times):
        new, old = (
            np.array([0.0, *(t for s in way.stops[d] for t in (s.t, s.t + s.visit.dwell)), task.horizon])
            for way, task in ((p.itinerary, p.problem) for p in (stage, near.stage))
        )
        apart = np.append(True, np.diff(new) > SAME_KNOT)
        new, old = new[apart], old[apart]
        pace = np.diff(old) / np.diff(new)
        before = np.clip(np.searchsorted(new, times - SAME_KNOT) - 1, 0, len(pace) - 1)
        after = np.clip(np.searchsorted(new, times + SAME_KNOT) - 1, 0, len(pace) - 1)
        rate = (pace[before] + pace[after])[:, None] / 2
        found = states(near.stage.grid, near.x, d, np.interp(times, new, old))
        stage.grid.knots(out, d)[:] = found * rate[:, :, None] ** np.arange(3)[None, :, None]
    return out


def solved(stage: Setup, x: Array, aim: Aim) -> Trial | None:
    """One step from `x` at the visit times of `stage`, with rows of all that was passed; None without one."""
    steps, size = Steps.of(stage), stage.grid.size
    level = stage.bound if aim.hold is None else aim.hold
    price = None if aim.hold is not None else PRICE * stage.problem.v_max * stage.problem.horizon
    least = min(steps.margins(x).tube, 0.0)
    trial = None
    for _ in range(AGAIN):
        below = steps.rows(x, level)
        found = program(stage, below, aim.hold, aim.weights, price)
        if found is None:
            return None
        y, now = found.x[:size], steps.margins(found.x[:size])
        short = max(float(found.x[-1]) - now.r, 0.0)
        over = max(now.share - 1.0 - (0.0 if price is None else float(found.x[-2])), 0.0)
        worth = found.value + (0.0 if price is None else short + price * over)
        trial = Trial(stage, y, now, worth, event_slopes(stage, y, below, found.z, aim))
        if short <= TOLERANCE and over <= 0.0 and now.tube >= least:
            return trial
        # Something that was not posed was passed: pose it too, from the trajectory that passed it.
        steps.rows(y, level)
    return None if price is None else trial


def event_slopes(stage: Setup, x: Array, below: list[Block], z: Array, aim: Aim) -> Array:
    """Derivative (n,) of the step's value by the time of every visit [1/sample]."""
    cuts = np.cumsum([len(b.rhs) for b in below])
    rows = list(zip(below, np.split(z[: cuts[-1]], cuts[:-1]), strict=True))
    soft = SOFT if aim.hold is None else 1.0
    by_knot = slopes(stage.grid, x, rows, {k: soft * w for k, w in aim.weights.items()})
    out = []
    for d, stops in enumerate(stage.itinerary.stops):
        times, owner = anchors(stage.problem, stage.itinerary, d)
        for k in range(len(stops)):
            carry = np.interp(stage.grid.times[d], times, (owner == k).astype(float))
            out.append(float(carry @ by_knot[d]))
    return np.array(out) * stage.problem.sample
