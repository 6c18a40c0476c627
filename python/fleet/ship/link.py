"""One fleet seen from the ground: what drones answer to queries, and messages with acknowledgement."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from fleet import _core
from fleet.errors import EnvironmentError_
from fleet.faults import RejectedError, environment
from fleet.ship.clock import Offset, measure

if TYPE_CHECKING:
    import zenoh

DownChannel = Literal["plan", "commit", "cmd"]

_QUERY_S = 1.0
_RESEND_S = 0.5


@dataclass(frozen=True)
class Message:
    """An encoded envelope for one drone. Sent again it is the same bytes, so a drone may get it twice."""

    drone: str
    channel: DownChannel
    of: str
    epoch: int
    seq: int
    payload: bytes


def compose(
    drone: str,
    body: Mapping[str, Any],
    *,
    mission_id: str,
    epoch: int,
    seq: int,
    offset: Offset,
    valid_s: float,
) -> Message:
    """Put ``body`` (a `Down` of the wire) in an envelope whose times are on the drone's clock."""
    issued = max(0, offset.to_agent(time.monotonic_ns()))
    payload = _core.encode_down(
        {
            "schema": _core.SCHEMA,
            "mission_id": mission_id,
            "epoch": epoch,
            "seq": seq,
            "issued": issued,
            "valid_until": issued + round(valid_s * 1e9),
            "body": dict(body),
        }
    )
    channel: DownChannel = "cmd"
    of = str(body.get("command", ""))
    if body["kind"] == "offer":
        channel, of = "plan", "plan"
    elif body["kind"] == "commit":
        channel, of = "commit", "commit"
    return Message(drone, channel, of, epoch, seq, payload)


class Link:
    """Queries and acknowledged messages of one fleet over an open session."""

    def __init__(self, session: zenoh.Session, fleet: str) -> None:
        """Subscribe to the acknowledgements of every drone of ``fleet``."""
        self.session = session
        self.fleet = fleet
        self._changed = threading.Condition()
        self._acks: dict[tuple[str, int, int], dict[str, Any]] = {}
        self._garbled = ""
        self._subscriber = session.declare_subscriber(_core.key_up(fleet, "*", "ack"), self._on_ack)

    def close(self) -> None:
        """Stop listening."""
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stub lacks it

    def drones(self) -> list[str]:
        """Ids of the drones whose agents are connected now, in order."""
        replies = self.session.liveliness().get(_core.key_alive(self.fleet, "*"), timeout=_QUERY_S)
        return sorted({str(reply.ok.key_expr).split("/")[2] for reply in replies if reply.ok is not None})

    def ask(self, drone: str, what: Literal["time", "status", "plan"]) -> bytes | None:
        """The drone's answer to a query, or None when it does not answer within 1 s."""
        import zenoh

        try:
            for reply in self.session.get(_core.key_query(self.fleet, drone, what), timeout=_QUERY_S):
                if reply.ok is not None:
                    return bytes(reply.ok.payload)
        except zenoh.ZError as error:
            raise _gone(error) from error
        return None

    def status(self, drone: str, within_s: float) -> dict[str, Any]:
        """The drone's `Status`.

        Raises:
            EnvironmentError_: when it does not answer within ``within_s``, or speaks another version.
        """
        answer = _poll(lambda: self.ask(drone, "status"), within_s)
        if answer is None:
            raise environment(
                "peer",
                f"{drone} did not answer within {within_s:g} s: is its fleet-agent running with "
                f"--fleet {self.fleet}, and connected to the same router?",
                field=drone,
            )
        return dict(_decoded(_core.decode_status, answer, drone))

    def offset(self, drone: str) -> Offset:
        """Offset of the drone's clock from at least 20 exchanges."""

        def clock() -> int:
            answer = self.ask(drone, "time")
            if answer is None:
                raise environment("peer", f"{drone} stopped answering `time` queries", field=drone)
            return int(_decoded(_core.decode_time, answer, drone)["now"])

        return measure(clock, drone=drone)

    def request(self, messages: list[Message], *, within_s: float, what: str) -> None:
        """Send ``messages`` and wait until every drone has accepted; unanswered ones are sent again.

        Raises:
            RejectedError: when a drone refuses; the first one in the order of ``messages``.
            EnvironmentError_: when a drone does not answer within ``within_s``.
        """
        deadline = time.monotonic() + within_s
        resend = 0.0
        while True:
            waiting = self._settle(messages)
            if not waiting:
                return
            now = time.monotonic()
            if now >= deadline:
                raise self._silent(waiting, within_s, what)
            if now >= resend:
                for message in waiting:
                    self._put(message)
                resend = now + _RESEND_S
            self._wait_for_one(waiting, min(resend, deadline) - now)

    def _wait_for_one(self, waiting: list[Message], seconds: float) -> None:
        """Return when one of ``waiting`` is answered or the time is up."""
        keys = [(message.drone, message.epoch, message.seq) for message in waiting]
        with self._changed:
            self._changed.wait_for(lambda: any(key in self._acks for key in keys), seconds)

    def _put(self, message: Message) -> None:
        import zenoh

        key = _core.key_down(self.fleet, message.drone, message.channel)
        try:
            self.session.put(key, message.payload, congestion_control=zenoh.CongestionControl.BLOCK)
        except zenoh.ZError as error:
            raise _gone(error) from error

    def _settle(self, messages: list[Message]) -> list[Message]:
        """Messages that still wait for an answer; a refusal raises."""
        waiting = []
        with self._changed:
            for message in messages:
                ack = self._acks.get((message.drone, message.epoch, message.seq))
                if ack is None:
                    waiting.append(message)
                elif ack["outcome"]["result"] != "accepted":
                    raise RejectedError(
                        message.drone, message.of, ack["outcome"]["code"], ack["outcome"]["reason"]
                    )
        return waiting

    def _silent(self, waiting: list[Message], within_s: float, what: str) -> EnvironmentError_:
        names = ", ".join(message.drone for message in waiting)
        garbled = f" (a message could not be read: {self._garbled})" if self._garbled else ""
        return environment(
            "peer",
            f"{names} did not answer {what} within {within_s:g} s: is fleet-agent running with "
            f"--fleet {self.fleet} and connected to the same router?{garbled}",
            field=names,
        )

    def _on_ack(self, sample: zenoh.Sample) -> None:
        try:
            envelope = _core.decode_up(bytes(sample.payload))
        except ValueError as error:
            self._garbled = str(error)
            return
        body: dict[str, Any] = dict(envelope["body"])
        if body.get("kind") != "ack":
            return
        if body["of"] == "unknown":
            # The drone could not read what we sent, so it cannot say which message it was.
            self._garbled = f"{body['drone']}: {body['outcome'].get('reason', '')}"
            return
        with self._changed:
            # The first answer counts; a later one answers a copy of the message.
            self._acks.setdefault((body["drone"], body["epoch"], body["seq"]), body)
            self._changed.notify_all()


def _gone(error: Exception) -> EnvironmentError_:
    return environment("router", f"the link to the router is gone: {error}", field="--connect")


def _poll(ask: Callable[[], bytes | None], within_s: float) -> bytes | None:
    """Ask until there is an answer or the time is up. A query for a key nobody serves returns at once."""
    deadline = time.monotonic() + within_s
    while (answer := ask()) is None and time.monotonic() < deadline:
        time.sleep(0.1)
    return answer


def _decoded(decode: Callable[[bytes], Any], payload: bytes, drone: str) -> Any:
    try:
        return decode(payload)
    except ValueError as error:
        raise environment("version", f"the answer of {drone} cannot be read: {error}", field=drone) from error
