"""Reduced formulas decide as whole ones do; a certificate is the same with and without reducing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.certificate import prove, verify
from fleet.generate import line
from fleet.planner import plan
from fleet.relevance import CUT, Boxes, hull
from fleet.scenario import load

REGIONS = [
    {
        "name": f"r{k}",
        "shape": [
            {"a": [s * float(axis == i) for i in range(3)], "b": s * 6.0 * k * float(axis == 0) + 1.5}
            for axis in range(3)
            for s in (1.0, -1.0)
        ],
    }
    for k in range(4)
]


def tracks(rng: np.random.Generator, drones: int) -> list[_core.Trajectory]:
    """Random flights near one region each."""
    out = []
    for d in range(drones):
        t = np.arange(6.0)[:, None]
        p = rng.normal(0, 1.0, (6, 3)) + np.array([6.0 * (d % 4), 0.0, 0.0])
        rates = rng.normal(0, 0.4, (6, 6))
        out.append(_core.Trajectory(np.hstack([t, p, rates, np.zeros((6, 3))])))
    return out


def predicate(rng: np.random.Generator, names: list[str]) -> dict:
    drone, other = rng.choice(names, 2, replace=False)
    kind = rng.choice(["in", "outside", "dist"])
    if kind == "dist":
        return {
            "op": "dist",
            "a": str(drone),
            "b": str(other),
            "cmp": "ge",
            "value": float(rng.uniform(0, 3)),
        }
    return {"op": str(kind), "drone": str(drone), "region": f"r{rng.integers(4)}"}


def formula(rng: np.random.Generator, names: list[str], depth: int) -> dict:
    if depth == 0:
        return predicate(rng, names)
    op = str(rng.choice(["and", "or", "always", "eventually", "not"], p=[0.35, 0.35, 0.12, 0.12, 0.06]))
    if op in ("and", "or"):
        return {"op": op, "fs": [formula(rng, names, depth - 1) for _ in range(rng.integers(2, 5))]}
    inner = formula(rng, names, depth - 1)
    return {"op": op, "f": inner} if op == "not" else {"op": op, "from": 0.0, "to": 1.0, "f": inner}


@pytest.mark.parametrize("seed", range(60))
def test_values_between_zero_and_the_cut_are_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = ["a", "b", "c", "d"]
    flown = tracks(rng, 4)
    boxes, fleet = Boxes(names, REGIONS, flown), _core.Fleet(names, REGIONS)
    positions = np.stack([np.ascontiguousarray(t.sample(np.arange(51) * 0.1)[:, :3]) for t in flown])
    whole = formula(rng, names, 3)
    reduced = boxes.reduced(whole)
    for value in (
        lambda f: fleet.evaluate(f, positions, 0.1)[0],
        lambda f: fleet.lower_bound(f, flown, 0.1)[0],
    ):
        assert np.clip(value(reduced), 0.0, CUT) == pytest.approx(np.clip(value(whole), 0.0, CUT), abs=1e-3)


def test_random_formulas_are_reduced_and_cover_all_outcomes() -> None:
    outcomes, smaller = set(), 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        names, flown = ["a", "b", "c", "d"], tracks(rng, 4)
        positions = np.stack([np.ascontiguousarray(t.sample(np.arange(51) * 0.1)[:, :3]) for t in flown])
        whole = formula(rng, names, 3)
        rho = _core.Fleet(names, REGIONS).evaluate(whole, positions, 0.1)[0]
        outcomes.add("below" if rho <= 0 else "above" if rho >= CUT else "between")
        smaller += len(repr(Boxes(names, REGIONS, flown).reduced(whole))) < len(repr(whole))
    assert outcomes == {"below", "above", "between"}
    assert smaller > 30


@pytest.mark.parametrize("seed", range(5))
def test_hulls_hold_the_curve(seed: int) -> None:
    (track,) = tracks(np.random.default_rng(seed), 1)
    points = track.sample(np.linspace(0.0, 5.0, 2001))[:, :3]
    low, high = hull(track.knots)
    assert (points >= low - 1e-12).all()
    assert (points <= high + 1e-12).all()


def test_a_line_is_proved_as_by_the_whole_formula(tmp_path: Path) -> None:
    path = tmp_path / "line.toml"
    path.write_text(line(2, 1))
    scenario = load(path)
    result = plan(scenario)
    flown = [_core.Trajectory.from_list(d["trajectory"]) for d in result.plan["drones"]]
    names = [d.id for d in scenario.drones]
    clauses = [(c.id, c.formula) for c in scenario.clauses()]
    proof = prove(names, scenario.regions(), clauses, flown, 60.0, 0.05)
    boxes, fleet = Boxes(names, scenario.regions(), flown), _core.Fleet(names, scenario.regions())
    positions = np.stack([np.ascontiguousarray(t.sample(np.arange(1201) * 0.05)[:, :3]) for t in flown])
    for name, whole in clauses:
        if name != "home":
            assert len(repr(boxes.reduced(whole))) < len(repr(whole))
        assert proof.clauses[name]["rho"] == pytest.approx(
            fleet.evaluate(whole, positions, 0.05)[0], abs=1e-9
        )
        bound = fleet.lower_bound(whole, flown, 0.05)[0]
        assert proof.clauses[name]["rho_lower"] == pytest.approx(bound, abs=1e-4)


def test_a_drone_sent_to_another_tower_is_noticed(tmp_path: Path) -> None:
    """What is left out for the true plan is not left out for a changed one."""
    path = tmp_path / "line.toml"
    path.write_text(line(2, 1))
    content = _core.decode_plan(plan(load(path)).data)
    for knot, other in zip(
        content["drones"][0]["trajectory"], content["drones"][2]["trajectory"], strict=False
    ):
        knot["p"] = [other["p"][0], other["p"][1], other["p"][2] + 1.0]
        knot["v"], knot["a"] = other["v"], other["a"]
    found = verify(content)
    assert not found.ok
    assert found.clauses["apart"]["rho"] < 0
