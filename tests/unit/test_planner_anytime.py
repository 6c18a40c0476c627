"""Better and better plans: every one certified, in order, from the same seed, and never later than asked."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.certificate import verify
from fleet.cli.searching import sparkline
from fleet.errors import Exit, InfeasibleError, TimeLimitError
from fleet.planner import PlanResult, Status, plan
from fleet.planner.anytime import End, Found, search
from fleet.planner.improve import on_knots
from fleet.planner.knots import Grid, refine
from fleet.planner.plan import better, improving, itineraries
from fleet.planner.problem import problem
from fleet.planner.progress import TimeUp
from fleet.planner.reorder import neighbours, reordered, shifted
from fleet.planner.result import trajectory
from fleet.planner.setup import setup, warm_start
from fleet.scenario import load

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def first_of(name: str, calls: int) -> list[PlanResult]:
    """The plans found until planning has told its progress `calls` times: the same on any machine."""
    told = 0

    def tell(_stage: str, _rho: float) -> None:
        nonlocal told
        told += 1
        if told > calls:
            raise TimeUp

    found = []
    with pytest.raises(TimeUp):
        for one in improving(load(SCENARIOS / f"{name}.toml"), progress=tell):
            found.append(one)
    return found


@cache
def improved() -> list[PlanResult]:
    return first_of("power_tower", 60)


def test_plans_get_better_and_each_is_certified() -> None:
    found = improved()
    assert len(found) > 1
    for one, after in pairwise(found):
        assert better(after, one)
        assert not better(one, after)
        assert round(after.rho, 3) >= round(one.rho, 3)
    for one in found:
        assert one.rho_lower > 0
        assert verify(one.data).ok, verify(one.data).problems
    assert found[-1].int_a2 < 0.99 * found[0].int_a2


def test_the_first_is_the_plan_without_a_time_limit() -> None:
    assert improved()[0].data == plan(load(SCENARIOS / "power_tower.toml")).data


def test_the_search_is_seeded() -> None:
    assert [p.hash for p in first_of("crossing", 12)] == [p.hash for p in first_of("crossing", 12)]


def test_a_search_keeps_what_it_has_when_it_is_broken_off() -> None:
    found = Found()

    def tell(_stage: str, _rho: float) -> None:
        if found.best is not None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(load(SCENARIOS / "hover.toml"), found, time_limit=60.0, progress=tell)
    assert found.best is not None
    assert found.best.data == plan(load(SCENARIOS / "hover.toml")).data
    (moment,) = found.history
    assert json.loads(json.dumps(moment.as_dict()))["rho"] == found.best.rho
    assert 0 < moment.t <= found.spent
    assert found.ended is None


def test_it_ends_early_at_the_bound() -> None:
    found = Found()
    search(load(SCENARIOS / "hover.toml"), found, time_limit=300.0)
    assert found.ended is End.BOUND
    assert found.spent < 100.0
    assert found.best is not None
    assert found.best.status is Status.OPTIMAL


def test_a_time_limit_ends_it() -> None:
    found = Found()
    search(load(SCENARIOS / "crossing.toml"), found, time_limit=2.0)
    assert found.ended is End.TIME_LIMIT
    assert 2.0 <= found.spent < 20.0
    assert found.best is not None
    assert [m.t for m in found.history] == sorted(m.t for m in found.history)


def test_no_plan_in_time_is_an_error_of_its_own() -> None:
    found = Found()
    with pytest.raises(TimeLimitError, match=r"no plan within 1e-06 s \(--time-limit\)") as caught:
        search(load(SCENARIOS / "crossing.toml"), found, time_limit=1e-6)
    assert caught.value.exit_code is Exit.INFEASIBLE
    assert caught.value.problems[0].code == "time_limit"
    assert found.best is None


def test_an_infeasible_mission_stays_one(tmp_path: Path) -> None:
    """Nothing is looked for where it is proved that there is nothing."""
    text = (SCENARIOS / "hover.toml").read_text()
    assert "v_max = 3.0" in text
    path = tmp_path / "slow.toml"
    path.write_text(text.replace("v_max = 3.0", "v_max = 0.05"))
    with pytest.raises(InfeasibleError):
        search(load(path), Found(), time_limit=300.0)


def made_up(status: str, rho: float, energy: float) -> PlanResult:
    """A plan of one clause, as far as plans are compared."""
    plan = {"clauses": [{"weight": 1.0, "result": {"rho": rho}}]}
    return replace(improved()[0], plan=plan, status=Status(status), rho=rho, rho_bound=1.0, int_a2=energy)


ranked = st.builds(
    made_up,
    st.sampled_from(["violated", "certified", "optimal"]),
    st.floats(0.0, 1.0),
    st.floats(0.1, 10.0),
)


@settings(max_examples=200, deadline=None)
@given(ranked, ranked)
def test_better_goes_by_status_then_rho_then_energy(a: PlanResult, b: PlanResult) -> None:
    assert not (better(a, b) and better(b, a))
    rank = {"violated": 0, "certified": 1, "optimal": 2}
    higher = min(a.rho, 0.998) > min(b.rho, 0.998) + 1e-3 + 1e-9
    if rank[a.status] > rank[b.status] or (a.status == b.status and higher):
        assert better(a, b)
    elif a.status == b.status and a.rho == b.rho:
        assert better(a, b) == (a.int_a2 < 0.999 * b.int_a2)


orders = st.integers(1, 3).flatmap(
    lambda d: st.lists(st.integers(0, d - 1), min_size=1, max_size=5).map(
        lambda who: tuple(tuple(e for e, w in enumerate(who) if w == k) for k in range(d))
    )
)


@given(orders)
def test_neighbours_serve_the_same_events(now: tuple[tuple[int, ...], ...]) -> None:
    wanted = sorted(e for order in now for e in order)
    found = neighbours(now)
    assert now not in found
    for one in found:
        assert len(one) == len(now)
        assert sorted(e for order in one for e in order) == wanted
    # From each neighbour there is a way back.
    assert all(now in neighbours(one) for one in found)


def test_reordered_and_shifted_itineraries_keep_windows() -> None:
    task = problem(load(SCENARIOS / "power_tower_4.toml"))
    ways, _ = itineraries(task, 1.0)
    rng = np.random.default_rng(3)
    others = list(reordered(task, ways[0], 1.0))
    assert others
    for way in [*others, *(shifted(task, ways[0], 10.0, rng) for _ in range(20))]:
        assert sorted(s.visit.clause for stops in way.stops for s in stops) == sorted(
            v.clause for v in task.spec.visits
        )
        for stops, paths in zip(way.stops, way.paths, strict=True):
            assert len(paths) == len(stops) + 1
            assert all(s.visit.window[0] <= s.t <= s.visit.window[1] for s in stops)
            assert all(a.t < b.t for a, b in pairwise(stops))
            for s in stops:
                assert s.t / task.sample == pytest.approx(round(s.t / task.sample), abs=1e-6)


def test_given_orders_stay_as_they_are() -> None:
    task = problem(load(SCENARIOS / "power_tower.toml"))
    ways, _ = itineraries(task, 1.0)
    kept = replace(task, given={task.ids[0]: (ways[0].stops[0][0].region,)})
    assert list(reordered(task, ways[0], 1.0))
    assert not list(reordered(kept, ways[0], 1.0))


def test_finer_knots_carry_the_same_trajectory() -> None:
    task = problem(load(SCENARIOS / "crossing.toml"))
    way = itineraries(task, 1.0)[0][0]
    coarse = setup(task, way, 1.0)
    fine = replace(coarse, grid=Grid(tuple(refine(times, 2) for times in coarse.grid.times)))
    x = warm_start(coarse)
    tracks = {n: trajectory(task, way, coarse.grid, x, d) for d, n in enumerate(task.ids)}
    y = on_knots(fine, tracks)
    times = np.linspace(0, task.horizon, 997)
    assert len(fine.grid.times[0]) > len(coarse.grid.times[0])
    for d, name in enumerate(task.ids):
        again = trajectory(task, way, fine.grid, y, d)
        assert np.abs(again.sample(times)[:, :9] - tracks[name].sample(times)[:, :9]).max() < 1e-8


def test_sparkline_is_between_zero_and_the_bound() -> None:
    assert sparkline([-1.0, 0.0, 0.5, 1.0, 2.0], 2.0) == "▁▁▃▅█"
    assert sparkline([0.0, 1.0], None) == "▁█"
    assert sparkline([], None) == ""
    assert sparkline([0.2, 0.4], float("inf")) == ""
