"""Itineraries in order of preference, made as they are asked for: mostly the first one is enough."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import overload

from .schedule import Itinerary


class Ways(Sequence[Itinerary]):
    """A sequence over the itineraries of `source`, each made once; the first one at once.

    Raises what `source` raises for the first one, and ValueError when there is none.
    """

    def __init__(self, source: Iterator[Itinerary]) -> None:
        self.source = source
        self.made: list[Itinerary] = []
        if not self.more():
            raise ValueError("there is no itinerary")

    def more(self) -> bool:
        """Make the next one; whether there was one."""
        found = next(self.source, None)
        if found is not None:
            self.made.append(found)
        return found is not None

    @overload
    def __getitem__(self, index: int) -> Itinerary: ...

    @overload
    def __getitem__(self, index: slice) -> list[Itinerary]: ...

    def __getitem__(self, index: int | slice) -> Itinerary | list[Itinerary]:
        while isinstance(index, slice) or index < 0 or index >= len(self.made):
            if not self.more():
                break
        return self.made[index]

    def __len__(self) -> int:
        while self.more():
            pass
        return len(self.made)

    def __iter__(self) -> Iterator[Itinerary]:
        k = 0
        while k < len(self.made) or self.more():
            yield self.made[k]
            k += 1
