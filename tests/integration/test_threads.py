"""A virtual flight gives the same log on any number of threads."""

from __future__ import annotations

import hashlib
import json
import subprocess
from pathlib import Path

from fleet.generate import line
from fleet.planner import plan
from fleet.processes import find_program
from fleet.scenario import load
from fleet.world import world_config


def test_the_log_does_not_depend_on_the_threads(tmp_path: Path) -> None:
    source = tmp_path / "line.toml"
    source.write_text(
        line(2, 1).replace(
            "[[obstacle]]", "[wind]\nvelocity = [3.0, 1.0, 0.0]\nturbulence = 3.0\n\n[[obstacle]]", 1
        )
    )
    scenario = load(source)
    world, mission = tmp_path / "world.toml", tmp_path / "line.plan.cbor"
    world.write_text(world_config(scenario))
    mission.write_bytes(plan(scenario).bytes)
    digests = []
    for threads in ("1", "2", "3"):
        log = tmp_path / f"{threads}.mcap"
        files = ["--config", str(world), "--plan", str(mission), "--log", str(log)]
        command = [str(find_program("fleet-sim")), "virtual", *files, "--threads", threads]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
        assert json.loads(done.stdout.splitlines()[-1])["end"] == dict.fromkeys(
            ("d1", "d2", "d3", "d4"), "landed"
        )
        digests.append(hashlib.sha256(log.read_bytes()).hexdigest())
    assert len(set(digests)) == 1
