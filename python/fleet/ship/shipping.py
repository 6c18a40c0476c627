"""A plan on its way to the drones: offer, commit, arm, start.

Nothing changes on any drone before all have accepted the offer. Each step sends one envelope a drone and
waits for the acknowledgement of all; an unanswered envelope is sent again as the same bytes.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fleet.faults import environment
from fleet.ship.clock import Offset
from fleet.ship.link import Link, Message, compose
from fleet.ship.watch import Watch

ANSWER_S = 5.0
"""Longest wait for the answer to one step [s]."""
APPEAR_S = 10.0
"""Longest wait for an agent that was just started [s]."""
PREFLIGHT_S = 20.0
"""Longest wait for the pre-flight checks to pass: an autopilot needs some seconds for its position [s]."""
ARM_S = 8.0
"""Longest time from the accepted `arm` to motors that are armed [s]."""
LEAD_S = 12.0
"""From `start` to mission time 0: take-off begins at t0 - 10 s (design.md, Start) [s]."""


@dataclass(frozen=True)
class Started:
    """A mission under way. ``t0_mono_ns`` and ``t0_unix_ns`` are mission time 0 on the ground's clocks."""

    mission_id: str
    epoch: int
    t0_mono_ns: int
    t0_unix_ns: int


class Shipment:
    """One plan for one fleet; call the steps in order."""

    def __init__(self, link: Link, plan: Mapping[str, Any], plan_bytes: bytes, plan_hash: str) -> None:
        """Nothing is sent yet."""
        self.link = link
        self.drones: list[str] = [drone["id"] for drone in plan["drones"]]
        self.mission_id = secrets.token_hex(16)
        self.epoch = 0
        self._plan_bytes = plan_bytes
        self._hash = plan_hash
        self._seq = 0
        self._offsets: dict[str, Offset] = {}

    def meet(self, tell: Callable[[str], None]) -> None:
        """Wait for every agent, take the next epoch and measure the clocks.

        Raises:
            EnvironmentError_: when an agent does not answer, flies already, or has an unsteady clock.
        """
        epochs = []
        for drone in self.drones:
            tell(f"waiting for {drone}")
            status = self.link.status(drone, APPEAR_S)
            if status["mode"] != "idle":
                raise environment(
                    "busy",
                    f"{drone} is in mode {status['mode']}: a plan is shipped to a drone on the ground only; "
                    f"`fleet land {drone}` first",
                    field=drone,
                )
            epochs.append(int(status["epoch"]))
        self.epoch = max(epochs) + 1
        for drone in self.drones:
            tell(f"clock of {drone}")
            self._offsets[drone] = self.link.offset(drone)

    def offer(self) -> None:
        """Offer the plan, and commit it once every drone has accepted."""
        body = {"kind": "offer", "hash": self._hash, "plan": self._plan_bytes}
        self._all(lambda _drone: body, "the plan offer")
        self._all(lambda _drone: {"kind": "commit", "hash": self._hash}, "the commit")

    def wait_for_preflight(self, tell: Callable[[str], None]) -> None:
        """Give the pre-flight checks time to pass. What still fails then is said by the refusal of `arm`."""
        deadline = time.monotonic() + PREFLIGHT_S
        for drone in self.drones:
            while (failing := self.link.status(drone, ANSWER_S)["preflight"]) and time.monotonic() < deadline:
                tell(f"pre-flight of {drone}: {failing[0]}")
                time.sleep(0.2)

    def arm(self, watch: Watch) -> None:
        """Arm all drones and wait until their motors are armed.

        Raises:
            RejectedError: when a drone refuses.
            EnvironmentError_: when a drone accepts and does not arm.
        """
        self._all(lambda _drone: {"kind": "command", "command": "arm"}, "the arm command")
        late = watch.wait(lambda view: view.armed, self.drones, ARM_S)
        if late:
            raise environment(
                "arm", f"{', '.join(late)} did not arm within {ARM_S:g} s: see its log for why", field=late[0]
            )

    def start(self) -> Started:
        """Fix mission time 0, 12 s ahead, and tell each drone on its own clock."""
        now_mono, now_unix = time.monotonic_ns(), time.time_ns()
        t0 = now_mono + round(LEAD_S * 1e9)

        def body(drone: str) -> dict[str, Any]:
            t0_agent = self._offsets[drone].to_agent(t0)
            return {"kind": "command", "command": "start", "t0": t0_agent, "hash": self._hash}

        # A start that comes in the last second cannot be obeyed: take-off begins at t0 - 10 s.
        self._all(body, "the start command", within_s=LEAD_S - 10.5)
        return Started(self.mission_id, self.epoch, t0, now_unix + (t0 - now_mono))

    def _all(
        self, body: Callable[[str], dict[str, Any]], what: str, *, within_s: float | None = None
    ) -> None:
        self._seq += 1
        within = ANSWER_S if within_s is None else within_s
        messages: list[Message] = [
            compose(
                drone,
                body(drone),
                mission_id=self.mission_id,
                epoch=self.epoch,
                seq=self._seq,
                offset=self._offsets[drone],
                valid_s=within,
            )
            for drone in self.drones
        ]
        self.link.request(messages, within_s=within, what=what)
