"""Assignment against brute force, and the timing of legs."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest

from fleet.assign import assign
from fleet.legs import Legs, tour_time
from fleet.route import leg_time, spread


def random_legs(rng: np.random.Generator, drones: int, n: int, tight: float) -> Legs:
    """Legs between random points of a square; windows of random width."""
    homes, targets = rng.uniform(0, 10, (drones, 2)), rng.uniform(0, 10, (n, 2))
    first = np.linalg.norm(homes[:, None] - targets[None], axis=2)
    between = np.linalg.norm(targets[:, None] - targets[None], axis=2)
    start = rng.uniform(0, 8, n)
    windows = np.column_stack([start, start + rng.uniform(2, tight, n)])
    dwell = rng.choice([0.0, 0.5], n)
    return Legs(
        first, np.repeat(between[None], drones, 0), first, np.zeros(drones), windows, dwell, 2 * tight
    )


def brute_force(legs: Legs) -> tuple[float, float] | None:
    """Least makespan, then least total, over every assignment and every order."""
    drones, n = legs.first.shape
    best = None
    for owners in product(range(drones), repeat=n):
        times = []
        for d in range(drones):
            mine = [e for e in range(n) if owners[e] == d]
            times.append(min(tour_time(legs, d, order) for order in permutations(mine)))
        cost = (max(times), sum(times))
        if np.isfinite(cost[0]) and (
            best is None or cost[0] < best[0] - 1e-9 or (cost[0] < best[0] + 1e-9 and cost[1] < best[1])
        ):
            best = cost
    return best


@pytest.mark.parametrize("seed", range(40))
def test_assignment_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    legs = random_legs(rng, int(rng.integers(1, 4)), int(rng.integers(1, 5)), float(rng.uniform(5, 25)))
    wanted, found = brute_force(legs), assign(legs)
    if wanted is None:
        assert found is None
        return
    assert found is not None
    assert sorted(e for order in found for e in order) == list(range(legs.first.shape[1]))
    times = [tour_time(legs, d, order) for d, order in enumerate(found)]
    assert max(times) == pytest.approx(wanted[0], abs=1e-6)
    assert sum(times) == pytest.approx(wanted[1], abs=1e-5)


def test_random_cases_cover_both_outcomes() -> None:
    outcomes = set()
    for seed in range(40):
        rng = np.random.default_rng(seed)
        legs = random_legs(rng, int(rng.integers(1, 4)), int(rng.integers(1, 5)), float(rng.uniform(5, 25)))
        outcomes.add(assign(legs) is None)
    assert outcomes == {True, False}


def test_large_fleets_get_every_event_once() -> None:
    rng = np.random.default_rng(3)
    legs = random_legs(rng, 4, 16, 200.0)
    found = assign(legs)
    assert found is not None
    assert sorted(e for order in found for e in order) == list(range(16))
    assert all(np.isfinite(tour_time(legs, d, order)) for d, order in enumerate(found))


def test_leg_time_is_that_of_the_trapezoid() -> None:
    assert leg_time(3.0, 3.0, 3.0) == pytest.approx(2.0)  # up to v_max and down again at once
    assert leg_time(9.0, 3.0, 3.0) == pytest.approx(4.0)
    assert leg_time(0.75, 3.0, 3.0) == pytest.approx(1.0)
    assert leg_time(9.0, 3.0, 3.0, rest=False) == pytest.approx(3.0)


@pytest.mark.parametrize("seed", range(30))
def test_spread_keeps_windows_and_legs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    least = rng.uniform(1, 5, n + 1)
    horizon = float(least.sum() * rng.uniform(1.0, 2.0))
    end = np.sort(rng.uniform(least[:-1].sum() * 0.8, horizon, n))
    windows = np.column_stack([np.zeros(n), end])
    times = spread(least, windows, horizon, 0.05)
    feasible = (np.cumsum(least[:-1]) <= end - 0.1).all()
    if times is None:
        assert not feasible or least.sum() > horizon - 0.1 * (n + 1)
        return
    assert (times <= end + 1e-9).all()
    assert (np.diff(np.concatenate([[0.0], times, [horizon]])) >= least - 0.1 - 1e-9).all()
    assert np.allclose(times / 0.05, np.round(times / 0.05), atol=1e-6)


def test_spread_uses_the_slack_evenly() -> None:
    times = spread(np.array([2.0, 4.0, 2.0]), np.array([[0.0, 99.0], [0.0, 99.0]]), 16.0, 0.05)
    assert times is not None
    assert times == pytest.approx([4.0, 12.0], abs=0.051)


def test_spread_waits_for_windows_that_open_late() -> None:
    """Three visits at one place, 5 s from home: slack is for the way out and home, not for the waits."""
    windows = np.array([[0.0, 20.0], [27.0, 33.0], [40.0, 46.0]])
    times = spread(np.array([5.0, 0.0, 0.0, 5.0]), windows, 60.0, 0.05)
    assert times is not None
    assert ((times >= windows[:, 0]) & (times <= windows[:, 1])).all()
    assert times[2] <= 55.0
