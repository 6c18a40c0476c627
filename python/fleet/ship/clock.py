"""Offset between the ground's monotonic clock and an agent's, from `time` queries."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fleet.faults import environment

ROUNDS = 20
"""Queries a drone (design.md, Start: at least 20)."""
MAX_SPREAD_NS = 20_000_000
"""Largest spread of the offsets that is accepted (design.md, Start: 20 ms)."""


@dataclass(frozen=True)
class Offset:
    """Agent's clock minus the ground's [ns], known to +- ``error_ns``."""

    ns: int
    error_ns: int
    spread_ns: int

    def to_agent(self, ground_ns: int) -> int:
        """The agent's clock when the ground's monotonic clock shows ``ground_ns``."""
        return ground_ns + self.ns


@dataclass(frozen=True)
class Round:
    """One exchange: ground clock before and after [ns], agent's clock in between [ns]."""

    sent: int
    agent: int
    received: int

    @property
    def round_trip(self) -> int:
        """Time on the way, both directions [ns]."""
        return self.received - self.sent

    @property
    def offset(self) -> int:
        """Agent minus ground, taking both directions as equal (Cristian 1989) [ns]."""
        return self.agent - (self.sent + self.received) // 2


def estimate(rounds: Sequence[Round], *, drone: str) -> Offset:
    """Offset of the exchange with the smallest round trip; half of it bounds the error.

    The spread is that of the offsets of the better half of the exchanges: a busy machine delays single
    answers by many milliseconds, which says nothing about the clocks.

    Raises:
        EnvironmentError_: when the offsets spread by more than 20 ms.
    """
    ranked = sorted(rounds, key=lambda one: one.round_trip)
    best = ranked[0]
    offsets = [one.offset for one in ranked[: max(1, len(ranked) // 2)]]
    spread = max(offsets) - min(offsets)
    if spread > MAX_SPREAD_NS or best.round_trip // 2 > MAX_SPREAD_NS:
        raise environment(
            "clock",
            f"the clock of {drone} is known to {max(spread, best.round_trip // 2) * 1e-6:.1f} ms; at most "
            f"{MAX_SPREAD_NS * 1e-6:g} ms is legal: the link is too slow or too unsteady for a common start",
            field=drone,
        )
    return Offset(best.offset, best.round_trip // 2, spread)


def measure(ask: Callable[[], int], *, drone: str, rounds: int = ROUNDS) -> Offset:
    """Ask the agent for its clock ``rounds`` times with ``ask`` and estimate the offset."""
    exchanges = []
    for _ in range(rounds):
        sent = time.monotonic_ns()
        agent = ask()
        exchanges.append(Round(sent, agent, time.monotonic_ns()))
    return estimate(exchanges, drone=drone)
