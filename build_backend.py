"""PEP 517 backend: maturin's, after cargo has built the two binaries that the wheel carries.

maturin packs either a Python extension or binaries, not both; `data` scripts close the gap.
"""

import shutil
import subprocess
from pathlib import Path

import maturin
from maturin import *  # noqa: F403  (the hooks that need nothing of ours)

ROOT = Path(__file__).parent
BINARIES = ("fleet-agent", "fleet-sim")


def _build_binaries() -> None:
    command = ["cargo", "build", "--release", "--locked"]
    for name in BINARIES:
        command += ["-p", name]
    subprocess.run(command, cwd=ROOT, check=True)
    metadata = subprocess.run(
        ["cargo", "metadata", "--format-version", "1", "--no-deps", "--locked"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    import json

    target = Path(json.loads(metadata.stdout)["target_directory"]) / "release"
    scripts = ROOT / "fleet.data" / "scripts"
    shutil.rmtree(scripts, ignore_errors=True)
    scripts.mkdir(parents=True)
    for name in BINARIES:
        shutil.copy2(target / name, scripts / name)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Build binaries, then the wheel."""
    _build_binaries()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """Build binaries, then the editable wheel."""
    _build_binaries()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)
