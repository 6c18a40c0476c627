"""Random scenarios: every plan that is accepted passes a check that shares no code with the package.

All 200 and the oracle for refusals run in `make bench-random`; here are those that fit into a minute.
"""

from pathlib import Path

import pytest

from fleet.certificate import verify
from fleet.errors import InfeasibleError
from fleet.planner import plan
from fleet.scenario import load
from tests.randomised.judge import faults
from tests.randomised.scenario import scenario

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
        return
    assert verify(found.data).problems == []
    assert faults(found.plan) == []
    assert found.rho_lower >= loaded.limits.tube - 1e-6


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
