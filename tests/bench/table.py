"""Printing and writing benchmark rows as docs/design.md says."""

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[2]
SCHEMA = 1
#: Linux counts peak memory in kB (man 2 getrusage).
KILOBYTES_A_MEGABYTE = 1024


def publish(name: str, rows: list[dict[str, Any]]) -> None:
    """Print `rows` as a table and write `target/bench/NAME.json`."""
    table = Table(title=f"{name} (load {os.getloadavg()[0]:.2f} on {os.cpu_count()} cores)")
    for column in rows[0]:
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(*(_cell(v) for v in row.values()))
    Console(file=sys.stdout, width=170).print(table)
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


def _cell(value: object) -> str:
    """A value of a row for people."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
    return str(value)


def _cpu() -> str:
    """Model name of the processor where Linux tells it, else the architecture."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


@dataclass(frozen=True)
class Run:
    """One `fleet` command: exit code, the object it printed, wall and CPU time [s], peak memory [MB]."""

    code: int
    answer: dict[str, Any]
    wall_s: float
    cpu_s: float
    peak_mb: float


def timed(*arguments: str) -> Run:
    """Run `fleet ARGUMENTS --json` as a user would, with what the kernel counted for it."""
    command = [str(Path(sys.executable).with_name("fleet")), *arguments, "--json"]
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        begin = time.perf_counter()
        process = subprocess.Popen(command, stdout=out, stderr=err, cwd=ROOT)
        # Not `wait`: only wait4 tells the usage of this one child.
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - begin
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        printed = out.read()
        if not printed:
            raise SystemExit(f"{' '.join(command)} printed nothing: {err.read().decode()}")
    cpu = usage.ru_utime + usage.ru_stime
    return Run(process.returncode, json.loads(printed), wall, cpu, usage.ru_maxrss / KILOBYTES_A_MEGABYTE)


def fleet(*arguments: str) -> tuple[int, dict[str, Any]]:
    """Run `fleet ARGUMENTS --json` as a user would; exit code and the object it printed."""
    run = timed(*arguments)
    return run.code, run.answer
