"""A flight log as a perfect drone would write it, shifted where a test wants it to be wrong."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer

from fleet import _core
from fleet.log import Mission, merge

T0_NS = 100_000_000_000
HZ = 100
Shift = Callable[[str, float], Any]


def no_shift(drone: str, t: float) -> Any:
    """A drone that is where it should be."""
    return np.zeros(3)


def write_flight(plan_bytes: bytes, folder: Path, shift: Shift = no_shift, *, landed: bool = True) -> Path:
    """Write part logs of the plan flown with `shift` [m] added to the truth, and merge them."""
    plan = _core.decode_plan(plan_bytes)
    parts = [_part(plan, drone, folder / f"{drone['id']}.mcap", shift, landed) for drone in plan["drones"]]
    out = folder / "flight.mcap"
    merge(parts, out, Mission(plan_bytes, T0_NS))
    return out


def _part(plan: Any, drone: Any, path: Path, shift: Shift, landed: bool) -> Path:
    trajectory = _core.Trajectory.from_list(drone["trajectory"])
    times = np.arange(-HZ, round(plan["horizon"] * HZ) + HZ) / HZ
    rows = trajectory.sample(times)
    name = drone["id"]
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("test", "jsonschema", b'{"type":"object"}')
        channels: dict[str, int] = {}

        def put(topic: str, t: float, body: dict[str, Any]) -> None:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", schema)
            at = T0_NS + round(t * 1e9)
            writer.add_message(channels[topic], at, json.dumps(body).encode(), at)

        put(f"/{name}/mode", -1.0, {"mode": "takeoff", "cause": "start"})
        for t, row in zip(times.tolist(), rows, strict=True):
            v = row[3:6].tolist()
            put(f"/{name}/truth", t, {**_pose(row[:3] + shift(name, t)), "v": v, "w": [0, 0, 0]})
            put(f"/{name}/reference", t, {**_pose(row[:3]), "v": v, "a": row[6:9].tolist()})
            deviation = float(np.linalg.norm(shift(name, t)))
            setpoint = {"rates": [0, 0, 0], "thrust": 0.4, "hover_thrust": 0.4, "deviation": deviation}
            put(f"/{name}/setpoint", t, setpoint)
        put(f"/{name}/mode", plan["horizon"] + 0.9, {"mode": "idle", "cause": "disarmed"})
        if landed:
            event = {"drone": name, "mission_time": None, "what": {"event": "landed"}, "cause": "disarmed"}
            put("/event", plan["horizon"] + 0.9, {"drone": name, "event": event})
        writer.finish()
    return path


def _pose(p: Any) -> dict[str, Any]:
    x, y, z = (float(value) for value in p)
    return {
        "pose": {
            "position": {"x": x, "y": y, "z": z},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        }
    }
