"""Stays, named regions and past operators in missions: planned, proved, and seen in the flight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.errors import InfeasibleError
from fleet.log import read
from fleet.planner import plan
from fleet.planner.problem import problem
from fleet.planner.spec import specification
from fleet.report.figures import robustness
from fleet.scenario import Scenario, load
from fleet.verdict import judge
from tests.unit.synthetic import write_flight
from tests.unit.test_planner_rest import mission, planned, sampled

REGIONS = """
[[region]]
name = "gate"
box = [[-7.0, -3.0, 4.0], [-3.0, 1.0, 9.0]]
[[region]]
name = "closed"
box = [[-7.0, -4.5, 12.0], [7.0, -1.0, 16.0]]
"""


def with_regions(tmp_path: Path, *clauses: str) -> Scenario:
    """`mission` with a gate beside the tower and a closed layer between the home of d1 and tr1."""
    mission(tmp_path, "@t eventually[0,40] d1 in tr1")
    path = tmp_path / "mission.toml"
    text = path.read_text().replace("@t eventually[0,40] d1 in tr1", "\n".join(clauses))
    path.write_text(text + REGIONS)
    return load(path)


def test_a_stay_lasts(tmp_path: Path) -> None:
    result = planned(mission(tmp_path, "@long eventually[0,40] some d: stay 4 d in tr1"))
    ((drone, region),) = [(d, r) for d, regions in result.assignment.items() for r in regions]
    times, there = sampled(result, drone, region)
    assert times[there].max() - times[there].min() >= 4.0
    assert [c["kind"] for c in result.plan["clauses"] if c["id"] == "long"] == ["event"]


def test_a_stay_is_an_event_with_options(tmp_path: Path) -> None:
    scenario = mission(tmp_path, "@long eventually[0,40] some d: stay 4 d in tr1")
    (visit,) = specification(scenario.clauses(), 60.0).visits
    assert (visit.window, visit.dwell) == ((0.0, 40.0), 4.0)
    assert visit.options == (("d1", "tr1"), ("d2", "tr1"))


def test_named_regions_are_visited_kept_and_kept_out_of(tmp_path: Path) -> None:
    scenario = with_regions(
        tmp_path,
        "@t eventually[20,40] d1 in tr1",
        "@gate eventually[0,20] stay 1 d1 in gate",
        "@out always[0,T] all d: d outside closed",
    )
    assert "closed" in problem(scenario).walls()
    result = planned(scenario)
    assert {"gate", "closed"} <= {r["name"] for r in result.plan["regions"]}
    assert not {"gate", "closed"} & set(result.plan["obstacles"])
    times, there = sampled(result, "d1", "gate")
    assert times[there].min() <= 20
    for drone in ("d1", "d2"):
        assert not sampled(result, drone, "closed")[1].any()


def test_what_was_once_is_asked_for(tmp_path: Path) -> None:
    """Nobody would send d2 to tr2 but that d1 needs somebody to have been there before it."""
    clauses = (
        "@t1 eventually[20,40] d1 in tr1",
        "@first always[0,T] (d1 in tr1 -> once[0,20] d2 in tr2)",
    )
    result = planned(mission(tmp_path, *clauses))
    times, asked = sampled(result, "d1", "tr1")
    before = times[sampled(result, "d2", "tr2")[1]]
    assert asked.any()
    for t in times[asked]:
        assert ((before >= t - 20.02) & (before <= t + 0.02)).any()


def test_since_and_historically_are_kept(tmp_path: Path) -> None:
    clauses = (
        "@since eventually[25,40] (d1 outside tr3 since[5,25] d1 in tr1)",
        "@low eventually[30,40] historically[0,20] d2.z <= 12",
        "@up eventually[0,20] d2.z >= 14",
    )
    result = planned(mission(tmp_path, *clauses))
    assert all(c["result"]["rho_lower"] >= 0.4 for c in result.plan["clauses"])
    kinds = {c["id"]: c["kind"] for c in result.plan["clauses"]}
    assert {kinds[name] for name in ("since", "low", "up")} == {"rest"}
    times, there = sampled(result, "d1", "tr1")
    assert times[there].min() <= 35


def test_the_past_cannot_be_made_up_for(tmp_path: Path) -> None:
    with pytest.raises(InfeasibleError) as caught:
        plan(mission(tmp_path, "@wrong eventually[0,3] once[0,3] d1 in tr1"), method="convex")
    assert "wrong" in str(caught.value)


def test_the_certificate_is_the_robustness_of_the_flight(tmp_path: Path) -> None:
    """Seen by numpy: the worst moment of the response, at the samples."""
    clauses = ("@t1 eventually[20,40] d1 in tr1", "@first always[0,T] (d1 in tr1 -> once[0,20] d2 in tr2)")
    result = planned(mission(tmp_path, *clauses))
    content = result.plan
    times = np.arange(0.0, 60.0 + 1e-9, 0.05)

    def depth(drone: str, region: str) -> np.ndarray:
        knots = next(d["trajectory"] for d in content["drones"] if d["id"] == drone)
        shape = next(r["shape"] for r in content["regions"] if r["name"] == region)
        return _core.inside(
            shape, np.ascontiguousarray(_core.Trajectory.from_list(knots).sample(times)[:, :3])
        )

    asked, met = depth("d1", "tr1"), depth("d2", "tr2")
    once = np.array([met[max(0, k - 400) : k + 1].max() for k in range(len(times))])
    rho = next(c["result"]["rho"] for c in content["clauses"] if c["id"] == "first")
    assert np.maximum(-asked, once).min() == pytest.approx(rho, abs=1e-9)


def test_a_flight_is_judged_by_past_operators(tmp_path: Path) -> None:
    """The plan flown keeps them; d2 blown 3 m aside as it visits tr2 has not been there before d1."""
    clauses = ("@t1 eventually[20,40] d1 in tr1", "@first always[0,T] (d1 in tr1 -> once[0,20] d2 in tr2)")
    result = planned(mission(tmp_path, *clauses))
    flight = read(write_flight(result.data, tmp_path))
    verdict = judge(flight)
    assert verdict.satisfied, verdict.problems
    flown = {c.id: c.rho_flown for c in verdict.clauses}
    assert flown["first"] == pytest.approx(
        next(c["result"]["rho"] for c in result.plan["clauses"] if c["id"] == "first"), abs=0.02
    )
    assert len(robustness(flight).data) == len(result.plan["clauses"])
    blown = tmp_path / "blown"
    blown.mkdir()
    aside = np.array([3.0, 0.0, 0.0])
    flight = read(write_flight(result.data, blown, lambda drone, t: aside if drone == "d2" else 0 * aside))
    wrong = {c.id for c in judge(flight).clauses if (c.rho_flown or 0.0) <= 0}
    assert "first" in wrong
