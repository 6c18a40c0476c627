"""Kinodynamic RRT*: its connections against brute force, and its plans against an own oracle at 100 Hz."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.certificate import verify
from fleet.cli.planning import exit_of_plan
from fleet.errors import InfeasibleError
from fleet.planner import PlanResult, Status, connection, plan, rrt
from fleet.planner.rounding import FASTER, LIMIT, Cubics
from fleet.scenario import Scenario, load

SCENARIOS = Path(__file__).parents[2] / "scenarios"
A_MAX, V_MAX = 3.0, 3.0


def random_states(rng: np.random.Generator, n: int) -> np.ndarray:
    return np.column_stack([rng.uniform(-8, 8, (n, 3)), rng.uniform(-3, 3, (n, 3))])


def changed(name: str, tmp_path: Path, *changes: tuple[str, str]) -> Scenario:
    text = (SCENARIOS / f"{name}.toml").read_text()
    for old, new in changes:
        assert text.count(old) >= 1
        text = text.replace(old, new)
    (tmp_path / f"{name}.toml").write_text(text)
    return load(tmp_path / f"{name}.toml")


def test_connections_are_optimal() -> None:
    """No duration of a fine scan is cheaper, and the cost is what quadrature makes of the input."""
    rng = np.random.default_rng(1)
    start, end, weight = random_states(rng, 300), random_states(rng, 300), 0.3
    cost, tau = connection.optimal(start, end, weight)
    scan = np.geomspace(connection.SHORTEST, connection.LONGEST, 20_000)
    for k in range(300):
        a0, jerk = connection.inputs(start[k], end[k], scan)
        squared = (a0**2).sum(1) * scan + (a0 * jerk).sum(1) * scan**2 + (jerk**2).sum(1) * scan**3 / 3
        assert cost[k] <= (scan + weight * squared).min() + 1e-6
        assert cost[k] == pytest.approx((scan + weight * squared).min(), rel=1e-4)
    a0, jerk = connection.inputs(start, end, tau)
    p, v, _ = connection.states(start, a0, jerk, tau)
    assert np.allclose(np.column_stack([p, v]), end, atol=1e-6)


def test_limits_of_connections_are_those_of_dense_samples() -> None:
    rng = np.random.default_rng(2)
    start, end = random_states(rng, 2000), random_states(rng, 2000)
    _, tau = connection.optimal(start, end, 1 / A_MAX**2)
    said = connection.admissible(start, end, tau, V_MAX, A_MAX)
    a0, jerk = connection.inputs(start, end, tau)
    dense = np.linspace(0, 1, 400)
    states = [connection.states(start, a0, jerk, u * tau) for u in dense]
    seen = np.array([(np.abs(v) <= V_MAX).all(1) & (np.abs(a) <= A_MAX).all(1) for _, v, a in states]).all(0)
    assert not (said & ~seen).any()
    near = (said != seen).mean()
    assert near < 0.01, "only a peak between two samples may be missed by them"
    assert 0.01 < said.mean() < 0.99


@pytest.mark.parametrize("seed", range(20))
def test_rounded_corners_keep_limits_and_leave_the_way_by_less_than_a_millimetre(seed: int) -> None:
    """Cubics at the full limits with jumps of twice the limit between them."""
    rng = np.random.default_rng(seed)
    limit = LIMIT * A_MAX
    state, time = [np.zeros(6)], [0.0]
    for tau in (0.5, *rng.uniform(connection.SHORTEST, 1.0, 12)):
        a0 = rng.choice([-limit, limit], 3) if len(time) > 1 else np.zeros(3)
        a1 = rng.choice([-limit, limit], 3) if len(time) > 1 else np.zeros(3)
        p, v = state[-1][:3], state[-1][3:]
        jerk = (a1 - a0) / tau
        state.append(
            np.concatenate([p + tau * v + tau**2 * (a0 / 2 + tau * jerk / 6), v + tau * (a0 + a1) / 2])
        )
        time.append(time[-1] + tau)
    way = Cubics(np.array(time), np.array(state))
    # The last cubic is not followed by another: its own end is a knot.
    times, knots = way.knots(np.zeros(0))
    track = _core.Trajectory(
        np.column_stack([times, knots.reshape(len(times), 9), np.zeros((len(times), 3))]).astype(float)
    )
    speed, acceleration = track.bounds()
    fastest = max(np.abs(dense(way)[1]).max(), 1e-9)
    assert acceleration.max() <= A_MAX
    assert speed.max() <= fastest + FASTER * limit * 2 + 1e-3
    clock = np.linspace(0, time[-1], 4001)
    assert np.abs(track.sample(clock)[:, :3] - dense(way, clock)[0]).max() < 1e-3


def dense(way: Cubics, clock: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of the cubics themselves."""
    clock = np.linspace(0, way.time[-1], 4001) if clock is None else clock
    k = np.clip(np.searchsorted(way.time, clock, side="right") - 1, 0, len(way.time) - 2)
    a0, jerk = connection.inputs(way.state[k], way.state[k + 1], np.diff(way.time)[k])
    return connection.states(way.state[k], a0, jerk, clock - way.time[k])[:2]


