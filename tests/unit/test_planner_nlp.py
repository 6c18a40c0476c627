"""The nonlinear reference against the convex steps, and the smooth evaluator against the exact one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fleet import _core
from fleet.certificate import verify
from fleet.planner import plan
from fleet.planner.smooth import NEVER, smooth_robustness
from fleet.scenario import load

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SAMPLE = 0.5


@pytest.mark.parametrize("name", ["hover", "crossing", "power_tower"])
def test_reference_and_convex_steps_agree(name: str) -> None:
    scenario = load(SCENARIOS / f"{name}.toml")
    fast, reference = plan(scenario, method="convex"), plan(scenario, method="nlp")
    assert (fast.method, reference.method) == ("convex", "nlp")
    assert fast.rho == pytest.approx(reference.rho, abs=0.02)
    assert reference.rho_lower > 0
    assert verify(reference.data).ok


def box(low: list[float], high: list[float]) -> np.ndarray:
    return np.array(
        [[*(s * np.eye(3)[k]), s * (high if s > 0 else low)[k]] for k in range(3) for s in (1, -1)]
    )


REGIONS = {"a": box([-2, -2, -2], [1, 1, 1]), "b": box([0, -1, -1], [3, 2, 2])}
WIRE = [{"name": n, "shape": [{"a": list(f[:3]), "b": f[3]} for f in faces]} for n, faces in REGIONS.items()]


def random_formula(rng: np.random.Generator, depth: int, past: bool = False) -> dict:
    """A random formula over drones p and q with short windows, with past operators or without."""
    if depth == 0:
        drone, region = str(rng.choice(["p", "q"])), str(rng.choice(["a", "b"]))
        return [
            {"op": "in", "drone": drone, "region": region},
            {"op": "outside", "drone": drone, "region": region},
            {"op": "dist", "a": "p", "b": "q", "cmp": str(rng.choice(["ge", "le"])), "value": 2.0},
            {"op": "linear", "terms": [{"drone": drone, "axis": "y", "coef": 1.5}], "constant": 0.3},
        ][int(rng.integers(4))]
    kids = [random_formula(rng, depth - 1, past) for _ in range(2)]
    window = {"from": SAMPLE * int(rng.integers(0, 3)), "to": SAMPLE * int(rng.integers(3, 6))}
    return [
        {"op": "not", "f": kids[0]},
        {"op": "and", "fs": kids},
        {"op": "or", "fs": kids},
        {"op": "implies", "left": kids[0], "right": kids[1]},
        {"op": "always", **window, "f": kids[0]},
        {"op": "eventually", **window, "f": kids[0]},
        {"op": "until", **window, "left": kids[0], "right": kids[1]},
        {"op": "once", **window, "f": kids[0]},
        {"op": "historically", **window, "f": kids[0]},
        {"op": "since", **window, "left": kids[0], "right": kids[1]},
    ][int(rng.integers(10 if past else 7))]


@pytest.mark.parametrize("seed", range(60))
def test_smooth_robustness_is_below_the_exact_one_and_comes_near_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    formula = random_formula(rng, int(rng.integers(1, 4)), past=seed % 3 == 0)
    if seed % 3 == 0:  # late enough to have a past
        formula = {"op": "always", "from": 5 * SAMPLE, "to": 6 * SAMPLE, "f": formula}
    positions = np.cumsum(rng.normal(0, 0.5, (2, 24, 3)), axis=1)
    exact, _ = _core.Fleet(["p", "q"], WIRE).evaluate(formula, positions, SAMPLE)
    exact = np.clip(exact, -NEVER, NEVER)
    loose, sharp = (smooth_robustness(formula, ["p", "q"], positions, REGIONS, SAMPLE, c) for c in (5, 500))
    assert loose <= exact + 1e-9
    assert sharp <= exact + 1e-9
    assert sharp == pytest.approx(exact, abs=0.05)
