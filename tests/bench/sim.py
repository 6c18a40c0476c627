"""Virtual-time flights of fleets of several sizes against real time, by threads, with log and without.

The plans are made first; what is timed is `fleet-sim virtual`: 1 kHz physics, MAVLink encoded and decoded,
agents in the loop.
"""

import json
import statistics
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from fleet import generate
from fleet.planner import plan
from fleet.processes import find_program
from fleet.scenario import load
from fleet.world import world_config
from tests.bench.table import ROOT, publish

#: Shipped scenarios, and towers of lines (two drones each).
SHIPPED, LINES = ("hover", "power_tower"), (5, 32)
THREADS = (1, 2)
#: Repeats of a flight; one of large fleets, which take long.
REPEATS, LARGE = 3, 20


def prepare(folder: Path) -> list[tuple[int, Path, Path]]:
    """Number of drones, world and plan file of every fleet, the smallest first."""
    sources = [ROOT / "scenarios" / f"{case}.toml" for case in SHIPPED]
    for towers in LINES:
        path = folder / f"line_{towers}.toml"
        path.write_text(generate.line(towers, 1))
        sources.append(path)
    fleets = []
    for source in sources:
        scenario = load(source)
        world, file = folder / f"{source.stem}.world.toml", folder / f"{source.stem}.plan.cbor"
        world.write_text(world_config(scenario))
        file.write_bytes(plan(scenario).bytes)
        fleets.append((len(scenario.drones), world, file))
    return fleets


def measure(drones: int, world: Path, file: Path, threads: int, *, log: bool) -> dict[str, Any]:
    """Fly one fleet; the median of its repeats."""
    command = [str(find_program("fleet-sim")), "virtual", "--config", str(world), "--plan", str(file)]
    command += ["--threads", str(threads), *(["--log", str(file.with_suffix(".mcap"))] if log else [])]
    walls, sim_s = [], 0.0
    for _ in range(REPEATS if drones < LARGE else 1):
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        last = json.loads(done.stdout.splitlines()[-1])
        if set(last["end"].values()) != {"landed"}:
            raise SystemExit(f"{world.stem}: not every drone landed: {last['end']}")
        walls.append(last["wall_s"])
        sim_s = last["sim_s"]
    wall_s = statistics.median(walls)
    return {
        "drones": drones,
        "threads": threads,
        "log": log,
        "sim_s": sim_s,
        "wall_s": wall_s,
        "x_real": sim_s / wall_s,
    }


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        fleets = prepare(Path(name))
        rows = [measure(*f, threads, log=log) for f in fleets for threads in THREADS for log in (False, True)]
        publish("sim", rows)
