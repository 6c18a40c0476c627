"""JSON Schema of scenario files, for editors that complete and check TOML."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ConfigDict, Field

from fleet.scenario.tables import (
    Disturbance,
    DroneTable,
    Energy,
    Gust,
    Limits,
    Mission,
    NamedRegion,
    Obstacle,
    Planner,
    Replan,
    Shape,
    Table,
    TargetTable,
    Wind,
)

#: Where the shipped schema lies in the repository.
FILE = "docs/scenario.schema.json"


class Document(Table):
    """A scenario file; lengths in metres, times in seconds, angles in radians."""

    model_config = ConfigDict(title="fleet scenario")

    mission: Mission
    workspace: Shape
    limits: Limits = Field(default_factory=Limits)
    replan: Replan = Field(default_factory=Replan)
    planner: Planner = Field(default_factory=lambda: Planner.model_validate({}))
    energy: Energy | None = None
    wind: Wind = Field(default_factory=lambda: Wind.model_validate({}))
    obstacle: list[Obstacle] = Field(default_factory=list)
    target: list[TargetTable] = Field(default_factory=list)
    region: list[NamedRegion] = Field(default_factory=list)
    drone: list[DroneTable] = Field(min_length=1, max_length=64)
    disturbance: list[Disturbance] = Field(default_factory=list)
    gust: list[Gust] = Field(default_factory=list)
    assignment: dict[str, list[str]] = Field(
        default_factory=dict, description="Targets of each drone, in order, by hand."
    )


def schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of scenario files.

    It knows tables, keys, types and ranges; names, geometry and the formula are for `fleet check`.
    """
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Document.model_json_schema()}


def text() -> str:
    """The schema as the text of a file."""
    return json.dumps(schema(), indent=2) + "\n"
