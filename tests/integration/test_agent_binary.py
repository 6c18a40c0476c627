"""The agent binary as a process: its ready line, its answers over a real Zenoh router, its end."""

import json
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fleet import _core
from fleet.processes import find_program
from tests.integration.conftest import free_port


def eventually(what: str, probe: Callable[[], Any], within: float = 20.0) -> Any:
    """The first true answer of `probe`."""
    end = time.monotonic() + within
    while time.monotonic() < end:
        answer = probe()
        if answer:
            return answer
        time.sleep(0.05)
    pytest.fail(f"not within {within} s: {what}")


class Agent:
    """One agent process; ended with the test."""

    def __init__(self, folder: Path, port: int, *flags: str, drone: str = "d1") -> None:
        words = [str(find_program("fleet-agent")), "--fleet", "testfleet", "--drone", drone]
        words += ["--zenoh", f"tcp/127.0.0.1:{port}", "--state-dir", str(folder / "state")]
        if "--mavlink" not in flags:
            words += ["--mavlink", "udpin:127.0.0.1:0"]
        self.process = subprocess.Popen(
            [*words, *flags], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder
        )
        assert self.process.stdout is not None
        self.ready: dict[str, Any] = json.loads(self.process.stdout.readline() or "{}")

    def end(self, *signals: signal.Signals) -> int:
        for number in signals or (signal.SIGTERM,):
            self.process.send_signal(number)
        return self.process.wait(10)

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Agent]]:
    agents: list[Agent] = []

    def launch(port: int, *flags: str, **more: str) -> Agent:
        agents.append(Agent(tmp_path, port, *flags, **more))
        return agents[-1]

    yield launch
    for agent in agents:
        agent.kill()


def open_router(port: int) -> Any:
    import zenoh

    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["tcp/127.0.0.1:{port}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def ask(session: Any, key: str) -> bytes | None:
    """The payload of the first good answer."""
    for reply in session.get(key, timeout=1.0):
        if reply.ok is not None:
            return bytes(reply.ok.payload)
    return None


def test_ready_line_names_drone_and_bound_address(start: Callable[..., Agent]) -> None:
    agent = start(free_port())
    assert agent.ready["ready"] is True
    assert agent.ready["drone"] == "d1"
    host, port = agent.ready["mavlink"].split(":")
    assert host == "127.0.0.1" and int(port) > 0
    assert agent.end() == 0  # also without any router


def test_answers_time_and_status_and_is_alive(start: Callable[..., Agent]) -> None:
    port = free_port()
    agent = start(port)  # before the router: it must find it later by itself
    with open_router(port) as session:
        key = _core.key_query("testfleet", "d1", "time")
        first = _core.decode_time(eventually("time query", lambda: ask(session, key)))["now"]
        before = time.monotonic_ns()
        second = _core.decode_time(eventually("time query", lambda: ask(session, key)))["now"]
        after = time.monotonic_ns()
        assert 1_000_000_000 <= first < second
        assert second - first < after - before + 2_000_000_000
        status = eventually(
            "status query", lambda: ask(session, _core.key_query("testfleet", "d1", "status"))
        )
        decoded = _core.decode_status(status)
        assert (decoded["drone"], decoded["mode"], decoded["hash"]) == ("d1", "idle", "")
        alive = [str(reply.ok.key_expr) for reply in session.liveliness().get("fleet/testfleet/*/alive")]
        assert alive == [_core.key_alive("testfleet", "d1")]
        assert ask(session, _core.key_query("testfleet", "d1", "plan")) is None  # none is committed
        assert agent.end() == 0


def test_hears_its_own_commands_and_its_peers(start: Callable[..., Agent], tmp_path: Path) -> None:
    """What arrives over Zenoh lands in the recorded inbox, and the replay gives the same outbox."""
    from mcap.reader import make_reader

    port, log = free_port(), tmp_path / "d1.mcap"
    agent = start(port, "--record", str(log))
    with open_router(port) as session:
        key = _core.key_query("testfleet", "d1", "time")
        eventually("time query", lambda: ask(session, key))
        session.put(_core.key_down("testfleet", "d1", "cmd"), b"own command")
        session.put(_core.key_down("testfleet", "d2", "cmd"), b"command of another")
        session.put(_core.key_up("testfleet", "d2", "heartbeat"), b"peer heartbeat")
        session.put(_core.key_up("testfleet", "d2", "telemetry"), b"peer telemetry")
        session.put(_core.key_up("other", "d2", "heartbeat"), b"another fleet")
        time.sleep(0.5)
        assert agent.end() == 0
    with log.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        inbox = b"".join(m.data for _, _, m in reader.iter_messages(topics=["/d1/inbox"]))
    for heard in (b"own command", b"peer heartbeat"):
        assert cbor_array(heard) in inbox, heard
    for unheard in (b"command of another", b"peer telemetry", b"another fleet"):
        assert cbor_array(unheard) not in inbox, unheard
    assert replay(log, "d1") == 0


def cbor_array(data: bytes) -> bytes:
    """`data` as the log holds it: a CBOR array of integers, without its head."""
    return b"".join(bytes([value]) if value < 24 else bytes([0x18, value]) for value in data)


def replay(log: Path, drone: str) -> int:
    words = [str(find_program("fleet-agent")), "replay", str(log), "--drone", drone]
    return subprocess.run(words, check=False, capture_output=True, timeout=60).returncode


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_on_the_ground(start: Callable[..., Agent], number: signal.Signals) -> None:
    agent = start(free_port())
    began = time.monotonic()
    assert agent.end(number) == 0
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize(
    ("flags", "code", "words"),
    [
        (["--drone", "d 1"], 2, "is not a name"),
        (["--system", "0"], 2, "legal are 1 to 255"),
        (["--mavlink", "udpin:8.8.8.8:1"], 2, "--insecure"),
        (["--zenoh", "tcp/8.8.8.8:1"], 2, "--insecure"),
        (["--config", "/nonexistent.toml"], 2, "/nonexistent.toml"),
        (["--record", "/nonexistent/x.mcap"], 4, "/nonexistent/x.mcap"),
    ],
)
def test_a_users_mistake_is_one_line(flags: list[str], code: int, words: str) -> None:
    base = ["--drone", "d1"] if "--drone" not in flags else []
    mavlink = ["--mavlink", "udpin:127.0.0.1:0"] if "--mavlink" not in flags else []
    run = subprocess.run(
        [str(find_program("fleet-agent")), *base, *mavlink, *flags],
        check=False,
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert run.returncode == code
    assert words in run.stderr
    assert "panicked" not in run.stderr and run.stdout == ""


def test_a_taken_port_is_an_environment_error() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        endpoint = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        words = [str(find_program("fleet-agent")), "--drone", "d1", "--mavlink", endpoint]
        run = subprocess.run(words, check=False, capture_output=True, text=True, timeout=30)
    assert run.returncode == 4
    assert endpoint in run.stderr


def test_an_orphan_ends_by_itself() -> None:
    words = [str(find_program("fleet-agent")), "--drone", "d1", "--zenoh", f"tcp/127.0.0.1:{free_port()}"]
    words += ["--mavlink", "udpin:127.0.0.1:0", "--exit-when-orphaned"]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdin is not None
    assert process.stdout is not None
    assert json.loads(process.stdout.readline())["ready"]
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(timeout=6.0)
    process.stdin.close()
    assert process.wait(timeout=20.0) == 0
    process.stdout.close()
    assert process.stderr is not None
    process.stderr.close()
