"""`fleet generate`: scenario files made by rule, and their JSON Schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fleet import files
from fleet.cli.reply import Json, reply
from fleet.faults import bad_input

group = typer.Typer(no_args_is_help=True, help="Make scenario files by rule, or their JSON Schema.")


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.add_typer(group, name="generate")


@group.command("schema")
def schema(
    output: Annotated[Path, typer.Option("-o", "--output", help="JSON file to write.")],
    as_json: Json = False,
) -> None:
    """Write the JSON Schema of scenario files, with which editors complete and check them.

    Name it in the first line of a scenario: #:schema scenario.schema.json

    Example: fleet generate schema -o scenario.schema.json
    """
    with reply("generate", as_json=as_json, keys=("file",)) as answer:
        from fleet.scenario import schema as document

        if output.suffix != ".json":
            raise bad_input(
                "file", "is not a schema's name; it must end in .json", file=str(output), field="--output"
            )
        files.write_atomic(output, document.text().encode())
        answer.fields["file"] = str(output)
        answer.say(f"{output}: JSON Schema of scenario files")


@group.command("line")
def line(
    output: Annotated[Path, typer.Option("-o", "--output", help="Scenario file (.toml) to write.")],
    towers: Annotated[int, typer.Option(help="Number of towers, 1 to 32.")] = 4,
    seed: Annotated[int, typer.Option(help="Seed of the small differences from tower to tower.")] = 1,
    as_json: Json = False,
) -> None:
    """Write a line of towers 40 m apart, with two drones and four targets at each, and 60 s to visit them.

    Example: fleet generate line --towers 8 --seed 1 -o line_8.toml
    """
    with reply("generate", as_json=as_json, keys=("file", "towers", "drones", "targets")) as answer:
        from fleet import generate

        if output.suffix != ".toml":
            raise bad_input(
                "file", "is not a scenario's name; it must end in .toml", file=str(output), field="--output"
            )
        if not 1 <= towers <= generate.MOST_TOWERS:
            legal = f"legal is 1 to {generate.MOST_TOWERS} (two drones a tower, at most 64 drones)"
            raise bad_input("value", f"{towers} is not legal; {legal}", field="--towers")
        if not 0 <= seed < 2**63:
            raise bad_input("value", f"{seed} is not legal; legal is 0 to 2^63 - 1", field="--seed")
        files.write_atomic(output, generate.line(towers, seed).encode())
        answer.scenario, answer.seed = output.stem, seed
        counts = {"drones": generate.DRONES * towers, "targets": generate.TARGETS * towers}
        answer.fields |= {"file": str(output), "towers": towers, **counts}
        answer.say(f"{output}: {towers} towers, {counts['drones']} drones, {counts['targets']} targets")