@cache
def planned(name: str) -> PlanResult:
    return plan(load(SCENARIOS / f"{name}.toml"), method="rrt")


@pytest.mark.parametrize("name", ["crossing", "power_tower"])
def test_plans_keep_clear_at_100_hz_and_within_limits(name: str) -> None:
    result = planned(name)
    content, limits = result.plan, result.plan["limits"]
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in content["drones"]]
    clock = np.arange(0.0, content["horizon"] + 1e-9, 0.01)
    states = [t.sample(clock) for t in tracks]
    shapes = {r["name"]: r["shape"] for r in content["regions"]}
    for track, state in zip(tracks, states, strict=True):
        speed, acceleration = track.bounds()
        assert speed.max() <= limits["v_max"] and acceleration.max() <= limits["a_max"]
        p = state[:, :3]
        for obstacle in content["obstacles"]:
            a, b = (np.array([f[k] for f in shapes[obstacle]]) for k in ("a", "b"))
            assert (p @ a.T - b).max(axis=1).min() >= limits["tube"]
        a, b = (np.array([f[k] for f in shapes["workspace"]]) for k in ("a", "b"))
        assert (b - p @ a.T).min() >= limits["tube"]
    gap = states[0][:, :3] - states[1][:, :3]
    distance = np.linalg.norm(gap, axis=1)
    closing = np.maximum(-(gap * (states[0][:, 3:6] - states[1][:, 3:6])).sum(1) / distance, 0)
    assert (distance - limits["delta_min"] - 2 * limits["tube"] - 0.02 * closing).min() >= 0
    assert result.status is Status.CERTIFIED
    assert result.method == "rrt"
    assert verify(result.data).ok


def test_it_has_the_corners_that_the_paper_shows() -> None:
    """Acceleration steps where the convex plan's is smooth, at an energy that is no better."""
    ours = plan(load(SCENARIOS / "crossing.toml"))
    theirs = planned("crossing")

    def sharpest(result: PlanResult) -> float:
        tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in result.plan["drones"]]
        clock = np.arange(0.0, result.plan["horizon"], 0.01)
        return max(np.abs(np.diff(t.sample(clock)[:, 6:9], axis=0)).max() / 0.01 for t in tracks)

    assert sharpest(theirs) > 5 * sharpest(ours)
    assert theirs.int_a2 > ours.int_a2


def test_same_seed_gives_same_bytes_and_another_seed_other_ones(tmp_path: Path) -> None:
    other = changed("power_tower", tmp_path, ("seed = 1", "seed = 2"))
    assert plan(load(SCENARIOS / "power_tower.toml"), method="rrt").data == planned("power_tower").data
    found = plan(other, method="rrt")
    knots = [d["trajectory"] for d in found.plan["drones"]]
    assert knots != [d["trajectory"] for d in planned("power_tower").plan["drones"]]


def test_windows_are_not_looked_at_and_the_plan_says_so(tmp_path: Path) -> None:
    """A visit that must not be before 30 s is made long before, and the plan is violated: exit code 1."""
    late = "@tr1 eventually[30,40] some d: d in tr1"
    formula = f'seed = 1\nformula = """\n@safe always[0,T] all d: d outside obstacles\n{late}\n"""\n'
    scenario = changed("power_tower", tmp_path, ("seed = 1\n", formula))
    found = plan(scenario, method="rrt")
    assert found.status is Status.VIOLATED
    assert exit_of_plan(found.plan) == 1
    assert found.events[0]["t"] < 30
    assert not verify(found.data).ok
    assert plan(scenario).status is not Status.VIOLATED


def test_a_leg_without_a_way_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rrt, "SAMPLES", 2)
    monkeypatch.setattr(rrt, "PATIENCE", 4)
    with pytest.raises(InfeasibleError, match=r"RRT\* found no way for d1 to north within .* samples"):
        plan(load(SCENARIOS / "crossing.toml"), method="rrt")


def test_progress_is_told_and_may_stop_it() -> None:
    seen: list[str] = []

    def stop(stage: str, rho: float) -> None:
        seen.append(stage)
        if stage.startswith("RRT*") and len(seen) > 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan(load(SCENARIOS / "crossing.toml"), method="rrt", progress=stop)
    assert any("d1 to north" in stage for stage in seen)
