"""Wire messages, key names, trajectories, geometry and robustness of fleet, from the Rust core.

Functions are documented in the module itself. The TypedDicts are the messages as Python sees them:
crates/core holds the one definition, with the meaning, unit and frame of each field.
`MYPYPATH=python python -m mypy.stubtest fleet._core` compares this file with the module, and
tests/unit/test_core_messages.py the TypedDicts with messages that Rust has encoded.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, TypeAlias, final, type_check_only

import numpy as np
from numpy.typing import NDArray
from typing_extensions import TypedDict

__all__ = [
    "MAX_BYTES",
    "SCHEMA",
    "Fleet",
    "Trajectory",
    "decode_down",
    "decode_plan",
    "decode_status",
    "decode_time",
    "decode_up",
    "encode_down",
    "encode_plan",
    "encode_status",
    "encode_time",
    "encode_up",
    "flight_power",
    "hover_power",
    "inside",
    "is_name",
    "key_alive",
    "key_down",
    "key_query",
    "key_up",
    "outside",
    "plan_hash",
]

SCHEMA: Final = 1
MAX_BYTES: Final = 2097152

_Array: TypeAlias = NDArray[np.float64]
_Vec3: TypeAlias = tuple[float, float, float]

# Formulas and regions.

@type_check_only
class HalfSpace(TypedDict):
    a: _Vec3
    b: float

@type_check_only
class Region(TypedDict):
    name: str
    shape: list[HalfSpace]

@type_check_only
class Term(TypedDict):
    drone: str
    axis: Literal["x", "y", "z"]
    coef: float

@type_check_only
class _Place(TypedDict):
    op: Literal["in", "outside"]
    drone: str
    region: str

@type_check_only
class _Dist(TypedDict):
    op: Literal["dist"]
    a: str
    b: str
    cmp: Literal["ge", "le"]
    value: float

@type_check_only
class _Linear(TypedDict):
    op: Literal["linear"]
    terms: list[Term]
    constant: float

@type_check_only
class _Not(TypedDict):
    op: Literal["not"]
    f: _Formula

@type_check_only
class _Junction(TypedDict):
    op: Literal["and", "or"]
    fs: list[_Formula]

@type_check_only
class _Implies(TypedDict):
    op: Literal["implies"]
    left: _Formula
    right: _Formula

# `from` is a keyword, so that these need the functional form.
_Window = TypedDict(
    "_Window",
    {
        "op": Literal["always", "eventually", "once", "historically"],
        "from": float,
        "to": float,
        "f": "_Formula",
    },
)

_Until = TypedDict(
    "_Until",
    {"op": Literal["until", "since"], "from": float, "to": float, "left": "_Formula", "right": "_Formula"},
)

_Formula: TypeAlias = _Place | _Dist | _Linear | _Not | _Junction | _Implies | _Window | _Until

# The plan.

@type_check_only
class Knot(TypedDict):
    t: float
    p: _Vec3
    v: _Vec3
    a: _Vec3
    psi: float
    psi_rate: float
    psi_acc: float

@type_check_only
class Limits(TypedDict):
    v_max: float
    a_max: float
    psi_rate_max: float
    delta_min: float
    tube: float

@type_check_only
class ReplanParams(TypedDict):
    t_e: float
    t_g: float
    eta: float
    enabled: bool

@type_check_only
class ClauseResult(TypedDict):
    rho: float
    rho_lower: float
    t_tightest: float

@type_check_only
class PlannedClause(TypedDict):
    id: str
    text: str
    kind: str
    drones: list[str]
    weight: float
    priority: int
    formula: _Formula
    result: ClauseResult

@type_check_only
class Pad(TypedDict):
    p: _Vec3
    psi: float

@type_check_only
class Visit(TypedDict):
    region: str
    t: float
    window: tuple[float, float]
    psi: float | None

@type_check_only
class DronePlan(TypedDict):
    id: str
    pad: Pad
    home: str
    trajectory: list[Knot]
    visits: list[Visit]
    topics: list[float]

@type_check_only
class Plan(TypedDict):
    schema: int
    scenario: str
    fleet: str
    seed: int
    horizon: float
    sample: float
    limits: Limits
    replan: ReplanParams
    regions: list[Region]
    workspace: str
    obstacles: list[str]
    clauses: list[PlannedClause]
    method: str
    status: Literal["optimal", "certified", "violated"]
    rho: float
    rho_lower: float
    rho_bound: float
    drones: list[DronePlan]

# Messages to a drone.

@type_check_only
class Offer(TypedDict):
    kind: Literal["offer"]
    hash: str
    plan: bytes

@type_check_only
class Commit(TypedDict):
    kind: Literal["commit"]
    hash: str

@type_check_only
class Start(TypedDict):
    kind: Literal["command"]
    command: Literal["start"]
    t0: int
    hash: str

@type_check_only
class Command(TypedDict):
    kind: Literal["command"]
    command: Literal["arm", "hold", "resume", "return", "land", "abort", "disarm"]

@type_check_only
class DownEnvelope(TypedDict):
    schema: int
    mission_id: str
    epoch: int
    seq: int
    issued: int
    valid_until: int
    body: Offer | Commit | Start | Command

# Messages from a drone.

_Mode: TypeAlias = Literal[
    "idle", "armed", "takeoff", "track", "replan", "hold", "return", "land", "abort", "released"
]

@type_check_only
class Heartbeat(TypedDict):
    kind: Literal["heartbeat"]
    drone: str
    now: int
    mode: _Mode
    hash: str
    mission_time: float | None
    armed: bool
    battery: float | None
    state_age: float | None

@type_check_only
class State(TypedDict):
    at: int
    p: _Vec3
    v: _Vec3
    q: tuple[float, float, float, float]
    w: _Vec3

@type_check_only
class Reference(TypedDict):
    p: _Vec3
    v: _Vec3
    a: _Vec3
    j: _Vec3
    psi: float
    psi_rate: float

@type_check_only
class Setpoint(TypedDict):
    rates: _Vec3
    thrust: float

@type_check_only
class Telemetry(TypedDict):
    kind: Literal["telemetry"]
    drone: str
    mode: _Mode
    mission_time: float | None
    state: State | None
    reference: Reference | None
    setpoint: Setpoint | None
    deviation: float | None
    hover_thrust: float
    replans: int
    next_topic: float | None
    next_region: str | None

_ModeEvent = TypedDict("_ModeEvent", {"event": Literal["mode"], "from": _Mode, "to": _Mode})

@type_check_only
class _PlanEvent(TypedDict):
    event: Literal["plan"]
    hash: str

@type_check_only
class _MetresEvent(TypedDict):
    event: Literal["deviation", "estimator_reset"]
    metres: float

@type_check_only
class _LostEvent(TypedDict):
    event: Literal["link", "state_stale"]
    lost: bool

@type_check_only
class _TextEvent(TypedDict):
    event: Literal["autopilot", "fault"]
    text: str

@type_check_only
class _LandedEvent(TypedDict):
    event: Literal["landed"]

_What: TypeAlias = _ModeEvent | _PlanEvent | _MetresEvent | _LostEvent | _TextEvent | _LandedEvent

@type_check_only
class Event(TypedDict):
    kind: Literal["event"]
    drone: str
    mission_time: float | None
    what: _What
    cause: str

@type_check_only
class _Accepted(TypedDict):
    result: Literal["accepted"]

@type_check_only
class _Rejected(TypedDict):
    result: Literal["rejected"]
    code: Literal[
        "malformed",
        "expired",
        "stale",
        "wrong_mission",
        "hash",
        "not_in_plan",
        "wrong_fleet",
        "limits",
        "clearance",
        "separation",
        "ends",
        "certificate",
        "mode",
        "preflight",
        "start_time",
        "peer",
        "autopilot",
    ]
    reason: str

@type_check_only
class Ack(TypedDict):
    kind: Literal["ack"]
    drone: str
    of: str
    epoch: int
    seq: int
    outcome: _Accepted | _Rejected

@type_check_only
class ReplanNotice(TypedDict):
    kind: Literal["replan"]
    drone: str
    outcome: Literal["committed", "infeasible", "late", "refused"]
    t_event: float
    deviation: float
    t_splice: float | None
    t_rejoin: float | None
    trajectory: list[Knot] | None

@type_check_only
class UpEnvelope(TypedDict):
    schema: int
    mission_id: str
    epoch: int
    seq: int
    issued: int
    valid_until: int
    body: Heartbeat | Telemetry | Event | Ack | ReplanNotice

@type_check_only
class Status(TypedDict):
    drone: str
    mode: _Mode
    mission_id: str
    epoch: int
    seq: int
    hash: str
    t0: int | None
    preflight: list[str]

@type_check_only
class TimeReply(TypedDict):
    now: int

# Functions. What is given may be a plain dict; Rust checks it and names the field that is wrong.

_Given: TypeAlias = Mapping[str, Any]

def encode_plan(plan: _Given) -> bytes: ...
def decode_plan(data: bytes) -> Plan: ...
def plan_hash(data: bytes) -> str: ...
def encode_down(envelope: _Given) -> bytes: ...
def decode_down(data: bytes) -> DownEnvelope: ...
def encode_up(envelope: _Given) -> bytes: ...
def decode_up(data: bytes) -> UpEnvelope: ...
def encode_status(status: _Given) -> bytes: ...
def decode_status(data: bytes) -> Status: ...
def encode_time(time: _Given) -> bytes: ...
def decode_time(data: bytes) -> TimeReply: ...
def key_down(fleet: str, drone: str, channel: Literal["plan", "commit", "cmd"]) -> str: ...
def key_up(
    fleet: str, drone: str, channel: Literal["heartbeat", "telemetry", "event", "ack", "replan"]
) -> str: ...
def key_query(fleet: str, drone: str, query: Literal["time", "status", "plan"]) -> str: ...
def key_alive(fleet: str, drone: str) -> str: ...
def is_name(name: str) -> bool: ...
def flight_power(velocities: _Array, accelerations: _Array) -> _Array: ...
def hover_power() -> float: ...
def inside(faces: Sequence[_Given], points: _Array) -> _Array: ...
def outside(faces: Sequence[_Given], points: _Array) -> _Array: ...

@final
class Trajectory:
    def __new__(cls, knots: _Array) -> Trajectory: ...
    @staticmethod
    def from_list(knots: Sequence[_Given]) -> Trajectory: ...
    def to_list(self) -> list[Knot]: ...
    @property
    def knots(self) -> _Array: ...
    @property
    def start(self) -> float: ...
    @property
    def end(self) -> float: ...
    def sample(self, times: _Array) -> _Array: ...
    def bounds(self) -> tuple[_Array, _Array]: ...
    def energy(self) -> tuple[float, float]: ...

@final
class Fleet:
    def __new__(cls, drones: Sequence[str], regions: Sequence[_Given]) -> Fleet: ...
    @property
    def drones(self) -> list[str]: ...
    def check(self, formula: _Given, sample: float, end: float | None = None) -> float: ...
    def robustness(self, formula: _Given, positions: _Array, sample: float) -> _Array: ...
    def evaluate(self, formula: _Given, positions: _Array, sample: float) -> tuple[float, float]: ...
    def lower_bound(
        self, formula: _Given, trajectories: Sequence[Trajectory], sample: float
    ) -> tuple[float, float]: ...
