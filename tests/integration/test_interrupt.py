"""Ctrl-C at every phase: what is kept, what is answered, and that no process and no port stays taken."""

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from queue import Empty, SimpleQueue

import pytest

from tests.integration.conftest import SCENARIOS, Answer, finish, processes_with, start
from tests.integration.test_bad_input import doubles

HOVER = str(SCENARIOS / "hover.toml")


class Flight:
    """A running `fleet fly`, whose stderr can be waited for."""

    def __init__(self, folder: Path, endpoint: str, **extra: str) -> None:
        self.run = folder / "run"
        words = ("fly", HOVER, "--connect", endpoint, "--run-dir", str(self.run), "--json")
        self.process = start(*words, cwd=folder, **extra)
        self.said: list[str] = []
        self._lines: SimpleQueue[str] = SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append(line)
            self._lines.put(line)

    def wait_for(self, words: str, within: float = 60.0) -> None:
        """Until a line of stderr has ``words``."""
        deadline = time.monotonic() + within
        while time.monotonic() < deadline:
            try:
                if words in self._lines.get(timeout=0.2):
                    return
            except Empty:
                assert self.process.poll() is None, "".join(self.said)
        pytest.fail(f"{words!r} did not come: {''.join(self.said)}")

    def interrupt(self, number: signal.Signals = signal.SIGINT) -> None:
        """As the terminal would."""
        self.process.send_signal(number)

    def end(self, within: float) -> Answer:
        """Wait for its end."""
        try:
            self.process.wait(within)
        except subprocess.TimeoutExpired:
            self.process.kill()
            pytest.fail(f"not done within {within} s: {''.join(self.said)}")
        self._reader.join(5.0)
        assert self.process.stdout is not None and self.process.stderr is not None
        out = self.process.stdout.read()
        self.process.stdout.close()
        self.process.stderr.close()
        return Answer(self.process.returncode, out, "".join(self.said))


def until(condition: Callable[[], bool], within: float) -> None:
    deadline = time.monotonic() + within
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def assert_nothing_kept(answer: Answer, flight: Flight) -> None:
    answer.assert_no_traceback()
    assert answer.code == 130, answer.err
    assert answer.json["exit"] == 130
    assert answer.json["errors"][0]["code"] == "interrupted"
    assert not flight.run.exists()


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.15, 0.4, 0.8, 1.2])
def test_at_any_moment_of_the_beginning(
    tmp_path: Path, endpoint: str, nothing_left: None, delay: float
) -> None:
    flight = Flight(tmp_path, endpoint, FLEET_BIN_DIR=str(doubles(tmp_path)))
    time.sleep(delay)
    flight.interrupt()
    answer = flight.end(15.0)
    python_began = "Fatal Python error: init_" not in answer.err
    assert answer.code in {130, -signal.SIGINT} or not python_began, answer.err
    assert not flight.run.exists()
    # Before its first own line runs, Python itself ends by the signal, and may say so with a traceback.
    if answer.code == 130:
        answer.assert_no_traceback()


@pytest.mark.parametrize(
    ("method", "delay"),
    [("nlp", 1.0), ("nlp", 1.5), ("nlp", 2.0), ("nlp", 2.5), ("paper", 3.0), ("paper", 5.0)],
)
def test_while_planning(tmp_path: Path, method: str, delay: float) -> None:
    """Solvers in C must not swallow it: in the middle of IPOPT it was lost, and the command ended with 0."""
    slow = str(SCENARIOS / "power_tower_4.toml")
    process = start("plan", slow, "--method", method, "-o", "x.plan.cbor", "--json", cwd=tmp_path)
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    answer = finish(process, 20.0)
    answer.assert_no_traceback()
    assert answer.code == 130, answer.err
    assert answer.json["errors"][0]["code"] == "interrupted"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_while_waiting_for_agents(
    tmp_path: Path, endpoint: str, nothing_left: None, number: signal.Signals
) -> None:
    flight = Flight(tmp_path, endpoint, FLEET_BIN_DIR=str(doubles(tmp_path)))
    until((flight.run / "parts" / "d1.stderr").exists, 20.0)
    time.sleep(0.5)
    flight.interrupt(number)
    assert_nothing_kept(flight.end(15.0), flight)


def test_armed_on_the_ground(tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    flight = Flight(tmp_path, endpoint)
    flight.wait_for("idle -> armed")
    flight.interrupt()
    assert_nothing_kept(flight.end(20.0), flight)


def test_once_in_the_air_lands_and_keeps_the_log(tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    flight = Flight(tmp_path, endpoint)
    flight.wait_for("takeoff -> track")
    flight.interrupt()
    answer = flight.end(60.0)
    answer.assert_no_traceback()
    assert answer.code == 1, answer.err
    assert answer.json["verdict"] == "aborted"
    assert "-> land" in answer.err
    assert Path(answer.json["log"]).is_file()
    assert Path(answer.json["report"]).is_file()
    assert answer.json["drones"][0]["end"] == "landed"


def test_twice_in_the_air_kills_the_simulation(tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    flight = Flight(tmp_path, endpoint)
    flight.wait_for("takeoff -> track")
    flight.interrupt()
    time.sleep(0.5)
    flight.interrupt()
    assert_nothing_kept(flight.end(10.0), flight)


def test_an_agent_that_dies_in_the_air(tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    flight = Flight(tmp_path, endpoint)
    flight.wait_for("armed -> takeoff")
    (agent,) = (
        one for one in processes_with(str(tmp_path)) if "fleet-agent" in one and "fly" not in one.split()
    )
    os.kill(int(agent.split(":")[0]), signal.SIGKILL)
    answer = flight.end(30.0)
    answer.assert_no_traceback()
    assert answer.code == 4, answer.err
    assert "fleet-agent d1 ended in flight (exit code -9)" in answer.json["errors"][0]["message"]
    assert (flight.run / "parts" / "sim.mcap").is_file()


def test_a_dead_ground_station_leaves_a_fleet_that_others_command(
    tmp_path: Path, endpoint: str, nothing_left: None
) -> None:
    flight = Flight(tmp_path, endpoint)
    flight.wait_for("armed -> takeoff")
    flight.process.kill()
    assert flight.end(5.0).code == -signal.SIGKILL
    status = finish(start("status", "--connect", endpoint, "--json", cwd=tmp_path), 15.0)
    assert status.code == 0, status.err
    assert status.json["drones"][0]["mode"] == "takeoff"
    landed = finish(start("land", "d1", "--connect", endpoint, "--json", cwd=tmp_path), 15.0)
    assert landed.code == 0, landed.err
    assert landed.json["drones"] == [{"id": "d1", "accepted": True}]
    # Agent and simulator end by themselves after landing, then the router when nobody is connected.
    until(lambda: not processes_with(str(tmp_path)) and not processes_with(endpoint), 60.0)


def test_virtual_flight(tmp_path: Path) -> None:
    words = ("simulate", HOVER, "--run-dir", str(tmp_path / "run"), "--json")
    process = start(*words, cwd=tmp_path, FLEET_BIN_DIR=str(doubles(tmp_path)))
    until((tmp_path / "run" / "parts" / "sim.stderr").exists, 20.0)
    process.send_signal(signal.SIGINT)
    answer = finish(process, 15.0)
    answer.assert_no_traceback()
    assert answer.code == 130
    assert not (tmp_path / "run").exists()
    assert not processes_with(str(tmp_path))
