"""All commands under one name."""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

import typer

from fleet.cli import flight, generate, ground, planning, spec
from fleet.cli.reply import SETTINGS, usage_error

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Plan, fly and judge missions of a fleet of inspection drones.",
    epilog="Exit codes: 0 satisfied, 1 violated or aborted, 2 bad input, 3 no feasible plan, 4 environment, "
    "130 interrupted with nothing kept.",
)
planning.register(app)
spec.register(app)
generate.register(app)
flight.register(app)
ground.register(app)


def _version(wanted: bool) -> None:
    if not wanted:
        return
    try:
        number = version("fleet-inspect")
    except PackageNotFoundError:
        number = "(not installed)"
    typer.echo(f"fleet {number}")
    raise typer.Exit


@app.callback()
def _settings(
    debug: Annotated[
        bool, typer.Option("--debug", help="Show where in the program a defect happened.")
    ] = False,
    _show_version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    SETTINGS.debug = debug


def run(arguments: list[str]) -> int:
    """Run one command line; its exit code."""
    try:
        app(arguments, prog_name="fleet")
    except SystemExit as end:
        if SETTINGS.answered is not None:
            # A signal after the answer does not change it.
            return SETTINGS.answered
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        if code == 2 and "--json" in arguments:
            usage_error(arguments)
            sys.stdout.flush()
        return code
    return 0
