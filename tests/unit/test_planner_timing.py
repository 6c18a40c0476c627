"""Visit times as unknowns: slopes against solving again, bounds that always hold, slack that is used."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fleet.planner import convex
from fleet.planner.events import Events, events, snapped
from fleet.planner.problem import Problem, problem
from fleet.planner.result import squared_acceleration
from fleet.planner.schedule import Itinerary, schedules
from fleet.planner.setup import Setup, setup
from fleet.planner.timing import Aim, Trial, carried, clock, laid, retime, solved
from fleet.scenario import load

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def staged(name: str) -> tuple[Setup, np.ndarray]:
    """A shipped scenario at its even visit times, and its trajectory."""
    task = problem(load(SCENARIOS / f"{name}.toml"))
    stage = setup(task, next(iter(schedules(task, 1.0))), 1.0)
    x, margins, _ = convex.optimise(stage)
    assert margins.share <= 1
    assert margins.r > 0.99
    return stage, x


def at_rest(stage: Setup, x: np.ndarray, aim: Aim, steps: int) -> Trial:
    """A trajectory whose planes are nearly its own: they are found anew at every step."""
    now = solved(stage, x, aim)
    for _ in range(steps):
        assert now is not None
        now = solved(stage, now.x, aim)
    assert now is not None
    return now


@pytest.mark.parametrize(
    ("name", "steps", "tolerance"),
    [("power_tower", 2, 1e-4), ("multi_line", 2, 1e-3), ("crossing", 12, 0.05)],
)
def test_slopes_are_those_of_solving_again(name: str, steps: int, tolerance: float) -> None:
    """Central differences of the value of the program solved at times moved by a hundredth of a second.

    In `crossing` the planes of the pair, which the slope holds, change with the times to second order
    only where the trajectory stands still.
    """
    stage, x = staged(name)
    aim = Aim(0.4, {2: 1.0, 3: 0.3})
    now = at_rest(stage, x, aim, steps)
    found, h = events(stage.problem, stage.itinerary), 0.2
    again = []
    for e in range(len(found.who)):
        values = []
        for side in (h, -h):
            t = clock(stage)
            t[e] += side
            moved = laid(now, found, t)
            then = solved(moved, carried(now, moved), aim)
            assert then is not None
            values.append(then.value)
        again.append((values[0] - values[1]) / (2 * h))
    assert np.abs(now.slope).max() > 1e-4
    assert now.slope == pytest.approx(np.array(again), abs=tolerance * np.abs(now.slope).max())


@pytest.mark.parametrize("name", ["power_tower", "crossing"])
def test_retimed_visits_save_energy_and_keep_everything(name: str) -> None:
    stage, x = staged(name)
    same = retime(stage, x, hold=0.5, weights={2: 1.0}, trials=1)
    found = retime(stage, x, hold=0.5, weights={2: 1.0})
    before, after = (squared_acceleration(r.stage.grid, r.x) for r in (same, found))
    assert after < 0.98 * before
    assert found.margins.r >= 0.5 - 1e-3
    assert found.margins.share <= 1
    assert kept(stage.problem, stage.itinerary, found.stage.itinerary)
    # Nothing is left: a slope points out of the windows or is flat.
    free = events(found.stage.problem, found.stage.itinerary)
    last = solved(found.stage, found.x, Aim(0.5, {2: 1.0}))
    assert last is not None
    inward = np.where(free.t >= free.high, np.maximum(last.slope, 0.0), last.slope)
    assert np.abs(inward).max() < 2e-3 * after
    assert np.array_equal(retime(stage, x, hold=0.5, weights={2: 1.0}).x, found.x)


def kept(task: Problem, before: Itinerary, after: Itinerary) -> bool:
    """Whether windows, order, dwell, turns and samples are kept; an oracle of its own."""
    from fleet.planner.heading import headings

    for d, stops in enumerate(after.stops):
        ends = 0.0
        assert [s.region for s in stops] == [s.region for s in before.stops[d]]
        for s in stops:
            assert s.visit.window[0] - 1e-9 <= s.t <= s.visit.window[1] + 1e-9
            assert s.t >= ends
            assert abs(s.t / task.sample - round(s.t / task.sample)) < 1e-6
            ends = s.t + s.visit.dwell
        assert ends <= task.horizon
        headings(task, after, d, np.array([0.0, task.horizon]))  # raises if a turn is too fast
    return True


@pytest.mark.parametrize("seed", range(30))
def test_snapped_times_keep_bounds_and_links(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    feasible = np.sort(rng.integers(1, 200, n))
    low, high = feasible - rng.integers(0, 40, n), feasible + rng.integers(0, 40, n)
    links = [
        (i, j, int(feasible[j] - feasible[i] - rng.integers(0, 10)))
        for j in range(n)
        for i in range(j)
        if rng.random() < 0.6
    ]
    found = Events(
        0.05,
        tuple((0, k) for k in range(n)),
        feasible.astype(float),
        low,
        high,
        np.array(links, dtype=int).reshape(-1, 3),
    )
    out = snapped(found, feasible + rng.uniform(-60, 60, n))
    assert out is not None
    assert (out >= low).all()
    assert (out <= high).all()
    assert all(out[j] - out[i] >= gap for i, j, gap in links)
    near = feasible + rng.uniform(-0.45, 0.45, n)
    assert np.array_equal(snapped(found, near), feasible)
    stuck = Events(0.05, found.who, found.t, high + 1, high, found.links)
    assert snapped(stuck, near) is None
