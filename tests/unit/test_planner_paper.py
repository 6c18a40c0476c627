"""The paper's formulation as a baseline: its program, and its plans against an own oracle."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fleet import _core
from fleet.certificate import verify
from fleet.cli.planning import exit_of_plan, plan_fields
from fleet.errors import InputError
from fleet.planner import PlanResult, Status, plan
from fleet.planner.algebra import Numbers, Score
from fleet.planner.lifted import Lifted
from fleet.planner.paper import settled
from fleet.planner.program import Program
from fleet.planner.thinning import thinned
from fleet.scenario import Scenario, load

SCENARIOS = Path(__file__).parents[2] / "scenarios"
C = 5.0
SWAP = """
[mission]
T = 12.0
T_s = 0.1
c = 5.0
seed = 1

[limits]
v_max = 3.0
a_max = 3.0
delta_min = 1.5
tube = 0.2

[replan]
T_e = 0.1
T_g = 5.0
eta = 0.2
enabled = true

[workspace]
box = [[-6.0, -4.0, 0.0], [6.0, 4.0, 6.0]]

[[obstacle]]
name = "post"
box = [[-0.5, -4.0, 0.0], [0.5, 0.0, 6.0]]

[[target]]
name = "east"
box = [[3.0, -1.0, 2.0], [5.0, 1.0, 4.0]]
heading = 0.0

[[target]]
name = "west"
box = [[-5.0, -1.0, 2.0], [-3.0, 1.0, 4.0]]
heading = 0.0

[[drone]]
id = "d1"
home = { box = [[-5.0, -1.0, 0.5], [-3.0, 1.0, 2.5]] }
pad = [-4.0, 0.0, 0.1]
heading = 0.0

[[drone]]
id = "d2"
home = { box = [[3.0, -1.0, 0.5], [5.0, 1.0, 2.5]] }
pad = [4.0, 0.0, 0.1]
heading = 0.0

