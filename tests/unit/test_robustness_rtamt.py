"""Exact robustness from Rust against rtamt, an implementation by others.

Predicates are fed to rtamt as variables that hold their robustness, so that only temporal and Boolean
operators are compared. rtamt's until and since leave out the left side at the switch, ours have it in:
ours `a until b` is rtamt's `a until (a and b)`. Both begin the past at the first sample.
"""

from typing import Any

import numpy as np
import pytest
import rtamt
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fleet import _core
from tests.unit.formulas import horizon as ahead
from tests.unit.formulas import operators

Formula = dict[str, Any]
Array = NDArray[np.float64]

SIGNALS = ["u", "v", "w"]
FLEET = _core.Fleet(SIGNALS, [])
LENGTH = 40


def signal(name: str) -> Formula:
    """The predicate `name.x >= 0`."""
    return {"op": "linear", "terms": [{"drone": name, "axis": "x", "coef": 1.0}], "constant": 0.0}


def text(f: Formula) -> str:
    """The formula in rtamt's language, one sample a second."""
    window = f"[{f['from']},{f['to']}]" if "to" in f else ""
    match f["op"]:
        case "linear":
            return f"({f['terms'][0]['drone']} >= 0)"
        case "not":
            return f"(not {text(f['f'])})"
        case "and" | "or":
            return "(" + f" {f['op']} ".join(map(text, f["fs"])) + ")"
        case "implies":
            return f"({text(f['left'])} implies {text(f['right'])})"
        case "always" | "eventually" | "once" | "historically":
            return f"({f['op']}{window} {text(f['f'])})"
        case "until" | "since":
            left, right = text(f["left"]), text(f["right"])
            return f"({left} {f['op']}{window} ({left} and {right}))"
    raise AssertionError(f["op"])


def horizon(f: Formula) -> int:
    """How many samples ahead a formula looks."""
    return int(ahead(f, 1.0))


def by_rtamt(f: Formula, x: Array) -> list[float]:
    """Robustness at every sample of signals x (3, n); meaningless where the horizon does not fit."""
    specification = rtamt.StlDiscreteTimeSpecification()
    for name in SIGNALS:
        specification.declare_var(name, "float")
    specification.spec = text(f)
    specification.parse()
    columns = {name: row.tolist() for name, row in zip(SIGNALS, x, strict=True)}
    return [rho for _, rho in specification.evaluate({"time": list(range(x.shape[1])), **columns})]


windows = st.tuples(st.integers(0, 4), st.integers(0, 5)).map(lambda w: {"from": w[0], "to": w[0] + w[1]})


formulas = st.recursive(
    st.sampled_from(SIGNALS).map(signal),
    lambda inner: operators(inner, windows, past=True, least=2),
    max_leaves=5,
)


@seed(1)
@settings(max_examples=300, deadline=None)
@given(formulas, st.integers(0, 2**32 - 1))
def test_random_formulas_have_the_robustness_that_rtamt_finds(f: Formula, trace: int) -> None:
    x = np.random.default_rng(trace).normal(0.0, 2.0, (len(SIGNALS), horizon(f) + LENGTH))
    positions = np.zeros((*x.shape, 3))
    positions[:, :, 0] = x
    ours = FLEET.robustness(f, positions, 1.0)
    assert len(ours) == LENGTH
    assert np.array_equal(ours, by_rtamt(f, x)[:LENGTH])


def test_until_differs_from_rtamt_by_the_switch_alone() -> None:
    """The reason for the translation: left fails exactly where right begins to hold."""
    x = np.array([[1.0, 1.0, -2.0], [-1.0, -1.0, 3.0], [0.0, 0.0, 0.0]])
    positions = np.zeros((*x.shape, 3))
    positions[:, :, 0] = x
    until = {"op": "until", "from": 0, "to": 2, "left": signal("u"), "right": signal("v")}
    assert FLEET.evaluate(until, positions, 1.0)[0] == pytest.approx(-1.0)
    specification = rtamt.StlDiscreteTimeSpecification()
    for name in SIGNALS:
        specification.declare_var(name, "float")
    specification.spec = "(u >= 0) until[0,2] (v >= 0)"
    specification.parse()
    columns = {name: row.tolist() for name, row in zip(SIGNALS, x, strict=True)}
    assert specification.evaluate({"time": [0, 1, 2], **columns})[0][1] == pytest.approx(1.0)
