"""From a TOML file to tables: each table on its own, so that one problem does not hide the others."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from fleet.errors import Problem, ScenarioError
from fleet.scenario import tables

T = TypeVar("T", bound=BaseModel)

SINGLE = ("mission", "workspace", "limits", "replan", "planner", "energy", "wind", "assignment")
REPEATED = ("obstacle", "target", "region", "drone", "disturbance", "gust")


class Problems:
    """The problems of one file, in the order in which they are found."""

    def __init__(self, file: str) -> None:
        """For the file of this name."""
        self.file = file
        self.found: list[Problem] = []

    def add(self, code: str, field: str, message: str) -> None:
        """Notes that `field` is wrong."""
        self.found.append(Problem(code, self.file, field, message))


class Tables:
    """What could be read of a scenario file; None, or left out of its list, where a table has problems.

    Entries of lists keep the place that they have in the file, for naming fields.
    """

    def __init__(self, document: Mapping[str, Any], problems: Problems) -> None:
        """Reads each table of a TOML document; what cannot be read goes to `problems`."""
        self._document = document
        self._problems = problems
        for key in document.keys() - {*SINGLE, *REPEATED}:
            legal = ", ".join((*SINGLE, *REPEATED))
            problems.add("unknown_key", key, f"no such table; legal: {legal}")
        self.mission = self._one("mission", tables.Mission, needed=True)
        self.workspace = self._one("workspace", tables.Shape, needed=True)
        self.limits = self._one("limits", tables.Limits)
        self.replan = self._one("replan", tables.Replan)
        self.planner = self._one("planner", tables.Planner)
        self.energy = self._one("energy", tables.Energy) if "energy" in document else None
        self.wind = self._one("wind", tables.Wind)
        self.obstacles = self._many("obstacle", tables.Obstacle)
        self.targets = self._many("target", tables.TargetTable)
        self.regions = self._many("region", tables.NamedRegion)
        self.drones = self._many("drone", tables.DroneTable)
        self.disturbances = self._many("disturbance", tables.Disturbance)
        self.gusts = self._many("gust", tables.Gust)
        self.assignment = self._assignment()

    def entries(self, key: str) -> int:
        """How many tables `[[key]]` the file has, readable or not."""
        entries = self._document.get(key, [])
        return len(entries) if isinstance(entries, list) else 1

    @property
    def complete(self) -> bool:
        """Whether every obstacle, target, region and drone of the file could be read."""
        read = {"obstacle": len(self.obstacles), "target": len(self.targets)}
        read |= {"region": len(self.regions), "drone": len(self.drones)}
        return all(count == self.entries(key) for key, count in read.items())

    def _one(self, key: str, table: type[T], *, needed: bool = False) -> T | None:
        if key not in self._document and needed:
            self._problems.add("missing_key", key, f"the table [{key}] is missing")
            return None
        return self._table(key, self._document.get(key, {}), table)

    def _many(self, key: str, table: type[T]) -> dict[int, T]:
        entries = self._document.get(key, [])
        if not isinstance(entries, list):
            self._problems.add("type", key, f"must be a list of tables, written [[{key}]]")
            return {}
        read = {i: self._table(f"{key}[{i}]", entry, table) for i, entry in enumerate(entries)}
        return {i: entry for i, entry in read.items() if entry is not None}

    def _table(self, field: str, value: object, table: type[T]) -> T | None:
        try:
            return table.model_validate(value)
        except ValidationError as error:
            for detail in error.errors(include_url=False):
                self._problems.add(*_translate(field, detail, table))
            return None

    def _assignment(self) -> dict[str, list[str]] | None:
        if "assignment" not in self._document:
            return None
        try:
            return TypeAdapter(dict[str, list[str]]).validate_python(
                self._document["assignment"], strict=True
            )
        except ValidationError as error:
            for detail in error.errors(include_url=False):
                self._problems.add(*_translate("assignment", detail, None))
            return None


def read(path: Path) -> tuple[Tables, Problems]:
    """Reads a scenario file.

    Raises:
        ScenarioError: the file cannot be read or is not TOML.
    """
    try:
        with path.open("rb") as file:
            document = tomllib.load(file)
    except FileNotFoundError:
        code, message = "missing_file", "no such file"
    except OSError as error:
        code, message = "unreadable", error.strerror or str(error)
    except UnicodeDecodeError as error:
        code, message = "toml", f"not TOML: byte {error.start} is not UTF-8 text"
    except tomllib.TOMLDecodeError as error:
        code, message = "toml", f"not TOML: {error}"
    except RecursionError:
        code, message = "toml", "not TOML that can be read: nested too deep"
    else:
        problems = Problems(str(path))
        return Tables(document, problems), problems
    raise ScenarioError([Problem(code, str(path), "", message)])


def _translate(field: str, detail: ErrorDetails, table: type[BaseModel] | None) -> tuple[str, str, str]:
    """A pydantic error as code, field and message, in the words of a scenario file."""
    path = field
    for part in detail["loc"]:
        path += f"[{part}]" if isinstance(part, int) else f".{part}"
    kind, given = detail["type"], detail["input"]
    if kind == "missing":
        return "missing_key", path, "is missing"
    if kind == "extra_forbidden":
        legal = ", ".join(_keys(table, detail["loc"][:-1])) if table else ""
        return "unknown_key", path, f"no such key; legal: {legal}"
    if kind == "shape":
        return "shape", path, detail["msg"]
    code = "value" if kind in _RANGES else "type"
    return code, path, f"{_shown(given)} is not legal; must be {_legal(detail)}"


def _legal(detail: ErrorDetails) -> str:
    """What would be legal, as the words after "must be"."""
    kind, context = detail["type"], detail.get("ctx", {})
    if kind in {"model_type", "dict_type"}:
        return "a table"
    if kind in {"tuple_type", "list_type"}:
        return "a list"
    if kind == "too_short":
        return f"a list of at least {context['min_length']} values"
    if kind == "too_long":
        return f"a list of at most {context['max_length']} values"
    return detail["msg"].removeprefix("Input should be ").replace("a valid ", "a ")


_RANGES = {
    "greater_than",
    "greater_than_equal",
    "less_than",
    "less_than_equal",
    "finite_number",
    "too_short",
    "too_long",
}


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _keys(table: type[BaseModel], loc: tuple[int | str, ...]) -> list[str]:
    """The legal keys of the table at `loc` inside `table`."""
    for part in loc:
        field = table.model_fields.get(part) if isinstance(part, str) else None
        inner = _table_of(field.annotation) if field is not None else None
        table = inner or table
    return list(table.model_fields)


def _table_of(annotation: object) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    candidates = (_table_of(inner) for inner in getattr(annotation, "__args__", ()))
    return next((table for table in candidates if table is not None), None)
