"""Missions flown by real processes and in virtual time, through the command line."""

import csv
import hashlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fleet.files import read_plan
from fleet.interrupt import Interrupt
from fleet.processes import Children, find_program
from fleet.world import world_of_plan
from tests.integration.conftest import SCENARIOS, Answer, finish, start

HOVER = str(SCENARIOS / "hover.toml")
# design.md, --json: keys of every answer, and what flights add.
HEAD = ["schema", "command", "scenario", "seed", "exit", "errors"]
FLIGHT = [
    *("log", "report", "verdict", "rho_planned", "rho_flown", "min_pair_m", "sim_s", "wall_s"),
    *("clauses", "drones"),
]
COLUMNS = ["t", "drone", "source", "px", "py", "pz", "vx", "vy", "vz", "ax", "ay", "az"]
CLAUSE = {"id", "text", "kind", "drones", "rho_planned", "rho_lower", "rho_flown", "t_tightest"}
DRONE = {"id", "rmse_m", "max_m", "replans", "end", "energy_J", "min_clearance_m", "gap_max_ms"}
PLAN = [
    *("plan", "hash", "status", "method", "rho", "rho_lower", "rho_bound", "clauses", "assignment"),
    *("events", "time_s", "int_a2", "energy_J", "hover_share", "drones", "conflict"),
    *("relaxed", "notes", "history", "ended", "memory_mb"),
]
Fleet = Callable[..., Answer]


def assert_satisfied(answer: Answer, folder: Path) -> None:
    assert answer.code == 0, answer.err
    found = answer.json
    assert list(found) == HEAD + FLIGHT
    assert (found["scenario"], found["verdict"], found["errors"]) == ("hover", "satisfied", [])
    assert all(set(clause) == CLAUSE and clause["rho_flown"] > 0 for clause in found["clauses"])
    assert found["rho_flown"] == min(clause["rho_flown"] for clause in found["clauses"])
    for drone in found["drones"]:
        assert set(drone) >= DRONE
        assert drone["end"] == "landed"
        # Calm flights track to 0.10 m RMSE and 0.30 m at most.
        assert drone["rmse_m"] <= 0.10
        assert drone["max_m"] <= 0.30
    assert (folder / found["log"]).is_file()
    assert (folder / found["report"]).read_text().lower().startswith("<!doctype html>")


def test_a_plan_has_its_keys_and_verifies(fleet: Fleet, tmp_path: Path) -> None:
    planned = fleet("plan", HOVER, "-o", "x.plan.cbor", "--json")
    assert planned.code == 0, planned.err
    assert list(planned.json) == HEAD + PLAN
    payload = (tmp_path / "x.plan.cbor").read_bytes()
    assert planned.json["hash"] == hashlib.sha256(payload).hexdigest()
    assert list(tmp_path.iterdir()) == [tmp_path / "x.plan.cbor"]
    again = fleet("plan", HOVER, "-o", "y.plan.cbor", "--json")
    assert (tmp_path / "y.plan.cbor").read_bytes() == payload
    assert again.json["hash"] == planned.json["hash"]
    proof = fleet("verify", "x.plan.cbor", "--json")
    assert (proof.code, proof.json["verdict"], proof.json["hash"]) == (0, "satisfied", planned.json["hash"])
    assert proof.json["rho"] == planned.json["rho"]


