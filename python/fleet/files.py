"""Files that people give to commands: read with errors they can use, written so that no half file is left."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from fleet.faults import bad_input

if TYPE_CHECKING:
    from fleet import _core
    from fleet.scenario import Scenario

Kind = Literal["scenario", "plan", "log"]
_MCAP_MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class PlanFile:
    """A plan with the exact bytes of its file; ``hash`` is their SHA-256."""

    plan: _core.Plan
    payload: bytes
    hash: str


def kind(path: Path) -> Kind:
    """What ``path`` is: logs by MCAP's magic, scenarios by `.toml`, everything else is taken for a plan.

    Raises:
        InputError: when it is missing, or not a file.
    """
    if not path.is_file():
        what = "is not a file" if path.exists() else "does not exist"
        raise bad_input("file", what, file=str(path))
    if path.suffix == ".toml":
        return "scenario"
    try:
        with path.open("rb") as stream:
            return "log" if stream.read(len(_MCAP_MAGIC)) == _MCAP_MAGIC else "plan"
    except OSError as error:
        raise bad_input("file", f"cannot be read: {error.strerror}", file=str(path)) from error


def read_plan(path: Path) -> PlanFile:
    """The plan in ``path``.

    Raises:
        InputError: when it is missing, too large, or not a plan of this version.
    """
    kind(path)
    try:
        payload = path.read_bytes()
    except OSError as error:
        raise bad_input("file", f"cannot be read: {error.strerror}", file=str(path)) from error
    try:
        return plan_of(payload)
    except ValueError as error:
        raise bad_input(
            "plan",
            f"is not a plan: {error}; legal is a file of `fleet plan -o`, or a scenario ending in .toml",
            file=str(path),
        ) from error


def plan_of(payload: bytes) -> PlanFile:
    """The plan in the bytes of a plan file.

    Raises:
        ValueError: when they are not a plan of this version.
    """
    from fleet import _core

    return PlanFile(_core.decode_plan(payload), payload, _core.plan_hash(payload))


def read_scenario(path: Path) -> Scenario:
    """The scenario in ``path``, completely checked.

    Raises:
        InputError: when it is missing, another kind of file, or has problems (all of them at once).
    """
    from fleet import scenario

    found = kind(path)
    if found != "scenario":
        raise bad_input("file", f"is a {found} file; a scenario file ends in .toml", file=str(path))
    return scenario.load(path)


def write_atomic(path: Path, payload: bytes) -> None:
    """Write ``payload`` as `replacing` does.

    Raises:
        InputError: when the folder does not exist or cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(payload)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary file beside ``path`` to write to; flushed to disk and renamed at the end of the block.

    Raises:
        InputError: when the folder does not exist or cannot be written.
    """
    if not path.name or path.is_dir():
        raise bad_input("file", "is a folder; legal is the name of a file", file=str(path))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            yield temporary
            with temporary.open("rb+") as stream:
                os.fsync(stream.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise bad_input("file", f"cannot be written: {error.strerror}", file=str(path)) from error
