"""Attempts to beat a certified plan, the cheapest and most promising first.

More energy steps from the plan itself, visits at other times, other ways of pairs past each other, other
orders of visits, the nonlinear program, finer segments; then the same at random, seeded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from fleet import _core

from . import convex, groups
from .convex import Margins
from .knots import Array
from .problem import Problem
from .progress import Progress
from .reorder import reordered, shifted
from .result import PlanResult, squared_acceleration
from .schedule import Itinerary
from .setup import MOST_SEGMENTS, Setup, warm_start
from .timing import ENERGY_TRIALS, raised, retime

#: Energy steps of one attempt at most, and the share that a step has to save for another one.
POLISHING, SAVED = 10, 1e-3
#: Robustness given up where visits move [m]: far below the millimetre that counts.
HAIR = 1e-5
#: Visit times tried at first, so that large fleets have something of it soon.
FEW = 8
#: Shortest segment that finer knots come down to [s].
FINEST = 0.2
#: Random attempts in a row without a better plan after which one at its bound is left as it is.
FRUITLESS = 12
#: Spread of random shifts of visits, as a share of the mission.
SHIFT = 0.08


@dataclass(frozen=True)
class Attempt:
    """One thing to try: an itinerary of a problem, how to fly it, and the name of that method.

    `timing`, if there is one, has the last word on the visit times.
    """

    task: Problem
    way: Itinerary
    method: str
    run: groups.Method
    timing: groups.Timing | None = None


@dataclass(frozen=True)
class Certified:
    """A plan that satisfies the mission, the attempt that made it, and its trajectories."""

    result: PlanResult
    attempt: Attempt
    tracks: list[_core.Trajectory]


@dataclass
class Lead:
    """The best plan so far, if there is one, and all attempts that were flown with what they reached."""

    best: Certified | None = None
    tried: list[tuple[Attempt, convex.Margins]] = field(default_factory=list)


def improvements(
    task: Problem, ways: Sequence[Itinerary], bound: float, method: str, lead: Lead, seed: int
) -> Iterator[Attempt]:
    """Attempts to beat the lead. They end when it is at its bound and nothing has helped for a while.

    Methods other than ours are left as they are: a baseline is what it is.
    """
    if method not in ("auto", "convex", "nlp"):
        return
    if lead.best is not None:
        yield again(lead, "convex", polished)
        for trials in (FEW, ENERGY_TRIALS):
            yield replace(again(lead, "convex", polished), timing=partial(thriftier, trials=trials))
    for way in ways[1:]:
        yield Attempt(task, way, "convex", climbed, raised)
    if task.pairs():
        for lift in convex.LIFTS[1:]:
            yield Attempt(task, ways[0], "convex", partial(climbed, lift=lift), raised)
    for way in reordered(task, ways[0], bound):
        yield Attempt(task, way, "convex", climbed, thriftier)
    while lead.best is not None:
        before = lead.best
        yield from refined(lead, nonlinear=method != "convex")
        if lead.best is before:
            break
    yield from wandering(task, ways, lead, np.random.default_rng(seed))


def refined(lead: Lead, *, nonlinear: bool) -> Iterator[Attempt]:
    """The lead's own trajectories, made better by other means."""
    assert lead.best is not None
    yield again(lead, "convex", polished)
    yield replace(again(lead, "convex", polished), timing=thriftier)
    task = lead.best.attempt.task
    shorter = task.segment / 2
    if shorter >= FINEST and task.horizon / shorter < MOST_SEGMENTS:
        finer = again(lead, "convex", climbed)
        yield replace(finer, task=replace(task, segment=shorter))
    if nonlinear:
        yield again(lead, "nlp", from_nlp)


def again(lead: Lead, method: str, run: Callable[..., tuple[Array, Margins]]) -> Attempt:
    """An attempt that begins with the trajectories of the lead."""
    assert lead.best is not None
    made = lead.best.attempt
    tracks = dict(zip(made.task.ids, lead.best.tracks, strict=True))
    return Attempt(made.task, made.way, method, partial(run, tracks=tracks))


