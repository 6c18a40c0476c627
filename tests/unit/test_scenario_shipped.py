"""The scenarios that are shipped load, and are what design.md says they are."""

from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.scenario import load

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def scenario(name):
    return load(SCENARIOS / f"{name}.toml")


def test_all_are_there():
    names = {"hover", "power_tower", "power_tower_4", "power_tower_solo", "power_tower_gust", "crossing"}
    assert names | {"multi_line", "power_tower_energy"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_loads_with_a_mission(name):
    loaded = scenario(name)
    assert loaded.name == name
    ids = [clause.id for clause in loaded.clauses()]
    assert ids[0] == "safe"
    assert ids[-1] == "home"
    assert set(ids) >= {target.name for target in loaded.targets}


@pytest.mark.parametrize("name", NAMES)
def test_core_reads_regions_and_clauses(name):
    """The core evaluates every clause over drones that hover at their starts."""
    loaded = scenario(name)
    fleet = _core.Fleet([drone.id for drone in loaded.drones], loaded.regions())
    steps = round(loaded.mission.T / loaded.mission.T_s) + 1
    hover = np.repeat(np.array([drone.start for drone in loaded.drones])[:, None, :], steps, axis=1)
    rho = {c.id: fleet.evaluate(c.formula, hover, loaded.mission.T_s)[0] for c in loaded.clauses()}
    assert rho["safe"] > loaded.limits.tube
    assert rho["home"] == pytest.approx(1.0)
    assert all(rho[target.name] < 0 for target in loaded.targets)


@pytest.mark.parametrize("name", NAMES)
def test_every_target_can_be_seen_from_outside(name):
    """A target's centre leaves at least the tube to every obstacle, and its heading looks at one."""
    loaded = scenario(name)
    for target in loaded.targets:
        assert all(-obstacle.depth(target.center) > loaded.limits.tube for obstacle in loaded.obstacles)
        assert target.heading is not None
        if loaded.obstacles:
            sight = np.linspace(0.0, 8.0, 81)[:, None]
            seen = target.center + sight * [np.cos(target.heading), np.sin(target.heading), 0.0]
            assert any(obstacle.depth(point) > -1e-6 for obstacle in loaded.obstacles for point in seen)


def test_reference_geometry():
    """Numbers of design.md, Reference geometry."""
    small, large = scenario("power_tower"), scenario("power_tower_4")
    assert (len(small.drones), len(small.targets)) == (2, 4)
    assert (len(large.drones), len(large.targets)) == (4, 8)
    assert small.mission.T == 60
    assert small.mission.T_s == 0.05
    assert small.mission.c == 5
    assert small.limits.model_dump() == pytest.approx(
        {"v_max": 3.0, "a_max": 3.0, "delta_min": 3.0, "tube": 0.4, "heading_rate": np.radians(30)}
    )
    assert small.replan.model_dump() == {"T_e": 0.1, "T_g": 5.0, "eta": 0.4, "enabled": True}
    low, high = small.workspace.vertices.min(axis=0), small.workspace.vertices.max(axis=0)
    assert np.array_equal(high - low, [14, 18, 23])
    tower = small.obstacles[0]
    assert tower.inradius == 3
    assert len(tower.faces) == 10
    assert tower.vertices[:, 2].max() == 20
    centers = {
        region.name: region.center.tolist() for region in (*large.targets, *(d.home for d in large.drones))
    }
    expected = {
        "tr1": [-4.8, -2, 18.5],
        "tr2": [4.8, 2, 18.5],
        "tr3": [-2.2, -5.5, 12],
        "tr4": [2.2, 5.5, 12],
        "tr5": [-5, 0, 7],
        "tr6": [5, 0, 7],
        "tr7": [-2.5, 5.5, 20],
        "tr8": [2.5, -5.5, 20],
        "home.d1": [-5, -7, 1.2],
        "home.d2": [5, 7, 1.2],
        "home.d3": [-5, 7.5, 1.2],
        "home.d4": [5, -7.5, 1.2],
    }
    assert set(centers) == set(expected)
    for name, center in expected.items():
        assert centers[name] == pytest.approx(center, abs=1e-12), name
    assert all(
        region.inradius == pytest.approx(1.0) for region in (*large.targets, *(d.home for d in large.drones))
    )


def test_power_tower_energy_has_the_papers_parameters():
    """docs/paper.md, case EA; the geometry of power_tower."""
    loaded, small = scenario("power_tower_energy"), scenario("power_tower")
    assert (loaded.mission.T, loaded.mission.T_s, loaded.mission.c) == (110.0, 0.05, 5.0)
    assert (loaded.limits.v_max, loaded.limits.a_max, loaded.limits.delta_min) == (3.0, 3.0, 3.0)
    assert loaded.limits.tube == loaded.replan.eta == 0.3
    assert loaded.regions() == small.regions()


def test_crossing_is_coupled():
    """Each drone flies to the side that the other one comes from, in [0, 15]; home in [20, 30]."""
    loaded = scenario("crossing")
    assert loaded.assignment == {"d1": ["north"], "d2": ["south"]}
    clauses = {clause.id: clause.formula for clause in loaded.clauses()}
    visit = {"op": "in", "drone": "d1", "region": "north"}
    assert clauses["north"] == {"op": "eventually", "from": 0.0, "to": 15.0, "f": visit}
    assert (clauses["home"]["from"], clauses["home"]["to"]) == (20.0, 30.0)


def test_gusts_are_about_four_metres_per_second_squared():
    """design.md: about 3.9 m/s^2 x mass (1.7 kg) for 1 s, one on each drone."""
    loaded = scenario("power_tower_gust")
    assert [pulse.drone for pulse in loaded.disturbances] == ["d1", "d2"]
    for pulse in loaded.disturbances:
        assert pulse.duration == 1.0
        assert 3.5 <= np.linalg.norm(pulse.force) / 1.7 <= 4.3


def test_multi_line_has_the_papers_parameters():
    """docs/paper.md, case ML; several spans and towers."""
    loaded = scenario("multi_line")
    assert (loaded.mission.T, loaded.mission.T_s, loaded.mission.c) == (110.0, 0.05, 10.0)
    assert (loaded.limits.v_max, loaded.limits.a_max, loaded.limits.delta_min) == (3.0, 2.5, 3.0)
    assert sum(obstacle.name.startswith("tower") for obstacle in loaded.obstacles) == 3
    assert sum(obstacle.name.startswith("cable") for obstacle in loaded.obstacles) == 4
