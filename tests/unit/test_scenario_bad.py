"""Scenario files that are not legal: each problem is named by its field, and all of them at once."""

import copy
import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.errors import ScenarioError
from fleet.scenario import load
from fleet.stl.extent import too_large

SCENARIOS = Path(__file__).parents[2] / "scenarios"
BASE = tomllib.loads((SCENARIOS / "power_tower.toml").read_text(encoding="utf-8"))
BOX = [[-4.0, -6.5, 11.0], [-2.0, -4.5, 13.0]]


def toml(value):
    """A TOML document's values as inline text; enough of a writer for these tests."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)} = {toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(inner) for inner in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return (
            '"'
            + "".join(c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08x}" for c in value)
            + '"'
        )
    return repr(value)


def _key(key):
    return toml(key)


def problems(tmp_path, document):
    """The problems of a document as (field, message), empty when it loads."""
    path = tmp_path / "case.toml"
    path.write_text("".join(f"{_key(k)} = {toml(v)}\n" for k, v in document.items()), encoding="utf-8")
    try:
        load(path)
    except ScenarioError as error:
        assert error.exit_code == 2
        assert all(problem.file == str(path) for problem in error.problems)
        return [(problem.field, problem.message) for problem in error.problems]
    return []


def changed(*changes):
    """BASE with each (path, value) set; DELETE removes."""
    document = copy.deepcopy(BASE)
    for path, value in changes:
        inner = document
        for part in path[:-1]:
            inner = inner[part] if isinstance(part, int) else inner.setdefault(part, {})
        if value is DELETE:
            del inner[path[-1]]
        elif isinstance(inner, list) and path[-1] == len(inner):
            inner.append(value)
        else:
            inner[path[-1]] = value
    return document


DELETE = object()
PULSE = {"drone": "d1", "t": 1.0, "duration": 1.0, "force": [1.0, 0.0, 0.0]}
UNBOUNDED = {"A": [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], "b": [1, 1, 1, 1]}
EMPTY = {"A": [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], "b": [1, -2, 1, 1, 1, 1]}
FLAT = {"A": EMPTY["A"], "b": [1, -1, 1, 1, 1, 1]}
ZERO_ROW = {"A": [[0, 0, 0], *EMPTY["A"]], "b": [1, 1, 1, 1, 1, 1, 1]}

# What is changed, the field that must be named, and words that its message must have.
CASES = [
    ([("mission", "T"), 0], "mission.T", "greater than 0"),
    ([("mission", "T"), -60.0], "mission.T", "-60.0"),
    ([("mission", "T"), "60"], "mission.T", "number"),
    ([("mission", "T"), True], "mission.T", "number"),
    ([("mission", "T"), float("nan")], "mission.T", "nan"),
    ([("mission", "T"), 10**400], "mission.T", "number"),
    ([("mission", "T"), DELETE], "mission.T", "missing"),
    ([("mission",), DELETE], "mission", "missing"),
    ([("mission",), 3], "mission", "table"),
    ([("mission", "T_s"), 0.07], "mission.T_s", "divide T = 60"),
    ([("mission", "seed"), -1], "mission.seed", "0"),
    ([("mission", "fleet"), "a/b"], "mission.fleet", "letter"),
    ([("mission", "duration"), 60], "mission.duration", "T, T_s, c, formula, seed, fleet"),
    ([("missoin",), {}], "missoin", "mission, workspace"),
    ([("workspace",), DELETE], "workspace", "missing"),
    ([("workspace", "box"), DELETE], "workspace", "exactly one of"),
    ([("workspace", "box", 1, 2), -1.0], "workspace.box", "below"),
    ([("limits", "v_max"), 0], "limits.v_max", "greater than 0"),
    ([("limits", "a_max"), "fast"], "limits.a_max", "'fast'"),
    ([("limits", "delta_min"), 0.8], "limits.delta_min", "two tubes"),
    ([("limits", "tube"), 1.2], "target[0].box", "more than the tube"),
    ([("replan", "T_e"), 0.12], "replan.T_e", "multiple of mission.T_s"),
    ([("replan", "T_e"), 0.025], "replan.T_e", "multiple of mission.T_s"),
    ([("replan", "T_g"), 0.1], "replan.T_g", "longer than T_e"),
    ([("replan", "enabled"), "yes"], "replan.enabled", "'yes'"),
    ([("planner", "segment"), 0.1], "mission.T", "at most 25.6 s"),
    ([("wind", "velocity"), [1.0, 2.0]], "wind.velocity[2]", "missing"),
    ([("obstacle",), {"name": "x"}], "obstacle", "[[obstacle]]"),
    ([("obstacle", 0, "name"), "tr1"], "target[0].name", "obstacle[0]"),
    ([("obstacle", 0, "prism", "sides"), 2], "obstacle[0].prism", "3 to 64 sides"),
    ([("obstacle", 0, "prism", "sides"), DELETE], "obstacle[0].prism", "all of center"),
    ([("obstacle", 0, "prism", "z"), [5.0, 5.0]], "obstacle[0].prism", "low < high"),
    ([("obstacle", 0, "prism"), {"z": [0, 1], "base": [[0, 0], [1, 0]]}], "obstacle[0].prism", "convex"),
    (
        [("obstacle", 0, "prism"), {"z": [0, 1], "base": [[0, 0], [2, 0], [1, 0.1], [0, 2]]}],
        "obstacle[0].prism",
        "convex",
    ),
    ([("obstacle", 0, "color"), "red"], "obstacle[0].color", "box, prism, polyhedron, name"),
    ([("obstacle", 0, "prism", "colour"), 1], "obstacle[0].prism.colour", "z, base, center, apothem, sides"),
    ([("target", 0, "name"), "always"], "target[0].name", "reserved"),
    ([("target", 0, "name"), "workspace"], "target[0].name", "reserved"),
    ([("target", 0, "name"), "9lives"], "target[0].name", "letter"),
    ([("target", 0, "name"), "t" * 33], "target[0].name", "letter"),
    ([("target", 0, "name"), "tür"], "target[0].name", "letter"),
    ([("target", 1, "name"), "tr1"], "target[1].name", "target[0]"),
    ([("target", 2, "heading"), "north"], "target[2].heading", "number"),
    ([("target", 2, "heading"), 90.0], "target[2].heading", "less than"),
    ([("target", 2, "box"), [[0, 0], [1, 1]]], "target[2].box[0][2]", "missing"),
    ([("target", 2, "box"), [[-1, -1, 9], [1, 1, 11]]], "target[2].box", "inside obstacle tower"),
    ([("target", 2, "box"), [[6.5, 0, 9], [8.5, 2, 11]]], "target[2].box", "outside the workspace"),
    ([("target", 2, "polyhedron"), EMPTY], "target[2]", "exactly one of"),
    ([("region",), {"name": "yard"}], "region", "[[region]]"),
    ([("region",), [{"name": "yard"}]], "region[0]", "exactly one of"),
    ([("region",), [{"name": "stay", "box": BOX}]], "region[0].name", "reserved"),
    ([("region",), [{"name": "tr1", "box": BOX}]], "region[0].name", "also the name of target[0]"),
    ([("region",), [{"name": "yard", "box": BOX, "heading": 1.0}]], "region[0].heading", "polyhedron, name"),
    (
        [("region",), [{"name": "yard", "box": [[8, 0, 0], [9, 1, 1]]}]],
        "region[0].box",
        "outside the workspace",
    ),
    (
        [("region",), [{"name": "yard", "box": [[-1, -1, 1], [1, 1, 3]]}]],
        "region[0].box",
        "inside obstacle tower",
    ),
    ([("drone",), DELETE], "drone", "0 drones"),
    ([("drone", 0, "id"), "d2"], "drone[1].id", "drone[0]"),
    ([("drone", 0, "id"), "tr1"], "drone[0].id", "target[0]"),
    ([("drone", 1, "home", "box"), [[-5.5, -8, 0.2], [-3.5, -6, 2.2]]], "drone[1].home", "overlaps home.d1"),
    ([("drone", 1, "home", "box"), [[-3.9, -8, 0.2], [-1.9, -6, 2.2]]], "drone[1].home", "delta_min = 3"),
    (
        [("drone", 1, "home", "box"), [[3.5, -8, 0.2], [5.5, -5.5, 2.2]]],
        "drone[1].home",
        "overlaps obstacle shed_east",
    ),
    (
        [("drone", 1, "home", "box"), [[5, 8.5, 0.2], [7, 10.5, 2.2]]],
        "drone[1].home",
        "outside the workspace",
    ),
    ([("drone", 1, "pad"), [-5.0, -6.0, 0.1]], "drone[1].pad", "delta_min"),
    ([("drone", 1, "pad"), [5.0, 7.0, 1.3]], "drone[1].pad", "below the start"),
    ([("drone", 1, "pad"), [5.0, -4.0, 0.1]], "drone[1].pad", "inside obstacle shed_east"),
    ([("drone", 1, "start"), [5.0, 5.0, 1.2]], "drone[1].start", "inside home.d2"),
    ([("drone", 1, "home"), "here"], "drone[1].home", "table"),
    ([("disturbance",), [{**PULSE, "drone": "d9"}]], "disturbance[0].drone", "d1, d2"),
    ([("disturbance",), [{**PULSE, "t": 60.1}]], "disturbance[0].t", "0 to T = 60"),
    ([("disturbance",), [{**PULSE, "t": -1.0}]], "disturbance[0].t", "-1.0"),
    ([("disturbance",), [{**PULSE, "duration": 0}]], "disturbance[0].duration", "greater than 0"),
    ([("disturbance",), [{**PULSE, "force": [1.0]}]], "disturbance[0].force[1]", "missing"),
    ([("assignment",), {"d9": ["tr1", "tr2", "tr3", "tr4"]}], "assignment.d9", "legal: d1, d2"),
    ([("assignment",), {"d1": ["tr9", "tr1", "tr2", "tr3", "tr4"]}], "assignment.d1", "'tr9'"),
    ([("assignment",), {"d1": ["tr1", "tr1", "tr2", "tr3", "tr4"]}], "assignment.d1", "already"),
    ([("assignment",), {"d1": ["tr1", "tr2"]}], "assignment", "tr3, tr4"),
    ([("assignment",), {"d1": "tr1"}], "assignment.d1", "list"),
    ([("mission", "formula"), "always[0,2T] d1 in tr1"], "mission.formula", "line 1, column 7"),
    ([("mission", "formula"), "d1 in\ntr9"], "mission.formula", "line 2, column 1"),
    ([("mission", "formula"), ""], "mission.formula", "too early"),
    ([("mission", "formula"), "eventually[0,5] d1 in yard"], "mission.formula", "'yard' is not a region"),
    ([("mission", "formula"), "eventually[0,5] d9 in tr1"], "mission.formula", "'d9' is not a drone"),
    ([("mission", "formula"), "eventually[5,4] d1 in tr1"], "mission.formula", "start <= end"),
    ([("mission", "formula"), "eventually[0,9] stay -1 d1 in tr1"], "mission.formula", "a stay of -1 s"),
    (
        [("mission", "formula"), "@odd always[0,5] once[1,2] d1 in tr1"],
        "mission.formula",
        "clause odd fails whatever is flown: it looks back beyond mission time 0",
    ),
    (
        [("mission", "formula"), "@odd eventually[0,5] historically[1,2] d1 in tr1"],
        "mission.formula",
        "clause odd holds whatever is flown",
    ),
]


@pytest.mark.parametrize(
    ("change", "field", "words"), CASES, ids=[f"{i}-{c[1]}" for i, c in enumerate(CASES)]
)
def test_bad_field_is_named(tmp_path, change, field, words):
    path, value = change
    found = problems(tmp_path, changed((path, value)))
    assert any(f == field and words in message for f, message in found), found


@pytest.mark.parametrize(
    ("shape", "words"),
    [(UNBOUNDED, "unbounded"), (EMPTY, "empty"), (FLAT, "flat"), (ZERO_ROW, "not zero")],
)
@pytest.mark.parametrize("place", [("obstacle", 1), ("target", 3)])
def test_polyhedron_without_inside(tmp_path, shape, words, place):
    document = changed(((*place, "box"), DELETE), ((*place, "polyhedron"), shape))
    found = problems(tmp_path, document)
    assert any(f == f"{place[0]}[{place[1]}].polyhedron" and words in message for f, message in found), found


def test_more_samples_than_can_be_evaluated(tmp_path):
    many = " and ".join(["d1 in tr1"] * 1800)
    fine = changed((("mission", "T"), 2400.0), (("mission", "T_s"), 0.01), (("mission", "formula"), many))
    found = problems(tmp_path, fine | {"planner": {"segment": 10.0}})
    values = "432001800 values of predicates, and at most 400000000 are legal; choose a longer T_s"
    assert [(field, values in message) for field, message in found] == [("mission.T_s", True)]
    assert too_large([], 64, 3600.0, 0.05) is None
    assert "23040064 positions, and at most 8000000 are legal" in too_large([], 64, 3600.0, 0.01)


def test_rows_without_values(tmp_path):
    document = changed(
        (("target", 3, "box"), DELETE), (("target", 3, "polyhedron"), {**EMPTY, "b": [1, 1, 1, 1]})
    )
    assert problems(tmp_path, document) == [
        ("target[3].polyhedron", "A has 6 rows and b 4 values; need as many")
    ]


def test_all_problems_at_once(tmp_path):
    document = changed(
        (("mission", "T_s"), 0.07),
        (("limits", "v_max"), -3.0),
        (("target", 0, "box"), BOX[::-1]),
        (("target", 1, "name"), "until"),
        (("drone", 0, "pad"), [0.0, 0.0, 0.1]),
        (("disturbance",), [{**PULSE, "drone": "d7"}]),
        (("assignment",), {"d1": ["tr9"]}),
    )
    fields = {field for field, _ in problems(tmp_path, document)}
    assert fields >= {
        "mission.T_s",
        "limits.v_max",
        "target[0].box",
        "target[1].name",
        "drone[0].pad",
        "disturbance[0].drone",
        "assignment.d1",
    }


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"[mission\nT = 3", "line 1"),
        (b"[mission]\nT = 3\nT = 4\n", "line 3"),
        (b"\xff\xfe", "UTF-8"),
        (b"a = " + b"[" * 5000, "not TOML"),
        (b"", "mission"),
    ],
)
def test_not_a_scenario(tmp_path, content, words):
    path = tmp_path / "case.toml"
    path.write_bytes(content)
    with pytest.raises(ScenarioError, match=words):
        load(path)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(ScenarioError, match=r"absent\.toml: no such file"):
        load(tmp_path / "absent.toml")
    with pytest.raises(ScenarioError, match="directory"):
        load(tmp_path)


# Any one value of a good file replaced by any TOML value: it loads or is refused, never anything else.
VALUES = st.recursive(
    st.none().map(lambda _: "") | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


def paths(value, prefix=()):
    """Every path into a document, the document itself left out."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*prefix, key)
        yield from paths(inner, (*prefix, key))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(path=st.sampled_from(list(paths(BASE))), value=VALUES)
def test_any_value_anywhere_is_judged(tmp_path_factory, path, value):
    for field, message in problems(tmp_path_factory.mktemp("any"), changed((path, value))):
        assert field
        assert message
