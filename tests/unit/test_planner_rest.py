"""Clauses without a normal form: planned by convex steps, proved, or refused by name."""

from __future__ import annotations

import re
import time
from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.certificate import verify
from fleet.errors import InfeasibleError
from fleet.planner import PlanResult, plan
from fleet.planner.signals import Signals
from fleet.planner.spec import Rest, negation_normal
from fleet.planner.witness import choose, spaced
from fleet.scenario import Scenario, load
from tests.unit.test_planner_nlp import SAMPLE, WIRE, random_formula

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SECONDS = 10.0
"""CPU time far above what a plan takes, 0.2 to 1 s."""


def mission(tmp_path: Path, *clauses: str, T: float = 60.0) -> Scenario:
    """`power_tower` with these clauses beside safety, separation and home."""
    always = (
        "@safe always[0,T] all d: d in workspace and d outside obstacles",
        "@apart always[0,T] all d != e: dist(d,e) >= delta_min",
        "@home eventually[2T/3,T] all d: d in home",
    )
    text = (SCENARIOS / "power_tower.toml").read_text()
    formula = "\n".join((*always, *clauses))
    text, count = re.subn(r"\nT = 60.0\n", f'\nT = {T}\nformula = """\n{formula}\n"""\n', text)
    assert count == 1
    path = tmp_path / "mission.toml"
    path.write_text(text)
    return load(path)


def planned(scenario: Scenario) -> PlanResult:
    """The plan, proved again from its bytes, made by convex steps in a few seconds."""
    began = time.process_time()
    result = plan(scenario)
    assert time.process_time() - began < SECONDS
    assert result.method == "convex"
    assert result.rho_lower >= 0.4  # the tube
    assert verify(result.data).ok
    return result


def sampled(result: PlanResult, drone: str, region: str) -> tuple[np.ndarray, np.ndarray]:
    """Times every 10 ms, and whether the drone is in the region then."""
    content = result.plan
    times = np.arange(0.0, content["horizon"], 0.01)
    knots = next(d["trajectory"] for d in content["drones"] if d["id"] == drone)
    shape = next(r["shape"] for r in content["regions"] if r["name"] == region)
    points = np.ascontiguousarray(_core.Trajectory.from_list(knots).sample(times)[:, :3])
    return times, _core.inside(shape, points) > 0


def test_order_of_visits(tmp_path: Path) -> None:
    """But for the order, nothing would take the drone to tr3."""
    clauses = ("@order (not d1 in tr1) until[0,40] d1 in tr3", "@t1 eventually[0,40] d1 in tr1")
    result = planned(mission(tmp_path, *clauses))
    times, first = sampled(result, "d1", "tr3")
    _, second = sampled(result, "d1", "tr1")
    assert times[first].min() < times[second].min() <= 40


def test_order_between_drones(tmp_path: Path) -> None:
    clauses = ("@order d1 outside tr1 until[0,40] d2 in tr2", "@t1 eventually[0,40] d1 in tr1")
    result = planned(mission(tmp_path, *clauses))
    times, first = sampled(result, "d2", "tr2")
    assert times[first].min() < times[sampled(result, "d1", "tr1")[1]].min()


def test_meeting(tmp_path: Path) -> None:
    result = planned(mission(tmp_path, "@meet eventually[0,40] (d1 in tr1 and d2 in tr2)"))
    times, one = sampled(result, "d1", "tr1")
    assert times[one & sampled(result, "d2", "tr2")[1]].min() <= 40


def test_meeting_that_lasts(tmp_path: Path) -> None:
    result = planned(mission(tmp_path, "@stay eventually[0,40] always[0,5] (d1 in tr1 and d2 in tr2)"))
    times, one = sampled(result, "d1", "tr1")
    together = times[one & sampled(result, "d2", "tr2")[1]]
    assert together.max() - together.min() >= 5


def test_proximity(tmp_path: Path) -> None:
    result = planned(mission(tmp_path, "@close always[10,20] dist(d1,d2) <= 12"))
    tracks = [_core.Trajectory.from_list(d["trajectory"]) for d in result.plan["drones"]]
    a, b = (t.sample(np.arange(10, 20, 0.01))[:, :3] for t in tracks)
    assert np.linalg.norm(a - b, axis=1).max() < 12


def test_response(tmp_path: Path) -> None:
    clauses = (
        "@t1 eventually[0,30] d1 in tr1",
        "@answer always[0,50] (d1 in tr1 -> eventually[0,10] d2 in tr2)",
    )
    result = planned(mission(tmp_path, *clauses))
    times, asked = sampled(result, "d1", "tr1")
    answers = times[sampled(result, "d2", "tr2")[1]]
    assert asked.any()
    for t in times[asked & (times <= 50)]:
        assert ((answers >= t - 0.02) & (answers <= t + 10.02)).any()


def test_patrol(tmp_path: Path) -> None:
    clauses = ("@p always[0,50] eventually[0,25] d1 in tr3", "@q always[0,50] eventually[0,25] d1 in tr1")
    result = planned(mission(tmp_path, *clauses, T=90))
    for region in ("tr1", "tr3"):
        times, there = sampled(result, "d1", region)
        gaps = np.diff(np.concatenate([[0.0], times[there]]))
        assert gaps.max() <= 25.02
        assert times[there].max() >= 50


