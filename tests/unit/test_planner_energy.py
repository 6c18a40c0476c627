"""Energy-aware plans: what they save, what they keep, and how the two objectives relate."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fleet import _core, certificate
from fleet.errors import ScenarioError
from fleet.planner import PlanResult, plan
from fleet.planner.plan import itineraries
from fleet.planner.problem import problem
from fleet.planner.saving import electrical
from fleet.planner.setup import setup, warm_start
from fleet.planner.tradeoff import accelerations, price
from fleet.scenario import Scenario, load
from fleet.scenario.tables import Energy
from tests.bench import reference

#: Least integral of |a|^2 [m^2/s^3] at the same floor that a long IPOPT run over knots and visit times found
#: for power_tower_energy, peers left out: row "long IPOPT" of `make bench-energy` (tests/bench/reference.py;
#: CasADi 3.8.2, IPOPT with MUMPS; 6 starts a drone, then 24 and 48 segments a leg).
LONG_IPOPT = 0.08492

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def aware(scenario: Scenario, **keys: object) -> Scenario:
    """The scenario with an `[energy]` table."""
    return replace(scenario, energy=Energy.model_validate(keys))


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load(SCENARIOS / "power_tower_energy.toml")


@pytest.fixture(scope="module")
def basic(scenario: Scenario) -> PlanResult:
    return plan(replace(scenario, energy=None))


@pytest.fixture(scope="module")
def thrifty(scenario: Scenario) -> PlanResult:
    return plan(scenario)


@pytest.fixture(scope="module")
def weighted(scenario: Scenario) -> PlanResult:
    return plan(aware(scenario, objective="weighted", floor=0.3, weight=3000.0))


def tracks(found: PlanResult) -> list[_core.Trajectory]:
    return [_core.Trajectory.from_list(d["trajectory"]) for d in found.plan["drones"]]


def test_saving_keeps_the_floor_and_never_takes_more_energy(
    scenario: Scenario, basic: PlanResult, thrifty: PlanResult
) -> None:
    """A third of the squared acceleration goes; electrical energy does not rise; all limits hold."""
    assert basic.rho > 0.99
    assert 0.3 <= thrifty.rho_lower <= thrifty.rho <= 0.31
    assert thrifty.energy <= basic.energy
    assert thrifty.int_a2 < 0.7 * basic.int_a2
    assert thrifty.int_a2 <= 1.05 * LONG_IPOPT
    assert certificate.verify(thrifty.bytes).ok
    for track in tracks(thrifty):
        v, a = track.bounds()
        assert (v <= scenario.limits.v_max).all()
        assert (a <= scenario.limits.a_max).all()


def test_the_yardstick_still_measures(scenario: Scenario) -> None:
    """One start of the reference program on coarse knots comes close to the stored figure, never below."""
    task = problem(scenario)
    guess = reference.routed(task, 0, ("tr3", "tr1"), 0.8)
    assert guess is not None
    tour = reference.solve(task, 0, guess, 0.3)
    assert tour is not None
    # The drones' halves of the mission mirror each other.
    assert LONG_IPOPT <= 2 * tour.cost <= 1.02 * LONG_IPOPT
    finer = reference.refined(tour, 24)
    assert finer.times[24] == pytest.approx(tour.times[12])
    assert finer.knots[24] == pytest.approx(tour.knots[12], abs=1e-9)


def test_visits_move_to_where_they_cost_least(basic: PlanResult, thrifty: PlanResult) -> None:
    """The tour is flown backwards: then no visit has to wait for the end of its window."""
    for name, order in basic.assignment.items():
        assert thrifty.assignment[name] == order[::-1]
    assert all(event["slack_s"] > 5.0 for event in thrifty.events)


def test_each_objective_is_best_by_its_own_measure(
    scenario: Scenario, basic: PlanResult, thrifty: PlanResult, weighted: PlanResult
) -> None:
    """Weighted lies between the plan of largest rho and that of least energy, and beats both by its score."""
    assert thrifty.rho < weighted.rho < basic.rho
    assert thrifty.int_a2 < weighted.int_a2 < basic.int_a2
    assert weighted.energy <= basic.energy
    goal = Energy.model_validate({"objective": "weighted", "weight": 3000.0})
    scores = [price(goal, problem(scenario), p.rho, tracks(p)) for p in (weighted, basic, thrifty)]
    assert scores[0] < min(scores[1:])


def test_hand_made_orders_stay(scenario: Scenario, thrifty: PlanResult) -> None:
    """An order given by hand is not turned round, and less is kept where more cannot be saved."""
    given = {"d1": ["tr1", "tr3"], "d2": ["tr2", "tr4"]}
    found = plan(replace(aware(scenario, give_up=0.2), assignment=given))
    assert found.assignment == given
    assert 0.79 <= found.rho <= 0.81
    assert found.int_a2 > thrifty.int_a2


def test_saving_past_a_peer_keeps_the_tube_and_repeats_itself() -> None:
    """In `crossing` pair distance, tower and box bind; the same input gives the same bytes."""
    crossing = load(SCENARIOS / "crossing.toml")
    one, two = (plan(aware(crossing, floor=0.4)) for _ in range(2))
    assert one.bytes == two.bytes
    basic = plan(crossing)
    assert one.rho >= 0.4
    assert certificate.verify(one.bytes).ok
    assert one.int_a2 < 0.8 * basic.int_a2
    assert one.energy <= basic.energy


def test_saving_keeps_clauses_without_a_normal_form(scenario: Scenario, tmp_path: Path) -> None:
    """An order by `until` and a meeting are proved for the plan that saves, too."""
    formula = """
