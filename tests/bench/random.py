"""All random scenarios: who is planned, how fast, whether the independent check agrees, and every refusal
before the oracle (tests/randomised): proved impossible, a plan found by others (a false refusal), or neither.

`--store` writes the opinions on refusals that the tests read.
"""

import argparse
import json
import multiprocessing
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

from fleet.certificate import verify
from fleet.errors import InfeasibleError
from fleet.planner import plan
from fleet.scenario import Scenario, load
from tests.bench.table import publish
from tests.randomised.judge import faults
from tests.randomised.necessary import impossible
from tests.randomised.oracle import opinion, world_of
from tests.randomised.scenario import COUNT, SEED, scenario

STORED = Path(__file__).parents[1] / "randomised" / "refusals.json"


def row(number: int, seconds: float) -> dict[str, Any]:
    """One scenario by its number."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"random_{number}.toml"
        path.write_text(scenario(number))
        out = judged(number, load(path), seconds)
    print(f"{number}: {out['outcome']} in {out['cpu_s']:.1f} s of CPU", flush=True)
    return out


def judged(number: int, loaded: Scenario, seconds: float) -> dict[str, Any]:
    """One scenario: outcome and times [s]; `wrong` is what the independent check found."""
    began, cpu = time.perf_counter(), time.process_time()
    out: dict[str, Any] = {
        "case": number, "drones": len(loaded.drones), "targets": len(loaded.targets),
        "outcome": "planned", "clause": "", "rho_lower": None, "wrong": 0,
    }  # fmt: skip
    found = None
    try:
        found = plan(loaded)
    except InfeasibleError as error:
        out |= {"outcome": "refused", "clause": error.clause}
    out |= {"wall_s": time.perf_counter() - began, "cpu_s": time.process_time() - cpu}
    if found is not None:
        wrong = [*verify(found.data).problems, *faults(found.plan)]
        for fault in wrong:
            print(f"{number}: {fault}", flush=True)
        return out | {"rho_lower": found.rho_lower, "wrong": len(wrong)}
    if impossible(world_of(loaded)):
        return out | {"outcome": "impossible"}
    found_by_others = opinion(loaded, seconds)
    print(f"{number}: refused; the oracle: {found_by_others}", flush=True)
    return out | {"outcome": "false" if found_by_others.verdict == "plan" else "refused"}


def main() -> None:
    """Run the set, or a part of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("numbers", nargs="*", type=int, help="scenarios; all when none is given")
    parser.add_argument("--oracle", type=float, default=60.0, help="wall time of the oracle on a refusal [s]")
    parser.add_argument("--store", action="store_true", help=f"write {STORED.name}")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    given = parser.parse_args()
    with multiprocessing.get_context("spawn").Pool(given.jobs) as pool:
        numbers = given.numbers or range(COUNT)
        rows = list(pool.imap(partial(row, seconds=given.oracle), numbers))
    publish("random", rows)
    count = {name: sum(r["outcome"] == name for r in rows) for name in OUTCOMES}
    print(f"{count}, wrong plans: {sum(r['wrong'] > 0 for r in rows)}")
    if given.store:
        told = {str(r["case"]): r["outcome"] for r in rows if r["outcome"] != "planned"}
        made = f"python -m tests.bench.random --oracle {given.oracle:g} --store, seed {SEED}"
        STORED.write_text(json.dumps({"made": made, "count": len(rows), "refused": told}, indent=1) + "\n")


#: Planned; proved impossible; refused though others found a plan; refused and nobody found one.
OUTCOMES = ("planned", "impossible", "false", "refused")

if __name__ == "__main__":
    main()
