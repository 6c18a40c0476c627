"""Power over time of plans and flights, and where it is shown."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fleet import _core, consumption, verdict
from fleet.log import read
from fleet.log.flight import Flight
from fleet.planner import PlanResult, plan
from fleet.report import figures, write
from fleet.scenario import load
from tests.unit.synthetic import write_flight

SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.fixture(scope="module")
def planned() -> PlanResult:
    return plan(load(SCENARIOS / "crossing.toml"))


@pytest.fixture(scope="module")
def flight(planned: PlanResult, tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return read(write_flight(planned.bytes, tmp_path_factory.mktemp("perfect")))


def test_a_plan_tells_its_energy(planned: PlanResult) -> None:
    """The fleet's energy is the sum over drones of power over time; hovering takes nearly all of it."""
    for drone in planned.plan["drones"]:
        track = _core.Trajectory.from_list(drone["trajectory"])
        times = consumption.sample_times(planned.plan["horizon"])
        integral = float(np.trapezoid(consumption.planned_power(track, times), times))
        total, hover = planned.energies[drone["id"]]
        assert integral == pytest.approx(total, rel=1e-4)
        assert hover == pytest.approx(_core.hover_power() * planned.plan["horizon"])
    assert planned.energy == pytest.approx(sum(total for total, _ in planned.energies.values()))
    assert 0.97 < planned.hover_share < 1.03


def test_a_perfect_flight_takes_the_planned_energy(planned: PlanResult, flight: Flight) -> None:
    judged = verdict.judge(flight)
    for drone in judged.drones:
        assert drone.energy_J == pytest.approx(planned.energies[drone.id][0], rel=2e-4)
    assert consumption.flown_energy(flight.drones["d1"].truth, planned.plan["horizon"] + 30.0) is None


def test_the_report_shows_another_plan(planned: PlanResult, flight: Flight, tmp_path: Path) -> None:
    """Profiles of power and squared acceleration, each plan by itself; the other one only when given."""
    crossing = load(SCENARIOS / "crossing.toml")
    gentle = replace(crossing, limits=crossing.limits.model_copy(update={"a_max": 1.2}))
    other = plan(gentle).plan
    alone, both = figures.power(flight), figures.power(flight, other)
    assert [t.name for t in alone.data] == ["d1 flown", "d1 planned", "d2 flown", "d2 planned"]
    traces = {t.name: np.asarray(t.y, dtype=float) for t in both.data}
    assert np.abs(traces["d1 flown"] - traces["d1 planned"])[5:-5].max() < 5.0
    assert np.abs(traces["d1 other plan"] - traces["d1 planned"]).max() > 0.01
    squared = {t.name: np.asarray(t.y, dtype=float) for t in figures.effort(flight, other).data}
    times = consumption.sample_times(planned.plan["horizon"])
    total = sum(float(np.trapezoid(squared[f"{d} planned"], times)) for d in ("d1", "d2"))
    assert total == pytest.approx(planned.int_a2, rel=1e-2)
    page = tmp_path / "report.html"
    write(flight, verdict.judge(flight), page, other)
    text = page.read_text()
    assert "<h2>Energy</h2>" in text
    assert "other plan [kJ]" in text