@safe always[0,T] all d: d in workspace and d outside obstacles
@order (not d1 in tr1) until[0,2T/3] d2 in tr2
@tr1 eventually[0,2T/3] d1 in tr1
@meet eventually[0,2T/3] (d1 in tr3 and d2 in tr4)
@home eventually[2T/3,T] all d: d in home
"""
    text = (SCENARIOS / f"{scenario.name}.toml").read_text()
    path = tmp_path / "ordered.toml"
    path.write_text(text.replace("seed = 1\n", f'seed = 1\nformula = """{formula}"""\n', 1))
    ordered = load(path)
    found, without = plan(ordered), plan(replace(ordered, energy=None))
    assert certificate.verify(found.bytes).ok
    assert found.rho_lower >= 0.3
    assert found.int_a2 < 0.7 * without.int_a2
    assert found.energy <= without.energy


def test_slope_of_electrical_energy_is_that_of_the_core() -> None:
    task = problem(load(SCENARIOS / "power_tower.toml"))
    stage = setup(task, itineraries(task, 1.0)[0][0], 1.0)
    x, rng = warm_start(stage), np.random.default_rng(5)
    _, slope = electrical(stage, x)
    for _ in range(5):
        way = rng.normal(0.0, 1.0, len(x)) * 1e-3
        ends = [electrical(stage, x + sign * way)[0] for sign in (1, -1)]
        assert ends[0] - ends[1] == pytest.approx(2 * float(slope @ way), rel=1e-3, abs=1e-4)


def test_nodes_integrate_squared_acceleration() -> None:
    """Rows of the weighted form give the acceleration of the core's trajectory, their weights time."""
    task = problem(load(SCENARIOS / "hover.toml"))
    stage = setup(task, itineraries(task, 1.0)[0][0], 1.0)
    maps, weights = accelerations(stage.grid)
    x = np.random.default_rng(2).normal(0.0, 1.0, stage.grid.size)
    times = stage.grid.times[0]
    rows = np.column_stack([times, stage.grid.knots(x, 0).reshape(len(times), 9), np.zeros((len(times), 3))])
    dense = np.linspace(0.0, task.horizon, 40_001)
    a = _core.Trajectory(rows).sample(dense)[:, 6:9]
    assert float(weights @ (maps @ x) ** 2) == pytest.approx(
        float(np.trapezoid((a**2).sum(axis=1), dense)), rel=1e-4
    )
    assert float(weights.sum()) == pytest.approx(3 * task.horizon)


@pytest.mark.parametrize(
    ("line", "field", "words"),
    [
        ('objective = "least"', "energy.objective", "lexicographic"),
        ("floor = 0.1", "energy.floor", "limits.tube = 0.3"),
        ("weight = 0.0", "energy.weight", "greater than 0"),
        ("ceiling = 1.0", "energy.ceiling", "legal: objective, floor"),
    ],
)
def test_bad_energy_tables_are_named(line: str, field: str, words: str, tmp_path: Path) -> None:
    text = (SCENARIOS / "power_tower_energy.toml").read_text()
    begin, end = text.index("[energy]"), text.index("[workspace]")
    path = tmp_path / "bad.toml"
    path.write_text(f"{text[:begin]}[energy]\n{line}\n\n{text[end:]}")
    with pytest.raises(ScenarioError) as caught:
        load(path)
    assert [p.field for p in caught.value.problems] == [field]
    assert words in str(caught.value)