[assignment]
d1 = ["east"]
d2 = ["west"]
"""


def hover(folder: Path, formula: str) -> Scenario:
    """The hover mission with another formula."""
    text = (SCENARIOS / "hover.toml").read_text()
    (folder / "other.toml").write_text(
        text.replace("seed = 1\n", f'seed = 1\nformula = """\n{formula}\n"""\n', 1)
    )
    return load(folder / "other.toml")


@cache
def planned() -> PlanResult:
    return plan(load(SCENARIOS / "hover.toml"), method="paper")


def test_the_plan_is_certified_and_verified() -> None:
    result = planned()
    assert result.method == "paper"
    assert result.status is Status.CERTIFIED
    # Log-sum-exp pays for time in a target, so that it stays well inside, but not for the exact minimum.
    assert 0.2 < result.rho_lower <= result.rho < 0.95
    assert verify(result.data).ok
    assert exit_of_plan(result.plan) == 0


def test_its_robustness_and_limits_are_those_of_samples_at_100_hz() -> None:
    content = planned().plan
    times = np.arange(0, content["horizon"] + 1e-9, 0.01)
    track = _core.Trajectory.from_list(content["drones"][0]["trajectory"])
    states = track.sample(times)
    assert np.abs(states[:, 3:6]).max() <= content["limits"]["v_max"]
    assert np.abs(states[:, 6:9]).max() <= content["limits"]["a_max"] * (1 + 1e-3)
    slope = (states[2:, :3] - states[:-2, :3]) / 0.02
    assert np.abs(slope - states[1:-1, 3:6]).max() < 5e-3
    deep = {}
    for name in ("up", "home.d1"):
        shape = next(r["shape"] for r in content["regions"] if r["name"] == name)
        deep[name] = np.min([f["b"] - states[:, :3] @ np.array(f["a"]) for f in shape], axis=0)
    assert deep["up"][times <= 8.0].max() == pytest.approx(clause("up")["rho"], abs=2e-3)
    assert deep["home.d1"][times >= 8.0].max() == pytest.approx(clause("home")["rho"], abs=2e-3)
    assert deep["home.d1"][-1] > 0


def clause(name: str) -> dict:
    return next(c for c in planned().plan["clauses"] if c["id"] == name)["result"]


def test_both_solves_are_reported_and_the_better_one_is_kept() -> None:
    notes = planned().notes
    assert len(notes) == 2
    assert sorted("exact" in note for note in notes) == [False, True]
    kept, other = (float(note.split("rho ")[1].split(" m")[0]) for note in notes)
    assert notes[0].startswith("kept") and notes[1].startswith("not kept")
    assert kept >= other - 1e-3
    assert plan_fields(planned())["notes"] == list(notes)


def test_it_is_deterministic() -> None:
    assert plan(load(SCENARIOS / "hover.toml"), method="paper").data == planned().data


def test_a_violating_plan_is_returned_as_such(tmp_path: Path) -> None:
    """The target begins 0.1 m above what is allowed; log-sum-exp says more of it than is true."""
    scenario = hover(tmp_path, "@up eventually[0,8] d1 in up\n@low always[0,T] d1.z <= 2.4")
    result = plan(scenario, method="paper")
    assert result.status is Status.VIOLATED
    score = float(result.notes[0].split("score ")[1].split(" m")[0])
    assert result.rho < -0.05 + 1e-6
    assert result.rho < score
    assert exit_of_plan(result.plan) == 1


def test_until_is_planned_too(tmp_path: Path) -> None:
    """Low until up: the clause has no normal form, and the second derivatives are those of a nest."""
    result = plan(hover(tmp_path, "@order d1.x <= 0.5 until[4,6] d1 in up"), method="paper")
    assert result.status is Status.CERTIFIED
    assert verify(result.data).ok


def test_drones_and_axes_are_planned_together(tmp_path: Path) -> None:
    """Two drones change sides beside a post; pair distance and clearance by an own oracle at 100 Hz."""
    (tmp_path / "swap.toml").write_text(SWAP)
    result = plan(load(tmp_path / "swap.toml"), method="paper")
    assert result.status is Status.CERTIFIED
    assert verify(result.data).ok
    times = np.arange(0, 12.0 + 1e-9, 0.01)
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in result.plan["drones"]]
    one, two = (track.sample(times)[:, :3] for track in tracks)
    assert np.linalg.norm(one - two, axis=1).min() >= 1.5 + result.rho_lower
    for p in (one, two):
        beside = np.max([np.abs(p[:, 0]) - 0.5, np.abs(p[:, 1] + 2.0) - 2.0, p[:, 2] - 6.0], axis=0)
        assert beside.min() >= result.rho_lower - 1e-6


def test_choices_of_a_drone_are_settled_and_others_stay() -> None:
    def inside(drone: str, region: str) -> dict:
        return {"op": "in", "drone": drone, "region": region}

    window = {"from": 0.0, "to": 1.0}
    some = {"op": "or", "fs": [inside("d1", "a"), inside("d2", "a")]}
    other = {"op": "or", "fs": [inside("d1", "b"), {"op": "outside", "drone": "d2", "region": "b"}]}
    f = {
        "op": "and",
        "fs": [{"op": "eventually", **window, "f": some}, {"op": "always", **window, "f": other}],
    }
    expected = {
        "op": "and",
        "fs": [
            {"op": "eventually", **window, "f": inside("d2", "a")},
            {"op": "always", **window, "f": other},
        ],
    }
    assert settled(f, {("d2", "a")}) == expected


@pytest.mark.parametrize("seed", range(10))
def test_further_unknowns_leave_the_score_as_it_is(seed: int) -> None:
    """Maximised over them, the lifted score of fixed values is their log-sum-exp, wherever it starts."""
    rng = np.random.default_rng(seed)
    values, start = rng.uniform(-3, 3, (40, 2)), rng.uniform(-3, 3, (40, 2))
    program = Program()
    x = program.unknown("x", 40, 2, start, values, values)
    algebra, numbers = Lifted(program, C), Numbers(Score.PAPER, C)
    score = algebra.least(ca.horzcat(algebra.most(x[:, 0].T), algebra.least(x[:, 1].T)))
    statement = {"x": ca.vertcat(*program.unknowns), "f": -score, "g": ca.vertcat(*program.g)}
    quiet = {"ipopt": {"print_level": 0, "sb": "yes", "fixed_variable_treatment": "make_constraint"}}
    solver = ca.nlpsol("lifted", "ipopt", statement, {**quiet, "print_time": False})
    found = solver(
        x0=np.concatenate(program.guess),
        lbx=np.concatenate(program.low),
        ubx=np.concatenate(program.high),
        lbg=np.concatenate(program.g_low),
        ubg=np.concatenate(program.g_high),
    )
    parts = np.stack([numbers.most(values[:, :1].T), numbers.least(values[:, 1:].T)], axis=1)
    assert solver.stats()["success"]
    assert -float(found["f"]) == pytest.approx(float(numbers.least(parts)[0]), abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_knots_go_where_quintics_reproduce_them(seed: int) -> None:
    """Samples of a few long quintics: thinned to a third, they are met as before."""
    rng = np.random.default_rng(seed)
    times = np.array([0.0, 2.0, 5.0, 7.0])
    rows = np.column_stack([times, rng.normal(0, 1, (4, 9)), np.zeros((4, 3))])
    track = _core.Trajectory(rows)
    clock = np.arange(141) * 0.05
    samples = track.sample(clock)[:, :9]
    chosen = thinned(samples, 0.05, {40, 100, 63}, 47, 1.0)
    assert len(chosen) == 48
    assert {0, 140, 40, 100, 63} <= set(chosen.tolist())
    assert np.diff(chosen).max() * 0.05 <= 1.0 + 1e-9
    fewer = np.column_stack([clock[chosen], samples[chosen], np.zeros((48, 3))])
    assert np.abs(_core.Trajectory(fewer).sample(clock)[:, :9] - samples).max() < 1e-6


def test_fewer_knots_than_must_stay_are_refused() -> None:
    samples = np.zeros((101, 9))
    with pytest.raises(ValueError, match="knots"):
        thinned(samples, 0.05, set(range(0, 101, 2)), 20, 1.0)


def test_a_mission_too_large_for_memory_is_refused_before_any_solve(tmp_path: Path) -> None:
    """Nested windows multiply: 81 x 81 x 81 x 6 values, more than 3 million."""
    text = "@often always[0,4] (eventually[0,4] (always[0,4] (d1 in workspace)))"
    with pytest.raises(InputError, match="plan fewer drones, or with a longer T_s") as caught:
        plan(hover(tmp_path, text), method="paper")
    assert caught.value.problems[0].code == "size"
