"""Merging the logs of agents and simulator into one file that stands alone."""

from __future__ import annotations

import base64
import heapq
import json
import math
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from fleet import _core
from fleet.errors import LogError
from fleet.log import schemas
from fleet.log.flight import Mission
from fleet.log.scene import entity

_PLAN_STEP = 0.25


def merge(
    parts: list[Path],
    out: Path,
    mission: Mission,
    *,
    verdict: dict[str, Any] | None = None,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write one log with every message of `parts` in order of log time, plus mission, plans, scene, verdict.

    The file is written to a temporary name, flushed to disk and renamed. `progress` gets the fraction done.
    Raises `LogError` naming the part that cannot be read.
    """
    from mcap.writer import CompressionType, Writer

    temporary = out.with_name(out.name + ".part")
    with temporary.open("wb") as stream:
        writer: Any = Writer(stream, compression=CompressionType.LZ4)
        writer.start(profile="", library="fleet")
        channels = _Channels(writer)
        _write_mission(channels, mission, verdict)
        _copy(parts, channels, progress)
        writer.finish()
        stream.flush()
        os.fsync(stream.fileno())
    temporary.replace(out)


class _Channels:
    """Channels of the output by topic, registered on first use."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[tuple[str, str, int], int] = {}

    def write(
        self, topic: str, encoding: str, schema: tuple[str, str, bytes] | None, at: int, data: bytes
    ) -> None:
        schema_id = 0
        if schema is not None:
            name, kind, text = schema
            schema_id = self._schemas.get((name, text), 0)
            if not schema_id:
                schema_id = self._writer.register_schema(name=name, encoding=kind, data=text)
                self._schemas[name, text] = schema_id
        key = (topic, encoding, schema_id)
        if key not in self._channels:
            self._channels[key] = self._writer.register_channel(
                topic=topic, message_encoding=encoding, schema_id=schema_id
            )
        self._writer.add_message(channel_id=self._channels[key], log_time=at, data=data, publish_time=at)

    def json(self, topic: str, schema: str, at: int, body: dict[str, Any]) -> None:
        data = json.dumps({"timestamp": schemas.stamp(at), **body}, separators=(",", ":"), allow_nan=False)
        self.write(topic, "json", (schema, "jsonschema", schemas.encoded(schema)), at, data.encode())


def _write_mission(channels: _Channels, mission: Mission, verdict: dict[str, Any] | None) -> None:
    plan = _core.decode_plan(mission.plan_bytes)
    at = mission.t0_ns
    channels.json(
        "/mission",
        "fleet.Mission",
        at,
        {
            "scenario": plan["scenario"],
            "hash": _core.plan_hash(mission.plan_bytes),
            "seed": plan["seed"],
            "t0_ns": at,
            "plan_cbor_base64": base64.b64encode(mission.plan_bytes).decode(),
        },
    )
    for drone in plan["drones"]:
        channels.json(f"/{drone['id']}/plan", "foxglove.PosesInFrame", at, _poses(drone))
    entities = [entity(region, plan, schemas.stamp(at)) for region in plan["regions"]]
    channels.json("/scene", "foxglove.SceneUpdate", at, {"deletions": [], "entities": entities})
    if verdict is not None:
        channels.json("/verdict", "fleet.Verdict", at, {"verdict": verdict})


def _poses(drone: Any) -> dict[str, Any]:
    trajectory = _core.Trajectory.from_list(drone["trajectory"])
    times = np.arange(trajectory.start, trajectory.end + 1e-9, _PLAN_STEP)
    return {"frame_id": "map", "poses": [_pose(row) for row in trajectory.sample(times).tolist()]}


def _pose(row: list[float]) -> dict[str, Any]:
    x, y, z, half = row[0], row[1], row[2], row[12] / 2
    return {
        "position": {"x": x, "y": y, "z": z},
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
    }


def _copy(parts: list[Path], channels: _Channels, progress: Callable[[float], None] | None) -> None:
    # The planner's word on these topics is the one written above; a part's own copy is left out.
    ours = {"/mission", "/scene", "/verdict"}
    with ExitStack() as stack:
        streams = [_records(part, stack) for part in parts]
        total = sum(count for count, _ in streams)
        merged = heapq.merge(*(records for _, records in streams), key=lambda record: record[2].log_time)
        for done, (schema, channel, message) in enumerate(merged):
            if progress is not None and done % 5000 == 0:
                progress(done / max(total, 1))
            if channel.topic in ours or channel.topic.endswith("/plan"):
                continue
            kind = None if schema is None else (schema.name, schema.encoding, schema.data)
            channels.write(channel.topic, channel.message_encoding, kind, message.log_time, message.data)


def _records(part: Path, stack: ExitStack) -> tuple[int, Iterator[tuple[Any, Any, Any]]]:
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        reader = make_reader(stack.enter_context(part.open("rb")))
        summary = reader.get_summary()
    except FileNotFoundError as error:
        raise LogError(part, "does not exist: the process that should have written it did not") from error
    except (McapError, OSError, EOFError) as error:
        raise LogError(part, f"is not a readable MCAP file ({error or type(error).__name__})") from error
    statistics = summary.statistics if summary is not None else None
    return (statistics.message_count if statistics is not None else 0), reader.iter_messages()
