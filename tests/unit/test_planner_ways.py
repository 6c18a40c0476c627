"""Itineraries are made when they are asked for, once, and the first at once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from fleet.errors import InfeasibleError
from fleet.planner.schedule import Itinerary
from fleet.planner.ways import Ways


def counted(made: list[int], most: int) -> Iterator[Itinerary]:
    for k in range(most):
        made.append(k)
        yield Itinerary(((),) * (k + 1), ())


def test_only_what_is_asked_for_is_made() -> None:
    made: list[int] = []
    ways = Ways(counted(made, 4))
    assert made == [0]
    assert len(ways[0].stops) == 1 and made == [0]
    assert len(next(iter(ways)).stops) == 1 and made == [0]
    assert len(ways[1].stops) == 2 and made == [0, 1]
    assert [len(way.stops) for way in ways] == [1, 2, 3, 4]
    assert [len(way.stops) for way in ways[1:]] == [2, 3, 4]
    assert len(ways) == 4 and made == [0, 1, 2, 3]
    with pytest.raises(IndexError):
        ways[4]


def test_a_refusal_comes_with_the_first_one() -> None:
    def refused() -> Iterator[Itinerary]:
        raise InfeasibleError("no way")
        yield

    with pytest.raises(InfeasibleError, match="no way"):
        Ways(refused())
    with pytest.raises(ValueError, match="no itinerary"):
        Ways(iter(()))
