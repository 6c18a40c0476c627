"""The `mcap` package, an independent reader, reads what the recorder writes."""

import json
from pathlib import Path
from typing import Any

import pytest

GOLDEN = Path(__file__).parents[1] / "golden" / "record.mcap"
SCHEMAS = {
    "/d1/state": "foxglove.PoseInFrame",
    "/d1/reference": "foxglove.PoseInFrame",
    "/d1/setpoint": "fleet.Setpoint",
    "/d1/mode": "fleet.Mode",
    "/d1/replan": "fleet.Replan",
    "/event": "fleet.Event",
}


@pytest.fixture(scope="module")
def messages() -> dict[str, list[tuple[Any, Any, Any]]]:
    from mcap.reader import make_reader

    found: dict[str, list[tuple[Any, Any, Any]]] = {}
    with GOLDEN.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            found.setdefault(channel.topic, []).append((schema, channel, message))
    return found


def test_topics_and_schemas(messages: dict[str, list[tuple[Any, Any, Any]]]) -> None:
    assert set(messages) == {*SCHEMAS, "/d1/inbox"}
    for topic, name in SCHEMAS.items():
        for schema, channel, message in messages[topic]:
            assert (schema.name, schema.encoding, channel.message_encoding) == (name, "jsonschema", "json")
            properties = json.loads(schema.data)
            content = json.loads(message.data)
            assert set(properties["required"]) <= set(content) <= set(properties["properties"])


def test_times_and_sequence(messages: dict[str, list[tuple[Any, Any, Any]]]) -> None:
    for rows in messages.values():
        assert [message.log_time for _, _, message in rows] == [1_010_000_000, 1_020_000_000, 1_030_000_000]
        assert all(message.publish_time == message.log_time for _, _, message in rows)
        assert [message.sequence for _, _, message in rows] == [0, 1, 2]


def test_state(messages: dict[str, list[tuple[Any, Any, Any]]]) -> None:
    state = json.loads(messages["/d1/state"][0][2].data)
    assert state["timestamp"] == {"sec": 1, "nsec": 6_000_000}  # measured 4 ms before the tick
    assert state["mission_time"] == pytest.approx(1.496)
    assert state["frame_id"] == "map"
    assert state["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    assert sum(value**2 for value in state["pose"]["orientation"].values()) == pytest.approx(1.0)
    assert (state["v"], state["w"]) == ([0.1, 0.2, 0.3], [0.01, 0.02, 0.03])


def test_reference_setpoint_and_event(messages: dict[str, list[tuple[Any, Any, Any]]]) -> None:
    reference = json.loads(messages["/d1/reference"][0][2].data)
    assert (reference["v"], reference["a"], reference["mission_time"]) == ([0.0] * 3, [0.0] * 3, 1.5)
    setpoint = json.loads(messages["/d1/setpoint"][0][2].data)
    assert setpoint["rates"] == [0.4, 0.5, 0.6]
    assert (setpoint["thrust"], setpoint["hover_thrust"], setpoint["deviation"]) == (0.45, 0.42, 0.25)
    mode = json.loads(messages["/d1/mode"][0][2].data)
    assert (mode["mode"], mode["cause"]) == ("track", "mission time 0 reached")
    event = json.loads(messages["/event"][0][2].data)
    assert (event["drone"], event["event"]["what"]["event"]) == ("d1", "mode")
    replan = json.loads(messages["/d1/replan"][0][2].data)
    assert replan["notice"]["outcome"] == "infeasible"


def test_inbox_is_cbor_without_schema(messages: dict[str, list[tuple[Any, Any, Any]]]) -> None:
    schema, channel, message = messages["/d1/inbox"][0]
    assert schema is None
    assert channel.message_encoding == "cbor"
    assert message.data == bytes([0x83, 1, 2, 3])
