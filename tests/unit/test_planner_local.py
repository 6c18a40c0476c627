"""What makes large fleets cheap: groups in the assignment, sides before clipping, near places only."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fleet.assign import EXACT, assign, components, exact
from fleet.generate import line
from fleet.legs import Legs, tour_time
from fleet.planner.problem import Problem, problem
from fleet.planner.survey import survey
from fleet.route import blocked, unblocked
from fleet.scenario import load
from tests.unit.test_planner_assign import random_legs


def side_by_side(blocks: list[Legs]) -> Legs:
    """Independent assignment problems as one: no drone can reach the events of another block."""
    d = np.cumsum([0, *(b.first.shape[0] for b in blocks)])
    n = np.cumsum([0, *(b.first.shape[1] for b in blocks)])
    first, last = (np.full((d[-1], n[-1]), np.inf) for _ in range(2))
    between = np.full((d[-1], n[-1], n[-1]), np.inf)
    for k, b in enumerate(blocks):
        who, events = slice(d[k], d[k + 1]), slice(n[k], n[k + 1])
        first[who, events], last[who, events], between[who, events, events] = b.first, b.last, b.between
    idle, dwell = np.concatenate([b.idle for b in blocks]), np.concatenate([b.dwell for b in blocks])
    windows = np.concatenate([b.windows for b in blocks])
    return Legs(first, between, last, idle, windows, dwell, blocks[0].horizon)


@pytest.mark.parametrize("seed", range(10))
def test_large_fleets_are_exact_group_by_group(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = [replace(random_legs(rng, 2, 4, 40.0), horizon=80.0) for _ in range(5)]
    legs = side_by_side(blocks)
    assert legs.first.shape[1] > EXACT
    assert [(len(who), len(events)) for who, events in components(legs)] == [(2, 4)] * 5
    alone = [exact(b) for b in blocks]
    found = assign(legs)
    if any(orders is None for orders in alone):
        assert found is None
        return
    assert found is not None
    for d, order in enumerate(found):
        wanted = alone[d // 2]
        assert wanted is not None
        assert order == tuple(e + 4 * (d // 2) for e in wanted[d % 2])
        assert np.isfinite(tour_time(legs, d, order))


def test_an_event_that_nobody_reaches_is_not_forgotten() -> None:
    rng = np.random.default_rng(0)
    legs = side_by_side([replace(random_legs(rng, 2, 4, 200.0), horizon=400.0) for _ in range(4)])
    assert assign(legs) is not None
    legs.first[:, 5], legs.between[:, 5], legs.between[:, :, 5] = np.inf, np.inf, np.inf
    assert assign(legs) is None


def test_sides_before_clipping_change_nothing() -> None:
    rng = np.random.default_rng(5)
    solids = []
    for _ in range(6):
        centre, size = rng.uniform(-10, 10, 3), rng.uniform(0.5, 5, 3)
        turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        normals = np.vstack([turned, -turned])
        solids.append(np.column_stack([normals, normals @ centre + np.tile(size, 2)]))
    a, b = rng.uniform(-15, 15, (2, 4000, 3))
    wanted = np.logical_or.reduce([blocked(a, b, faces) for faces in solids])
    assert 0.2 < wanted.mean() < 0.9
    nodes, i = np.vstack([a, b]), np.arange(len(a))
    assert (unblocked(nodes, i, i + len(a), solids) == ~wanted).all()


def line_problem(folder: Path, towers: int) -> Problem:
    path = folder / "line.toml"
    path.write_text(line(towers, 1))
    return problem(load(path))


def test_ways_between_near_places_are_those_of_the_whole_map(tmp_path: Path) -> None:
    """Around one tower the ways are as short as with all obstacles and no limit on detours."""
    task = line_problem(tmp_path, 2)
    near, whole = survey(task, 1.0, local=True), survey(task, 1.0)
    assert near.names == whole.names
    far = 0
    for i in range(len(near.points)):
        for j in range(len(near.points)):
            path, best = near.ways.path(i, j), whole.ways.path(i, j)
            assert best is not None
            apart = abs(near.points[i, 1] - near.points[j, 1]) > 20.0
            assert (path is None) == apart
            far += apart
            if path is not None:
                lengths = [np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p in (path, best)]
                # Points on edges stand elsewhere where an edge is cut at the group's box.
                assert lengths[0] == pytest.approx(lengths[1], rel=0.02, abs=1e-9)
    assert far > 0
