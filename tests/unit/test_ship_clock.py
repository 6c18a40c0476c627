"""The clock offset: bounded by the round trip whatever the delays, refused when the link is unsteady."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.errors import EnvironmentError_
from fleet.ship.clock import MAX_SPREAD_NS, ROUNDS, Round, estimate, measure

delays = st.integers(min_value=0, max_value=4_000_000)


@given(
    st.integers(min_value=-(10**15), max_value=10**15),
    st.lists(st.tuples(delays, delays), min_size=ROUNDS, max_size=ROUNDS),
)
def test_the_error_is_at_most_half_the_best_round_trip(offset: int, ways: list[tuple[int, int]]) -> None:
    rounds = []
    for k, (there, back) in enumerate(ways):
        sent = 10**12 + k * 10**7
        rounds.append(Round(sent, sent + there + offset, sent + there + back))
    found = estimate(rounds, drone="d1")
    best = min(there + back for there, back in ways)
    assert abs(found.ns - offset) <= best // 2 + 1
    assert abs(found.ns - offset) <= found.error_ns + 1
    assert found.to_agent(5) == 5 + found.ns


def test_one_late_answer_does_no_harm() -> None:
    rounds = [Round(k, k + 7, k + 2) for k in range(19)] + [Round(0, 7, 500_000_000)]
    assert estimate(rounds, drone="d1").ns == 6


def test_clocks_that_spread_are_refused() -> None:
    jumping = [Round(0, k * (MAX_SPREAD_NS // 5), 1000) for k in range(ROUNDS)]
    with pytest.raises(EnvironmentError_, match="d1") as caught:
        estimate(jumping, drone="d1")
    assert caught.value.problems[0].field == "d1"


def test_slow_links_are_refused() -> None:
    with pytest.raises(EnvironmentError_, match="too slow"):
        estimate([Round(0, 0, 3 * MAX_SPREAD_NS)] * ROUNDS, drone="d1")


def test_at_least_twenty_questions_are_asked() -> None:
    asked = []

    def ask() -> int:
        asked.append(time.monotonic_ns())
        return asked[-1] + 7_000_000_000

    offset = measure(ask, drone="d1")
    assert len(asked) >= 20
    assert abs(offset.ns - 7_000_000_000) <= offset.error_ns + 1
