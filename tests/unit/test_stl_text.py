"""Text syntax of mission formulas: what it means, what it refuses, and that the printer undoes the parser."""

import re
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fleet.errors import FormulaError
from fleet.stl import RESERVED, Clause, Vocabulary, clause_text, default_formula, is_name, parse, to_text
from tests.unit.formulas import DRONES, formulas

WORDS = Vocabulary(
    DRONES, ("tower", "cable"), ("tr1", "tr2"), T=60.0, T_s=0.05, delta_min=3.0, regions=("yard",)
)
GATED = replace(WORDS, regions=("gate",))
README = Path(__file__).parents[2] / "README.md"


def one(text, words=WORDS):
    (clause,) = parse(text, words)
    return clause.formula


PAIRS = (("d1", "d2"), ("d1", "d3"), ("d2", "d3"))


def visit(drone, region):
    return {"op": "in", "drone": drone, "region": region}


A, B, C = visit("d1", "tr1"), visit("d2", "tr2"), visit("d3", "workspace")
a, b, c = "d1 in tr1", "d2 in tr2", "d3 in workspace"


def both(*fs):
    return {"op": "and", "fs": list(fs)}


def either(*fs):
    return {"op": "or", "fs": list(fs)}


def no(f):
    return {"op": "not", "f": f}


def until(left, right, start, end):
    return {"op": "until", "from": start, "to": end, "left": left, "right": right}


def since(left, right, start, end):
    return {**until(left, right, start, end), "op": "since"}


def timed(op, start, end, f):
    return {"op": op, "from": start, "to": end, "f": f}


def dist(first, second, cmp, value):
    return {"op": "dist", "a": first, "b": second, "cmp": cmp, "value": value}


