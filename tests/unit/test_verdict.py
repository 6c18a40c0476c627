"""The verdict on flights whose truth is known, and the files made from them."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from fleet import export, verdict
from fleet.errors import LogError
from fleet.log import read
from fleet.planner import PlanResult, plan
from fleet.report import draw, write
from fleet.scenario import load
from tests.unit.synthetic import write_flight

SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.fixture(scope="module")
def planned() -> PlanResult:
    return plan(load(SCENARIOS / "crossing.toml"))


@pytest.fixture(scope="module")
def perfect(planned: PlanResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(planned.bytes, tmp_path_factory.mktemp("perfect"))


def test_a_perfect_flight_keeps_the_planned_robustness(planned: PlanResult, perfect: Path) -> None:
    judged = verdict.judge(read(perfect))
    assert judged.satisfied
    assert judged.source == "truth"
    assert judged.problems == []
    for clause in judged.clauses:
        assert clause.rho_flown == pytest.approx(clause.rho_planned, abs=2e-3)
    for drone in judged.drones:
        assert drone.max_m is not None and drone.max_m < 1e-6
        assert drone.end == "landed"
        assert drone.gap_max_ms == pytest.approx(10.0, abs=0.1)


def test_a_flight_off_by_more_than_the_margin_is_violated(planned: PlanResult, tmp_path: Path) -> None:
    down = np.array([0.0, 0.0, -2.5])
    path = write_flight(planned.bytes, tmp_path, lambda drone, t: down if drone == "d2" else down * 0)
    judged = verdict.judge(read(path))
    assert not judged.satisfied
    assert judged.rho_flown is not None and judged.rho_flown < 0.0
    worst = {d.id: d.max_m for d in judged.drones}
    assert worst["d1"] == pytest.approx(0.0, abs=1e-6)
    assert worst["d2"] == pytest.approx(2.5)


def test_a_drone_that_did_not_land_spoils_the_mission(planned: PlanResult, tmp_path: Path) -> None:
    judged = verdict.judge(read(write_flight(planned.bytes, tmp_path, landed=False)))
    assert not judged.satisfied
    assert any("did not land" in problem for problem in judged.problems)


def test_pairs_are_judged_on_the_flight_not_the_plan(planned: PlanResult, tmp_path: Path) -> None:
    flight = planned.plan
    starts = {d["id"]: np.array(d["trajectory"][0]["p"]) for d in flight["drones"]}
    across = starts["d1"] - starts["d2"]

    def shift(drone: str, t: float) -> np.ndarray:
        # d2 sits half a metre from where d1 starts, before the mission begins.
        return across + np.array([0.5, 0.0, 0.0]) if drone == "d2" and t < 0.0 else np.zeros(3)

    judged = verdict.judge(read(write_flight(planned.bytes, tmp_path, shift)))
    assert any("d1 and d2 came within 0.50 m" in problem for problem in judged.problems)
    assert not judged.satisfied


def test_report_stands_alone_and_names_every_clause(perfect: Path, tmp_path: Path) -> None:
    flight = read(perfect)
    page = tmp_path / "report.html"
    write(flight, verdict.judge(flight), page)
    text = page.read_text(encoding="utf-8")
    assert "Mission satisfied" in text
    for clause in flight.plan["clauses"]:
        assert f"<td>{clause['id']}</td>" in text
    # Nothing is loaded from elsewhere: plotly's own code is inside, and there is no other script or style.
    assert "<script src" not in text
    assert "<link" not in text
    picture = tmp_path / "flight.png"
    draw(flight, picture)
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_export_has_plan_and_truth_at_the_asked_rate(perfect: Path, tmp_path: Path) -> None:
    flight = read(perfect)
    out = tmp_path / "flight.csv"
    count = export.write(out, export.flight_rows(flight, 20.0))
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == count
    assert list(rows[0]) == export.COLUMNS
    plan_rows = [r for r in rows if r["source"] == "plan" and r["drone"] == "d1"]
    assert len(plan_rows) == round(flight.plan["horizon"] * 20) + 1
    truth = {r["t"]: r for r in rows if r["source"] == "truth" and r["drone"] == "d1"}
    for row in plan_rows:
        assert float(truth[row["t"]]["px"]) == pytest.approx(float(row["px"]), abs=1e-5)


def test_merged_log_carries_scene_and_plans_for_foxglove(perfect: Path) -> None:
    from mcap.reader import make_reader

    with perfect.open("rb") as stream:
        reader = make_reader(stream)
        schemas = {c.topic: s.name for s, c, _ in reader.iter_messages() if s is not None}
    assert schemas["/scene"] == "foxglove.SceneUpdate"
    assert schemas["/d1/plan"] == "foxglove.PosesInFrame"
    assert schemas["/mission"] == "fleet.Mission"


@pytest.mark.parametrize("content", [None, b"", b"not an mcap file", b"\x89MCAP0\r\n" + b"\x00" * 40])
def test_a_file_that_is_no_log_is_named(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "broken.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(LogError, match=r"broken\.mcap"):
        read(path)


def test_verdict_is_plain_json(perfect: Path) -> None:
    text = json.dumps(verdict.judge(read(perfect)).as_dict(), allow_nan=False)
    assert json.loads(text)["satisfied"] is True
