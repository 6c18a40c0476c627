"""fleet and stlpy on the same missions, both judged by fleet's core. Run it by `make bench-peers`.

The first argument is the Python of the peers' environment (requirements.txt here).
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from fleet.errors import InfeasibleError
from fleet.planner import plan
from fleet.scenario import Scenario, load
from tests.bench.peers import judge
from tests.bench.peers.missions import HEIGHT, flat, own, shipped
from tests.bench.table import ROOT, publish

#: Wall clock that a solver of a peer may take [s], and how much longer its process may live.
LIMIT, GRACE = 60.0, 30.0
#: stlpy's solvers that run without a licence (solve.py), and steps of the shipped missions [s].
METHODS = ("highs-sos1", "highs-micp", "smooth")
SHIPPED = (("crossing", 1.0), ("power_tower", 1.0))
HERE = Path(__file__).parent


def ask(python: str, method: str, mission: dict[str, Any], folder: Path) -> dict[str, Any]:
    """One run of `solve.py` in its own process; a process that lives too long is ended."""
    asked, answer = folder / "mission.json", folder / "answer.json"
    asked.write_text(json.dumps(mission))
    answer.unlink(missing_ok=True)
    command = [python, str(HERE / "solve.py"), method, str(LIMIT), str(asked), str(answer)]
    begin = time.perf_counter()
    try:
        done = subprocess.run(
            command, cwd=HERE, capture_output=True, text=True, timeout=LIMIT + GRACE, check=False
        )
    except subprocess.TimeoutExpired:
        return {"build_s": None, "solve_s": time.perf_counter() - begin, "status": "no end", "x": None}
    if done.returncode != 0:
        raise SystemExit(f"{method}: {done.stderr[-2000:]}")
    found: dict[str, Any] = json.loads(answer.read_text())
    return found


def row(case: str, step: float, solver: str, answer: dict[str, Any], proof: Any) -> dict[str, Any]:
    """One row of the table; times are wall clock."""
    return {
        "case": case,
        "step_s": step,
        "solver": solver,
        "build_s": answer["build_s"],
        "solve_s": answer["solve_s"],
        "status": answer["status"],
        "rho_said": answer.get("rho"),
        "rho": proof.rho if proof else None,
        "rho_lower": proof.rho_lower if proof else None,
    }


def ours(case: str, scenario: Scenario) -> dict[str, Any]:
    """fleet's own row."""
    try:
        found = plan(scenario)
    except InfeasibleError as error:
        print(f"{case}: {error}")
        return row(case, 0.05, "fleet", {"build_s": None, "solve_s": None, "status": "refused"}, None)
    spent = found.timings
    times = {"build_s": spent["route"] + spent["build"], "solve_s": spent["solve"] + spent["certify"]}
    return row(case, 0.05, "fleet", times | {"status": found.status.value, "rho": found.rho}, found)


def flat_rows(python: str, folder: Path) -> list[dict[str, Any]]:
    """stlpy's own scenarios."""
    rows = []
    for name in own():
        rows.append(ours(name, flat(name, folder, homeward=True)))
        scenario = flat(name, folder, homeward=False)
        clauses = [(c.id, c.formula) for c in scenario.clauses()]
        for method in METHODS:
            answer = ask(python, method, {"own": name}, folder)
            proof = None
            if answer["x"] is not None:
                tracks = judge.straight(np.array(answer["x"]), HEIGHT)
                proof = judge.judged(scenario.regions(), clauses, ["d1"], tracks)
            rows.append(row(name, 1.0, f"stlpy {method}", answer, proof))
    return rows


def shipped_rows(python: str, folder: Path) -> list[dict[str, Any]]:
    """Missions of this project, as far as stlpy can state them."""
    rows = []
    for name, dt in SHIPPED:
        scenario = load(ROOT / "scenarios" / f"{name}.toml")
        rows.append(ours(name, scenario))
        clauses = [(c.id, c.formula) for c in scenario.clauses()]
        mission = shipped(name, dt)
        for method in METHODS:
            answer = ask(python, method, mission, folder)
            proof = None
            if answer["x"] is not None:
                tracks = judge.driven(np.array(answer["x"]), dt)
                proof = judge.judged(scenario.regions(), clauses, mission["drones"], tracks)
            rows.append(row(name, dt, f"stlpy {method}", answer, proof))
    return rows


if __name__ == "__main__":
    peers = sys.argv[1]
    with tempfile.TemporaryDirectory() as scratch:
        plan(load(ROOT / "scenarios" / "hover.toml"))  # imports are not part of anybody's time
        publish("peers", flat_rows(peers, Path(scratch)) + shipped_rows(peers, Path(scratch)))