def linear(constant, **coefs):
    terms = [{"drone": key[:2], "axis": key[3:], "coef": float(value)} for key, value in coefs.items()]
    return {"op": "linear", "terms": terms, "constant": constant}


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        (a, A),
        ("d1 outside tower", {"op": "outside", "drone": "d1", "region": "tower"}),
        ("d1 in home", visit("d1", "home.d1")),
        ("d1 outside home.d2", {"op": "outside", "drone": "d1", "region": "home.d2"}),
        ("d1 in obstacles", either(visit("d1", "tower"), visit("d1", "cable"))),
        # Precedence: -> or and until unary, from loose to tight; and, or flat; -> and until to the right.
        (f"{a} and {b} and {c}", both(A, B, C)),
        (f"({a} and {b}) and {c}", both(both(A, B), C)),
        (f"{a} or {b} and {c}", either(A, both(B, C))),
        (f"{a} and {b} -> {c}", {"op": "implies", "left": both(A, B), "right": C}),
        (
            f"{a} -> {b} -> {c}",
            {"op": "implies", "left": A, "right": {"op": "implies", "left": B, "right": C}},
        ),
        (f"not {a} and {b}", both({"op": "not", "f": A}, B)),
        (f"{a} and {b} until[0,5] {c}", both(A, until(B, C, 0.0, 5.0))),
        (f"{a} until[0,5] {b} until[1,2] {c}", until(A, until(B, C, 1.0, 2.0), 0.0, 5.0)),
        (f"always[0,T] {a} and {b}", both(timed("always", 0.0, 60.0, A), B)),
        (f"always[0,T] ({a} and {b})", timed("always", 0.0, 60.0, both(A, B))),
        # Aliases.
        (f"G[0,1] F[2,3] {a}", timed("always", 0.0, 1.0, timed("eventually", 2.0, 3.0, A))),
        (f"{a} U[0,5] {b}", until(A, B, 0.0, 5.0)),
        (f"{a} release[0,5] {b}", {"op": "not", "f": until(no(A), no(B), 0.0, 5.0)}),
        # Stays, and the past; windows that look back end at mission time 0 or after it.
        (f"stay 2 {a}", timed("always", 0.0, 2.0, A)),
        (f"stay (T/4) ({a} and {b})", timed("always", 0.0, 15.0, both(A, B))),
        (
            "eventually[0,40] some d: stay 2.5 d in tr1",
            timed(
                "eventually", 0.0, 40.0, either(*(timed("always", 0.0, 2.5, visit(d, "tr1")) for d in DRONES))
            ),
        ),
        (f"once[0,3] {a}", timed("once", 0.0, 3.0, A)),
        (
            f"always[5,T] historically[1,T] {a}",
            timed("always", 5.0, 60.0, timed("historically", 1.0, 60.0, A)),
        ),
        (f"{a} since[0,5] {b} and {c}", both(since(A, B, 0.0, 5.0), C)),
        (f"{a} since[0,5] {b} until[1,2] {c}", since(A, until(B, C, 1.0, 2.0), 0.0, 5.0)),
        # What is looked back at from late in the mission may look ahead to its end again.
        (
            f"eventually[0,40] once[10,20] always[0,30] {a}",
            timed("eventually", 0.0, 40.0, timed("once", 10.0, 20.0, timed("always", 0.0, 30.0, A))),
        ),
        ("d1 in yard", visit("d1", "yard")),
        (f"{c} or {a} release[1,2] not {b}", either(C, no(until(no(A), no(no(B)), 1.0, 2.0)))),
        # The body of a quantifier reaches to the right as far as it can, also inside always.
        ("all d: d in tr1", both(visit("d1", "tr1"), visit("d2", "tr1"), visit("d3", "tr1"))),
        (
            "always[0,T] all d: d in tr1 or d in tr2",
            timed("always", 0.0, 60.0, both(*(either(visit(d, "tr1"), visit(d, "tr2")) for d in DRONES))),
        ),
        ("some d: d in home", either(*(visit(d, f"home.{d}") for d in DRONES))),
        # Pairs: once where the order does not matter, both ways where it does.
        ("all x != y: dist(x,y) >= 3", both(*(dist(*pair, "ge", 3.0) for pair in PAIRS))),
        (
            "some x != y: x in tr1 and y in tr2",
            either(*(both(visit(x, "tr1"), visit(y, "tr2")) for x, y in permutations(DRONES, 2))),
        ),
        # Predicates over numbers.
        ("dist(d2,d1) >= 3", dist("d1", "d2", "ge", 3.0)),
        ("dist(d1,d2) <= delta_min + 1", dist("d1", "d2", "le", 4.0)),
        ("3 <= dist(d1,d2)", dist("d1", "d2", "ge", 3.0)),
        ("2*dist(d1,d2) - 6 <= 0", dist("d1", "d2", "le", 3.0)),
        ("d1.x - 2*d2.z <= 3", linear(3.0, d1_x=-1, d2_z=2)),
        ("d1.x >= -T/4", linear(15.0, d1_x=1)),
        ("(d1.x + d2.x)/2 - d1.x >= d3.y", linear(0.0, d1_x=-0.5, d2_x=0.5, d3_y=-1)),
        ("(d1.z) >= 1", linear(-1.0, d1_z=1)),
        ("d1.z >= 1 # not too low", linear(-1.0, d1_z=1)),
    ],
)
def test_meaning(text, formula):
    assert one(text) == formula


@pytest.mark.parametrize(
    ("T", "window", "bounds"),
    [
        (110.0, "0,2T/3", (0.0, 73.3)),  # design.md, Windows
        (110.0, "2T/3,T", (73.3, 110.0)),
        (60.0, "T/3,2*T/3", (20.0, 40.0)),
        (60.0, "T-5,T", (55.0, 60.0)),
        (30.0, "0,T/2", (0.0, 15.0)),
        (60.0, "0.05,0.15", (0.05, 0.15)),
        (10.01, "T/3,T/2", (3.3, 5.0)),
        (60.0, "(1+2)*3,-1+20", (9.0, 19.0)),
    ],
)
def test_windows_are_rounded_down_to_samples(T, window, bounds):
    words = Vocabulary(DRONES, (), ("tr1",), T=T, T_s=0.05, delta_min=3.0)
    formula = one(f"eventually[{window}] d1 in tr1", words)
    assert (formula["from"], formula["to"]) == bounds


@pytest.mark.parametrize(
    ("window", "column", "words"),
    [
        ("0.149,0.2", 12, "0.149 s is not a multiple of T_s = 0.05 s; next to it are 0.1 and 0.15"),
        ("3,3.02", 14, "3.02 s is not a multiple of T_s = 0.05 s; next to it are 3 and 3.05"),
        ("0,10/3", 14, "is not a multiple of T_s"),
    ],
)
def test_times_between_samples_are_refused(window, column, words):
    vocabulary = Vocabulary(DRONES, (), ("tr1",), T=60.0, T_s=0.05, delta_min=3.0)
    with pytest.raises(FormulaError, match=re.escape(words)) as caught:
        one(f"eventually[{window}] d1 in tr1", vocabulary)
    assert (caught.value.line, caught.value.column) == (1, column)


