"""Virtual-time flights of the shipped scenarios against real time."""

import tempfile
import tomllib
from pathlib import Path
from typing import Any

from tests.bench.table import ROOT, fleet, publish

CASES = ("hover", "power_tower", "power_tower_4", "crossing")


def measure(case: str, folder: Path) -> dict[str, Any]:
    """Fly one scenario in virtual time, with its log."""
    scenario = ROOT / "scenarios" / f"{case}.toml"
    drones = len(tomllib.loads(scenario.read_text())["drone"])
    _, result = fleet("simulate", str(scenario), "--run-dir", str(folder / case))
    sim_s, wall_s = result["sim_s"], result["wall_s"]
    return {
        "drones": drones,
        "threads": 1,
        "log": True,
        "sim_s": sim_s,
        "wall_s": wall_s,
        "x_real": sim_s / wall_s,
    }


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        publish("sim", [measure(case, Path(name)) for case in CASES])
