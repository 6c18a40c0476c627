"""Reading a flight log into arrays."""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet import _core
from fleet.errors import LogError

Array = NDArray[np.float64]
_MAGIC = b"\x89MCAP0\r\n"
_POSE_COLUMNS = 14
_SETPOINT_COLUMNS = 7


@dataclass
class DroneLog:
    """What one drone did; every `t` is mission time [s], negative before the start.

    `truth`, `state`, `reference` have rows `t, p(3), v(3), q(w x y z), last(3)`, shape (n, 14): world ENU,
    body FLU to ENU; `last` is body rates [rad/s] for truth and state, acceleration [m/s^2] for the reference.
    `setpoint` has rows `t, rates(3), thrust, hover_thrust, deviation`, shape (n, 7).
    """

    truth: Array = field(default_factory=lambda: np.empty((0, _POSE_COLUMNS)))
    state: Array = field(default_factory=lambda: np.empty((0, _POSE_COLUMNS)))
    reference: Array = field(default_factory=lambda: np.empty((0, _POSE_COLUMNS)))
    setpoint: Array = field(default_factory=lambda: np.empty((0, _SETPOINT_COLUMNS)))
    modes: list[tuple[float, str, str]] = field(default_factory=list)
    replans: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class Mission:
    """What was flown and when: the plan file's bytes, and mission time 0 on the log's clock [ns]."""

    plan_bytes: bytes
    t0_ns: int


@dataclass
class Flight:
    """A whole run: the plan that was flown and what each drone did."""

    path: Path
    plan: _core.Plan
    plan_bytes: bytes
    plan_hash: str
    t0_ns: int
    drones: dict[str, DroneLog]
    events: list[tuple[float, str, dict[str, Any]]]


def read(path: Path) -> Flight:
    """Read a merged log.

    Raises `LogError` when the file is missing, is no MCAP file, or holds no `/mission`.
    """
    missions = [json.loads(data) for _, _, data in messages(path, ["/mission"])]
    if not missions:
        raise LogError(path, "holds no /mission message; is it one agent's own log, not a merged one?")
    mission = missions[-1]
    plan_bytes = base64.b64decode(mission["plan_cbor_base64"])
    found = _core.plan_hash(plan_bytes)
    if found != mission["hash"]:
        raise LogError(path, f"/mission names plan {mission['hash'][:12]} but holds {found[:12]}")
    return assemble([path], path, Mission(plan_bytes, int(mission["t0_ns"])))


def assemble(parts: list[Path], path: Path, mission: Mission) -> Flight:
    """The flight that the logs of agents and simulator tell together; `path` is where they are merged to.

    Raises `LogError` when a part or the plan cannot be read.
    """
    try:
        plan = _core.decode_plan(mission.plan_bytes)
    except ValueError as error:
        raise LogError(path, f"the flown plan cannot be read: {error}") from error
    flight = Flight(
        path, plan, mission.plan_bytes, _core.plan_hash(mission.plan_bytes), mission.t0_ns, {}, []
    )
    _fill(flight, parts)
    return flight


def is_complete(path: Path) -> bool:
    """Whether a log has its closing magic bytes (MCAP specification, File structure), or is not there."""
    if not path.exists():
        return True
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - len(_MAGIC)))
        return stream.read() == _MAGIC and size > len(_MAGIC)


def messages(path: Path, topics: list[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
    """Topic, log time [ns] and content of each message, in order of log time.

    Raises `LogError` when the file is missing or cannot be read.
    """
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages(topics=topics):
                yield channel.topic, message.log_time, message.data
    except FileNotFoundError as error:
        raise LogError(path, "does not exist") from error
    except (McapError, OSError, EOFError) as error:
        raise LogError(path, f"is not a readable MCAP file ({error or type(error).__name__})") from error


def _fill(flight: Flight, parts: list[Path]) -> None:
    ids = [drone["id"] for drone in flight.plan["drones"]]
    rows: dict[str, dict[str, list[list[float]]]] = {
        i: {"truth": [], "state": [], "reference": [], "setpoint": []} for i in ids
    }
    flight.drones = {i: DroneLog() for i in ids}
    wanted = [f"/{i}/{leaf}" for i in ids for leaf in (*rows[i], "mode", "replan")]
    for topic, at, data in chain.from_iterable(messages(part, [*wanted, "/event"]) for part in parts):
        t = (at - flight.t0_ns) * 1e-9
        body = json.loads(data)
        if topic == "/event":
            flight.events.append((t, body["drone"], body["event"]))
            continue
        _, drone, leaf = topic.split("/")
        if leaf == "mode":
            flight.drones[drone].modes.append((t, body["mode"], body.get("cause", "")))
        elif leaf == "replan":
            flight.drones[drone].replans.append(body["notice"])
        elif leaf == "setpoint":
            rows[drone][leaf].append(_setpoint(t, body))
        else:
            rows[drone][leaf].append(_pose(t, body))
    for i in ids:
        for leaf, values in rows[i].items():
            if values:
                setattr(flight.drones[i], leaf, np.asarray(values, dtype=float))
    flight.events.sort(key=lambda event: event[0])


def _pose(t: float, body: dict[str, Any]) -> list[float]:
    p, q = body["pose"]["position"], body["pose"]["orientation"]
    last = body["a"] if "a" in body else body["w"]
    return [t, p["x"], p["y"], p["z"], *body["v"], q["w"], q["x"], q["y"], q["z"], *last]


def _setpoint(t: float, body: dict[str, Any]) -> list[float]:
    deviation = body["deviation"]
    return [
        t,
        *body["rates"],
        body["thrust"],
        body["hover_thrust"],
        np.nan if deviation is None else deviation,
    ]
