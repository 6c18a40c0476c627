"""The missions of `make bench-peers`, and the judge of what peers answer: both without a peer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fleet.scenario import load
from tests.bench.peers.judge import driven, judged, straight
from tests.bench.peers.missions import HEIGHT, HOMEWARD, flat, own, shipped
from tests.bench.table import ROOT


@pytest.mark.parametrize("name", sorted(own()))
def test_flat_scenarios_are_legal_and_keep_the_windows(name: str, tmp_path: Path) -> None:
    theirs = flat(name, tmp_path, homeward=False)
    steps = own()[name].steps
    assert steps == theirs.mission.T
    ours = flat(name, tmp_path, homeward=True)
    assert ours.mission.T == theirs.mission.T + HOMEWARD
    ends = [c.formula["to"] for c in ours.clauses() if c.formula["op"] in ("eventually", "until")]
    assert ends and max(ends) <= theirs.mission.T


def test_the_judge_sees_what_happens_between_samples(tmp_path: Path) -> None:
    """Two points on both sides of the obstacle's corner, each 0.5 m clear: the line between them cuts it."""
    scenario = flat("reach_avoid", tmp_path, homeward=False)
    clauses = [(c.id, c.formula) for c in scenario.clauses() if c.id == "avoid"]
    points = np.array([[1.0, 2.0], [2.5, 5.9], [3.1, 6.5], [7.5, 8.5], *[[7.5, 8.5]] * 12])
    path = np.vstack([points.T, np.zeros((2, len(points)))])
    found = judged(scenario.regions(), clauses, ["d1"], straight(path, HEIGHT))
    at_points = [max(3 - x, x - 5, 4 - y, y - 6) for x, y in points]
    assert min(at_points) >= 0.5 - 1e-9
    assert found.rho < 0.3
    assert found.rho_lower <= found.rho


def test_driven_ways_are_double_integrators() -> None:
    """The judged way is that of the inputs, integrated finely, but for the rounded steps."""
    rng, dt, n = np.random.default_rng(4), 0.5, 21
    push = rng.uniform(-3, 3, (n - 1, 6))
    state = [np.zeros(12)]
    for u in push:
        p, v = state[-1][:6], state[-1][6:]
        state.append(np.concatenate([p + dt * v + dt**2 / 2 * u, v + dt * u]))
    tracks = driven(np.array(state).T, dt)
    clock = np.linspace(0, (n - 1) * dt, 5001)[:-1]
    k = (clock / dt).astype(int)
    s = (clock - k * dt)[:, None]
    base = np.array(state)[k]
    exact = base[:, :6] + s * base[:, 6:] + s**2 / 2 * push[k]
    for d, track in enumerate(tracks):
        assert np.abs(track.sample(clock)[:, :3] - exact[:, 3 * d : 3 * d + 3]).max() < 1e-3


def test_shipped_missions_carry_the_whole_mission() -> None:
    scenario, mission = load(ROOT / "scenarios" / "crossing.toml"), shipped("crossing", 1.0)
    assert mission["steps"] == 30
    assert len(mission["clauses"]) == len(scenario.clauses())
    assert mission["low"] == [-7, -9, 0] and mission["high"] == [7, 9, 23]
    assert {r["name"] for r in mission["regions"]} >= {"tower", "north", "south", "workspace"}
