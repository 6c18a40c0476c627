"""Smooth robustness against the exact one of the core, and on symbols against numbers."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from fleet.planner.algebra import TIP, Score, Symbols
from fleet.planner.smooth import NEVER, Smooth, leaves, smooth_robustness
from tests.unit.test_robustness_oracle import (
    DRONES,
    FLEET,
    REGIONS,
    SAMPLE,
    Array,
    Formula,
    formulas,
    horizon,
    random_walk,
    whole_language,
)

FACES = {name: np.array([[*a, b] for a, b in faces]) for name, faces in REGIONS.items()}
sharpness = st.floats(-3.0, 6.0).map(lambda power: 10.0**power)
walks = st.integers(0, 2**32 - 1)


def smooth(f: Formula, x: Array, c: float, score: Score) -> float:
    return smooth_robustness(f, DRONES, x, FACES, SAMPLE, c, score)


def trace(f: Formula, walk: int, scale: float = 1.0) -> Array:
    return scale * random_walk(horizon(f) + 1, walk)


def expression(f: Formula, length: int, c: float, score: Score) -> Any:
    """The evaluator on symbols, as a function of positions (d n, 3), one drone below the other."""
    x = ca.MX.sym("x", len(DRONES) * length, 3)
    columns = {name: x[d * length : (d + 1) * length, :] for d, name in enumerate(DRONES)}
    value = Smooth(columns, FACES, SAMPLE, Symbols(score, c)).at_start(f)
    return ca.Function("rho", [x], [value, ca.gradient(value, x)])


@seed(1)
@settings(max_examples=300, deadline=None)
@given(formulas, walks, sharpness, st.sampled_from([1.0, 1e-3, 1e3]))
def test_the_sound_one_is_never_above_the_exact_one(f: Formula, walk: int, c: float, scale: float) -> None:
    x = trace(f, walk, scale)
    exact, _ = FLEET.evaluate(f, x, SAMPLE)
    assert smooth(f, x, c, Score.SOUND) <= exact + 1e-12 * max(1.0, abs(exact))


@seed(2)
@settings(max_examples=300, deadline=None)
@given(formulas, walks, sharpness, st.sampled_from([1.0, 1e-3, 1e3]))
def test_log_sum_exp_is_within_log_m_by_c(f: Formula, walk: int, c: float, scale: float) -> None:
    x = trace(f, walk, scale)
    exact, _ = FLEET.evaluate(f, x, SAMPLE)
    error = abs(smooth(f, x, c, Score.PAPER) - exact)
    assert error <= np.log(leaves(f, FACES, SAMPLE)) / c * (1 + 1e-9) + 1e-12 * max(1.0, abs(exact))


@seed(5)
@settings(max_examples=200, deadline=None)
@given(whole_language, walks, sharpness)
def test_formulas_that_look_back_keep_both_bounds(f: Formula, walk: int, c: float) -> None:
    x = trace(f, walk)
    # Nothing was before sample 0: exact robustness is infinite there, smooth robustness far away.
    exact = float(np.clip(FLEET.evaluate(f, x, SAMPLE)[0], -NEVER, NEVER))
    rounding = 1e-12 * max(1.0, abs(exact))
    assert smooth(f, x, c, Score.SOUND) <= exact + rounding
    error = abs(smooth(f, x, c, Score.PAPER) - exact)
    assert error <= np.log(leaves(f, FACES, SAMPLE)) / c * (1 + 1e-9) + rounding


@seed(3)
@settings(max_examples=150, deadline=None)
@given(formulas, walks)
def test_both_come_near_the_exact_one(f: Formula, walk: int) -> None:
    x = trace(f, walk)
    exact, _ = FLEET.evaluate(f, x, SAMPLE)
    for score in Score:
        assert smooth(f, x, 1e6, score) == pytest.approx(exact, abs=1e-4)


@seed(4)
@settings(max_examples=60, deadline=None)
@given(formulas, walks, sharpness, st.sampled_from(list(Score)))
def test_symbols_and_numbers_agree_and_slopes_are_finite(
    f: Formula, walk: int, c: float, score: Score
) -> None:
    x = trace(f, walk)
    value, slope = expression(f, x.shape[1], c, score)(x.reshape(-1, 3))
    number = smooth(f, x, c, score)
    # Symbols round the tip of a norm.
    tolerance = 10 * TIP if "dist" in str(f) else 1e-9 * max(1.0, abs(number))
    assert float(value) == pytest.approx(number, rel=0, abs=tolerance)
    exact, _ = FLEET.evaluate(f, x, SAMPLE)
    assert score is Score.PAPER or float(value) <= exact + 1e-12 * max(1.0, abs(exact))
    assert np.isfinite(np.asarray(slope)).all()


@pytest.mark.parametrize("score", list(Score))
@pytest.mark.parametrize("c", [1e-3, 1.0, 5.0, 1e3, 1e6])
def test_nothing_overflows_far_away(score: Score, c: float) -> None:
    """A kilometre apart, where exp(c r) would be infinite, values that tie included."""
    x = np.zeros((len(DRONES), 5, 3))
    x[0] += 1e3
    window = {"from": 0.0, "to": 1.0}
    f = {
        "op": "until",
        **window,
        "left": {"op": "dist", "a": "d1", "b": "d2", "cmp": "ge", "value": 3.0},
        "right": {"op": "or", "fs": [{"op": "in", "drone": d, "region": "box"} for d in ("d1", "d2")]},
    }
    value, slope = expression(f, 5, c, score)(x.reshape(-1, 3))
    assert np.isfinite(smooth(f, x, c, score))
    assert float(value) == pytest.approx(smooth(f, x, c, score), rel=1e-6)
    assert np.isfinite(np.asarray(slope)).all()


def test_the_leaves_of_the_unrolled_tree_are_counted() -> None:
    inside = {"op": "in", "drone": "d1", "region": "wedge"}
    apart = {"op": "dist", "a": "d1", "b": "d2", "cmp": "ge", "value": 3.0}
    window = {"from": SAMPLE, "to": 3 * SAMPLE}
    assert leaves(inside, FACES, SAMPLE) == 3
    assert leaves({"op": "always", **window, "f": inside}, FACES, SAMPLE) == 9
    # t' = 1, 2, 3: one right side each, and left sides from 0 to t'.
    until = {"op": "until", **window, "left": apart, "right": inside}
    assert leaves(until, FACES, SAMPLE) == 3 * 3 + (2 + 3 + 4)
    assert leaves({"op": "not", "f": until}, FACES, SAMPLE) == 18
    assert leaves({"op": "implies", "left": apart, "right": until}, FACES, SAMPLE) == 19


def test_the_bound_of_log_sum_exp_is_reached_where_all_leaves_tie() -> None:
    x = np.zeros((len(DRONES), 41, 3))
    f = {"op": "linear", "terms": [{"drone": "d1", "axis": "x", "coef": 1.0}], "constant": 1.0}
    for op, sign in (("always", -1), ("eventually", 1)):
        whole = {"op": op, "from": 0.0, "to": 40 * SAMPLE, "f": f}
        assert smooth(whole, x, 5.0, Score.PAPER) == pytest.approx(1.0 + sign * np.log(41) / 5.0)
        assert smooth(whole, x, 5.0, Score.SOUND) == pytest.approx(1.0 - (op == "always") * np.log(41) / 5.0)
