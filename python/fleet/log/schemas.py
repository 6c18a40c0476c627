"""JSON Schemas of the topics that Python writes.

`foxglove.*` names and fields are Foxglove's well-known schemas, so that its 3-D panel draws them unasked
(https://docs.foxglove.dev/docs/visualization/message-schemas).
"""

import json
from typing import Any

Json = dict[str, Any]

_TIME: Json = {
    "type": "object",
    "title": "time",
    "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0}},
}
_DURATION: Json = {
    "type": "object",
    "title": "duration",
    "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
}
_NUMBER: Json = {"type": "number"}
_STRING: Json = {"type": "string"}


def _object(title: str, **properties: Json) -> Json:
    return {"title": title, "type": "object", "properties": properties}


def _array(items: Json) -> Json:
    return {"type": "array", "items": items}


_VECTOR = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POINT = _object("foxglove.Point3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_COLOR = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)

POSES_IN_FRAME = _object("foxglove.PosesInFrame", timestamp=_TIME, frame_id=_STRING, poses=_array(_POSE))

_TRIANGLES = _object(
    "foxglove.TriangleListPrimitive",
    pose=_POSE,
    points=_array(_POINT),
    color=_COLOR,
    colors=_array(_COLOR),
    indices=_array({"type": "integer", "minimum": 0}),
)
_ENTITY = _object(
    "foxglove.SceneEntity",
    timestamp=_TIME,
    frame_id=_STRING,
    id=_STRING,
    lifetime=_DURATION,
    frame_locked={"type": "boolean"},
    metadata=_array(_object("foxglove.KeyValuePair", key=_STRING, value=_STRING)),
    arrows=_array({"type": "object"}),
    cubes=_array({"type": "object"}),
    spheres=_array({"type": "object"}),
    cylinders=_array({"type": "object"}),
    lines=_array({"type": "object"}),
    triangles=_array(_TRIANGLES),
    texts=_array({"type": "object"}),
    models=_array({"type": "object"}),
)
SCENE_UPDATE = _object("foxglove.SceneUpdate", deletions=_array({"type": "object"}), entities=_array(_ENTITY))

MISSION = _object(
    "fleet.Mission",
    timestamp=_TIME,
    scenario=_STRING,
    hash=_STRING,
    seed={"type": "integer"},
    t0_ns={"type": "integer"},
    plan_cbor_base64=_STRING,
)
VERDICT = _object("fleet.Verdict", timestamp=_TIME, verdict={"type": "object"})

BY_NAME: dict[str, Json] = {
    schema["title"]: schema for schema in (POSES_IN_FRAME, SCENE_UPDATE, MISSION, VERDICT)
}


def encoded(name: str) -> bytes:
    """The JSON Schema called `name`, as MCAP stores it."""
    return json.dumps(BY_NAME[name], separators=(",", ":")).encode()


def stamp(ns: int) -> Json:
    """Foxglove's `time` for `ns` nanoseconds of the log's clock."""
    return {"sec": ns // 1_000_000_000, "nsec": ns % 1_000_000_000}
