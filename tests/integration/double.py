"""A drone's agent as the ground sees it, for tests of the ground alone: answers, refuses, or is silent.

It keeps what it received, so that a test can look at order, header and content of the messages.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import zenoh

from fleet import _core
from fleet.endpoint import parse_endpoint
from fleet.ship.session import close, config

ZERO_ID = "0" * 32
Answer = dict[str, Any] | None


def accept(_of: str) -> Answer:
    """Accepts everything."""
    return {"result": "accepted"}


def silent(_of: str) -> Answer:
    """Answers nothing."""
    return None


def reject(what: str, code: str) -> Callable[[str], Answer]:
    """Refuses ``what`` with ``code``, accepts the rest."""
    refusal = {"result": "rejected", "code": code, "reason": "because"}
    return lambda of: refusal if of == what else {"result": "accepted"}


@dataclass
class Double:
    """One drone. ``clock_ahead`` is its clock minus this machine's monotonic clock [s]."""

    endpoint: str
    drone: str
    answer: Callable[[str], Answer] = accept
    clock_ahead: float = 1000.0
    epoch: int = 0
    seq: int = 0
    drop: int = 0
    fleet: str = "fleet"
    mode: str = "idle"
    armed: bool = False
    mission_id: str = ""
    t0: int | None = None
    received: list[dict[str, Any]] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)
    stopped: threading.Event = field(default_factory=threading.Event)

    def __enter__(self) -> "Double":
        """Connect and begin to answer."""
        self.session = zenoh.open(config("client", connect=parse_endpoint(self.endpoint, field="test")))
        for query, reply in (("time", self._time), ("status", self._status)):
            self.session.declare_queryable(_core.key_query(self.fleet, self.drone, query), reply)
        for channel in ("plan", "commit", "cmd"):
            key = _core.key_down(self.fleet, self.drone, channel)
            self.session.declare_subscriber(key, self._on_down)
        self.token = self.session.liveliness().declare_token(_core.key_alive(self.fleet, self.drone))
        self.beating = threading.Thread(target=self._beat, daemon=True)
        self.beating.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Disconnect."""
        self.stopped.set()
        self.beating.join()
        close(self.session)

    @property
    def kinds(self) -> list[str]:
        """What was received, in order, copies left out."""
        seen: dict[tuple[int, int], str] = {}
        for one in self.received:
            body = one["body"]
            seen[(one["epoch"], one["seq"])] = body.get("command", body["kind"])
        return list(seen.values())

    def now(self) -> int:
        """Its clock [ns]."""
        return time.monotonic_ns() + round(self.clock_ahead * 1e9)

    def land(self) -> None:
        """Come down."""
        self.mode, self.armed = "idle", False
        self._up(
            {
                "kind": "event",
                "drone": self.drone,
                "mission_time": None,
                "what": {"event": "landed"},
                "cause": "",
            }
        )

    def _time(self, query: zenoh.Query) -> None:
        query.reply(query.key_expr, _core.encode_time({"now": self.now()}))

    def _status(self, query: zenoh.Query) -> None:
        status = {
            "drone": self.drone,
            "mode": self.mode,
            "mission_id": self.mission_id,
            "epoch": self.epoch,
            "seq": self.seq,
            "hash": "",
            "t0": self.t0,
            "preflight": [],
        }
        query.reply(query.key_expr, _core.encode_status(status))

    def _on_down(self, sample: zenoh.Sample) -> None:
        payload = bytes(sample.payload)
        self.payloads.append(payload)
        if self.drop > 0:
            self.drop -= 1
            return
        envelope = _core.decode_down(payload)
        self.received.append(envelope)
        body = envelope["body"]
        of = {"offer": "plan", "commit": "commit"}.get(body["kind"]) or body["command"]
        outcome = self.answer(of)
        if outcome is None:
            return
        if outcome["result"] == "accepted":
            self._obey(envelope, of)
        ack = {"epoch": envelope["epoch"], "seq": envelope["seq"], "outcome": outcome}
        self._up({"kind": "ack", "drone": self.drone, "of": of, **ack})

    def _obey(self, envelope: dict[str, Any], of: str) -> None:
        self.mission_id, self.epoch, self.seq = envelope["mission_id"], envelope["epoch"], envelope["seq"]
        if of == "arm":
            self.armed, self.mode = True, "armed"
        elif of == "start":
            self.t0 = envelope["body"]["t0"]
        elif of in {"abort", "disarm", "land"}:
            self.armed, self.mode = False, "idle"

    def _beat(self) -> None:
        while not self.stopped.wait(0.2):
            beat = {
                "drone": self.drone,
                "now": self.now(),
                "mode": self.mode,
                "hash": "",
                "armed": self.armed,
            }
            rest = {"mission_time": None, "battery": None, "state_age": None}
            self._up({"kind": "heartbeat", **beat, **rest})

    def _up(self, body: dict[str, Any]) -> None:
        envelope = {
            "schema": _core.SCHEMA,
            "mission_id": self.mission_id or ZERO_ID,
            "epoch": self.epoch,
            "seq": 0,
            "issued": self.now(),
            "valid_until": self.now() + 5_000_000_000,
            "body": body,
        }
        self.session.put(_core.key_up(self.fleet, self.drone, body["kind"]), _core.encode_up(envelope))
