"""The shipped missions in virtual time: the real agent, autopilot and plant, judged on ground truth."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fleet.processes import find_program
from tests.integration.conftest import SCENARIOS, Answer

Run = Callable[..., Answer]
Array = NDArray[np.float64]


def simulate(fleet: Run, scenario: Path, run_dir: str = "run") -> tuple[Answer, dict[str, Any]]:
    answer = fleet("simulate", str(scenario), "--run-dir", run_dir, "--json", within=240.0)
    answer.assert_no_traceback()
    return answer, answer.json


@pytest.mark.parametrize("name", ["hover", "power_tower", "power_tower_4", "crossing"])
def test_calm_flights_satisfy_their_mission(name: str, fleet: Run) -> None:
    answer, result = simulate(fleet, SCENARIOS / f"{name}.toml")
    assert answer.code == 0, result
    assert result["verdict"] == "satisfied"
    assert result["rho_flown"] > 0.0
    assert all(clause["rho_flown"] > 0.0 for clause in result["clauses"])
    for drone in result["drones"]:
        assert drone["rmse_m"] <= 0.10, drone
        assert drone["max_m"] <= 0.30, drone
        assert drone["gap_max_ms"] <= 50.0, drone
        assert drone["replans"] == 0, drone
        assert drone["end"] == "landed", drone


def test_gusts_trigger_replans_and_the_drones_rejoin(fleet: Run, tmp_path: Path) -> None:
    answer, result = simulate(fleet, SCENARIOS / "power_tower_gust.toml")
    assert answer.code == 0, result
    rho = {clause["id"]: clause["rho_flown"] for clause in result["clauses"]}
    assert rho["safe"] > 0.0
    assert rho["apart"] > 0.0
    assert [drone["replans"] >= 1 for drone in result["drones"]] == [True, True]
    # Rejoined: from the last rejoin to the end of the mission each drone is on the fleet plan again.
    from fleet.log import read
    from fleet.verdict import plan_positions, positions_at

    flight = read(Path(result["log"]) if Path(result["log"]).is_absolute() else tmp_path / result["log"])
    for drone, log in flight.drones.items():
        rejoins = [n["t_rejoin"] for n in log.replans if n["outcome"] == "committed"]
        times = log.truth[(log.truth[:, 0] > max(rejoins) + 2.0) & (log.truth[:, 0] < 60.0), 0]
        away = positions_at(log.truth, times) - plan_positions(flight.plan, drone, times)
        assert float((away**2).sum(axis=1).max()) ** 0.5 < 0.3


# What a tick of 10 ms may change, at a splice as anywhere in a gust: the acceleration that is asked for
# [m/s^2], and body rates [rad/s] (the controller feeds jerk forward at no more than 60 m/s^4).
ACCELERATION_STEP = 0.10
RATE_STEP = 0.10


def test_a_replan_is_spliced_without_a_jump(fleet: Run, tmp_path: Path) -> None:
    from fleet.log import read

    _, result = simulate(fleet, SCENARIOS / "power_tower_gust.toml")
    flight = read(tmp_path / result["log"])
    for drone, log in flight.drones.items():
        splices = [n["t_splice"] for n in log.replans if n["outcome"] == "committed"]
        assert splices
        for splice in splices:
            # The gust still pushes: the demand is far from rest and beyond the plan's own limit.
            times, asked = asked_acceleration(log.state, log.reference, splice)
            assert np.abs(asked).max() > flight.plan["limits"]["a_max"], drone
            steps = np.linalg.norm(np.diff(asked, axis=0), axis=1)
            assert steps.max() <= ACCELERATION_STEP, (drone, splice, times[int(steps.argmax())], steps.max())
            near = np.abs(log.setpoint[:, 0] - splice) < 0.15
            turns = np.abs(np.diff(log.setpoint[near, 1:4], axis=0)).max(axis=1)
            assert turns.max() <= RATE_STEP, (drone, splice, turns.max())


def asked_acceleration(state: Array, reference: Array, around: float) -> tuple[Array, Array]:
    """The controller's demand from what was logged, 0.15 s around a moment: times and (n, 3) [m/s^2].

    Lee 2010, equation 15 with the agent's default gains 4 and 3.6; the integral, which changes by less
    than 0.003 m/s^2 in a tick, is left out.
    """
    state, reference = (rows[np.abs(rows[:, 0] - around) < 0.15] for rows in (state, reference))
    assert np.allclose(state[:, 0], reference[:, 0], atol=1e-6)
    away, drift = reference[:, 1:4] - state[:, 1:4], reference[:, 4:7] - state[:, 4:7]
    return state[:, 0], reference[:, 11:14] + 4.0 * away + 3.6 * drift


def test_gusts_are_sized_to_need_a_replan(fleet: Run, tmp_path: Path) -> None:
    text = (SCENARIOS / "power_tower_gust.toml").read_text()
    assert text.count("enabled = true") == 1
    scenario = tmp_path / "gust_without_replan.toml"
    scenario.write_text(text.replace("enabled = true", "enabled = false"))
    _, result = simulate(fleet, scenario)
    for drone in result["drones"]:
        assert drone["replans"] == 0
        assert 0.6 <= drone["max_plan_m"] <= 0.9, drone


def test_same_seed_gives_the_same_bytes(fleet: Run, tmp_path: Path) -> None:
    logs = []
    for run_dir in ("one", "two"):
        simulate(fleet, SCENARIOS / "hover.toml", run_dir)
        logs.append(sorted((tmp_path / run_dir).rglob("*.mcap")))
    assert [p.name for p in logs[0]] == [p.name for p in logs[1]]
    for one, two in zip(*logs, strict=True):
        assert one.read_bytes() == two.read_bytes(), one.name


def test_a_recorded_inbox_replays_to_the_same_outbox(fleet: Run, tmp_path: Path) -> None:
    _, result = simulate(fleet, SCENARIOS / "crossing.toml")
    log = tmp_path / result["log"]
    for drone in ("d1", "d2"):
        command = [str(find_program("fleet-agent")), "replay", str(log), "--drone", drone]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["equal"] is True


def test_a_changed_inbox_is_noticed(fleet: Run, tmp_path: Path) -> None:
    _, result = simulate(fleet, SCENARIOS / "hover.toml")
    from mcap.reader import make_reader
    from mcap.writer import CompressionType, Writer

    changed = tmp_path / "changed.mcap"
    with (tmp_path / result["log"]).open("rb") as source, changed.open("wb") as target:
        writer = Writer(target, compression=CompressionType.LZ4)
        writer.start()
        channel = writer.register_channel("/d1/inbox", "cbor", 0)
        for index, (_, _, message) in enumerate(make_reader(source).iter_messages(topics=["/d1/inbox"])):
            # The first message is the configuration; the last bytes of a step are its outbox' hash.
            data = message.data if index != 500 else message.data[:-1] + bytes([message.data[-1] ^ 1])
            writer.add_message(channel, message.log_time, data, message.publish_time)
        writer.finish()
    command = [str(find_program("fleet-agent")), "replay", str(changed), "--drone", "d1"]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 1


def test_every_message_of_a_log_fits_its_schema(fleet: Run, tmp_path: Path) -> None:
    from jsonschema import Draft202012Validator
    from mcap.reader import make_reader

    _, result = simulate(fleet, SCENARIOS / "power_tower_gust.toml")
    checked: dict[str, int] = {}
    validators: dict[int, Draft202012Validator] = {}
    with (tmp_path / result["log"]).open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.message_encoding != "json":
                continue
            assert schema is not None, channel.topic
            if schema.id not in validators:
                Draft202012Validator.check_schema(json.loads(schema.data))
                validators[schema.id] = Draft202012Validator(json.loads(schema.data))
            # A hundred of each topic say as much as all thousands.
            checked[channel.topic] = checked.get(channel.topic, 0) + 1
            if checked[channel.topic] <= 100:
                validators[schema.id].validate(json.loads(message.data))
    leaves = {"plan", "state", "truth", "reference", "setpoint", "mode", "replan"}
    wanted = {f"/{drone}/{leaf}" for drone in ("d1", "d2") for leaf in leaves}
    assert wanted | {"/mission", "/event", "/verdict", "/scene"} <= set(checked)
