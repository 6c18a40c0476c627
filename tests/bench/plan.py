"""Planning time and robustness of the shipped scenarios, process start included."""

import statistics
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

from tests.bench.table import ROOT, fleet, publish

CASES = ("hover", "power_tower", "power_tower_4", "power_tower_solo", "multi_line", "crossing")
REPEATS = 5


def measure(case: str, folder: Path) -> dict[str, Any]:
    """Plan one scenario `REPEATS` times; medians."""
    scenario = ROOT / "scenarios" / f"{case}.toml"
    document = tomllib.loads(scenario.read_text())
    walls, plans, last = [], [], {}
    for repeat in range(REPEATS):
        begin = time.perf_counter()
        code, last = fleet("plan", str(scenario), "-o", str(folder / f"{case}-{repeat}.plan.cbor"))
        walls.append(time.perf_counter() - begin)
        if code != 0:
            raise SystemExit(f"{case}: exit {code}: {last['errors']}")
        spent = last["time_s"]
        plans.append(sum(spent[k] for k in ("route", "build", "solve", "certify")))
    return {
        "case": case,
        "method": last["method"],
        "drones": len(document["drone"]),
        "targets": len(document.get("target", [])),
        "repeats": REPEATS,
        "process_s": statistics.median(walls),
        "plan_s": statistics.median(plans),
        "rho": last["rho"],
        "rho_lower": last["rho_lower"],
        "rho_bound": last["rho_bound"],
        "status": last["status"],
    }


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        publish("plan", [measure(case, Path(name)) for case in CASES])
