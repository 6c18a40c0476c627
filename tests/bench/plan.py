"""Planning time and robustness of every method on the shipped scenarios, and of ours on lines.

`process_s` is a whole `fleet plan`, imports included; `plan_s` from after the imports until certified, where
of the two solves of `paper` the better one alone counts (the other is `aside_s`); `cpu_s` and `peak_mb` are
of the whole process. `faster` is how many times `plan_s` of a method is ours; `growth` the exponent of
`plan_s` against drones, fitted over the lines.
"""

import math
import statistics
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from tests.bench.table import ROOT, Run, fleet, publish, timed

#: Cases that every method plans, and how many times faster than `paper` ours has to be.
COMPARED = {"power_tower": 10.0, "power_tower_4": 20.0, "crossing": 10.0}
ALONE = ("hover", "power_tower_solo", "multi_line")
#: How often each method runs; medians are shown. The baselines take seconds to minutes.
REPEATS = {"ours": 5, "paper": 1, "rrt": 1}
#: Towers of the lines (`fleet generate line`, seed 1): 4 to 32 drones.
LINES = (2, 4, 8, 16)
#: Largest exponent of growth.
GROWTH = 1.3


def measure(scenario: Path, method: str, folder: Path) -> dict[str, Any]:
    """Plan one scenario by one method as often as `REPEATS` says; without times where nothing is found."""
    document = tomllib.loads(scenario.read_text())
    choice = () if method == "ours" else ("--method", method)
    target = folder / f"{scenario.stem}-{method}.plan.cbor"
    runs = [timed("plan", str(scenario), "-o", str(target), *choice) for _ in range(REPEATS[method])]
    last = runs[-1].answer
    # 1 is a plan that violates the mission: a result of a baseline, and a defect of ours.
    if runs[-1].code not in ((0,) if method == "ours" else (0, 1, 3)):
        raise SystemExit(f"{scenario.stem} by {method}: exit {runs[-1].code}: {last['errors']}")
    found = last["status"] is not None
    for note in last["notes"] or ():
        print(f"{scenario.stem} by {method}: {note}")
    return {
        "case": scenario.stem,
        "method": method,
        "drones": len(document["drone"]),
        "targets": len(document.get("target", [])),
        "repeats": len(runs),
        "process_s": statistics.median(run.wall_s for run in runs),
        "plan_s": statistics.median(planning(run) for run in runs) if found else None,
        "faster": None,
        "aside_s": last["time_s"].get("aside") if found else None,
        "rho": last["rho"],
        "rho_lower": last["rho_lower"],
        "rho_bound": last["rho_bound"],
        "status": last["status"] or "none found",
        "int_a2": last["int_a2"],
        "cpu_s": statistics.median(run.cpu_s for run in runs),
        "peak_mb": max(run.peak_mb for run in runs),
    }


def planning(run: Run) -> float:
    """Seconds from after the imports until certified."""
    return float(sum(run.answer["time_s"][part] for part in ("route", "build", "solve", "certify")))


def compared(case: str, folder: Path) -> list[dict[str, Any]]:
    """One case by every method, right after one another."""
    rows = [measure(ROOT / "scenarios" / f"{case}.toml", method, folder) for method in REPEATS]
    for row in rows[1:]:
        if row["plan_s"] is not None:
            row["faster"] = row["plan_s"] / rows[0]["plan_s"]
    return rows


def line(towers: int, folder: Path) -> Path:
    """A line of towers as a scenario file."""
    path = folder / f"line_{towers}.toml"
    code, answer = fleet("generate", "line", "--towers", str(towers), "--seed", "1", "-o", str(path))
    if code != 0:
        raise SystemExit(f"{path.name}: exit {code}: {answer['errors']}")
    return path


def growth(rows: list[dict[str, Any]]) -> float:
    """Exponent k of `plan_s = c * drones^k`: the least-squares slope in logarithms."""
    points = [(math.log(r["drones"]), math.log(r["plan_s"])) for r in rows]
    slope, _ = statistics.linear_regression(*zip(*points, strict=True))
    return slope


def judged(value: float, bound: float, *, least: bool) -> str:
    """Whether a figure is within its bound, in words."""
    kept = value >= bound if least else value <= bound
    return f"{'at least' if least else 'at most'} {bound:g} asked: {'kept' if kept else 'NOT KEPT'}"


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        rows = [row for case in COMPARED for row in compared(case, Path(name))]
        rows += [measure(ROOT / "scenarios" / f"{case}.toml", "ours", Path(name)) for case in ALONE]
        lines = [measure(line(towers, Path(name)), "ours", Path(name)) for towers in LINES]
        publish("plan", rows + lines)
    for row in rows:
        if row["method"] == "paper" and row["faster"] is not None:
            asked = judged(row["faster"], COMPARED[row["case"]], least=True)
            other = row["faster"] * row["aside_s"] / row["plan_s"]
            print(
                f"{row['case']}: {row['faster']:.1f} times faster than the paper's formulation ({asked}), "
                f"{other:.1f} times than the other, worse one of its two solves"
            )
    exponent = growth(lines)
    print(f"growth over the lines: drones^{exponent:.2f} ({judged(exponent, GROWTH, least=False)})")
