"""Planning time and robustness of the shipped scenarios and of lines, process start included.

`growth` is the exponent of planning time against drones, fitted over the lines.
"""

import math
import statistics
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

from tests.bench.table import ROOT, fleet, publish

CASES = ("hover", "power_tower", "power_tower_4", "power_tower_solo", "multi_line", "crossing")
#: Towers of the lines (`fleet generate line`, seed 1): 4 to 32 drones.
LINES = (2, 4, 8, 16)
REPEATS = 5


def measure(scenario: Path, folder: Path) -> dict[str, Any]:
    """Plan one scenario `REPEATS` times; medians. A plan too large for the wire is a row without times."""
    case, document = scenario.stem, tomllib.loads(scenario.read_text())
    walls, plans, last = [], [], {}
    for repeat in range(REPEATS):
        begin = time.perf_counter()
        code, last = fleet("plan", str(scenario), "-o", str(folder / f"{case}-{repeat}.plan.cbor"))
        walls.append(time.perf_counter() - begin)
        if code != 0:
            if last["errors"][0]["code"] != "size":
                raise SystemExit(f"{case}: exit {code}: {last['errors']}")
            break
        spent = last["time_s"]
        plans.append(sum(spent[k] for k in ("route", "build", "solve", "certify")))
    return {
        "case": case,
        "method": last["method"],
        "drones": len(document["drone"]),
        "targets": len(document.get("target", [])),
        "repeats": len(walls),
        "process_s": statistics.median(walls),
        "plan_s": statistics.median(plans) if plans else None,
        "rho": last["rho"],
        "rho_lower": last["rho_lower"],
        "rho_bound": last["rho_bound"],
        "status": last["status"] if plans else "too large",
    }


def line(towers: int, folder: Path) -> Path:
    """A line of towers as a scenario file."""
    path = folder / f"line_{towers}.toml"
    code, answer = fleet("generate", "line", "--towers", str(towers), "--seed", "1", "-o", str(path))
    if code != 0:
        raise SystemExit(f"{path.name}: exit {code}: {answer['errors']}")
    return path


def growth(rows: list[dict[str, Any]]) -> float:
    """Exponent k of `plan_s = c * drones^k`: the least-squares slope in logarithms."""
    points = [(math.log(r["drones"]), math.log(r["plan_s"])) for r in rows if r["plan_s"] is not None]
    slope, _ = statistics.linear_regression(*zip(*points, strict=True))
    return slope


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        shipped = [measure(ROOT / "scenarios" / f"{case}.toml", Path(name)) for case in CASES]
        lines = [measure(line(towers, Path(name)), Path(name)) for towers in LINES]
        publish("plan", shipped + lines)
    print(f"growth over the lines: drones^{growth(lines):.2f}")
