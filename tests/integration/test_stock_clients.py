"""Stock MAVLink clients, unmodified, fly a simulated vehicle as they fly a PX4."""

import asyncio
import itertools
import json
import os
import signal
import subprocess
import time
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from fleet.processes import find_program

# pymavlink chooses the protocol's version when it is imported.
os.environ["MAVLINK20"] = "1"

DEADLINE = 60.0
HEIGHT = 2.0
# Each test's vehicle has a system id of its own.
SYSTEMS = itertools.count(171)


@dataclass(frozen=True)
class Vehicle:
    """A vehicle of a running `fleet-sim run`."""

    system: int
    host: str
    port: int


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Vehicle]:
    """The vehicle of a simulator process of its own, on an ephemeral port; ended by its id."""
    system, folder = next(SYSTEMS), tmp_path
    config = folder / "world.toml"
    config.write_text(
        'seed = 1\nfleet = "fleet"\n'
        f'[[vehicle]]\nid = "d1"\nsystem = {system}\npad = [3.0, -2.0, 0.2]\nmavlink = "127.0.0.1:0"\n'
    )
    with (folder / "sim.err").open("wb") as log:
        process = subprocess.Popen(
            [str(find_program("fleet-sim")), "run", "--config", str(config)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
        )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line, (folder / "sim.err").read_text()
        host, _, port = json.loads(line)["vehicles"][0]["mavlink"].rpartition(":")
        yield Vehicle(system, host, int(port))
        assert process.poll() is None, (folder / "sim.err").read_text()
        process.send_signal(signal.SIGINT)
        assert process.wait(10.0) == 0
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


class Pymavlink:
    """A pilot's script on pymavlink's own connection."""

    def __init__(self, vehicle: Vehicle) -> None:
        from pymavlink import mavutil

        self.util = mavutil
        self.end = time.monotonic() + DEADLINE
        self.link: Any = mavutil.mavlink_connection(
            f"udpout:{vehicle.host}:{vehicle.port}", source_system=245, source_component=190
        )

    def say_hello(self) -> None:
        mav = self.util.mavlink
        self.link.mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def hear(self, kind: str, within: float = 5.0) -> Any:
        """The next message of a kind."""
        message = self.link.recv_match(type=kind, blocking=True, timeout=within)
        assert message is not None, f"no {kind} within {within} s"
        return message

    def acknowledged(self, command: int) -> None:
        ack = self.hear("COMMAND_ACK")
        assert (ack.command, ack.result) == (command, self.util.mavlink.MAV_RESULT_ACCEPTED), ack

    def push(self, thrust: float) -> None:
        """Level body rates and thrust, as the agent sends them: type mask 128."""
        self.link.mav.set_attitude_target_send(
            0, self.link.target_system, 1, 128, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, thrust
        )

    def climb(self, hover: float, seconds: float) -> float:
        """Hold `HEIGHT` by thrust for a while; the height at the end [m].

        The parameter is not quite what this vehicle hovers at, so that it stays above by up to a metre.
        """
        until = time.monotonic() + seconds
        height = 0.0
        while time.monotonic() < until:
            assert time.monotonic() < self.end
            position = self.hear("LOCAL_POSITION_NED")
            height = -position.z
            wanted = max(-5.0, min(2.0, 4.0 * (HEIGHT - height) + 4.0 * position.vz))
            self.push(hover * (1.0 + wanted / 9.81))
        return height


def test_pymavlink_arms_flies_body_rates_and_lands(vehicle: Vehicle) -> None:
    pilot = Pymavlink(vehicle)
    try:
        _pymavlink(pilot, vehicle)
    finally:
        pilot.link.close()


def _pymavlink(pilot: Pymavlink, vehicle: Vehicle) -> None:
    mav, link = pilot.util.mavlink, pilot.link
    pilot.say_hello()
    link.wait_heartbeat(timeout=5.0)
    assert link.target_system == vehicle.system
    assert link.messages["HEARTBEAT"].autopilot == mav.MAV_AUTOPILOT_PX4
    needed = (
        mav.MAV_SYS_STATUS_SENSOR_3D_GYRO
        | mav.MAV_SYS_STATUS_SENSOR_3D_ACCEL
        | mav.MAV_SYS_STATUS_SENSOR_3D_MAG
        | mav.MAV_SYS_STATUS_SENSOR_GPS
        | mav.MAV_SYS_STATUS_PREARM_CHECK
    )
    while pilot.hear("SYS_STATUS").onboard_control_sensors_health & needed != needed:
        assert time.monotonic() < pilot.end, "never healthy"

    link.param_fetch_one("MPC_THR_HOVER")
    hover = pilot.hear("PARAM_VALUE").param_value
    for _ in range(25):
        pilot.push(0.0)
        time.sleep(0.02)
    link.set_mode("OFFBOARD")
    pilot.acknowledged(mav.MAV_CMD_DO_SET_MODE)
    pilot.push(0.0)
    link.arducopter_arm()
    pilot.acknowledged(mav.MAV_CMD_COMPONENT_ARM_DISARM)
    height = pilot.climb(hover, 6.0)
    assert link.motors_armed() and link.flightmode == "OFFBOARD"
    assert HEIGHT - 0.5 < height < HEIGHT + 1.2, height

    link.set_mode("LAND")
    pilot.acknowledged(mav.MAV_CMD_DO_SET_MODE)
    while link.motors_armed():
        assert time.monotonic() < pilot.end, "never disarmed"
        pilot.say_hello()
        pilot.hear("HEARTBEAT")
    assert abs(pilot.hear("LOCAL_POSITION_NED").z) < 0.1


def test_mavsdk_is_healthy_takes_off_flies_body_rates_and_lands(vehicle: Vehicle) -> None:
    async def bounded() -> None:
        async with asyncio.timeout(DEADLINE):
            await _mavsdk(vehicle)

    asyncio.run(bounded())


async def _first(updates: AsyncIterator[Any], wanted: Any) -> Any:
    """The first update that is wanted."""
    async for update in updates:
        if wanted(update):
            return update
    raise AssertionError("the stream ended")


async def _mavsdk(vehicle: Vehicle) -> None:
    from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
    from mavsdk.asyncio.plugins.action import ActionAsync
    from mavsdk.asyncio.plugins.offboard import OffboardAsync
    from mavsdk.asyncio.plugins.param import ParamAsync
    from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
    from mavsdk.plugins.offboard import AttitudeRate

    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    async with Mavsdk(configuration) as mavsdk:
        await mavsdk.add_any_connection(f"udpout://{vehicle.host}:{vehicle.port}")
        system = await mavsdk.first_autopilot(timeout_s=10.0)
        assert system is not None, "no autopilot discovered"
        telemetry, action, offboard = TelemetryAsync(system), ActionAsync(system), OffboardAsync(system)
        await _first(telemetry.subscribe_health_all_ok(), lambda ok: ok)
        await _first(telemetry.subscribe_health(), lambda health: health.is_armable)
        hover = await ParamAsync(system).get_param_float("MPC_THR_HOVER")

        await action.arm()
        await action.takeoff()
        height = telemetry.subscribe_position_velocity_ned()
        await _first(height, lambda at: -at.position.down_m > 1.5 and abs(at.velocity.down_m_s) < 0.2)

        before = (await telemetry.attitude_euler()).yaw_deg
        await offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 30.0, hover))
        await offboard.start()
        await asyncio.sleep(1.0)
        assert await offboard.is_active()
        await offboard.stop()
        turned = ((await telemetry.attitude_euler()).yaw_deg - before + 180.0) % 360.0 - 180.0
        assert 15.0 < turned < 60.0, turned

        await action.land()
        await _first(telemetry.subscribe_armed(), lambda armed: not armed)
        assert abs((await telemetry.position_velocity_ned()).position.down_m) < 0.1
