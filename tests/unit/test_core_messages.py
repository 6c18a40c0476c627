"""Python's TypedDicts against messages that Rust has encoded, one of every kind and variant.

tests/golden/messages.json is written and checked by crates/core/tests/wire_golden.rs, which does not
compile while a variant of the wire is missing in it.
"""

import json
import sys
import typing
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from pydantic import ConfigDict, TypeAdapter, ValidationError
from typing_extensions import is_typeddict

from fleet import _core

ROOT = Path(__file__).parents[2]
GOLDEN: dict[str, list[str]] = json.loads((ROOT / "tests/golden/messages.json").read_text())
KINDS: dict[str, tuple[str, Callable[[bytes], Any], Callable[[Any], bytes]]] = {
    "plan": ("Plan", _core.decode_plan, _core.encode_plan),
    "down": ("DownEnvelope", _core.decode_down, _core.encode_down),
    "up": ("UpEnvelope", _core.decode_up, _core.encode_up),
    "status": ("Status", _core.decode_status, _core.encode_status),
    "time": ("TimeReply", _core.decode_time, _core.encode_time),
}


def load_stub() -> ModuleType:
    """The stub as a module."""
    path = ROOT / "python/fleet/_core.pyi"
    module = ModuleType("core_stub")
    # Names that stand before their definition, and a decorator that only type checkers know.
    code = compile("from __future__ import annotations\n" + path.read_text(), str(path), "exec")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typing, "type_check_only", lambda cls: cls, raising=False)
        sys.modules[module.__name__] = module
        exec(code, module.__dict__)
    return module


def adapters(stub: ModuleType) -> dict[str, TypeAdapter[Any]]:
    """Validators that take neither another type nor another field than the stub says."""
    for value in vars(stub).values():
        if is_typeddict(value):
            value.__pydantic_config__ = ConfigDict(extra="forbid", strict=True)
    return {name: TypeAdapter(getattr(stub, name)) for name, _, _ in KINDS.values()}


STUB = load_stub()
ADAPTERS = adapters(STUB)
MESSAGES = [
    pytest.param(kind, bytes.fromhex(text), id=f"{kind}-{i}")
    for kind, encoded in GOLDEN.items()
    for i, text in enumerate(encoded)
]


def decoded(kind: str) -> list[Any]:
    return [KINDS[kind][1](bytes.fromhex(text)) for text in GOLDEN[kind]]


def test_every_kind_is_in_the_golden_file() -> None:
    assert GOLDEN.keys() == KINDS.keys()
    assert all(GOLDEN.values())


@pytest.mark.parametrize(("kind", "data"), MESSAGES)
def test_what_rust_encodes_is_what_the_stub_says(kind: str, data: bytes) -> None:
    name, decode, encode = KINDS[kind]
    message = decode(data)
    ADAPTERS[name].validate_python(message)
    assert encode(message) == data


@pytest.mark.parametrize(("kind", "data"), MESSAGES)
def test_a_field_more_or_less_is_noticed(kind: str, data: bytes) -> None:
    name, decode, encode = KINDS[kind]
    message = decode(data)
    for damaged in ({**message, "extra": 1}, {k: v for k, v in message.items() if k != next(iter(message))}):
        with pytest.raises(ValidationError):
            ADAPTERS[name].validate_python(damaged)
        with pytest.raises(ValueError, match="field"):
            encode(damaged)


def values(message: Any, field: str) -> set[str]:
    """Every string that stands under `field` anywhere in a message."""
    found: set[str] = set()
    if isinstance(message, dict):
        found |= {v for k, v in message.items() if k == field and isinstance(v, str)}
        children = list(message.values())
    else:
        children = list(message) if isinstance(message, list | tuple) else []
    for child in children:
        found |= values(child, field)
    return found


def literals(name: str, field: str) -> set[str]:
    return set(typing.get_args(typing.get_type_hints(getattr(STUB, name), vars(STUB))[field]))


# A legal value that the wire never carries would be a leftover in the stub.
@pytest.mark.parametrize(
    ("kind", "field", "places"),
    [
        ("up", "kind", ["Heartbeat", "Telemetry", "Event", "Ack", "ReplanNotice"]),
        ("up", "mode", ["Heartbeat"]),
        ("up", "code", ["_Rejected"]),
        ("up", "result", ["_Accepted", "_Rejected"]),
        ("up", "outcome", ["ReplanNotice"]),
        (
            "up",
            "event",
            ["_ModeEvent", "_PlanEvent", "_MetresEvent", "_LostEvent", "_TextEvent", "_LandedEvent"],
        ),
        ("down", "kind", ["Offer", "Commit", "Start"]),
        ("down", "command", ["Start", "Command"]),
        ("plan", "status", ["Plan"]),
        ("plan", "cmp", ["_Dist"]),
        ("plan", "axis", ["Term"]),
        (
            "plan",
            "op",
            ["_Place", "_Dist", "_Linear", "_Not", "_Junction", "_Implies", "_Window", "_Until"],
        ),
    ],
)
def test_the_stub_lists_exactly_the_values_of_the_wire(kind: str, field: str, places: list[str]) -> None:
    listed = set().union(*(literals(place, field) for place in places))
    assert listed == values(decoded(kind), field)


def test_constants_are_those_of_the_module() -> None:
    assert (STUB.SCHEMA, STUB.MAX_BYTES) == (_core.SCHEMA, _core.MAX_BYTES)
