"""PEP 517 backend: maturin's, after cargo has built the two binaries that the wheel carries.

maturin packs either a Python extension or binaries, not both; `data` scripts close the gap.
"""

import json
import shutil
import subprocess
from pathlib import Path

import maturin
from maturin import *  # noqa: F403  (the hooks that need nothing of ours)

ROOT = Path(__file__).parent
SCRIPTS = ROOT / "fleet.data" / "scripts"
BINARIES = ("fleet-agent", "fleet-sim")
Settings = dict[str, object] | None


def _build_binaries() -> None:
    packages = [word for name in BINARIES for word in ("-p", name)]
    subprocess.run(["cargo", "build", "--release", "--locked", *packages], cwd=ROOT, check=True)
    metadata = subprocess.run(
        ["cargo", "metadata", "--format-version", "1", "--no-deps", "--locked"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    target = Path(json.loads(metadata.stdout)["target_directory"]) / "release"
    shutil.rmtree(SCRIPTS, ignore_errors=True)
    SCRIPTS.mkdir(parents=True)
    for name in BINARIES:
        shutil.copy2(target / name, SCRIPTS / name)


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: Settings = None) -> str:
    """Metadata needs the data folder to exist, not yet what is in it."""
    SCRIPTS.mkdir(parents=True, exist_ok=True)
    return str(maturin.prepare_metadata_for_build_wheel(metadata_directory, config_settings))


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


def build_wheel(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Build binaries, then the wheel."""
    _build_binaries()
    return str(maturin.build_wheel(wheel_directory, config_settings, metadata_directory))


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Build binaries, then the editable wheel."""
    _build_binaries()
    return str(maturin.build_editable(wheel_directory, config_settings, metadata_directory))
