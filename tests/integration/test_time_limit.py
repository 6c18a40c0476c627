"""`fleet plan --time-limit`, and Ctrl-C at many moments of it: what was found is kept, whole and proved."""

import signal
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from tests.integration.conftest import SCENARIOS, Answer, finish, start

CROSSING = str(SCENARIOS / "crossing.toml")
PLAN = "x.plan.cbor"


def assert_kept(answer: Answer, folder: Path) -> None:
    """A plan was kept: it is in the file, the answer tells of it, and it holds."""
    answer.assert_no_traceback()
    assert answer.code == 0, answer.err
    assert answer.json["exit"] == 0
    assert answer.json["errors"] == []
    history = answer.json["history"]
    assert history[-1]["rho"] == answer.json["rho"]
    assert history[-1]["int_a2"] == answer.json["int_a2"]
    for one, after in pairwise(history):
        assert one["t"] <= after["t"]
        assert round(after["rho"], 3) >= round(one["rho"], 3)
    assert all(one["rho"] >= one["rho_lower"] > 0 for one in history)
    assert 20 < answer.json["memory_mb"] < 2000
    checked = finish(start("verify", PLAN, "--json", cwd=folder))
    assert checked.code == 0, checked.err
    assert checked.json["hash"] == answer.json["hash"]


def assert_nothing(answer: Answer, folder: Path) -> None:
    """Nothing was kept, and nothing lies about."""
    answer.assert_no_traceback()
    assert answer.code == 130, answer.err
    assert answer.json["errors"][0]["code"] == "interrupted"
    assert answer.json["history"] is None
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    ("delay", "number"),
    [(0.0, signal.SIGINT), (0.4, signal.SIGTERM), (0.8, signal.SIGHUP), (2.0, signal.SIGINT)],
)
def test_a_signal_keeps_the_best_plan(tmp_path: Path, delay: float, number: signal.Signals) -> None:
    words = ("plan", CROSSING, "--time-limit", "120", "-o", PLAN, "--json")
    process = start(*words, cwd=tmp_path)
    assert process.stderr is not None
    said = process.stderr.readline()
    assert "rho 0.99" in said, said
    time.sleep(delay)
    process.send_signal(number)
    answer = finish(process, 20.0)
    assert_kept(answer, tmp_path)
    assert answer.json["ended"] == "interrupted"
    assert "interrupted: kept the best plan, rho 0.99" in answer.err


@pytest.mark.parametrize("delay", [0.3, 0.6, 0.8, 0.9, 1.0, 1.2, 1.5])
def test_at_any_moment_all_or_nothing(tmp_path: Path, delay: float) -> None:
    """Without a time limit: a plan in the file and exit 0, or 130 and no file; never in between."""
    process = start("plan", CROSSING, "-o", PLAN, "--json", cwd=tmp_path)
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    answer = finish(process, 20.0)
    if answer.code == 0:
        assert_kept(answer, tmp_path)
        assert answer.json["ended"] in {"first", "interrupted"}
    elif answer.out:
        assert_nothing(answer, tmp_path)
    else:  # before the command had begun
        assert answer.code in {130, -signal.SIGINT}, answer.err
        assert not list(tmp_path.iterdir())


def test_twice_is_once(tmp_path: Path) -> None:
    """An impatient second Ctrl-C does not lose what the first one has kept."""
    process = start("plan", CROSSING, "--time-limit", "120", "-o", PLAN, "--json", cwd=tmp_path)
    assert process.stderr is not None
    process.stderr.readline()
    for _ in range(3):
        process.send_signal(signal.SIGINT)
        time.sleep(0.01)
    assert_kept(finish(process, 20.0), tmp_path)


def test_a_time_limit(fleet: Callable[..., Answer], tmp_path: Path) -> None:
    begin = time.monotonic()
    answer = fleet("plan", CROSSING, "--time-limit", "2", "-o", PLAN, "--json")
    assert time.monotonic() - begin < 25.0
    assert_kept(answer, tmp_path)
    assert answer.json["ended"] == "time_limit"
    assert "first plan after" in answer.err
    assert "the time limit has passed" in answer.err


def test_too_little_time(fleet: Callable[..., Answer], tmp_path: Path) -> None:
    answer = fleet("plan", CROSSING, "--time-limit", "0.001", "-o", PLAN, "--json")
    answer.assert_no_traceback()
    assert answer.code == 3
    assert answer.json["errors"][0]["code"] == "time_limit"
    assert "no plan within 0.001 s" in answer.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("limit", ["0", "-1", "nan", "inf", "1e9"])
def test_a_time_limit_that_is_none(fleet: Callable[..., Answer], limit: str) -> None:
    answer = fleet("plan", CROSSING, "--time-limit", limit, "--json")
    answer.assert_no_traceback()
    assert answer.code == 2
    assert answer.json["errors"][0]["field"] == "--time-limit"
    assert "legal is above 0 up to 86400 s" in answer.err
