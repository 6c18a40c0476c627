"""Trajectories, keys and refusals of the core as Python sees them."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fleet import _core

Array = NDArray[np.float64]


def random_knots(n: int, seed: int) -> Array:
    """Knots (n, 13) that a quadrotor could fly through."""
    rng = np.random.default_rng(seed)
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 4.0, n - 1))])
    return np.column_stack([t, rng.normal(0, 2, (n, 3)), rng.normal(0, 1, (n, 9))])


def primitive(a: Array, b: Array, t: float, axis: int) -> list[float]:
    """Position, velocity, acceleration, jerk of the minimum-jerk primitive (Mueller et al. 2015)."""
    T = b[0] - a[0]
    p0, v0, a0 = a[1 + axis], a[4 + axis], a[7 + axis]
    p1, v1, a1 = b[1 + axis], b[4 + axis], b[7 + axis]
    delta = [p1 - p0 - v0 * T - a0 * T**2 / 2, v1 - v0 - a0 * T, a1 - a0]
    matrix = np.array(
        [[720, -360 * T, 60 * T**2], [-360 * T, 168 * T**2, -24 * T**3], [60 * T**2, -24 * T**3, 3 * T**4]]
    )
    alpha, beta, gamma = matrix @ delta / T**5
    s = t - a[0]
    return [
        alpha / 120 * s**5 + beta / 24 * s**4 + gamma / 6 * s**3 + a0 / 2 * s**2 + v0 * s + p0,
        alpha / 24 * s**4 + beta / 6 * s**3 + gamma / 2 * s**2 + a0 * s + v0,
        alpha / 6 * s**3 + beta / 2 * s**2 + gamma * s + a0,
        alpha / 2 * s**2 + beta * s + gamma,
    ]


@seed(1)
@settings(max_examples=100, deadline=None)
@given(st.integers(2, 8), st.integers(0, 2**32 - 1), st.floats(0.001, 0.999))
def test_samples_are_those_of_the_motion_primitive(n: int, knots: int, u: float) -> None:
    rows = random_knots(n, knots)
    trajectory = _core.Trajectory(rows)
    times = rows[:-1, 0] + u * np.diff(rows[:, 0])
    samples = trajectory.sample(times)
    for a, b, t, sample in zip(rows[:-1], rows[1:], times, samples, strict=True):
        expected = np.array([primitive(a, b, t, axis) for axis in range(3)]).T
        scale = np.array([1.0, 1 / (b[0] - a[0]), (b[0] - a[0]) ** -2, (b[0] - a[0]) ** -3])
        got = sample[:12].reshape(4, 3)
        assert np.all(np.abs(got - expected) <= 1e-9 * (1 + scale[:, None]) * 100)
    assert np.array_equal(trajectory.knots, rows)
    at_knots = trajectory.sample(rows[:, 0])
    np.testing.assert_allclose(at_knots[:, :9], rows[:, 1:10], rtol=0, atol=1e-7)
    np.testing.assert_allclose(at_knots[:, 12:], rows[:, 10:12], rtol=0, atol=1e-7)


@seed(2)
@settings(max_examples=50, deadline=None)
@given(st.integers(2, 6), st.integers(0, 2**32 - 1))
def test_bounds_lie_just_above_every_sample(n: int, knots: int) -> None:
    rows = random_knots(n, knots)
    trajectory = _core.Trajectory(rows)
    times = np.concatenate([np.linspace(a, b, 2001) for a, b in itertools.pairwise(rows[:, 0])])
    samples = np.abs(trajectory.sample(times))
    for bound, largest in zip(
        trajectory.bounds(), (samples[:, 3:6].max(axis=0), samples[:, 6:9].max(axis=0)), strict=True
    ):
        assert np.all(bound >= largest - 1e-9 * (1 + largest))
        assert np.all(bound <= largest * (1 + 1e-4) + 1e-4)


def test_outside_of_its_time_a_trajectory_rests() -> None:
    trajectory = _core.Trajectory(random_knots(3, 7))
    rest = trajectory.sample(np.array([trajectory.start - 1.0, trajectory.end + 1.0]))
    assert np.array_equal(rest[:, :3], trajectory.knots[[0, -1], 1:4])
    assert not rest[:, 3:12].any()


def test_the_list_of_a_plan_makes_the_same_trajectory() -> None:
    rows = random_knots(5, 8)
    again = _core.Trajectory.from_list(_core.Trajectory(rows).to_list())
    assert np.array_equal(again.knots, rows)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda k: k[:1], "2 to 513 knots, not 1"),
        (lambda k: k[:, :12], "12 columns; legal is 13"),
        (lambda k: np.where(k == k[1, 4], np.nan, k), "knot 1 holds a value that is not finite"),
        (lambda k: k[::-1], "segment 0 lasts"),
        (lambda k: k * np.array([1000.0] + [1.0] * 12), "legal is 0.05 to 10 s"),
    ],
)
def test_what_is_not_a_trajectory_is_refused(change: Any, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        _core.Trajectory(np.ascontiguousarray(change(random_knots(4, 9))))


@seed(3)
@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_bound_is_below_the_samples_and_close(knots: int) -> None:
    pair = [_core.Trajectory(random_knots(12, knots + i)) for i in range(2)]
    end = math.floor(min(t.end for t in pair) / 0.05) * 0.05
    fleet = _core.Fleet(["d1", "d2"], [])
    dist = {"op": "dist", "a": "d1", "b": "d2", "cmp": "ge", "value": 1.0}
    formula = {"op": "always", "from": 0.0, "to": end, "f": dist}
    times = np.arange(round(end / 0.05) + 1) * 0.05
    rho, _ = fleet.evaluate(formula, np.stack([t.sample(times)[:, :3] for t in pair]), 0.05)
    lower, t = fleet.lower_bound(formula, pair, 0.05)
    fine = np.linspace(0.0, end, 40 * len(times))
    x = [t.sample(fine)[:, :3] for t in pair]
    least = float(np.linalg.norm(x[0] - x[1], axis=1).min()) - 1.0
    assert lower <= rho
    assert least - 0.01 <= lower <= least
    assert 0.0 <= t <= end


def test_a_trajectory_that_ends_before_the_horizon_is_refused() -> None:
    trajectory = _core.Trajectory(random_knots(3, 10))
    fleet = _core.Fleet(["d1"], [])
    above = {"op": "linear", "terms": [{"drone": "d1", "axis": "z", "coef": 1.0}], "constant": 0.0}
    end = math.ceil(trajectory.end) + 1
    with pytest.raises(ValueError, match="beyond the end"):
        fleet.lower_bound({"op": "eventually", "from": 0, "to": end, "f": above}, [trajectory], 0.5)
    with pytest.raises(ValueError, match="0 trajectories for a fleet of 1 drones"):
        fleet.lower_bound(above, [], 0.5)


def test_endless_nesting_is_refused_and_does_not_crash() -> None:
    formula: dict[str, Any] = {"op": "in", "drone": "d1", "region": "r"}
    for _ in range(100_000):
        formula = {"op": "not", "f": formula}
    with pytest.raises(ValueError, match="formula: nested deeper than 64 levels"):
        _core.Fleet(["d1"], []).check(formula, 0.1)
    circle: dict[str, Any] = {"op": "not"}
    circle["f"] = circle
    with pytest.raises(ValueError, match="nested deeper"):
        _core.Fleet(["d1"], []).check(circle, 0.1)


def test_keys_are_those_of_the_design() -> None:
    assert _core.key_down("fleet", "d1", "commit") == "fleet/fleet/d1/down/commit"
    assert _core.key_up("a", "*", "heartbeat") == "fleet/a/*/up/heartbeat"
    assert _core.key_query("a", "d1", "time") == "fleet/a/d1/time"
    assert _core.key_alive("a", "d1") == "fleet/a/d1/alive"
    for name in ("a/b", "**", "", "1d"):
        with pytest.raises(ValueError, match="legal is a letter"):
            _core.key_alive(name, "d1")
        with pytest.raises(ValueError, match="legal is a letter"):
            _core.key_up("fleet", name, "ack")
    with pytest.raises(ValueError, match="legal is plan, commit, cmd"):
        _core.key_down("fleet", "d1", "x")  # type: ignore[arg-type]


def test_names_given_twice_are_refused() -> None:
    face = {"a": [1.0, 0.0, 0.0], "b": 0.0}
    with pytest.raises(ValueError, match="`d1` is given twice"):
        _core.Fleet(["d1", "d1"], [])
    with pytest.raises(ValueError, match="`r` is given twice"):
        _core.Fleet(["d1"], [{"name": "r", "shape": [face]}, {"name": "r", "shape": [face]}])
