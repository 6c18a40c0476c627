"""Missions that cannot hold end with the clause that cannot, in words and numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from fleet.errors import Exit, InfeasibleError
from fleet.planner import plan
from fleet.scenario import Scenario, load

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def changed(tmp_path: Path, name: str, *changes: tuple[str, str]) -> Scenario:
    """A shipped scenario with pieces of its text replaced."""
    text = (SCENARIOS / f"{name}.toml").read_text()
    for old, new in changes:
        assert old in text, f"{name} has no {old!r}"
        text = text.replace(old, new)
    path = tmp_path / f"{name}.toml"
    path.write_text(text)
    return load(path)


def refused(scenario: Scenario) -> InfeasibleError:
    with pytest.raises(InfeasibleError) as caught:
        plan(scenario)
    assert caught.value.exit_code == Exit.INFEASIBLE == 3
    return caught.value


def test_target_out_of_reach_in_time(tmp_path: Path) -> None:
    """From (-5, -7, 1.2) to (-5, 7, 12) is 14 m along y: 4.67 s at 3 m/s."""
    error = refused(changed(tmp_path, "crossing", ("[0,T/2] d1 in north", "[0,4] d1 in north")))
    assert error.clause == "north"
    assert "d1 cannot reach north before 4.0 s" in str(error)
    needs = float(str(error).split("needs ")[1].split(" s")[0])
    assert 14 / 3 - 0.01 <= needs < 8


def test_mission_too_short_for_the_way_home(tmp_path: Path) -> None:
    error = refused(changed(tmp_path, "power_tower", ("T = 60.0", "T = 9.0")))
    assert error.clause in {"tr1", "tr2", "tr3", "tr4"}
    assert "needs" in str(error)


def test_starts_too_near(tmp_path: Path) -> None:
    error = refused(changed(tmp_path, "crossing", ("delta_min = 3.0", "delta_min = 14.0")))
    assert error.clause == "apart"
    assert "starts of d1 and d2" in str(error)


def test_no_gap_wide_enough(tmp_path: Path) -> None:
    """A wall with a gap of 0.5 m: passable for a point, not within the tube."""
    wall = """
[[obstacle]]
name = "wall_low"
box = [[-7.5, 0.5, -0.5], [7.5, 1.0, 20.5]]

[[obstacle]]
name = "wall_high"
box = [[-7.5, 0.5, 21.0], [7.5, 1.0, 23.5]]

# Targets are cubes"""
    scenario = changed(
        tmp_path,
        "crossing",
        (
            "# Targets are cubes",
            wall.strip("\n"),
        ),
    )
    error = refused(scenario)
    assert error.clause in {"safe", "north", "south", "home"}
    assert "tube" in str(error) or "no way" in str(error)


def test_turn_too_fast(tmp_path: Path) -> None:
    error = refused(
        changed(tmp_path, "crossing", ("delta_min = 3.0", "delta_min = 3.0\nheading_rate = 0.05"))
    )
    assert error.clause in {"north", "south"}
    assert "deg" in str(error) or "needs" in str(error)


def test_clause_without_normal_form_that_cannot_hold(tmp_path: Path) -> None:
    """Target and home touch in a plane only, so that no point is inside both."""
    formula = 'seed = 1\nformula = "@both eventually[0,T] (d1 in up and d1 in home)"'
    error = refused(changed(tmp_path, "hover", ("seed = 1", formula)))
    assert error.clause == "both"
    assert "d1 cannot be in up and home.d1 at once" in str(error)


def test_unknown_method(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="legal are auto, convex, nlp"):
        plan(load(SCENARIOS / "hover.toml"), method="magic")