def test_quantifiers_cannot_explode():
    crowd = Vocabulary(tuple(f"d{i}" for i in range(64)), (), ("tr1",), T=10.0, T_s=0.1, delta_min=3.0)
    assert len(one("all d != e: dist(d,e) >= 3", crowd)["fs"]) == 64 * 63 // 2
    with pytest.raises(FormulaError, match="expand to over"):
        parse("all a: all b: all c: a in tr1 or b in tr1 or c in tr1", crowd)


def test_names_and_texts_of_clauses():
    clauses = parse("@safe always[0,T]\n  d1 in workspace; d1 in tr1\n@b d2 in tr1;", WORDS)
    assert [(clause.id, clause.text) for clause in clauses] == [
        ("safe", "always[0,T] d1 in workspace"),
        ("c2", "d1 in tr1"),
        ("b", "d2 in tr1"),
    ]


@pytest.mark.parametrize(
    ("attributes", "weight", "priority"),
    [
        ("", 1.0, 0),
        ("{weight 2}", 2.0, 0),
        ("{ priority 3 }", 1.0, 3),
        ("{weight 2.5, priority 3}", 2.5, 3),
        ("{priority 3, weight 1/4}", 0.25, 3),
        ("{weight 1e-3,\n priority 0} # light", 0.001, 0),
    ],
)
def test_weights_and_priorities(attributes, weight, priority):
    (clause,) = parse(f"@a {attributes}\n always[0,5] d1 in tr1", WORDS)
    assert (clause.weight, clause.priority, clause.text) == (weight, priority, "always[0,5] d1 in tr1")
    assert parse(clause_text(clause), WORDS) == [replace(clause, text=to_text(clause.formula))]


