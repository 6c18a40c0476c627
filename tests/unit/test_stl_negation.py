"""Negation and release, anywhere: robustness against what they mean, worked out by hand in Python."""

from __future__ import annotations

import numpy as np
import pytest

from fleet import _core
from fleet.planner.spec import negation_normal
from fleet.stl import Vocabulary, parse
from tests.unit.test_planner_nlp import SAMPLE, WIRE, random_formula

FLEET = _core.Fleet(["p", "q"], WIRE)
WORDS = Vocabulary(("p", "q"), ("a",), ("b",), T=12.0, T_s=SAMPLE, delta_min=1.0)


def trace(seed: int) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(0, 0.5, (2, 25, 3)), axis=1)


@pytest.mark.parametrize("seed", range(60))
def test_negation_turns_the_sign_and_normal_form_keeps_it(seed: int) -> None:
    formula = random_formula(np.random.default_rng(seed), 3, past=seed % 2 == 1)
    exact = FLEET.robustness(formula, trace(seed), SAMPLE)
    turned = FLEET.robustness({"op": "not", "f": formula}, trace(seed), SAMPLE)
    assert turned == pytest.approx(-exact)
    assert FLEET.robustness(negation_normal(formula), trace(seed), SAMPLE) == pytest.approx(exact)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("start", "end"), [(0, 0), (0, 6), (2, 8), (5, 5)])
def test_release_holds_what_it_says(seed: int, start: int, end: int) -> None:
    """At each t' of the window the right side, or the left side at some time from 0 to t'."""
    text = f"p in b release[{start * SAMPLE}, {end * SAMPLE}] q.x - p.y >= 0"
    formula = parse(text, WORDS)[0].formula
    left = FLEET.robustness({"op": "in", "drone": "p", "region": "b"}, trace(seed), SAMPLE)
    right = trace(seed)[1, :, 0] - trace(seed)[0, :, 1]
    wanted = min(max(right[t], left[: t + 1].max()) for t in range(start, end + 1))
    assert FLEET.evaluate(formula, trace(seed), SAMPLE)[0] == pytest.approx(wanted)