def test_other_branch_where_the_nearer_is_out_of_reach(tmp_path: Path) -> None:
    result = planned(mission(tmp_path, "@either (eventually[0,3] d1 in tr1) or (eventually[0,40] d2 in tr4)"))
    assert result.assignment == {"d1": [], "d2": ["tr4"]}


@pytest.mark.parametrize(
    "clause", ["not ((not d1 in tr3) until[0,40] d1 in tr1)", "d1 in tr3 release[0,40] d1 outside tr1"]
)
def test_release(tmp_path: Path, clause: str) -> None:
    """tr1 is closed to the drone until it has been in tr3."""
    clauses = (f"@r {clause}", "@t1 eventually[0,40] d1 in tr1")
    result = planned(mission(tmp_path, *clauses))
    times, first = sampled(result, "d1", "tr3")
    assert times[first].min() < times[sampled(result, "d1", "tr1")[1]].min()


def test_sum_over_two_drones(tmp_path: Path) -> None:
    result = planned(
        mission(tmp_path, "@t1 eventually[0,40] d1 in tr1", "@low always[5,20] d1.z - d2.z <= 3")
    )
    assert next(c for c in result.plan["clauses"] if c["id"] == "low")["kind"] == "rest"


@pytest.mark.parametrize(
    ("clause", "word"),
    [
        ("@wrong eventually[0,5] (d1 in tr1 and d2 in tr2)", "d1 cannot reach tr1 before 5.0 s"),
        ("@wrong always[0,5] dist(d1,d2) <= 10", "tube"),
        ("@wrong eventually[0,40] (d1 in tr1 and d1 in tr2)", "disjoint"),
    ],
)
def test_refused_by_name(tmp_path: Path, clause: str, word: str) -> None:
    began = time.process_time()
    with pytest.raises(InfeasibleError) as caught:
        plan(mission(tmp_path, clause))
    assert time.process_time() - began < 3 * SECONDS
    assert caught.value.clause == "wrong"
    assert word in str(caught.value)


@pytest.mark.parametrize("seed", range(80))
def test_signals_are_exact_and_duties_are_enough(seed: int) -> None:
    """Every part's signal is the core's; the least of the duties never promises more than the formula."""
    rng = np.random.default_rng(seed)
    formula = negation_normal(random_formula(rng, int(rng.integers(1, 4))))
    trace = np.cumsum(rng.normal(0, 0.5, (2, 24, 3)), axis=1)
    fleet = _core.Fleet(["p", "q"], WIRE)
    signals = Signals(fleet, trace, SAMPLE)
    exact = fleet.robustness(formula, trace, SAMPLE)
    assert signals.of_part(formula)[: len(exact)] == pytest.approx(exact)
    duties = choose([Rest("c", formula)], signals, np.inf)
    least = min(float(signals.of_part(d.predicate)[d.first : d.last + 1].min()) for d in duties)
    assert least <= exact[0] + 1e-9


@pytest.mark.parametrize("seed", range(120))
def test_duties_of_past_operators_are_enough(seed: int) -> None:
    """Over intervals late enough to have a past, and at the start, where windows are cut at time 0."""
    rng = np.random.default_rng(seed)
    inner = random_formula(rng, int(rng.integers(1, 3)), past=True)
    back = ("once", "historically", "since")[seed % 3]
    window = {"from": SAMPLE * (seed % 2), "to": SAMPLE * 4}
    f: dict = {"op": back, **window, "left": random_formula(rng, 1, past=True), "right": inner, "f": inner}
    for key in ("f",) if back == "since" else ("left", "right"):
        del f[key]
    f = {"op": "not", "f": f} if seed % 5 == 0 else f
    around = ("always", "eventually")[seed % 7 // 4]
    formula = negation_normal({"op": around, "from": SAMPLE * (seed % 4), "to": SAMPLE * 7, "f": f})
    trace = np.cumsum(rng.normal(0, 0.5, (2, 40, 3)), axis=1)
    fleet = _core.Fleet(["p", "q"], WIRE)
    signals = Signals(fleet, trace, SAMPLE)
    exact = fleet.robustness(formula, trace, SAMPLE)
    assert signals.of_part(formula)[: len(exact)] == pytest.approx(exact)
    for sketch in (False, True):
        duties = choose([Rest("c", formula)], signals, np.inf, sketch=sketch)
        values = [float(signals.of_part(d.predicate)[d.first : d.last + 1].min()) for d in duties]
        if exact[0] > -np.inf:  # what lies before the mission cannot be made good by any duty
            assert min(values, default=np.inf) <= exact[0] + 1e-9
        assert all(0 <= d.first <= d.last < trace.shape[1] for d in duties)


@pytest.mark.parametrize(
    ("first", "last", "a", "b"), [(0, 800, 0, 400), (3, 9, 2, 4), (0, 5, 0, 100), (0, 100, 7, 9)]
)
def test_spaced_witnesses_leave_no_window_empty(first: int, last: int, a: int, b: int) -> None:
    """Even with every witness at the early, or every at the late end of where it may be, or in turn."""
    windows = spaced(first, last, a, b)
    assert all(low <= high for low, high in windows)
    for shift in ([0], [1], [0, 1], [1, 0]):
        at = np.array([w[shift[k % len(shift)]] for k, w in enumerate(windows)])
        for t in range(first, last + 1):
            assert ((at >= t + a) & (at <= t + b)).any()
