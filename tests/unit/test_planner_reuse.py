"""A second plan in the same process builds nothing again, and comes out the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fleet.certificate import verify
from fleet.planner import nlp, plan, solvers, stages
from fleet.planner.convex import Steps
from fleet.planner.knots import difference
from fleet.planner.problem import problem
from fleet.planner.rows import gram, smoothness
from fleet.planner.schedule import schedules
from fleet.planner.setup import setup, warm_start
from fleet.route import corners, vertices
from fleet.scenario import Scenario, load
from fleet.stl.text import _parser

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def scenario(name: str) -> Scenario:
    return load(SCENARIOS / f"{name}.toml")


def meeting(tmp_path: Path, until: int) -> Scenario:
    """A mission with a part that has no normal form, so that smooth robustness is in the program."""
    text = (SCENARIOS / "hover.toml").read_text()
    formula = f'formula = "@up eventually[0,6] (d1 in up and eventually[1,{until}] d1 outside up)"'
    path = tmp_path / "meeting.toml"
    path.write_text(text.replace("seed = 1\n", f"seed = 1\n{formula}\n", 1))
    return load(path)


@pytest.mark.parametrize("name", ["hover", "power_tower"])
def test_a_second_plan_builds_no_solver_and_has_the_same_bytes(name: str) -> None:
    first = plan(scenario(name), method="nlp")
    built = solvers.built.cache_info()
    again = plan(scenario(name), method="nlp")
    now = solvers.built.cache_info()
    assert now.misses == built.misses
    assert now.hits > built.hits
    assert again.data == first.data


def test_other_numbers_of_the_same_shape_need_no_new_solver(tmp_path: Path) -> None:
    """Limits and regions are parameters of the solver; the plan follows them."""
    first = plan(scenario("hover"), method="nlp")
    built = solvers.built.cache_info().misses
    path = tmp_path / "hover.toml"
    wider = ("[[-1.0, -1.0, 2.5], [1.0,", "[[-0.9, -1.0, 2.5], [1.1,")
    for found, put in (("v_max = 3.0", "v_max = 2.9"), wider):
        text = (path if path.exists() else SCENARIOS / "hover.toml").read_text()
        assert found in text
        path.write_text(text.replace(found, put))
    other = plan(load(path), method="nlp")
    assert solvers.built.cache_info().misses == built
    assert other.data != first.data
    assert verify(other.data).ok


def test_smooth_robustness_is_reused_too(tmp_path: Path) -> None:
    """A part without a normal form is one solver for one formula, and another for another."""
    found = []
    for until in (3, 3, 4):
        task = problem(meeting(tmp_path, until))
        assert task.spec.rest
        stage = setup(task, next(iter(schedules(task, 1.0))), 1.0)
        terms = nlp.posed(Steps.of(stage), warm_start(stage), 1.0, 0.0)
        found.append(solvers.solver_for(stage.grid.size, terms, 100, 1e-4, quasi=True))
    assert found[0].smoothed
    assert found[0] is found[1]
    assert found[0] is not found[2]


def test_stage_functions_are_built_once() -> None:
    plan(scenario("hover"), method="nlp")
    plan(scenario("power_tower"), method="nlp")
    assert stages.stage.cache_info().misses == 1


def test_a_second_plan_by_convex_steps_finds_every_matrix_made() -> None:
    """Constant matrices, smoothness by knots, corners of regions, the parser of formulas."""
    kept = (gram, difference, smoothness, corners, _parser)
    first = plan(scenario("power_tower"))
    made = [one.cache_info().misses for one in kept]
    again = plan(scenario("power_tower"))
    assert [one.cache_info().misses for one in kept] == made
    assert all(one.cache_info().hits > 0 for one in kept)
    assert again.data == first.data


def test_what_is_shared_cannot_be_written_to() -> None:
    points, touch = vertices(np.column_stack([np.vstack([np.eye(3), -np.eye(3)]), np.ones(6)]))
    for matrix in (gram(3), difference(1), points, touch):
        with pytest.raises(ValueError, match="read-only"):
            matrix[0] = 0
