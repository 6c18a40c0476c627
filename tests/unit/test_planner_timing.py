"""Visit times as unknowns: slopes against solving again, bounds that always hold, slack that is used."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fleet.certificate import verify
from fleet.errors import InfeasibleError
from fleet.planner import convex, plan
from fleet.planner.at_times import Aim, Trial, carried, clock, laid, solved
from fleet.planner.events import Events, events, snapped
from fleet.planner.heading import headings
from fleet.planner.problem import Problem, problem
from fleet.planner.result import squared_acceleration
from fleet.planner.schedule import Itinerary, schedules
from fleet.planner.setup import Setup, setup
from fleet.planner.timing import raised, retime
from fleet.scenario import Scenario, load

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
    [("power_tower", 2, 1e-4), ("crossing", 12, 0.05)],
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
            then = solved(moved, carried(now.stage, now.x, moved), aim)
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


def legal(task: Problem, way: Itinerary) -> bool:
    """Whether every turn of the heading has the time that it needs."""
    try:
        return kept(task, way, way)
    except InfeasibleError:
        return False


def kept(task: Problem, before: Itinerary, after: Itinerary) -> bool:
    """Whether windows, order, dwell, turns and samples are kept; an oracle of its own."""
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


def alone(
    folder: Path, T: float, visits: list[tuple[tuple[float, ...], str, float | None]], extra: str = ""
) -> Scenario:
    """One drone that starts at the origin and visits cubes of side 2; a visit is centre, formula, heading."""
    clauses = "".join(f"@v{k} {text.format(f'd1 in tr{k}')}\n" for k, (_, text, _) in enumerate(visits))
    targets = ""
    for k, (center, _, heading) in enumerate(visits):
        low, high = ([round(c + side, 6) for c in center] for side in (-1.0, 1.0))
        look = "" if heading is None else f"heading = {heading}\n"
        targets += f'[[target]]\nname = "tr{k}"\nbox = [{low}, {high}]\n{look}\n'
    path = folder / "alone.toml"
    path.write_text(f'''
[mission]
T = {T}
T_s = 0.05
c = 5.0
seed = 1
formula = """
@safe always[0,T] d1 in workspace
{clauses}{extra}
@home eventually[T-1,T] d1 in home
"""

[limits]
v_max = 3.0
a_max = 3.0
delta_min = 3.0
tube = 0.4

[workspace]
box = [[-40.0, -40.0, 0.0], [60.0, 40.0, 23.0]]

{targets}
[[drone]]
id = "d1"
home = {{ box = [[-1.0, -1.0, 0.2], [1.0, 1.0, 2.2]] }}
pad = [0.0, 0.0, 0.1]
heading = 0.0
''')
    return load(path)


def test_tight_unequal_windows_need_times_as_unknowns(tmp_path: Path) -> None:
    """60 m and two stops in 23 s at 3 m/s: only the legs that begin or end at rest need the slack.

    At times that legs alone tell (even, early or late, from centres or from edges) the visits come nowhere
    near the margin that their times leave room for.
    """
    windows = ((6.0, "0,5"), (12.0, "0,6"), (18.0, "6,8"), (30.0, "9,12"))
    scenario = alone(
        tmp_path, 23.0, [((x, 0.0, 1.2), f"eventually[{window}] {{}}", None) for x, window in windows]
    )
    task = problem(scenario)
    fixed = [convex.optimise(setup(task, way, 1.0))[1].r for way in schedules(task, 1.0)]
    assert max(fixed) < 0.7
    found = plan(scenario)
    assert found.rho >= 0.95 * found.rho_bound
    assert found.rho_lower > 0.9
    assert verify(found.data).ok
    assert plan(scenario).data == found.data


def wishes(seed: int) -> tuple[float, list[tuple[tuple[float, ...], str, float | None]]]:
    """A random tour with turns and stays, and about the time [s] that it needs."""
    rng = np.random.default_rng(seed)
    at, way, visits = np.array([0.0, 0.0, 1.2]), 0.0, []
    for _ in range(int(rng.integers(2, 5))):
        center = np.round(at + rng.uniform([-9, -9, 0], [9, 9, 3]), 1)
        center[2] = min(center[2], 20.0)
        way += max(float(np.abs(center - at).max()) / 3.0, 0.0) + 1.0
        at = center
        stay = round(float(rng.uniform(0.5, 2.0)) / 0.05) * 0.05 if rng.random() < 0.5 else 0.0
        way += stay
        heading = round(float(rng.uniform(-3, 3)), 3) if rng.random() < 0.7 else None
        way += 0.0 if heading is None else 2.0
        inner = f"always[0,{stay:.2f}] {{}}" if stay else "{}"
        visits.append((tuple(float(c) for c in center), f"eventually[0,T-3] {inner}", heading))
    way += max(float(np.abs(at[:2]).max()) / 3.0, 0.0)
    return way, visits


def tight(folder: Path, seed: int) -> Problem:
    """The tour of `wishes` in hardly more time than the first for which there is an itinerary."""
    T, visits = wishes(seed)
    for share in np.arange(0.5, 2.0, 0.02):
        task = problem(alone(folder, round(round(share * T / 0.05) * 0.05, 2), visits))
        try:
            next(iter(schedules(task, 1.0)))
        except InfeasibleError:
            continue
        return problem(alone(folder, round(round(1.08 * share * T / 0.05) * 0.05, 2), visits))
    raise AssertionError(f"no itinerary for the tour of seed {seed}")


@pytest.mark.parametrize("seed", range(8))
def test_moved_visits_keep_dwell_heading_and_windows(seed: int, tmp_path: Path) -> None:
    task = tight(tmp_path, seed)
    way = next(iter(schedules(task, 1.0)))
    stage = setup(task, way, 1.0)
    x, margins, _ = convex.optimise(stage)
    then, y, after = raised(stage, x, margins)
    found = events(task, way)
    if snapped(found, found.t) is None:
        # In this order the turns do not fit: there is nothing that moving could mend.
        assert not legal(task, way)
        assert then is stage
        return
    assert not legal(task, way) or not convex.better(margins, after)
    assert kept(task, way, then.itinerary)
    if after.share > 1 or after.r < task.tube:
        return
    hold = after.r - 0.05
    last = retime(then, y, hold=hold, weights={2: 1.0}, trials=20)
    assert kept(task, way, last.stage.itinerary)
    assert last.margins.r >= hold - 1e-3
    assert last.margins.share <= 1
    assert squared_acceleration(last.stage.grid, last.x) <= squared_acceleration(then.grid, y) + 1e-9


def test_visits_move_away_from_windows_of_other_clauses(tmp_path: Path) -> None:
    """Half of the way is shut until a second before the even visit time: too late to be there in time."""
    visits = [((10.0, 0.0, 1.2), "eventually[0,16] {}", None)]
    task = problem(alone(tmp_path, 16.0, visits, "@shut always[0,7] d1.x <= 5"))
    way = next(iter(schedules(task, 1.0)))
    stage = setup(task, way, 1.0)
    x, margins, _ = convex.optimise(stage)
    assert way.stops[0][0].t == pytest.approx(8.0, abs=0.1)
    assert margins.r < 0.7
    then, _, after = raised(stage, x, margins)
    assert after.share <= 1
    assert after.r > 0.99
    assert kept(task, way, then.itinerary)
    assert 8.3 < then.itinerary.stops[0][0].t < 12.0
