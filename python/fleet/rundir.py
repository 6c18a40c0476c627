"""The folder of one run: where each part of a flight is written."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from fleet.errors import FleetError
from fleet.faults import bad_input


@dataclass(frozen=True)
class RunDir:
    """Paths inside the folder of one run."""

    root: Path

    @property
    def world(self) -> Path:
        """World of the simulator."""
        return self.root / "world.toml"

    @property
    def plan(self) -> Path:
        """The plan that is flown."""
        return self.root / "mission.plan.cbor"

    @property
    def log(self) -> Path:
        """Merged log."""
        return self.root / "flight.mcap"

    @property
    def report(self) -> Path:
        """HTML report."""
        return self.root / "report.html"

    def part(self, name: str) -> Path:
        """Log that one process writes."""
        return self.root / "parts" / f"{name}.mcap"

    def stderr(self, name: str) -> Path:
        """What one process says."""
        return self.root / "parts" / f"{name}.stderr"

    @property
    def state(self) -> Path:
        """Where the agents keep what must survive a restart, each in a folder of its own."""
        return self.root / "state"


@contextmanager
def run_dir(wanted: Path | None, name: str) -> Iterator[RunDir]:
    """Make the folder ``wanted``, or `runs/NAME-TIME`; removed again when interrupted, kept otherwise.

    Raises:
        InputError: when it cannot be made or is not empty.
    """
    root = wanted or Path("runs") / f"{name}-{datetime.now():%Y%m%d-%H%M%S-%f}"
    existed = root.is_dir()
    if existed and any(root.iterdir()):
        raise bad_input(
            "file", "is not empty; legal is a new or empty folder", file=str(root), field="--run-dir"
        )
    try:
        (root / "parts").mkdir(parents=True)
    except OSError as error:
        raise bad_input(
            "file", f"cannot be made: {error.strerror}", file=str(root), field="--run-dir"
        ) from error
    run = RunDir(root)
    try:
        yield run
    except KeyboardInterrupt:
        shutil.rmtree(root)
        if existed:
            root.mkdir()
        raise
    except FleetError as error:
        if any((root / "parts").iterdir()):
            error.add_note(f"what the processes said is in {root / 'parts'}")
        else:
            shutil.rmtree(root)
        raise