def test_a_flight_in_real_time(tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    process = start("fly", HOVER, "--connect", endpoint, "--run-dir", "run", "--json", cwd=tmp_path)
    assert_satisfied(finish(process, 90.0), tmp_path)


def test_a_flight_in_virtual_time_is_the_same_twice(fleet: Fleet, tmp_path: Path) -> None:
    answers = [fleet("simulate", HOVER, "--run-dir", name, "--json") for name in ("a", "b")]
    for answer in answers:
        assert_satisfied(answer, tmp_path)
    logs = [tmp_path / name / "parts" / "virtual.mcap" for name in ("a", "b")]
    assert logs[0].read_bytes() == logs[1].read_bytes()
    assert answers[0].json["rho_flown"] == answers[1].json["rho_flown"]


def test_a_log_is_judged_reported_and_exported_alone(fleet: Fleet, tmp_path: Path) -> None:
    flown = fleet("simulate", HOVER, "--run-dir", "run", "--json")
    judged = fleet("verify", "run/flight.mcap", "--json")
    assert judged.code == 0, judged.err
    assert judged.json["rho"] == flown.json["rho_flown"]
    reported = fleet("report", "run/flight.mcap", "-o", "other.html", "--json")
    assert (reported.code, reported.json["report"]) == (0, "other.html")
    exported = fleet("export", "run/flight.mcap", "--hz", "10", "--csv", "flight.csv", "--json")
    assert exported.code == 0, exported.err
    with (tmp_path / "flight.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == exported.json["rows"]
    assert list(rows[0]) == COLUMNS
    assert {row["source"] for row in rows} == {"plan", "est", "truth"}


def test_a_run_folder_in_use_is_refused(fleet: Fleet, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "mine").write_text("keep")
    answer = fleet("simulate", HOVER, "--run-dir", "run", "--json")
    assert (answer.code, answer.json["errors"][0]["field"]) == (2, "--run-dir")
    assert (tmp_path / "run" / "mine").read_text() == "keep"


@pytest.fixture
def vehicle(fleet: Fleet, router: str, tmp_path: Path) -> Iterator[Path]:
    """A vehicle with its agent, as on a real drone: nobody has started them for a flight. Its recording."""
    assert fleet("plan", HOVER, "-o", "x.plan.cbor").code == 0
    (tmp_path / "world.toml").write_text(world_of_plan(read_plan(tmp_path / "x.plan.cbor").plan))
    with Children(Interrupt()) as children:
        words = [str(find_program("fleet-sim")), "run", "--config", str(tmp_path / "world.toml")]
        sim = children.start("fleet-sim", words, tmp_path / "sim.stderr")
        (one,) = sim.ready(10.0)["vehicles"]
        recording = tmp_path / "d1.mcap"
        words = [str(find_program("fleet-agent")), "--drone", "d1", "--zenoh", router]
        words += ["--mavlink", f"udpout:{one['mavlink']}", "--system", str(one["system"])]
        words += ["--record", str(recording), "--state-dir", str(tmp_path / "state"), "--exit-when-landed"]
        children.start("fleet-agent", words, tmp_path / "d1.stderr").ready(10.0)
        yield recording


def test_a_vehicle_that_runs_already(fleet: Fleet, vehicle: Path, router: str, tmp_path: Path) -> None:
    busy = fleet("fly", "x.plan.cbor", "--connect", router, "--json")
    assert (busy.code, busy.json["errors"][0]["code"]) == (4, "busy")
    refused = fleet("resume", "d1", "--connect", router, "--json")
    assert (refused.code, refused.json["drones"]) == (4, [{"id": "d1", "accepted": False}])
    assert refused.json["errors"][0]["code"].startswith("rejected_")
    words = ("fly", "x.plan.cbor", "--no-sim", "--connect", router, "--run-dir", "run", "--json")
    process = start(*words, "--part", str(vehicle), cwd=tmp_path)
    assert process.poll() is None
    answer = finish(process, 90.0)
    assert_satisfied(answer, tmp_path)


def test_hold_and_resume_from_another_terminal(tmp_path: Path, endpoint: str, nothing_left: None) -> None:
    process = start("fly", HOVER, "--connect", endpoint, "--run-dir", "run", "--json", cwd=tmp_path)
    assert process.stderr is not None
    said = []
    try:
        for line in process.stderr:
            said.append(line)
            if "takeoff -> track" in line:
                break
        for command in ("hold", "resume", "land"):
            done = finish(start(command, "d1", "--connect", endpoint, "--json", cwd=tmp_path), 20.0)
            assert (done.code, done.json["drones"]) == (0, [{"id": "d1", "accepted": True}]), done.err
    finally:
        if process.poll() is None and len(said) < 3:
            process.terminate()
    out, err = process.communicate(timeout=60.0)
    assert "track -> hold" in err
    assert "hold -> track" in err or "hold -> replan" in err
    assert "-> land" in err
    answer = Answer(process.returncode, out, err)
    # It was landed before the plan's end, so the mission is not satisfied.
    assert (answer.code, answer.json["verdict"]) == (1, "violated")


def test_help_is_quick(tmp_path: Path) -> None:
    begin = time.perf_counter()
    code = (
        "import sys; from fleet.cli.app import run; assert run(['--help']) == 0; print(sorted(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"casadi", "zenoh", "plotly", "scipy", "numpy"} & set(done.stdout.replace("'", "").split(", "))
    # 0.5 s on an idle machine; the modules above are what makes it slow, the time is for the gross case.
    assert time.perf_counter() - begin < 5.0
