"""pymavlink, an independent implementation, decodes what the agent's codec encodes."""

import json
from pathlib import Path
from typing import Any

import pytest

GOLDEN = Path(__file__).parents[1] / "golden" / "mavlink_frames.json"
FRAMES: list[dict[str, Any]] = json.loads(GOLDEN.read_text())
MESSAGE_IDS = {
    "attitude": 31,
    "local_position": 32,
    "odometry": 331,
    "landed": 245,
    "battery": 1,
    "origin": 49,
}
MODES = {"offboard": (6, 0), "land": (4, 6), "loiter": (4, 3)}


def decode(frame: dict[str, Any]) -> Any:
    from pymavlink.dialects.v20 import common

    parser = common.MAVLink(None)
    messages = parser.parse_buffer(bytearray.fromhex(frame["hex"]))
    assert messages is not None and len(messages) == 1
    return messages[0]


@pytest.mark.parametrize("index", range(len(FRAMES)))
def test_header(index: int) -> None:
    message = decode(FRAMES[index])
    assert message.get_srcSystem() == 42
    assert message.get_srcComponent() == 191
    assert message.get_seq() == index
    assert message.get_msgbuf()[0] == 0xFD  # MAVLink 2


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: frame["command"]["cmd"])
def test_content(frame: dict[str, Any]) -> None:
    command, message = frame["command"], decode(frame)
    kind = command["cmd"]
    if kind == "heartbeat":
        assert message.get_type() == "HEARTBEAT"
        assert (message.type, message.autopilot) == (18, 8)  # onboard controller, no autopilot
        return
    assert (message.target_system, message.target_component) == (42, 1)
    if kind == "rates":
        assert message.get_type() == "SET_ATTITUDE_TARGET"
        roll, pitch, yaw = command["rates"]
        sent = (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate)
        assert sent == (roll, -pitch, -yaw)
        assert message.thrust == min(command["thrust"], 1.0)
        assert (message.type_mask, message.q) == (128, [1.0, 0.0, 0.0, 0.0])
        assert message.time_boot_ms == frame["boot_ms"]
    elif kind == "read_param":
        assert message.get_type() == "PARAM_REQUEST_READ"
        assert (message.param_id, message.param_index) == (command["name"], -1)
    else:
        assert message.get_type() == "COMMAND_LONG"
        assert [message.command, message.param1, message.param2, message.param3] == expected_long(command)
        assert [message.param4, message.param5, message.param6, message.param7] == [0.0] * 4


def expected_long(command: dict[str, Any]) -> list[float]:
    match command:
        case {"cmd": "set_mode", "mode": {"other": custom}}:
            return [176, 1, custom >> 16 & 0xFF, custom >> 24]
        case {"cmd": "set_mode", "mode": mode}:
            return [176, 1, *MODES[mode]]
        case {"cmd": "arm", "arm": arm, "force": force}:
            return [400, int(arm), 21196 if force else 0, 0]
        case {"cmd": "interval", "stream": stream, "period_us": period}:
            return [511, MESSAGE_IDS[stream], period, 0]
        case {"cmd": "request", "stream": stream}:
            return [512, MESSAGE_IDS[stream], 0, 0]
    raise AssertionError(command)
