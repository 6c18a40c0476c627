"""What a command does not use it does not import: a plan is there before a plotting library would be."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.integration.conftest import SCENARIOS, environment

#: Slow to import, or large.
HEAVY = {"casadi", "matplotlib", "mcap", "ortools", "pandas", "PIL", "plotly", "rtamt", "zenoh"}
#: Needed to plan, not to explain.
PLANNING = {"clarabel", "lark", "numpy", "scipy"}
POWER_TOWER = str(SCENARIOS / "power_tower.toml")


def imported(folder: Path, *words: str) -> set[str]:
    """Top-level modules that `fleet WORDS` has imported when it ends with 0."""
    code = (
        "import sys\nfrom fleet.cli import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        "print(*sorted({name.split('.')[0] for name in sys.modules}), file=open('modules', 'w'))\n"
    )
    command = [sys.executable, "-c", code, *words]
    done = subprocess.run(
        command, check=False, cwd=folder, env=environment(), capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return set((folder / "modules").read_text().split())


def test_help_imports_nothing_to_plan_with(tmp_path: Path) -> None:
    assert not imported(tmp_path, "--help") & (HEAVY | PLANNING)
    assert not imported(tmp_path, "plan", "--help") & (HEAVY | PLANNING)


@pytest.mark.parametrize(
    "words",
    [("plan", POWER_TOWER), ("plan", POWER_TOWER, "--json"), ("check", POWER_TOWER), ("spec", POWER_TOWER)],
)
def test_planning_imports_what_it_plans_with(tmp_path: Path, words: tuple[str, ...]) -> None:
    found = imported(tmp_path, *words)
    assert "numpy" in found
    assert not found & HEAVY


def test_the_nonlinear_program_imports_casadi_alone(tmp_path: Path) -> None:
    words = ("plan", str(SCENARIOS / "hover.toml"), "--method", "nlp")
    assert imported(tmp_path, *words) & HEAVY == {"casadi"}
