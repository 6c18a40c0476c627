"""The programs that the ground station starts: found, started, waited for, and ended by their id."""

from __future__ import annotations

import json
import os
import queue
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from fleet.errors import EnvironmentError_
from fleet.faults import environment
from fleet.interrupt import Interrupt

BIN_DIR = "FLEET_BIN_DIR"
"""Environment variable with the only directory in which programs are looked for, when it is set."""
_TERM_S = 2.0
_TAIL_LINES = 3


def find_program(name: str) -> Path:
    """Path of ``fleet-agent`` or ``fleet-sim``: in FLEET_BIN_DIR if set, else beside Python, else on PATH.

    Raises:
        EnvironmentError_: when it is in none of them.
    """
    chosen = os.environ.get(BIN_DIR)
    places = [chosen] if chosen else [str(Path(sys.executable).parent), *os.get_exec_path()]
    found = shutil.which(name, path=os.pathsep.join(places))
    if found is None:
        where = f"in {BIN_DIR}={chosen}" if chosen else "beside Python and on PATH"
        raise environment(
            "program",
            f"{name} is missing (looked {where}): `make setup` or `pip install .` installs it; "
            f"or `cargo build --release -p {name}` and set {BIN_DIR} to target/release",
            field=name,
        )
    return Path(found)


class Child:
    """A started program in a session of its own, so that Ctrl-C in the terminal does not reach it."""

    def __init__(self, name: str, argv: Sequence[str], stderr: Path) -> None:
        """Start it; its stderr goes to the file ``stderr``.

        Raises:
            EnvironmentError_: when it cannot be started.
        """
        self.name = name
        self.stderr = stderr
        try:
            with stderr.open("wb") as log:
                self._popen = subprocess.Popen(
                    argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, start_new_session=True
                )
        except OSError as error:
            raise environment("program", f"{name} cannot be started: {error}", field=name) from error
        self._lines: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        assert self._popen.stdout is not None  # follows from PIPE above
        self._reader = threading.Thread(target=self._read, args=(self._popen.stdout,), daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._popen.pid

    def code(self) -> int | None:
        """Exit code, or None while it runs."""
        return self._popen.poll()

    def next_line(self, within_s: float) -> dict[str, Any] | None:
        """The next JSON line of its stdout, or None at the end of it.

        Raises:
            TimeoutError: when none comes in time.
            EnvironmentError_: when a line is not a JSON object.
        """
        try:
            line = self._lines.get(timeout=max(within_s, 0.0))
        except queue.Empty:
            raise TimeoutError from None
        if line is None:
            return None
        try:
            value = json.loads(line)
        except ValueError:
            value = None
        if not isinstance(value, dict):
            raise environment(
                "program", f"{self.name} wrote {line[:80]!r}, which is not a JSON object", field=self.name
            )
        return value

    def ready(self, within_s: float) -> dict[str, Any]:
        """Its ready line.

        Raises:
            EnvironmentError_: when it ends before that, or does not come in time.
        """
        try:
            line = self.next_line(within_s)
        except TimeoutError:
            raise self.failed(f"was not ready within {within_s:g} s") from None
        if line is None or line.get("ready") is not True:
            self.wait(_TERM_S)
            raise self.failed(f"ended (exit code {self.code()}) before it was ready")
        return line

    def failed(self, what: str) -> EnvironmentError_:
        """An error that says ``what`` and quotes the end of its stderr."""
        lines = self.stderr.read_text(errors="replace").strip().splitlines() if self.stderr.exists() else []
        said = "; it said: " + " | ".join(lines[-_TAIL_LINES:]) if lines else ""
        return environment("program", f"{self.name} {what}{said}", field=self.name)

    def tell(self, message: dict[str, Any]) -> None:
        """Write one JSON line to its stdin.

        Raises:
            EnvironmentError_: when it has closed its stdin.
        """
        stdin = self._popen.stdin
        assert stdin is not None  # follows from PIPE in the constructor
        try:
            stdin.write(json.dumps(message).encode() + b"\n")
            stdin.flush()
        except OSError as error:
            raise self.failed(f"does not listen any more ({error})") from error

    def wait(self, within_s: float) -> bool:
        """Whether it has ended within that time."""
        try:
            self._popen.wait(max(within_s, 0.0))
        except subprocess.TimeoutExpired:
            return False
        return True

    def terminate(self) -> None:
        """Ask it to end."""
        if self.code() is None:
            self._popen.terminate()

    def kill(self) -> None:
        """End it now and take its exit code, so that nothing is left of it."""
        if self.code() is None:
            self._popen.kill()
        self._popen.wait()
        self._reader.join(1.0)
        for pipe in (self._popen.stdin, self._popen.stdout):
            if pipe is not None:
                _close(pipe)

    def _read(self, stdout: IO[bytes]) -> None:
        for line in stdout:
            self._lines.put(line)
        self._lines.put(None)


def _close(pipe: IO[bytes]) -> None:
    try:
        pipe.close()
    except BrokenPipeError:
        # Closing flushes; a line that the dead program never read is of no use to anyone.
        return


class Children:
    """All programs that one command has started. Leaving the block ends those that still run."""

    def __init__(self, interrupt: Interrupt) -> None:
        """None yet."""
        self._interrupt = interrupt
        self.all: list[Child] = []

    def start(self, name: str, argv: Sequence[str], stderr: Path) -> Child:
        """Start a program; an interrupt cannot come between its start and its entry in the list."""
        with self._interrupt.shielded():
            child = Child(name, argv, stderr)
            self.all.append(child)
        return child

    def end(self) -> None:
        """Ask all to end, wait 2 s altogether, then kill."""
        for child in self.all:
            child.terminate()
        deadline = time.monotonic() + _TERM_S
        for child in self.all:
            child.wait(deadline - time.monotonic())
        self.kill()

    def kill(self) -> None:
        """Kill all, at once."""
        for child in self.all:
            child.kill()

    def __enter__(self) -> Children:
        """Itself."""
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        """End what still runs."""
        self._interrupt.count_only()
        self.end()
