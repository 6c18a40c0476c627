"""Generated lines load, differ by seed only, and keep the reference geometry's room."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fleet.generate import line
from fleet.scenario import Scenario, load


def loaded(folder: Path, towers: int, seed: int) -> Scenario:
    path = folder / f"line_{towers}_{seed}.toml"
    path.write_text(line(towers, seed))
    return load(path)


@pytest.mark.parametrize(("towers", "seed"), [(1, 0), (2, 1), (3, 7), (8, 1), (16, 99), (32, 2**62)])
def test_lines_load_with_two_drones_and_four_targets_a_tower(tmp_path: Path, towers: int, seed: int) -> None:
    scenario = loaded(tmp_path, towers, seed)
    assert (len(scenario.drones), len(scenario.targets)) == (2 * towers, 4 * towers)
    assert (scenario.mission.T, scenario.mission.T_s, scenario.mission.seed) == (60.0, 0.05, seed)
    feet = [o.center[1] for o in scenario.obstacles if o.name.startswith("tower")]
    assert feet == pytest.approx([40.0 * k for k in range(towers)])


@pytest.mark.parametrize("seed", range(20))
def test_every_region_leaves_room_for_the_full_margin(tmp_path: Path, seed: int) -> None:
    """The bound of rho stays at 1 m: a drone in the middle of a region is that far from everything."""
    scenario = loaded(tmp_path, 3, seed)
    for region in (*scenario.targets, *(d.home for d in scenario.drones)):
        assert region.inradius == pytest.approx(1.0)
        assert scenario.workspace.depth(region.center) >= 1.0
        for obstacle in scenario.obstacles:
            # The largest of the distances beyond a face, as the core measures clearance.
            assert np.max(obstacle.A @ region.center - obstacle.b) >= 1.0


def test_headings_look_at_the_own_tower(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, 4, 3)
    for k, target in enumerate(scenario.targets):
        assert target.heading is not None
        away = np.array([0.0, 40.0 * (k // 4)]) - target.center[:2]
        looks = np.array([np.cos(target.heading), np.sin(target.heading)])
        assert looks @ away > 0.999 * np.linalg.norm(away)


def test_the_same_seed_gives_the_same_text_and_another_one_differs() -> None:
    assert line(3, 5) == line(3, 5)
    assert line(3, 5) != line(3, 6)


def test_cables_run_from_tower_to_tower(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, 3, 1)
    spans = [o.vertices[:, 1] for o in scenario.obstacles if o.name.startswith("cable")]
    ends = [(span.min(), span.max()) for span in spans]
    assert ends == [(-9.0, -3.0), (3.0, 37.0), (43.0, 77.0), (83.0, 89.0)]


@pytest.mark.parametrize(("towers", "seed"), [(0, 1), (33, 1), (-1, 1), (1, -1), (1, 2**63)])
def test_what_is_not_legal_is_refused(towers: int, seed: int) -> None:
    with pytest.raises(ValueError, match="legal is"):
        line(towers, seed)


def run(*words: str) -> tuple[int, dict]:
    command = [sys.executable, "-m", "fleet", "generate", "line", *words, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    return done.returncode, json.loads(done.stdout)


def test_command_writes_the_text(tmp_path: Path) -> None:
    code, answer = run("--towers", "2", "--seed", "4", "-o", str(tmp_path / "two.toml"))
    assert code == 0
    assert (answer["drones"], answer["targets"], answer["seed"]) == (4, 8, 4)
    assert Path(answer["file"]).read_text() == line(2, 4)


@pytest.mark.parametrize(
    ("words", "field"),
    [
        (["--towers", "0", "-o", "a.toml"], "--towers"),
        (["--towers", "33", "-o", "a.toml"], "--towers"),
        (["--seed", "-1", "-o", "a.toml"], "--seed"),
        (["-o", "a.json"], "--output"),
        (["-o", "no/such/folder/a.toml"], ""),
    ],
)
def test_command_names_what_is_wrong(words: list[str], field: str) -> None:
    code, answer = run(*words)
    assert code == 2
    assert answer["errors"][0]["field"] == field
