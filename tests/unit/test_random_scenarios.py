"""Random scenarios: every plan that is accepted passes a check that shares no code with the package.

All 200 and the oracle for refusals run in `make bench-random`, which stores what it found; here are those
that fit into a minute, and a refusal that the store does not have is a failure.
"""

import json
from pathlib import Path

import pytest

from fleet.certificate import verify
from fleet.errors import InfeasibleError
from fleet.planner import plan
from fleet.scenario import load
from tests.randomised.judge import faults
from tests.randomised.scenario import COUNT, scenario

#: Outcomes of all refusals: impossible (proved), refused (the oracle found nothing either) or false.
STORED = json.loads((Path(__file__).parents[1] / "randomised" / "refusals.json").read_text())
#: Every tenth scenario of the set.
SOME = range(0, 200, 10)
#: Made twice: the same input must give the same bytes.
TWICE = range(3, 200, 40)


@pytest.mark.parametrize("number", SOME)
def test_accepted_plans_pass_an_independent_check(tmp_path: Path, number: int) -> None:
    """A scenario is planned or refused by name, never anything else; a plan is what it claims to be."""
    path = tmp_path / f"random_{number}.toml"
    path.write_text(scenario(number))
    loaded = load(path)
    try:
        found = plan(loaded)
    except InfeasibleError as error:
        assert error.clause in {c.id for c in loaded.clauses()}
        assert str(number) in STORED["refused"]
        return
    assert verify(found.data).problems == []
    assert faults(found.plan) == []
    assert found.rho_lower >= loaded.limits.tube - 1e-6


def test_few_refusals_are_false() -> None:
    """Of the whole set the oracle finds a plan for at most 5 % that the planner refuses."""
    assert STORED["count"] == COUNT
    false = [number for number, outcome in STORED["refused"].items() if outcome == "false"]
    assert len(false) <= 0.05 * COUNT


def test_impossible_scenarios_are_refused_with_a_proof(tmp_path: Path) -> None:
    """What free space already forbids is told apart from a search without result."""
    number = next(int(n) for n, outcome in STORED["refused"].items() if outcome == "impossible")
    path = tmp_path / f"random_{number}.toml"
    path.write_text(scenario(number))
    with pytest.raises(InfeasibleError) as caught:
        plan(load(path))
    assert caught.value.conflict is not None
    assert caught.value.conflict.proved


@pytest.mark.parametrize("number", TWICE)
def test_the_same_scenario_gives_the_same_bytes(tmp_path: Path, number: int) -> None:
    path = tmp_path / f"random_{number}.toml"
    path.write_text(scenario(number))
    outcomes = []
    for _ in range(2):
        try:
            outcomes.append(plan(load(path)).data.hex())
        except InfeasibleError as error:
            outcomes.append(str(error))
    assert outcomes[0] == outcomes[1]
