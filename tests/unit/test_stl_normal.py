"""The normal form means exactly what the clauses mean: same robustness on random traces."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet import _core
from fleet.scenario.region import from_box
from fleet.stl import Clause, Vocabulary, default_formula, drones_of, normal_form, parse
from tests.unit.formulas import DRONES, REGIONS, T_S, formulas

T = 2.0
STEPS = round(T / T_S)
FLEET = _core.Fleet(
    list(DRONES),
    [from_box(name, [i - 3.0, -1, 0], [i - 2.0, 1 + i, 2]).wire() for i, name in enumerate(REGIONS)],
)


def visit(part):
    return {"op": "in", "drone": part.drone, "region": part.region}


def parts(form):
    """The formula of each part of a normal form."""
    for event in form.events:
        stay = {"op": "always", "from": 0.0, "to": event.dwell}
        f = {"op": "or", "fs": [{**stay, "f": visit(choice)} for choice in event.choices]}
        yield {"op": "eventually", "from": event.window[0], "to": event.window[1], "f": f}
    for gather in form.gathers:
        f = {"op": "and", "fs": [visit(part) for part in gather.visits]}
        yield {"op": "eventually", "from": gather.window[0], "to": gather.window[1], "f": f}
    for invariant in form.invariants:
        yield {"op": "always", "from": 0.0, "to": T, "f": invariant.predicate}
    for rest in form.rest:
        yield rest.formula


def wrapped(formula):
    """Shapes that the normal form takes apart, around a formula of any shape."""
    whole = {"op": "always", "from": 0.0, "to": T, "f": formula}
    later = {"op": "eventually", "from": 0.0, "to": T, "f": formula}
    both = {"op": "and", "fs": [whole, {"op": "and", "fs": [later, whole]}]}
    stay = {"op": "always", "from": 0.0, "to": 0.5, "f": formula}
    stays = {"op": "eventually", "from": 0.0, "to": T - 0.5, "f": {"op": "or", "fs": [stay, stay]}}
    return st.sampled_from([formula, whole, later, both, {"op": "or", "fs": [later, later]}, stays])


INSTANT = st.one_of(formulas(depth=2, steps=0), formulas(depth=1, steps=0))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    formula=st.one_of(formulas(depth=3, steps=STEPS), INSTANT.flatmap(wrapped)),
    seed=st.integers(0, 2**32 - 1),
)
def test_same_robustness(formula, seed):
    positions = np.random.default_rng(seed).uniform(-3, 5, (len(DRONES), STEPS + 1, 3))
    form = normal_form([Clause("c1", "", formula)], T)
    whole = FLEET.evaluate(formula, positions, T_S)[0]
    assert min(FLEET.evaluate(part, positions, T_S)[0] for part in parts(form)) == pytest.approx(
        whole, abs=1e-12
    )


def test_the_papers_mission_has_no_rest():
    words = Vocabulary(DRONES, ("tower", "cable"), ("tr1", "tr2"), T=60.0, T_s=0.05, delta_min=3.0)
    form = normal_form(parse(default_formula(words), words), words.T)
    assert not form.rest
    assert [(event.clause, event.window, len(event.choices)) for event in form.events] == [
        ("tr1", (0.0, 40.0), 3),
        ("tr2", (0.0, 40.0), 3),
    ]
    (home,) = form.gathers
    assert home.window == (40.0, 60.0)
    assert [(v.drone, v.region) for v in home.visits] == [(d, f"home.{d}") for d in DRONES]
    assert [i.clause for i in form.invariants] == ["safe"] * 9 + ["apart"] * 3


@pytest.mark.parametrize(
    ("text", "kinds"),
    [
        ("some d: eventually[0,5] d in tr1", (1, 0, 0, 0)),
        ("eventually[0,5] stay 2 d1 in tr1", (1, 0, 0, 0)),
        ("some d: eventually[0,5] stay 2 (d in tr1)", (1, 0, 0, 0)),
        ("eventually[0,5] some d: stay 2 d in tr1", (1, 0, 0, 0)),
        ("eventually[0,5] (stay 2 d1 in tr1 or d2 in tr1)", (0, 0, 0, 1)),
        ("eventually[0,5] always[1,2] d1 in tr1", (0, 0, 0, 1)),
        ("eventually[0,5] once[0,2] d1 in tr1", (0, 0, 0, 1)),
        ("eventually[0,5] (d1 in tr1 and d2 in tr2)", (0, 1, 0, 0)),
        ("eventually[0,5] d1 in tr1 and always[0,T] d1.z >= 1", (1, 0, 1, 0)),
        ("eventually[0,5] d1 in tr1 or eventually[0,6] d2 in tr1", (0, 0, 0, 1)),
        ("always[0,T] (d1 in workspace and (d1 in tr1 or d2 in tr1))", (0, 0, 1, 1)),
        ("always[0,5] d1 in workspace", (0, 0, 0, 1)),
        ("eventually[0,5] d1 outside tower", (0, 0, 0, 1)),
        ("not eventually[0,5] d1 in tr1", (0, 0, 0, 1)),
        ("d1 in workspace", (0, 0, 0, 1)),
    ],
)
def test_shapes(text, kinds):
    words = Vocabulary(DRONES, ("tower",), ("tr1", "tr2"), T=60.0, T_s=0.05, delta_min=3.0)
    form = normal_form(parse(text, words), words.T)
    assert (len(form.events), len(form.gathers), len(form.invariants), len(form.rest)) == kinds


def test_stays_have_their_dwell():
    words = Vocabulary(DRONES, ("tower",), ("tr1", "tr2"), T=60.0, T_s=0.05, delta_min=3.0)
    form = normal_form(parse("eventually[0,40] some d: stay 2 d in tr1", words), words.T)
    (event,) = form.events
    assert (event.window, event.dwell) == ((0.0, 40.0), 2.0)
    assert [choice.drone for choice in event.choices] == list(DRONES)


def test_drones_in_order_of_appearance():
    words = Vocabulary(DRONES, ("tower",), ("tr1", "tr2"), T=60.0, T_s=0.05, delta_min=3.0)
    (clause,) = parse("d3 in tr1 until[0,1] (dist(d1,d3) >= 2 or d2.x >= 1)", words)
    assert drones_of(clause.formula) == ["d3", "d1", "d2"]
