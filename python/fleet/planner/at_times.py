"""Convex steps at given visit times: solved, with slopes, and carried from one set of times to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .convex import SOFT, TOLERANCE, Margins, Steps, program
from .events import GAP, Events, anchors, moved, off_marks
from .knots import SAME_KNOT, Array, Grid, states
from .problem import Problem
from .rows import Block
from .schedule import Itinerary
from .setup import Setup, marks, on_grid, setup
from .slopes import row_slopes, slopes

#: Segments stretch up to this factor before knots are placed anew.
STRETCH = 1.5
#: Solves of a step at most, each with rows of what the one before passed.
AGAIN = 3


@dataclass(frozen=True)
class Aim:
    """What is made small: energy by `weights` at r >= `hold` [m]; with `hold` None, -r."""

    hold: float | None
    weights: Mapping[int, float]


@dataclass(frozen=True)
class Trial:
    """A solved step at some visit times: its value, and slope (n,) by the times of visits [1/sample].

    `below` are the rows that it was solved with.
    """

    stage: Setup
    x: Array
    margins: Margins
    value: float
    slope: Array
    below: list[Block]


def clock(stage: Setup) -> Array:
    """Times (n,) of all visits [samples]."""
    return np.array([s.t for stops in stage.itinerary.stops for s in stops]) / stage.problem.sample


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


def carried(near: Setup, x: Array, stage: Setup) -> Array:
    """The unknowns `x` of `near` on the knots of `stage`, as much slower or faster as visit times moved."""
    out = np.zeros(stage.grid.size)
    for d, times in enumerate(stage.grid.times):
        new, old = (
            np.array([0.0, *(t for s in way.stops[d] for t in (s.t, s.t + s.visit.dwell)), task.horizon])
            for way, task in ((p.itinerary, p.problem) for p in (stage, near))
        )
        apart = np.append(True, np.diff(new) > SAME_KNOT)
        new, old = new[apart], old[apart]
        pace = np.diff(old) / np.diff(new)
        before = np.clip(np.searchsorted(new, times - SAME_KNOT) - 1, 0, len(pace) - 1)
        after = np.clip(np.searchsorted(new, times + SAME_KNOT) - 1, 0, len(pace) - 1)
        rate = (pace[before] + pace[after])[:, None] / 2
        found = states(near.grid, x, d, np.interp(times, new, old))
        stage.grid.knots(out, d)[:] = found * rate[:, :, None] ** np.arange(3)[None, :, None]
    return out


def solved(stage: Setup, x: Array, aim: Aim) -> Trial | None:
    """One step from `x` at the visit times of `stage`, with rows of all that was passed; None without one."""
    steps, size = Steps.of(stage), stage.grid.size
    level = stage.bound if aim.hold is None else aim.hold
    least = min(steps.margins(x).tube, 0.0) if aim.hold is not None else -np.inf
    trial = None
    for _ in range(AGAIN):
        below = steps.rows(x, level)
        found = program(stage, below, aim.hold, aim.weights)
        if found is None:
            return None
        y, now = found.x[:size], steps.margins(found.x[:size])
        short = max(float(found.x[size]) - now.r, 0.0)
        slope = event_slopes(stage, y, below, found.z, aim)
        trial = Trial(stage, y, now, found.value + short, slope, below)
        if short <= TOLERANCE and now.share <= 1 and now.tube >= least:
            return trial
        # Something that was not posed was passed: pose it too, from the trajectory that passed it.
        steps.rows(y, level)
    return trial if aim.hold is None and now.share <= 1 else None


def event_slopes(stage: Setup, x: Array, below: list[Block], z: Array, aim: Aim) -> Array:
    """Derivative (n,) of the step's value by the time of every visit [1/sample]."""
    cuts = np.cumsum([len(b.rhs) for b in below])
    rows = list(zip(below, np.split(z[: cuts[-1]], cuts[:-1]), strict=True))
    soft = SOFT if aim.hold is None else 1.0
    by_knot = slopes(stage.grid, x, rows, {k: soft * w for k, w in aim.weights.items()})
    return np.concatenate([k @ c for k, c in zip(by_knot, carries(stage), strict=True)])


def carries(stage: Setup) -> list[Array]:
    """How far knots move with visits, per drone (knots, its visits) [s/sample]."""
    out = []
    for d, stops in enumerate(stage.itinerary.stops):
        times, owner = anchors(stage.problem, stage.itinerary, d)
        each = [np.interp(stage.grid.times[d], times, (owner == k).astype(float)) for k in range(len(stops))]
        out.append(np.array(each).reshape(len(stops), len(stage.grid.times[d])).T * stage.problem.sample)
    return out


def row_changes(now: Trial) -> Array:
    """Derivative (r, n) of all rows of a trial by the times of visits [1/sample]."""
    stage, along = now.stage, carries(now.stage)
    first = np.cumsum([0, *(c.shape[1] for c in along)])
    out = []
    for block in now.below:
        changes = np.zeros((len(block.rhs), first[-1]))
        for d, knots, values in row_slopes(stage.grid, now.x, block, np.ones(len(block.rhs), dtype=bool)):
            changes[:, first[d] : first[d + 1]] += values[:, None] * along[d][knots]
        out.append(changes)
    return np.concatenate(out)
