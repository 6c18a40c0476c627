"""The small parts of the ground station: endpoints, worlds, files, signals, views of drones."""

import os
import signal
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet import files
from fleet.endpoint import Endpoint, parse_endpoint
from fleet.errors import InputError
from fleet.interrupt import Interrupt
from fleet.landing import describe
from fleet.scenario import load
from fleet.ship.watch import DroneView
from fleet.simulate import world_config
from fleet.world import FIRST_SYSTEM

SCENARIOS = Path(__file__).parents[2] / "scenarios"


@given(
    st.sampled_from(["tcp", "tls", "udp"]),
    st.sampled_from(["127.0.0.1", "::1", "localhost", "drone-1.local"]),
    st.integers(1, 65535),
)
def test_endpoints_read_back(protocol: str, host: str, port: int) -> None:
    endpoint = Endpoint(protocol, host, port)
    assert parse_endpoint(str(endpoint), field="--connect") == endpoint


@pytest.mark.parametrize(
    "text",
    ["", "tcp", "tcp/", "tcp/host", "tcp/:7447", "tcp/h:0", "tcp/h:65536", "tcp/h:x", "quic/h:1", "h:7447"],
)
def test_what_is_no_endpoint_says_what_is(text: str) -> None:
    with pytest.raises(InputError, match=r"tcp/127\.0\.0\.1:7447") as caught:
        parse_endpoint(text, field="--connect")
    assert caught.value.problems[0].field == "--connect"


def test_loopback() -> None:
    assert all(
        parse_endpoint(f"tcp/{h}:1", field="").is_loopback
        for h in ("127.0.0.1", "127.9.9.9", "localhost", "[::1]")
    )
    assert not any(
        parse_endpoint(f"tcp/{h}:1", field="").is_loopback for h in ("0.0.0.0", "10.0.0.1", "example.org")
    )


def test_the_world_of_a_scenario() -> None:
    scenario = load(SCENARIOS / "power_tower_gust.toml")
    world = tomllib.loads(world_config(scenario))
    assert [one["id"] for one in world["vehicle"]] == [drone.id for drone in scenario.drones]
    assert [one["pad"] for one in world["vehicle"]] == [
        list(map(float, drone.pad)) for drone in scenario.drones
    ]
    systems = [one["system"] for one in world["vehicle"]]
    assert len(set(systems)) == len(systems)
    assert min(systems) == FIRST_SYSTEM > 1
    assert all(one["mavlink"] == "127.0.0.1:0" for one in world["vehicle"])
    assert all(one["params"] == {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 5} for one in world["vehicle"])
    assert [(one["drone"], one["t"], one["duration"]) for one in world["pulse"]] == [
        (one.drone, one.t, one.duration) for one in scenario.disturbances
    ]
    assert [one["name"] for one in world["obstacle"]] == [one.name for one in scenario.obstacles]
    assert (world["seed"], world["fleet"]) == (scenario.mission.seed, scenario.mission.fleet)


def test_the_world_has_the_scenarios_air(tmp_path: Path) -> None:
    air = "[wind]\nvelocity = [3.0, 1.0, 0.0]\nturbulence = 4.0\n"
    gust = "[[gust]]\nt = 10.0\nduration = 2.5\nvelocity = [0.0, 6.0, 0.0]\n"
    path = tmp_path / "windy.toml"
    path.write_text(f"{(SCENARIOS / 'hover.toml').read_text()}\n{air}{gust}")
    world = tomllib.loads(world_config(load(path)))
    assert world["wind"] == {"velocity": [3.0, 1.0, 0.0], "turbulence": 4.0}
    assert world["gust"] == [{"t": 10.0, "duration": 2.5, "velocity": [0.0, 6.0, 0.0]}]


def test_a_failed_write_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.plan.cbor"
    files.write_atomic(path, b"old")

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="No space left"):
        files.write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_first_signal_raises_the_next_are_counted() -> None:
    interrupt = Interrupt()
    before = signal.getsignal(signal.SIGINT)
    with interrupt.installed():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
        assert interrupt.count == 2
    assert signal.getsignal(signal.SIGINT) == before


def test_a_shield_holds_the_signal_to_its_end() -> None:
    interrupt = Interrupt()
    reached = []
    with interrupt.installed(), pytest.raises(KeyboardInterrupt), interrupt.shielded():
        signal.raise_signal(signal.SIGINT)
        reached.append(True)
    assert reached


def test_counting_only_never_raises() -> None:
    interrupt = Interrupt()
    interrupt.count_only()
    with interrupt.installed():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGHUP)
    assert interrupt.count == 2


@pytest.mark.parametrize(
    "mode", ["takeoff", "track", "replan", "hold", "return", "land", "abort", "released"]
)
def test_a_drone_is_down_only_after_it_was_armed(mode: str) -> None:
    view = DroneView("d1")
    assert not view.down
    view.heartbeat = {"mode": "idle", "armed": False}
    assert not view.down
    view.heartbeat, view.was_armed = {"mode": mode, "armed": True}, True
    assert view.airborne
    assert not view.down
    view.heartbeat = {"mode": "idle", "armed": False}
    assert view.down
    assert not view.airborne


def test_every_notice_has_its_words() -> None:
    replan = {
        "kind": "replan",
        "drone": "d1",
        "outcome": "committed",
        "t_event": 12.3,
        "deviation": 0.41,
        "t_rejoin": 15.0,
    }
    assert (
        describe(replan) == "d1: replan committed, 0.41 m off at t = 12.30 s, back on the plan at t = 15.00 s"
    )
    event = {
        "kind": "event",
        "drone": "d2",
        "mission_time": None,
        "what": {"event": "fault", "text": "no GPS"},
        "cause": "x",
    }
    assert describe(event) == "d2: fault no GPS (x)"
    moded = event | {"what": {"event": "mode", "from": "idle", "to": "armed"}, "mission_time": -12.0}
    assert describe(moded) == "d2: idle -> armed at t = -12.00 s (x)"
