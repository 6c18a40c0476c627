"""What a command answers: text for people or one JSON object, and the exit code.

The only place that maps errors to messages and exit codes.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any

import typer
from rich.console import Console

from fleet.errors import Exit, FleetError, Problem

SCHEMA = 1
"""Version of the `--json` objects (design.md, --json)."""
EXIT_DEFECT = 70
"""Exit code of a defect of the program itself (EX_SOFTWARE of sysexits.h); never one of design.md's codes."""

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on stdout; all else goes to stderr.")
]


@dataclass
class Settings:
    """Options of `fleet` itself, and the exit code of the command that has answered, if one has."""

    debug: bool = False
    answered: int | None = None


SETTINGS = Settings()


@dataclass
class Reply:
    """The answer of one command while it is made. ``fields`` are the keys of `--json`, null until known."""

    command: str
    as_json: bool
    fields: dict[str, Any] = field(default_factory=dict)
    scenario: str | None = None
    seed: int | None = None
    exit: int = 0
    problems: list[Problem] = field(default_factory=list)

    @cached_property
    def out(self) -> Console:
        """Where results for people go: stdout, or stderr when stdout is for JSON."""
        return self.err if self.as_json else Console(highlight=False, soft_wrap=True)

    @cached_property
    def err(self) -> Console:
        """Where progress and errors go; one console, so that lines and bars do not overwrite each other."""
        return Console(stderr=True, highlight=False, soft_wrap=True)

    def say(self, text: str) -> None:
        """A line for people; nothing in it is markup."""
        self.out.print(text, markup=False)

    def fail(self, error: FleetError) -> None:
        """Take over an error's problems and exit code."""
        self.exit = int(error.exit_code)
        self.problems = list(error.problems)
        self.err.print(f"fleet {self.command}: {error}", markup=False, style="red")
        for note in getattr(error, "__notes__", []):
            self.err.print(note, markup=False)

    def as_dict(self) -> dict[str, Any]:
        """The object of `--json`."""
        head = {"schema": SCHEMA, "command": self.command, "scenario": self.scenario, "seed": self.seed}
        return head | {"exit": self.exit, "errors": [one.as_dict() for one in self.problems]} | self.fields


@contextmanager
def reply(command: str, *, as_json: bool, keys: tuple[str, ...] = ()) -> Iterator[Reply]:
    """Run one command's body; turns what goes wrong into a message and an exit code, then exits.

    A FleetError is the user's or the surroundings' and prints its message. Any other exception is a defect of
    the program: it prints one line, and the traceback only with `fleet --debug`.
    """
    answer = Reply(command, as_json, fields=dict.fromkeys(keys))
    try:
        yield answer
    except FleetError as error:
        answer.fail(error)
    except KeyboardInterrupt:
        answer.exit = int(Exit.INTERRUPTED)
        answer.problems = [Problem("interrupted", "", "", "interrupted; nothing was kept")]
        answer.err.print(f"fleet {command}: interrupted; nothing was kept")
    except (BrokenPipeError, typer.Exit):
        raise
    except Exception as error:  # noqa: BLE001 - the boundary: a defect must end in a message as well
        _defect(answer, error)
    if as_json:
        sys.stdout.write(json.dumps(answer.as_dict(), allow_nan=False) + "\n")
        sys.stdout.flush()
    SETTINGS.answered = answer.exit
    raise typer.Exit(answer.exit)


def _defect(answer: Reply, error: Exception) -> None:
    answer.exit = EXIT_DEFECT
    text = f"{type(error).__name__}: {error}"
    answer.problems = [Problem("defect", "", "", text)]
    if SETTINGS.debug:
        traceback.print_exception(error, file=sys.stderr)
    hint = "" if SETTINGS.debug else f"; run `fleet --debug {answer.command} ...` again for where"
    answer.err.print(
        f"fleet {answer.command}: this is a defect of fleet: {text}{hint}", markup=False, style="red"
    )


def usage_error(arguments: list[str]) -> None:
    """The JSON object of a command line that could not be read; the parser has explained it on stderr."""
    command = next((one for one in arguments if not one.startswith("-")), "")
    answer = Reply(command, True, exit=int(Exit.INPUT))
    answer.problems = [Problem("usage", "", "", "the command line is not legal; see stderr")]
    sys.stdout.write(json.dumps(answer.as_dict()) + "\n")
