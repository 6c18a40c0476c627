"""Real processes on free ports, each ended by its id, and a check that nothing is left of them."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "scenarios"


@dataclass(frozen=True)
class Answer:
    """What a command line gave."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """The object on stdout."""
        return json.loads(self.out)

    def assert_no_traceback(self) -> None:
        """A user's mistake never shows the inside of the program."""
        assert "Traceback" not in self.err + self.out
        assert "defect" not in self.err, self.err


def environment(**extra: str) -> dict[str, str]:
    """Environment of a child: this tree's package, and what the test adds."""
    path = os.pathsep.join([str(ROOT / "python"), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    return os.environ | {"PYTHONPATH": path} | extra


def start(*words: str, cwd: Path, **extra: str) -> subprocess.Popen[str]:
    """Start `fleet WORDS` without waiting."""
    return subprocess.Popen(
        [sys.executable, "-m", "fleet", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
        env=environment(**extra),
        start_new_session=True,
    )


def finish(process: subprocess.Popen[str], within: float = 60.0) -> Answer:
    """Wait for a started command."""
    try:
        out, err = process.communicate(timeout=within)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        pytest.fail(f"not done within {within} s; stderr: {err}")
    return Answer(process.returncode, out, err)


@pytest.fixture
def fleet(tmp_path: Path) -> Callable[..., Answer]:
    """Run `fleet WORDS` to its end in the test's own folder."""

    def run(*words: str, within: float = 60.0, **extra: str) -> Answer:
        return finish(start(*words, cwd=tmp_path, **extra), within)

    return run


@pytest.fixture
def endpoint() -> str:
    """A loopback endpoint that nobody listens on."""
    return f"tcp/127.0.0.1:{free_port()}"


def free_port() -> int:
    """A TCP port that is free now."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def port_is_free(endpoint: str) -> bool:
    """Whether somebody could listen there at once."""
    with socket.socket() as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            one.bind(("127.0.0.1", int(endpoint.rpartition(":")[2])))
        except OSError:
            return False
        return True


@pytest.fixture
def router(endpoint: str, tmp_path: Path) -> Iterator[str]:
    """A `fleet router` process; its endpoint."""
    process = start("router", "--listen", endpoint, "--json", cwd=tmp_path)
    assert process.stdout is not None
    ready = process.stdout.readline()
    assert json.loads(ready or "{}").get("ready"), finish(process, 5.0).err
    yield endpoint
    process.send_signal(signal.SIGINT)
    assert finish(process, 10.0).code == 0


def processes_with(mark: str) -> list[str]:
    """Command lines of all living processes that mention ``mark``, this one left out."""
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit() or int(folder.name) == os.getpid():
            continue
        try:
            words = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if mark in words:
            found.append(f"{folder.name}: {words}")
    return found


@pytest.fixture
def nothing_left(tmp_path: Path, endpoint: str) -> Iterator[None]:
    """After the test: no process mentions its folder or its port, and the port can be had."""
    yield
    deadline = time.monotonic() + 3.0
    while left := [*processes_with(str(tmp_path)), *processes_with(endpoint)]:
        assert time.monotonic() < deadline, left
        time.sleep(0.05)
    assert port_is_free(endpoint)