def test_what_is_true_in_any_case_is_left_out():
    lonely = Vocabulary(("d1",), (), ("tr1",), T=10.0, T_s=0.1, delta_min=3.0)
    text = (
        "@apart always[0,T] all d != e: dist(d,e) >= 3  @safe all d: d in workspace and d outside obstacles"
    )
    (safe,) = parse(text, lonely)
    assert (safe.id, safe.formula) == ("safe", visit("d1", "workspace"))
    with pytest.raises(FormulaError, match="true in any case"):
        parse("not d1 outside obstacles", lonely)
    with pytest.raises(FormulaError, match="not enough drones"):
        parse("some d != e: dist(d,e) <= 3", lonely)


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("", (1, 1), "too early"),
        ("always[0,T]", (1, 12), "too early"),
        ("always[0,T d1 in tr1", (1, 12), r"unexpected 'd1'; expected .*'\]'"),
        ("d1 in tr1 d2 in tr2", (1, 11), "';'"),
        ("d1 in tr1 $", (1, 11), r"character '\$'"),
        ("d1 in\n  tr9", (2, 3), "legal: workspace, obstacles, home, tr1"),
        ("d7 in tr1", (1, 1), "legal: d1, d2, d3"),
        ("all d: e in tr1", (1, 8), "legal: d1, d2, d3, d"),
        ("all d1: d1 in tr1", (1, 5), "is a drone"),
        ("all tr1: tr1 in tr1", (1, 5), "is a drone or region"),
        ("all T: T in tr1", (1, 5), "reserved"),
        ("all d: all d: d in tr1", (1, 12), "in use"),
        ("all d != d: d in tr1", (1, 10), "used twice"),
        ("d1 in tr1.d2", (1, 7), "home.DRONE"),
        ("d1 in home.d9", (1, 12), "not a drone"),
        ("eventually[0,2T] d1 in tr1", (1, 11), "ends at 120 s; the mission ends at T = 60 s"),
        ("always[0,50] eventually[0,20] d1 in tr1", (1, 24), "reach to 50 s"),
        ("d1 in tr1 until[0,61] d2 in tr1", (1, 16), "61"),
        ("stay -2 d1 in tr1", (1, 6), "a stay of -2 s is not legal; need a number of seconds of 0 or more"),
        (
            "stay 2.01 d1 in tr1",
            (1, 6),
            "2.01 s is not a multiple of T_s = 0.05 s; next to it are 2 and 2.05",
        ),
        ("stay 61 d1 in tr1", (1, 6), "the stay ends at 61 s; the mission ends at T = 60 s"),
        ("eventually[0,59] stay 2 d1 in tr1", (1, 23), "inside windows that reach to 59 s"),
        ("stay (d1.x) d1 in tr1", (1, 7), "a stay is not legal; need a number"),
        ("stay d1 in tr1", (1, 6), "expected '\\(', '-', a number"),
        ("once[1,2] d1 in tr1", (1, 5), "looks back 1 s or more at mission time 0"),
        ("always[0,5] d1 in tr1 since[6,7] d2 in tr1", (1, 28), "looks back 6 s or more"),
        ("always[0,5] historically[0,61] d1 in tr1", (1, 25), "looks back 61 s; the mission lasts T = 60 s"),
        ("always[0,9] once[2,1] d1 in tr1", (1, 17), "start <= end"),
        ("d1 in yard2", (1, 7), "legal: workspace, obstacles, home, tr1, tr2, tower, cable, yard"),
        ("all yard: yard in tr1", (1, 5), "is a drone or region"),
        ("always[5,4] d1 in tr1", (1, 7), "start <= end"),
        ("always[-1,4] d1 in tr1", (1, 7), "start <= end"),
        ("always[0,d1.x] d1 in tr1", (1, 10), "number"),
        ("always[0,tr1] d1 in tr1", (1, 10), "legal: T, delta_min"),
        ("dist(d1,d1) >= 3", (1, 1), "itself"),
        ("dist(d1,d2) >= -1", (1, 1), "never below"),
        ("dist(d1,d2) + d1.x >= 1", (1, 1), "number alone"),
        ("d1.w >= 1", (1, 4), "legal: x, y, z"),
        ("d1.x*d2.x >= 1", (1, 1), "not linear"),
        ("1/d2.x >= 1", (1, 1), "division"),
        ("d1.x/0 >= 1", (1, 1), "division"),
        ("1 >= 2", (1, 1), "numbers only"),
        ("d1.x - d1.x >= 2", (1, 1), "numbers only"),
        ("d1.x >= 1e999", (1, 9), "too large"),
        ("d1.x >= 1e200*1e200", (1, 9), "too large"),
        ("always[0,1e999] d1 in tr1", (1, 10), "too large"),
        ("@a d1 in tr1 @a d2 in tr1", (1, 14), "two clauses"),
        (f"@{'n' * 33} d1 in tr1", (1, 2), "31 letters"),
        ("@a {wieght 2} d1 in tr1", (1, 5), "'wieght' is not an attribute of a clause; legal: weight, "),
        ("@a {weight 0} d1 in tr1", (1, 12), "the weight 0 is not legal; need a number above 0"),
        ("@a {weight -1} d1 in tr1", (1, 12), "the weight -1 is not legal"),
        ("@a {weight 1e4} d1 in tr1", (1, 12), "to 1000"),
        ("@a {weight 1e999} d1 in tr1", (1, 12), "too large"),
        ("@a {weight d1.x} d1 in tr1", (1, 12), "a weight is a number"),
        ("@a {priority 1.5} d1 in tr1", (1, 14), "the priority 1.5 is not legal; need a whole number"),
        ("@a {priority -1} d1 in tr1", (1, 14), "the priority -1 is not legal"),
        ("@a {weight 2, weight 3} d1 in tr1", (1, 15), "the weight is given twice"),
        ("@a {weight} d1 in tr1", (1, 11), "unexpected '}'"),
        ("@a {} d1 in tr1", (1, 5), "expected a name"),
        ("@a {weight 2; d1 in tr1", (1, 13), "unexpected ';'"),
        ("{weight 2} d1 in tr1", (1, 1), "unexpected '{'"),
        ("not " * 100 + "d1 in tr1", (1, 1), "nested"),
        ("(" * 3000 + "d1 in tr1" + ")" * 2999, (1, 6009), "too early"),
    ],
)
def test_refusal_points_at_the_place(text, place, words):
    with pytest.raises(FormulaError, match=words) as caught:
        parse(text, WORDS)
    assert (caught.value.line, caught.value.column) == place
    *_, caret = str(caught.value).splitlines()
    assert caret == " " * (4 + place[1] - 1) + "^"