def wandering(
    task: Problem, ways: Sequence[Itinerary], lead: Lead, rng: np.random.Generator
) -> Iterator[Attempt]:
    """Visits shifted at random and pairs past each other at random, from the lead if there is one."""
    fruitless = 0
    while True:
        before = lead.best
        base = task if before is None else before.attempt.task
        way = ways[int(rng.integers(len(ways)))] if before is None else before.attempt.way
        if not any(way.stops) and not base.pairs():
            return
        run = partial(climbed, seed=int(rng.integers(2**31))) if base.pairs() else climbed
        if any(way.stops) and (not base.pairs() or rng.random() < 0.7):
            way = shifted(base, way, SHIFT * base.horizon, rng)
            run = run if rng.random() < 0.3 else climbed
        yield Attempt(base, way, "convex", run, raised)
        fruitless = fruitless + 1 if lead.best is before else 0
        if fruitless >= FRUITLESS and before is not None and before.result.status == "optimal":
            return


def climbed(
    stage: Setup,
    progress: Progress | None,
    *,
    tracks: dict[str, _core.Trajectory] | None = None,
    lift: Array | Sequence[float] = (),
    seed: int | None = None,
) -> tuple[Array, Margins]:
    """Convex steps from given trajectories or from the route, pairs tilted by `lift` (3,) or at random."""
    start = warm_start(stage) if tracks is None else on_knots(stage, tracks)
    steps = convex.Steps.of(stage)
    if seed is not None:
        lift = np.random.default_rng(seed).normal(size=(len(steps.apart), 3))
        lift /= np.linalg.norm(lift, axis=1, keepdims=True)
    x, margins, _ = convex.climb(steps, start, lift, progress)
    if margins.share <= 1:
        x, margins, _ = convex.polish(steps, x, margins, progress)
    return settled(steps, x, margins, progress)


def polished(
    stage: Setup, progress: Progress | None, *, tracks: dict[str, _core.Trajectory]
) -> tuple[Array, Margins]:
    """More energy steps from given trajectories."""
    steps, x = convex.Steps.of(stage), on_knots(stage, tracks)
    return settled(steps, x, steps.margins(x), progress)


def thriftier(
    stage: Setup, x: Array, margins: Margins, progress: Progress | None, trials: int = ENERGY_TRIALS
) -> tuple[Setup, Array, Margins]:
    """Visits at times that raise r, where it can be, and then at times that save energy at the r reached."""
    stage, x, margins = raised(stage, x, margins, progress)
    if margins.share > 1:
        return stage, x, margins
    found = retime(stage, x, hold=margins.r - HAIR, weights={2: 1.0}, trials=trials, progress=progress)
    return found.stage, found.x, found.margins


def from_nlp(
    stage: Setup, progress: Progress | None, *, tracks: dict[str, _core.Trajectory]
) -> tuple[Array, Margins]:
    """The nonlinear program from given trajectories; convex steps take back what it gave up of r."""
    from . import nlp

    x, _, _ = nlp.optimise(stage, on_knots(stage, tracks), progress)
    steps = convex.Steps.of(stage)
    x, margins, _ = convex.climb(steps, x, (), progress)
    if margins.share <= 1:
        x, margins, _ = convex.polish(steps, x, margins, progress)
    return settled(steps, x, margins, progress)


def settled(
    steps: convex.Steps, x: Array, margins: Margins, progress: Progress | None
) -> tuple[Array, Margins]:
    """Energy steps at the r reached until one saves less than `SAVED`."""
    hold, grid = margins.r, steps.setup.grid
    energy = squared_acceleration(grid, x)
    for _ in range(POLISHING if margins.share <= 1 else 0):
        if progress is not None:
            progress("polish", margins.r)
        moved = steps.step(x, hold)
        if moved is None:
            break
        now, then = steps.margins(moved), squared_acceleration(grid, moved)
        if now.share > 1 or now.r < hold - 1e-4 or now.tube < min(margins.tube, 0.0):
            steps.rows(moved, hold)
            continue
        gain = energy - then
        if gain > 0:
            x, margins, energy = moved, now, then
        if gain < SAVED * energy:
            break
    return x, margins


def on_knots(stage: Setup, tracks: dict[str, _core.Trajectory]) -> Array:
    """Unknowns of given trajectories on the knots of a setup; exact where knots were only added."""
    x = np.zeros(stage.grid.size)
    for d, name in enumerate(stage.problem.ids):
        states = tracks[name].sample(stage.grid.times[d])[:, :9]
        stage.grid.knots(x, d)[:] = states.reshape(-1, 3, 3)
    return x
