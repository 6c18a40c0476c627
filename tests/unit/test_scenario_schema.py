"""The exported JSON Schema says what the loader says, as far as a schema can."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from fleet.scenario import read, schema

ROOT = Path(__file__).parents[2]
SHIPPED = sorted((ROOT / "scenarios").glob("*.toml"))


def shipped(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text())


def legal(document: dict[str, Any]) -> bool:
    """Whether the schema accepts a document."""
    checker = jsonschema.Draft202012Validator(schema.schema())
    return next(checker.iter_errors(document), None) is None


def test_the_schema_in_docs_is_the_one_of_the_code() -> None:
    assert (ROOT / schema.FILE).read_text() == schema.text()
    jsonschema.Draft202012Validator.check_schema(schema.schema())


def test_the_schema_has_the_tables_that_are_read() -> None:
    assert set(schema.Document.model_fields) == {*read.SINGLE, *read.REPEATED}


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenarios_pass_and_name_the_schema(path: Path) -> None:
    assert legal(shipped(path))
    assert path.read_text().splitlines()[0] == "#:schema ../docs/scenario.schema.json"


@pytest.mark.parametrize(
    ("at", "value"),
    [
        (("mission", "T"), -1.0),
        (("mission", "T"), "60"),
        (("mission", "duration"), 60.0),
        (("limits", "v_max"), 0.0),
        (("drone",), []),
        (("drone", 0, "pad"), [0.0, 0.0]),
        (("target", 0, "heading"), 10.0),
        (("target", 0, "prism"), {"z": [0.0, 1.0], "base": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]}),
        (("obstacle", 0, "prism"), {"z": [0.0, 1.0], "center": [0.0, 0.0], "apothem": 1.0}),
        (("weather",), {}),
    ],
)
def test_what_the_loader_refuses_the_schema_refuses(at: tuple[Any, ...], value: object) -> None:
    document = copy.deepcopy(shipped(ROOT / "scenarios" / "power_tower.toml"))
    place: Any = document
    for key in at[:-1]:
        place = place[key]
    place[at[-1]] = value
    assert not legal(document)
    problems = read.Problems("a.toml")
    read.Tables(document, problems)
    # How many drones there must be is checked with the rest of the numbers, not table by table.
    assert problems.found or at == ("drone",)
