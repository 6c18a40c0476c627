"""The independent check finds what is wrong with a plan, and nothing wrong with a good one."""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fleet import _core
from fleet.planner import plan
from fleet.scenario import load
from tests.randomised.flown import HZ, flown
from tests.randomised.judge import faults

CROSSING = Path(__file__).parents[2] / "scenarios" / "crossing.toml"


@pytest.fixture(scope="module")
def good() -> dict[str, Any]:
    return plan(load(CROSSING)).plan


def knots(content: dict[str, Any], drone: int = 0) -> list[dict[str, Any]]:
    return content["drones"][drone]["trajectory"]


def moved(content: dict[str, Any]) -> None:
    for knot in knots(content):
        knot["p"] = (knot["p"][0] + 3.0, *knot["p"][1:])


def hurried(content: dict[str, Any]) -> None:
    content["limits"]["a_max"] = 0.5


def spun(content: dict[str, Any]) -> None:
    content["limits"]["psi_rate_max"] = 0.01


def boasting(content: dict[str, Any]) -> None:
    content["clauses"][0]["result"]["rho_lower"] = 2.0


def crowded(content: dict[str, Any]) -> None:
    content["limits"]["delta_min"] = 4.5


def restless(content: dict[str, Any]) -> None:
    knots(content)[-1]["v"] = (0.1, 0.0, 0.0)


def early(content: dict[str, Any]) -> None:
    visit = next(c for c in content["clauses"] if c["id"] == "north")
    visit["formula"] = {**visit["formula"], "to": 3.0}


def test_a_good_plan_has_no_faults(good: dict[str, Any]) -> None:
    assert faults(good) == []


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        (moved, "is inside tower"),
        (hurried, "|a| reaches"),
        (spun, "heading rate"),
        (boasting, "and the plan claims"),
        (crowded, "come within"),
        (restless, "not at rest at the end"),
        (early, "clause north: rtamt finds -"),
    ],
)
def test_a_bad_plan_is_told(good: dict[str, Any], wrong: Callable[[dict[str, Any]], None], word: str) -> None:
    bad = copy.deepcopy(good)
    wrong(bad)
    assert any(word in fault for fault in faults(bad))


def test_samples_are_those_of_the_core(good: dict[str, Any]) -> None:
    own = flown(knots(good))
    times = np.arange(len(own.p)) / HZ
    core = _core.Trajectory.from_list(knots(good)).sample(times)
    assert own.p == pytest.approx(core[:, :3], abs=1e-9)
    assert own.v == pytest.approx(core[:, 3:6], abs=1e-9)
    assert own.a == pytest.approx(core[:, 6:9], abs=1e-8)
    assert own.psi_rate == pytest.approx(core[:, 13], abs=1e-9)
