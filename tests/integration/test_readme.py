"""The README's commands, run as a reader would type them."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.integration.conftest import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[list[str]]:
    """Lines of each fenced block of a language, comments and blank lines left out."""
    found = re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    return [
        [line.split("  #")[0].rstrip() for line in block.splitlines() if line and not line.startswith("#")]
        for block in found
    ]


def make_targets() -> set[str]:
    text = (ROOT / "Makefile").read_text()
    return set(re.findall(r"^([a-z-]+):", text, re.MULTILINE))


def test_the_make_commands_exist() -> None:
    named = {word for word in re.findall(r"make ([a-z-]+)", README)}
    assert {"setup", "demo", "test", "check"} <= named <= make_targets()


def test_the_tour_runs(tmp_path: Path) -> None:
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    tour = next(block for block in blocks("sh") if any("fleet plan" in line for line in block))
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    for line in tour:
        done = subprocess.run(
            line, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    assert (tmp_path / "tower.csv").read_text().startswith("t,drone,source,px")
    assert (tmp_path / "runs" / "tour" / "flight.html").exists()


def test_every_command_named_exists() -> None:
    words = {line.split()[1] for block in blocks("sh") for line in block if line.startswith("fleet ")}
    assert words
    for word in words:
        done = subprocess.run(
            [sys.executable, "-m", "fleet", word, "--help"], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, word
        assert "Example" in done.stdout, word


@pytest.mark.parametrize("block", range(len(blocks("toml"))))
def test_toml_examples_are_toml(block: int) -> None:
    import tomllib

    text = re.findall(r"^\s*```toml\n(.*?)^\s*```", README, re.MULTILINE | re.DOTALL)[block]
    assert tomllib.loads(text)
