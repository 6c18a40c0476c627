"""Shipping a plan and commanding drones over a real router, against doubles of the agents."""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest

from fleet import _core
from fleet.endpoint import parse_endpoint
from fleet.errors import EnvironmentError_
from fleet.faults import RejectedError
from fleet.ship.link import Link
from fleet.ship.operator import command
from fleet.ship.session import connect, is_router
from fleet.ship.shipping import LEAD_S, Shipment
from fleet.ship.watch import Watch
from tests.integration.double import Double, reject, silent

PLAN_BYTES = b"the bytes of a plan are opaque to shipping"


@contextmanager
def linked(router: str, *drones: Double) -> Iterator[Link]:
    with ExitStack() as stack:
        for drone in drones:
            stack.enter_context(drone)
        session = stack.enter_context(connect(parse_endpoint(router, field="test")))
        link = Link(session, "fleet")
        stack.callback(link.close)
        yield link


def shipment(link: Link, *ids: str) -> Shipment:
    plan = {"drones": [{"id": one} for one in ids]}
    return Shipment(link, plan, PLAN_BYTES, _core.plan_hash(PLAN_BYTES))


def test_a_plan_is_offered_committed_armed_and_started_at_one_moment(router: str) -> None:
    d1, d2 = Double(router, "d1", clock_ahead=1000.0, epoch=3), Double(router, "d2", clock_ahead=5.0, epoch=7)
    with linked(router, d1, d2) as link:
        ship = shipment(link, "d1", "d2")
        watch = Watch(link.session, "fleet", ["d1", "d2"])
        ship.meet(lambda _what: None)
        ship.offer()
        ship.arm(watch)
        started = ship.start()
        watch.close()
    for drone in (d1, d2):
        assert drone.kinds == ["offer", "commit", "arm", "start"]
        assert {one["epoch"] for one in drone.received} == {8}
        assert {one["mission_id"] for one in drone.received} == {started.mission_id}
        assert [one["seq"] for one in drone.received] == sorted(one["seq"] for one in drone.received)
        assert bytes(drone.received[0]["body"]["plan"]) == PLAN_BYTES
        assert drone.t0 is not None
        # One moment on all clocks, to well below the 20 ms of design.md.
        assert drone.t0 - drone.clock_ahead * 1e9 == pytest.approx(started.t0_mono_ns, abs=5e6)
        for one in drone.received:
            assert one["issued"] < one["valid_until"]
            assert abs(one["issued"] - drone.now()) < 20e9
    assert started.t0_unix_ns - time.time_ns() < LEAD_S * 1e9


def test_a_typed_refusal_stops_before_anything_is_committed(router: str) -> None:
    d1, d2 = Double(router, "d1"), Double(router, "d2", answer=reject("plan", "clearance"))
    with linked(router, d1, d2) as link:
        ship = shipment(link, "d1", "d2")
        ship.meet(lambda _what: None)
        with pytest.raises(RejectedError) as caught:
            ship.offer()
    assert (caught.value.drone, caught.value.of, caught.value.reject) == ("d2", "plan", "clearance")
    assert caught.value.exit_code == 4
    assert "commit" not in d1.kinds
    assert "commit" not in d2.kinds


def test_an_unanswered_message_is_sent_again_as_the_same_bytes(router: str) -> None:
    drone = Double(router, "d1", drop=2)
    with linked(router, drone) as link:
        ship = shipment(link, "d1")
        ship.meet(lambda _what: None)
        ship.offer()
    assert len(drone.payloads) >= 4
    assert len(set(drone.payloads[:3])) == 1


def test_a_drone_that_never_answers_is_named(router: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fleet.ship.shipping.ANSWER_S", 1.0)
    d1, d2 = Double(router, "d1"), Double(router, "d2", answer=silent)
    with linked(router, d1, d2) as link:
        ship = shipment(link, "d1", "d2")
        ship.meet(lambda _what: None)
        with pytest.raises(EnvironmentError_, match="d2 did not answer the plan offer within") as caught:
            ship.offer()
    assert caught.value.problems[0].field == "d2"
    assert len(d2.payloads) > 1


def test_a_missing_drone_is_named(router: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fleet.ship.shipping.APPEAR_S", 0.5)
    with (
        linked(router, Double(router, "d1")) as link,
        pytest.raises(EnvironmentError_, match="d9 did not answer"),
    ):
        shipment(link, "d1", "d9").meet(lambda _what: None)


def test_a_flying_drone_gets_no_new_plan(router: str) -> None:
    with (
        linked(router, Double(router, "d1", mode="track")) as link,
        pytest.raises(EnvironmentError_, match="d1 is in mode track"),
    ):
        shipment(link, "d1").meet(lambda _what: None)


def test_an_operator_takes_mission_and_sequence_from_the_drone(router: str) -> None:
    drone = Double(router, "d1", epoch=4, seq=17, mission_id="ab" * 16)
    with linked(router, drone) as link:
        answer = command(link, "d1", "hold")
    assert answer.error is None
    (sent,) = {(one["mission_id"], one["epoch"], one["seq"]) for one in drone.received}
    assert sent == ("ab" * 16, 4, 18)


def test_two_operators_may_take_the_same_number(router: str) -> None:
    drone = Double(router, "d1", epoch=1)

    def other_was_first(_of: str) -> dict[str, object]:
        if drone.seq == 0:
            drone.seq = 5
            return {"result": "rejected", "code": "stale", "reason": "expected a seq above 5"}
        return {"result": "accepted"}

    drone.answer = other_was_first
    with linked(router, drone) as link:
        answer = command(link, "d1", "resume")
    assert answer.error is None
    assert sorted({one["seq"] for one in drone.received}) == [1, 6]


def test_what_is_not_a_router_is_refused(endpoint: str) -> None:
    import socket

    host, port = "127.0.0.1", int(endpoint.rpartition(":")[2])
    assert not is_router(parse_endpoint(endpoint, field="test"))
    with socket.create_server((host, port)), pytest.raises(EnvironmentError_, match="not a Zenoh router"):
        is_router(parse_endpoint(endpoint, field="test"))


def test_only_drones_of_the_fleet_are_seen(router: str) -> None:
    with linked(
        router, Double(router, "d1"), Double(router, "d2"), Double(router, "x1", fleet="other")
    ) as link:
        assert link.drones() == ["d1", "d2"]