@settings(max_examples=400, deadline=None, derandomize=True)
@given(formulas())
@example({"op": "not", "f": {"op": "implies", "left": A, "right": either(A, both(B, C))}})
@example(until(until(A, B, 0.0, 1.0), C, 0.0, 1.0))
@example(linear(-1e-07, d1_x=-1, d1_y=1e16))
def test_parse_undoes_print(formula):
    assert one(to_text(formula)) == formula


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    st.lists(
        st.builds(
            Clause,
            st.from_regex(r"[a-z]{2,5}_[0-9]", fullmatch=True),
            st.just(""),
            formulas(depth=2),
            st.one_of(st.just(1.0), st.floats(1e-3, 1e3)),
            st.integers(0, 1_000_000),
        ),
        min_size=1,
        max_size=3,
        unique_by=lambda clause: clause.id,
    )
)
def test_parse_undoes_print_of_clauses(clauses):
    """Weights and priorities included; the text of a clause is what was read."""
    read = parse("\n".join(map(clause_text, clauses)), WORDS)
    assert read == [replace(clause, text=to_text(clause.formula)) for clause in clauses]


@settings(max_examples=400, deadline=None, derandomize=True)
@given(
    st.lists(
        st.sampled_from(
            [*sorted(RESERVED), *"[](){},:;@.+-*/", "weight", "!=", ">=", "<=", "->", "d1", "tr1", "d", "2"]
        )
    )
)
def test_any_text_is_read_or_refused_in_place(tokens):
    text = " ".join(tokens)
    try:
        clauses = parse(text, WORDS)
    except FormulaError as error:
        assert error.line == 1
        assert 1 <= error.column <= len(text) + 1
    else:
        assert all(one(to_text(clause.formula)) == clause.formula for clause in clauses)


def test_default_formula_is_the_papers():
    words = Vocabulary(("d1", "d2"), ("tower",), ("tr1", "tr2"), T=60.0, T_s=0.05, delta_min=3.0)
    text = default_formula(words)
    assert text.splitlines() == [
        "@safe  always[0,T] all d: d in workspace and d outside obstacles",
        "@apart always[0,T] all d != e: dist(d,e) >= delta_min",
        "@tr1   eventually[0,2T/3] some d: d in tr1",
        "@tr2   eventually[0,2T/3] some d: d in tr2",
        "@home  eventually[2T/3,T] all d: d in home",
    ]
    assert [clause.id for clause in parse(text, words)] == ["safe", "apart", "tr1", "tr2", "home"]


ANY_NAME = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,8}", fullmatch=True).filter(lambda n: n not in RESERVED)
SOME_NAMES = st.lists(ANY_NAME, min_size=1, max_size=3, unique=True)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(drones=SOME_NAMES, obstacles=SOME_NAMES, targets=SOME_NAMES)
@example(["d", "e"], ["d_"], ["safe", "apart", "home_"])
def test_default_formula_reads_for_any_names(drones, obstacles, targets):
    obstacles = [name for name in obstacles if name not in drones]
    targets = [name for name in targets if name not in (*drones, *obstacles)]
    words = Vocabulary(tuple(drones), tuple(obstacles), tuple(targets), T=60.0, T_s=0.05, delta_min=3.0)
    clauses = parse(default_formula(words), words)
    assert len(clauses) == 2 + (len(drones) > 1) + len(targets)


@pytest.mark.parametrize("name", ["d1", "D", "a_b", "z" * 32])
def test_names(name):
    assert is_name(name)


@pytest.mark.parametrize("name", ["", "1d", "_d", "a-b", "a.b", "é", "z" * 33, "a\n", "a b"])
def test_not_names(name):
    assert not is_name(name)


def test_the_words_of_the_readme_are_those_of_the_language():
    """Every formula of the README's table is read, with f, g and windows put in."""
    table = re.findall(r"^\| (`.*`[^|]*) \| (.*) \|$", README.read_text(encoding="utf-8"), re.MULTILINE)
    cells = [text for row in table for cell in row for text in re.findall(r"`([^`]*)`", cell)]
    words = {"f": "d1 in tr1", "g": "d2 in gate", "a,b": "0,5"}
    found = 0
    for cell in cells:
        text = re.sub(r"\bf\b|\bg\b|a,b", lambda m: words[m.group()], cell)
        if " in " in text or ">=" in text or "<=" in text:
            assert parse(f"always[0,10] ({text})" if not text.startswith("@") else text, GATED)
            found += 1
    assert found >= 14
