"""Fleets planned in parts: what is left out is proved by boxes, and the whole is certified as one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.certificate import verify
from fleet.errors import InputError
from fleet.generate import line
from fleet.planner import Status, groups, plan
from fleet.planner.problem import Problem, problem
from fleet.planner.result import encoded
from fleet.planner.schedule import Itinerary, schedules
from fleet.scenario import Scenario, load

SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.fixture
def three(tmp_path: Path) -> Scenario:
    path = tmp_path / "three.toml"
    path.write_text(line(3, 1))
    return load(path)


def first_way(task: Problem) -> Itinerary:
    return next(iter(schedules(task, 1.0)))


def test_the_drones_of_each_tower_are_a_part_with_the_obstacles_around_it(three: Scenario) -> None:
    task = problem(three)
    found = groups.parts(task, groups.route_boxes(first_way(task)), 1.0)
    assert [members for members, _ in found] == [(0, 1), (2, 3), (4, 5)]
    for k, (members, kept) in enumerate(found):
        assert {d for inv in kept for d in inv.drones} == {task.ids[d] for d in members}
        regions = {inv.region for inv in kept if inv.kind == "outside"}
        assert f"tower{k + 1}" in regions
        assert not any(r.startswith(("tower", "shed")) and not r.endswith(str(k + 1)) for r in regions)


def test_clauses_without_a_normal_form_keep_the_fleet_together(three: Scenario) -> None:
    task = problem(three)
    task = replace(task, spec=replace(task.spec, rest=[object()]))  # type: ignore[list-item]
    found = groups.parts(task, groups.route_boxes(first_way(task)), 1.0)
    assert found == [(tuple(range(6)), tuple(task.spec.invariants))]


def test_parts_make_one_certified_plan_at_the_bound(three: Scenario) -> None:
    result = plan(three)
    assert result.status is Status.OPTIMAL
    assert result.rho_lower >= 0.95 * result.rho_bound
    assert verify(result.data).ok
    assert plan(three).data == result.data


@pytest.mark.parametrize("room", [2.0, 0.0, -3.0])
def test_boxes_hold_the_trajectories_however_small_they_begin(
    three: Scenario, room: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Boxes that prove too much at first, even inverted ones, grow until they hold what was planned."""
    seen: list[np.ndarray] = []
    parts = groups.parts

    def watched(task: Problem, boxes: np.ndarray, bound: float):
        seen.append(boxes)
        return parts(task, boxes, bound)

    monkeypatch.setattr(groups, "ROOM", room)
    monkeypatch.setattr(groups, "parts", watched)
    task = problem(three)
    flight = groups.fly(task, first_way(task), 1.0, groups.steps)
    assert (len(seen) > 1) == (room <= 0)
    times = np.linspace(0.0, 60.0, 3001)
    for d, track in enumerate(flight.tracks):
        points = track.sample(times)[:, :3]
        assert (points >= seen[-1][0, d] - 1e-6).all()
        assert (points <= seen[-1][1, d] + 1e-6).all()
    assert flight.margins.r >= 0.95


@pytest.mark.parametrize("seed", range(10))
def test_boxes_bound_gaps_and_clearances_from_below(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corner, size = rng.uniform(-10, 10, (4, 3)), rng.uniform(0, 4, (4, 3))
    boxes = np.stack([corner, corner + size])
    inside = boxes[0][:, None] + rng.uniform(0, 1, (4, 500, 3)) * size[:, None]
    normals = rng.normal(size=(9, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    faces = np.column_stack([normals, rng.uniform(1, 4, 9)])
    measured = (inside @ faces[:, :3].T - faces[:, 3]).max(axis=2).min(axis=1)
    assert (groups.clearance(boxes, faces) <= measured + 1e-12).all()
    found = groups.gaps(boxes)
    for i in range(4):
        for j in range(4):
            distance = np.linalg.norm(inside[i][:, None] - inside[j][None], axis=2).min()
            assert found[i, j] <= distance + 1e-12


def test_a_plan_too_large_for_the_wire_is_the_users_to_know() -> None:
    content = dict(_core.decode_plan(plan(load(SCENARIOS / "hover.toml")).data))
    assert encoded(content) == _core.encode_plan(content)
    content["regions"] = content["regions"] * 20000
    with pytest.raises(InputError, match=f"at most {_core.MAX_BYTES}") as caught:
        encoded(content)
    assert caught.value.problems[0].code == "size"
    content["regions"] = [{"name": "r", "shape": "none"}]
    with pytest.raises(ValueError, match="unexpected type"):
        encoded(content)


def test_thirty_two_drones_and_sixty_four_targets_are_one_certified_plan(tmp_path: Path) -> None:
    path = tmp_path / "sixteen.toml"
    path.write_text(line(16, 1))
    found = plan(load(path))
    assert found.status is Status.OPTIMAL
    assert found.rho_lower >= 0.95 * found.rho_bound
    assert len(found.bytes) <= _core.MAX_BYTES
    assert sorted(r for order in found.assignment.values() for r in order) == sorted(
        f"tr{k}" for k in range(1, 65)
    )
