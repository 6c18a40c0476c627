"""Properties of plans of the shipped scenarios, checked by dense sampling and by an own oracle."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.certificate import verify, visitors
from fleet.planner import PlanResult, Status, plan
from fleet.scenario import load

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = ("hover", "power_tower", "power_tower_4", "power_tower_solo", "multi_line", "crossing")


@cache
def planned(name: str) -> PlanResult:
    return plan(load(SCENARIOS / f"{name}.toml"))


@cache
def dense(name: str) -> tuple[np.ndarray, np.ndarray]:
    """States (d, n, 14) every 5 ms of every drone, and the times."""
    content = planned(name).plan
    times = np.arange(0.0, content["horizon"] + 1e-9, 0.005)
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in content["drones"]]
    return np.stack([t.sample(times) for t in tracks]), times


def faces(content: dict, name: str) -> tuple[np.ndarray, np.ndarray]:
    shape = next(r["shape"] for r in content["regions"] if r["name"] == name)
    return np.array([f["a"] for f in shape]), np.array([f["b"] for f in shape])


@pytest.mark.parametrize("name", NAMES)
def test_rho_reaches_the_bound_and_is_certified(name: str) -> None:
    result = planned(name)
    assert result.status is Status.OPTIMAL
    assert result.rho >= result.rho_lower > 0
    assert result.rho_bound == pytest.approx(1.0)
    assert 0.9 * result.rho_bound <= result.rho <= result.rho_bound + 1e-6
    for clause in result.plan["clauses"]:
        assert clause["result"]["rho"] >= clause["result"]["rho_lower"] > 0


@pytest.mark.parametrize("name", NAMES)
def test_the_bound_lies_just_below_the_value_on_any_finer_grid(name: str) -> None:
    """Within 1 cm at the samples, and not above the exact robustness where those are among the times."""
    content = planned(name).plan
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in content["drones"]]
    fleet = _core.Fleet([d["id"] for d in content["drones"]], content["regions"])
    for clause in content["clauses"]:
        rho, lower = clause["result"]["rho"], clause["result"]["rho_lower"]
        assert rho - 0.01 <= lower <= rho
    for parts in (2, 3, 7):
        step = content["sample"] / parts
        times = np.arange(round(content["horizon"] / step) + 1) * step
        positions = np.stack([np.ascontiguousarray(t.sample(times)[:, :3]) for t in tracks])
        for clause in content["clauses"]:
            fine, _ = fleet.evaluate(clause["formula"], positions, step)
            assert clause["result"]["rho_lower"] <= fine


@pytest.mark.parametrize("name", NAMES)
def test_limits_hold_between_samples(name: str) -> None:
    limits = planned(name).plan["limits"]
    states, _ = dense(name)
    assert np.abs(states[:, :, 3:6]).max() <= limits["v_max"]
    assert np.abs(states[:, :, 6:9]).max() <= limits["a_max"]
    assert np.abs(states[:, :, 13]).max() <= limits["psi_rate_max"] + 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_states_are_continuous(name: str) -> None:
    """Velocity and acceleration are the derivatives of position: no jump anywhere, knots included."""
    states, times = dense(name)
    limits, h = planned(name).plan["limits"], times[1] - times[0]
    assert np.abs(np.diff(states[:, :, :3], axis=1)).max() <= limits["v_max"] * h * (1 + 1e-6)
    assert np.abs(np.diff(states[:, :, 3:6], axis=1)).max() <= limits["a_max"] * h * (1 + 1e-6)
    slope = (states[:, 2:, :3] - states[:, :-2, :3]) / (2 * h)
    assert np.abs(slope - states[:, 1:-1, 3:6]).max() < 1e-3
    assert np.abs(np.diff(states[:, :, 12], axis=1)).max() <= limits["psi_rate_max"] * h * (1 + 1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_clearances_hold_between_samples(name: str) -> None:
    """Own oracle: faces and distances in numpy, every 5 ms."""
    content, (states, _) = planned(name).plan, dense(name)
    rho = planned(name).rho_lower - 1e-6
    for p in states[:, :, :3]:
        a, b = faces(content, content["workspace"])
        assert (b - p @ a.T).min() >= rho
        for obstacle in content["obstacles"]:
            a, b = faces(content, obstacle)
            assert (p @ a.T - b).max(axis=1).min() >= rho


@pytest.mark.parametrize("name", NAMES)
def test_pairs_keep_what_the_tube_asks(name: str) -> None:
    content, (states, _) = planned(name).plan, dense(name)
    limits = content["limits"]
    for i in range(len(states)):
        for j in range(i):
            p = states[i, :, :3] - states[j, :, :3]
            v = states[i, :, 3:6] - states[j, :, 3:6]
            distance = np.linalg.norm(p, axis=1)
            closing = np.maximum(-(p * v).sum(axis=1) / distance, 0.0)
            asked = 2 * limits["tube"] + 0.02 * closing
            assert (distance - limits["delta_min"] - asked).min() >= 0


@pytest.mark.parametrize("name", NAMES)
def test_ends_at_rest_and_visits_with_heading(name: str) -> None:
    content = planned(name).plan
    scenario = load(SCENARIOS / f"{name}.toml")
    for drone, given in zip(content["drones"], scenario.drones, strict=True):
        track = _core.Trajectory.from_list(drone["trajectory"])
        start, end = track.sample(np.array([0.0, content["horizon"]]))
        assert start[:3] == pytest.approx(given.start, abs=1e-7)
        assert np.abs(start[3:9]).max() < 1e-7
        assert np.abs(end[3:9]).max() < 1e-7
        assert start[12] == pytest.approx(given.pad_heading)
        a, b = faces(content, drone["home"])
        assert (b - a @ end[:3]).min() > 0.9
        for visit in drone["visits"]:
            state = track.sample(np.array([visit["t"]]))[0]
            a, b = faces(content, visit["region"])
            assert (b - a @ state[:3]).min() > 0.9
            assert visit["window"][0] <= visit["t"] <= visit["window"][1]
            if visit["psi"] is not None:
                assert np.cos(state[12] - visit["psi"]) > 1 - 1e-9
        assert set(np.round([v["t"] for v in drone["visits"]], 9)) <= set(np.round(drone["topics"], 9))


@pytest.mark.parametrize("name", NAMES)
def test_verify_agrees_and_sees_tampering(name: str) -> None:
    result = planned(name)
    checked = verify(result.data)
    assert checked.ok, checked.problems
    assert checked.rho == pytest.approx(result.rho)
    assert checked.hash == result.hash
    content = _core.decode_plan(result.data)
    content["rho"] += 0.5
    assert any("claims rho" in p for p in verify(content).problems)
    content = _core.decode_plan(result.data)
    knot = content["drones"][0]["trajectory"][2]
    knot["p"] = [knot["p"][0], knot["p"][1], knot["p"][2] + 30.0]
    broken = verify(content)
    assert not broken.ok
    assert any("clause safe" in p for p in broken.problems)
    assert any("|v|" in p for p in broken.problems)


def test_same_scenario_gives_same_bytes_in_another_process() -> None:
    code = (
        "import sys; from fleet.planner import plan; from fleet.scenario import load;"
        "sys.stdout.write(plan(load(sys.argv[1])).hash)"
    )
    path = str(SCENARIOS / "crossing.toml")
    other = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True)
    assert other.stdout == planned("crossing").hash
    assert plan(load(Path(path))).data == planned("crossing").data


def test_drones_planned_alone_would_meet() -> None:
    """The pair clause of `crossing` is posed: without it the same mission breaks it."""
    text = (SCENARIOS / "crossing.toml").read_text()
    alone = SCENARIOS / "crossing.toml"
    clause = next(c.formula for c in load(alone).clauses() if c.id == "apart")
    assert "@apart" in text
    loose = loosened(text)
    result = plan(loose)
    checked = next(c for c in result.plan["clauses"] if c["id"] == "apart")
    assert checked["result"]["rho"] > 0
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in result.plan["drones"]]
    fleet = _core.Fleet([d["id"] for d in result.plan["drones"]], result.plan["regions"])
    assert fleet.lower_bound(clause, tracks, 0.05)[0] < 0


def loosened(text: str):
    """`crossing` with a pair distance so small that it never matters."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "loose.toml"
        changed, count = re.subn(r"delta_min = 3.0", "delta_min = 0.03", text)
        assert count == 1
        changed = changed.replace("tube = 0.4", "tube = 0.01")
        path.write_text(changed)
        return load(path)


def test_who_visits_for_each_clause() -> None:
    """`some d` speaks of both drones; the plan says which of them makes it true."""
    found = planned("power_tower")
    who = visitors(found.plan)
    assert set(who) == {clause["id"] for clause in found.plan["clauses"]}
    for event in found.events:
        assert who[event["region"]] == [(event["drone"], event["t"])]
    assert who["safe"] == who["apart"] == who["home"] == []
