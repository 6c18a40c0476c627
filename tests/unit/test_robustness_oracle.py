"""Exact robustness from Rust against a recursive oracle that reads like the definition (paper, Def. 1)."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fleet import _core
from tests.unit.formulas import horizon as ahead
from tests.unit.formulas import operators

Formula = dict[str, Any]
Array = NDArray[np.float64]

SAMPLE = 0.25
DRONES = ["d1", "d2", "d3"]
# A box, and a wedge whose rows are of unit length.
REGIONS: dict[str, list[tuple[tuple[float, float, float], float]]] = {
    "box": [
        ((1.0, 0.0, 0.0), 2.0),
        ((-1.0, 0.0, 0.0), 1.0),
        ((0.0, 1.0, 0.0), 1.5),
        ((0.0, -1.0, 0.0), 1.5),
        ((0.0, 0.0, 1.0), 3.0),
        ((0.0, 0.0, -1.0), 0.0),
    ],
    "wedge": [((0.6, 0.8, 0.0), 1.0), ((-0.6, 0.0, 0.8), 0.5), ((0.0, -0.8, -0.6), 0.75)],
}
FLEET = _core.Fleet(
    DRONES,
    [{"name": n, "shape": [{"a": list(a), "b": b} for a, b in faces]} for n, faces in REGIONS.items()],
)
AXES = {"x": 0, "y": 1, "z": 2}


def oracle(f: Formula, x: Array, k: int) -> float:
    """Robustness of `f` at sample k of positions x (d, n, 3)."""

    def at(drone: str) -> Array:
        return x[DRONES.index(drone), k]

    def window() -> range:
        return range(k + round(f["from"] / SAMPLE), k + round(f["to"] / SAMPLE) + 1)

    match f["op"]:
        case "in":
            return min(b - np.dot(a, at(f["drone"])) for a, b in REGIONS[f["region"]])
        case "outside":
            return max(np.dot(a, at(f["drone"])) - b for a, b in REGIONS[f["region"]])
        case "dist":
            margin = float(np.linalg.norm(at(f["a"]) - at(f["b"]))) - f["value"]
            return margin if f["cmp"] == "ge" else -margin
        case "linear":
            return sum(t["coef"] * at(t["drone"])[AXES[t["axis"]]] for t in f["terms"]) + f["constant"]
        case "not":
            return -oracle(f["f"], x, k)
        case "and":
            return min(oracle(g, x, k) for g in f["fs"])
        case "or":
            return max(oracle(g, x, k) for g in f["fs"])
        case "implies":
            return max(-oracle(f["left"], x, k), oracle(f["right"], x, k))
        case "always":
            return min(oracle(f["f"], x, j) for j in window())
        case "eventually":
            return max(oracle(f["f"], x, j) for j in window())
        case "until":
            return max(
                min(oracle(f["right"], x, j), *(oracle(f["left"], x, i) for i in range(k, j + 1)))
                for j in window()
            )
    return past(f, x, k)


def past(f: Formula, x: Array, k: int) -> float:
    """Robustness at sample k of what looks back; the past begins at sample 0."""
    window = range(max(0, k - round(f["to"] / SAMPLE)), k - round(f["from"] / SAMPLE) + 1)
    match f["op"]:
        case "once":
            return max((oracle(f["f"], x, j) for j in window), default=-np.inf)
        case "historically":
            return min((oracle(f["f"], x, j) for j in window), default=np.inf)
        case "since":
            return max(
                (
                    min(oracle(f["right"], x, j), *(oracle(f["left"], x, i) for i in range(j, k + 1)))
                    for j in window
                ),
                default=-np.inf,
            )
    raise AssertionError(f["op"])


def horizon(f: Formula) -> int:
    """How many samples ahead a formula looks."""
    return int(ahead(f, SAMPLE))


drones = st.sampled_from(DRONES)
numbers = st.floats(-3.0, 3.0, allow_subnormal=False)
regional = st.fixed_dictionaries(
    {"op": st.sampled_from(["in", "outside"]), "drone": drones, "region": st.sampled_from(list(REGIONS))}
)
pairs = st.permutations(DRONES).flatmap(
    lambda d: st.fixed_dictionaries(
        {
            "op": st.just("dist"),
            "a": st.just(d[0]),
            "b": st.just(d[1]),
            "cmp": st.sampled_from(["ge", "le"]),
            "value": st.floats(0.0, 5.0),
        }
    )
)
terms = st.fixed_dictionaries({"drone": drones, "axis": st.sampled_from(list(AXES)), "coef": numbers})
linear = st.fixed_dictionaries(
    {"op": st.just("linear"), "terms": st.lists(terms, min_size=1, max_size=3), "constant": numbers}
)
windows = st.tuples(st.integers(0, 3), st.integers(0, 4)).map(
    lambda w: {"from": w[0] * SAMPLE, "to": (w[0] + w[1]) * SAMPLE}
)


formulas = st.recursive(
    st.one_of(regional, pairs, linear), lambda inner: operators(inner, windows), max_leaves=5
)
whole_language = st.recursive(
    st.one_of(regional, pairs, linear), lambda inner: operators(inner, windows, past=True), max_leaves=5
)


def random_walk(n: int, seed: int) -> Array:
    """Positions (d, n, 3) [m]."""
    rng = np.random.default_rng(seed)
    return rng.normal(0.0, 1.5, (len(DRONES), 1, 3)) + np.cumsum(
        rng.normal(0, 0.5, (len(DRONES), n, 3)), axis=1
    )


@seed(1)
@settings(max_examples=400, deadline=None)
@given(whole_language, st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_every_formula_has_the_robustness_of_its_definition(f: Formula, extra: int, walk: int) -> None:
    x = random_walk(horizon(f) + extra, walk)
    expected = [oracle(f, x, k) for k in range(extra)]
    np.testing.assert_allclose(FLEET.robustness(f, x, SAMPLE), expected, rtol=0, atol=1e-12)
    rho, t = FLEET.evaluate(f, x, SAMPLE)
    assert rho == pytest.approx(expected[0], abs=1e-12)
    assert 0.0 <= t <= horizon(f) * SAMPLE
    assert FLEET.check(f, SAMPLE) == horizon(f) * SAMPLE


@seed(2)
@settings(max_examples=100, deadline=None)
@given(whole_language, st.integers(0, 2**32 - 1))
def test_one_sample_too_few_is_refused(f: Formula, walk: int) -> None:
    x = random_walk(horizon(f), walk)
    with pytest.raises(ValueError, match="ahead"):
        FLEET.evaluate(f, x, SAMPLE)
    if horizon(f) > 0:
        with pytest.raises(ValueError, match="ahead"):
            FLEET.check(f, SAMPLE, (horizon(f) - 1) * SAMPLE)
    FLEET.check(f, SAMPLE, horizon(f) * SAMPLE)


@seed(3)
@settings(max_examples=100, deadline=None)
@given(st.floats(0.1, 5.0), st.integers(0, 2**32 - 1))
def test_a_long_window_slides_as_it_should(threshold: float, walk: int) -> None:
    x = random_walk(400, walk)
    dist = np.linalg.norm(x[0] - x[1], axis=1)
    f = {"op": "dist", "a": "d1", "b": "d2", "cmp": "ge", "value": threshold}
    got = FLEET.robustness({"op": "always", "from": 5.0, "to": 60.0, "f": f}, x, SAMPLE)
    view = np.lib.stride_tricks.sliding_window_view(dist - threshold, 221)[20:]
    np.testing.assert_allclose(got, view.min(axis=1), rtol=0, atol=1e-12)
    rho, t = FLEET.evaluate({"op": "eventually", "from": 5.0, "to": 60.0, "f": f}, x, SAMPLE)
    assert rho == pytest.approx(view[0].max(), abs=1e-12)
    assert round(t / SAMPLE) == 20 + int(np.argmax(view[0]))


@seed(4)
@settings(max_examples=200, deadline=None)
@given(regional, st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=8))
def test_regions_measure_alike_alone_and_in_formulas(f: Formula, rows: list[tuple[float, ...]]) -> None:
    points = np.array(rows)
    x = np.broadcast_to(points, (len(DRONES), *points.shape))
    measure = _core.inside if f["op"] == "in" else _core.outside
    shape = [{"a": a, "b": b} for a, b in REGIONS[f["region"]]]
    assert np.array_equal(measure(shape, points), FLEET.robustness(f, x, SAMPLE))
