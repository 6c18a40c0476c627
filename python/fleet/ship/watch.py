"""What the drones say about themselves: newest heartbeat and telemetry of each, and every event."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fleet import _core

if TYPE_CHECKING:
    import zenoh

SILENT_S = 1.5
"""A drone without a heartbeat for this long is called silent (safety.md, table row 2)."""
_GROUND_MODES = frozenset({"idle", "armed"})


@dataclass
class DroneView:
    """What is known of one drone. ``heard`` is the ground's monotonic clock [s]; 0 = never."""

    drone: str
    heard: float = 0.0
    heartbeat: dict[str, Any] = field(default_factory=dict)
    telemetry: dict[str, Any] = field(default_factory=dict)
    was_armed: bool = False
    landed: bool = False

    @property
    def mode(self) -> str:
        """Mode in the newest heartbeat; empty before the first."""
        return str(self.heartbeat.get("mode", ""))

    @property
    def armed(self) -> bool:
        """Whether its motors were armed in the newest heartbeat."""
        return bool(self.heartbeat.get("armed", False))

    @property
    def airborne(self) -> bool:
        """Whether it is in a mode that flies. A released drone may be anywhere, so it counts while armed."""
        return bool(self.mode) and self.mode not in _GROUND_MODES and self.armed

    @property
    def down(self) -> bool:
        """Whether it has flown and its motors are off again."""
        return self.landed or (self.was_armed and bool(self.heartbeat) and not self.armed)

    def silence(self, now: float) -> float:
        """Seconds since the last heartbeat."""
        return now - self.heard if self.heard else float("inf")


class Watch:
    """Follows the upward messages of one fleet until closed."""

    def __init__(self, session: zenoh.Session, fleet: str, drones: Iterable[str]) -> None:
        """Subscribe to heartbeat, telemetry, event and replan of every drone of ``fleet``."""
        self.views = {drone: DroneView(drone) for drone in drones}
        self._lock = threading.Lock()
        self._notices: list[dict[str, Any]] = []
        self._subscribers = [
            session.declare_subscriber(_core.key_up(fleet, "*", channel), self._on_sample)
            for channel in ("heartbeat", "telemetry", "event", "replan")
        ]

    def close(self) -> None:
        """Stop listening."""
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stub lacks it

    def take_notices(self) -> list[dict[str, Any]]:
        """Events and replans (bodies of `Up`) since the last call, in order of arrival."""
        with self._lock:
            notices, self._notices = self._notices, []
        return notices

    def wait(
        self, condition: Callable[[DroneView], bool], drones: Iterable[str], within_s: float
    ) -> list[str]:
        """Wait until ``condition`` holds for each of ``drones``; gives those for which it did not in time."""
        names = list(drones)
        deadline = time.monotonic() + within_s
        while missing := [name for name in names if not condition(self.views[name])]:
            if time.monotonic() > deadline:
                return missing
            time.sleep(0.05)
        return []

    def _on_sample(self, sample: zenoh.Sample) -> None:
        try:
            body: dict[str, Any] = dict(_core.decode_up(bytes(sample.payload))["body"])
        except ValueError as error:
            with self._lock:
                self._notices.append({"kind": "unreadable", "key": str(sample.key_expr), "error": str(error)})
            return
        view = self.views.get(str(body["drone"]))
        if view is None:
            return
        kind = body["kind"]
        with self._lock:
            if kind == "heartbeat":
                view.heard = time.monotonic()
                view.heartbeat = body
                view.was_armed = view.was_armed or bool(body["armed"])
            elif kind == "telemetry":
                view.telemetry = body
            else:
                view.landed = view.landed or (kind == "event" and body["what"]["event"] == "landed")
                self._notices.append(body)
