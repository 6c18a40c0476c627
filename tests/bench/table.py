"""Printing and writing benchmark rows as docs/design.md says."""

import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[2]
SCHEMA = 1


def publish(name: str, rows: list[dict[str, Any]]) -> None:
    """Print `rows` as a table and write `target/bench/NAME.json`."""
    table = Table(title=f"{name} (load {os.getloadavg()[0]:.2f} on {os.cpu_count()} cores)")
    for column in rows[0]:
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(*(f"{v:.3f}" if isinstance(v, float) else str(v) for v in row.values()))
    Console(file=sys.stdout, width=140).print(table)
    git = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.strip()
    machine = {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
    }
    folder = ROOT / "target" / "bench"
    folder.mkdir(parents=True, exist_ok=True)
    document = {"schema": SCHEMA, "git": git, "machine": machine, "rows": rows}
    (folder / f"{name}.json").write_text(json.dumps(document, indent=1) + "\n")


def _cpu() -> str:
    """Model name of the processor where Linux tells it, else the architecture."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def fleet(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Run `fleet ARGUMENTS --json` as a user would; exit code and the object it printed."""
    command = [str(Path(sys.executable).with_name("fleet")), *arguments, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    if not done.stdout:
        raise SystemExit(f"{' '.join(command)} printed nothing: {done.stderr}")
    return done.returncode, json.loads(done.stdout)
