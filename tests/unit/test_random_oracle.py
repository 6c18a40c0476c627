"""The oracle for refusals: its plans are certified, and what it proves impossible is."""

from pathlib import Path

import numpy as np
import pytest

from fleet.errors import InfeasibleError
from fleet.planner import plan
from fleet.scenario import load
from tests.randomised.mip import TURNS
from tests.randomised.necessary import impossible
from tests.randomised.oracle import opinion, world_of
from tests.randomised.scenario import scenario

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def test_the_program_finds_certified_plans(tmp_path: Path) -> None:
    """Four drones, one target: found at once, with the tube's margin."""
    path = tmp_path / "random.toml"
    path.write_text(scenario(12))
    loaded = load(path)
    found = opinion(loaded, 100.0)
    assert found.verdict == "plan"
    assert found.rho_lower >= loaded.limits.tube - 1e-3


def test_bounds_leave_what_can_be_flown() -> None:
    for name in ("power_tower", "power_tower_4", "crossing"):
        assert not impossible(world_of(load(SCENARIOS / f"{name}.toml")))


@pytest.mark.parametrize("number", range(0, 200, 8))
def test_nothing_impossible_is_planned(tmp_path: Path, number: int) -> None:
    """The planner is held to the bounds, and the bounds to the planner."""
    path = tmp_path / f"random_{number}.toml"
    path.write_text(scenario(number))
    loaded = load(path)
    if impossible(world_of(loaded)):
        with pytest.raises(InfeasibleError):
            plan(loaded)


def test_headings_of_found_plans_keep_their_rate() -> None:
    """Quintic turns at rest in every knot: their peak is 15/8 of the mean that the program bounds."""
    u = np.linspace(0, 1, 1001)
    peak = (30 * u**2 * (1 - u) ** 2).max()
    assert peak * TURNS == pytest.approx(1.0)
