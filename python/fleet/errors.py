"""Everything that can go wrong for a reason outside the program, and the exit code of each.

    FleetError                 base; never raised itself
    +-- ViolatedError        1 the mission is violated or was aborted
    +-- InputError           2 something the user wrote is not legal
    |   +-- ScenarioError      a scenario file, with all of its problems at once
    |   +-- FormulaError       a formula text, with line and column
    |   +-- LogError           a flight log that cannot be read
    +-- InfeasibleError      3 no plan can satisfy the mission; names the clause
    +-- TimeLimitError       3 no plan was found in the time given; there may be one
    +-- EnvironmentError_    4 port, peer, process or version
    +-- InterruptedError_  130 stopped by the user with nothing kept

The command line prints `str(error)` on stderr, and `error.problems` as the `errors` of `--json`
(design.md, Exit codes); other exceptions are defects of the program and keep their traceback.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import ClassVar


class Exit(IntEnum):
    """Exit codes of the `fleet` command (design.md, Exit codes)."""

    SATISFIED = 0
    VIOLATED = 1
    INPUT = 2
    INFEASIBLE = 3
    ENVIRONMENT = 4
    INTERRUPTED = 130


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong: which file, which field of it, its value and what would be legal.

    `code` is a short stable word for programs; `file` and `field` are empty where there is none.
    """

    code: str
    file: str
    field: str
    message: str

    def __str__(self) -> str:
        where = ": ".join(part for part in (self.file, self.field) if part)
        return f"{where}: {self.message}" if where else self.message

    def as_dict(self) -> dict[str, str]:
        """The object that stands in `errors` of `--json`."""
        return {"code": self.code, "file": self.file, "field": self.field, "message": self.message}


class FleetError(Exception):
    """Base of all errors that a user can cause or meet; `problems` has at least one entry."""

    exit_code: ClassVar[Exit] = Exit.ENVIRONMENT
    code: ClassVar[str] = "error"

    def __init__(self, message: str, *, problems: Sequence[Problem] = ()) -> None:
        super().__init__(message)
        self.problems: list[Problem] = list(problems) or [Problem(self.code, "", "", message)]


class ViolatedError(FleetError):
    """The mission is violated or was aborted."""

    exit_code = Exit.VIOLATED
    code = "violated"


class InputError(FleetError):
    """Something that the user wrote is not legal."""

    exit_code = Exit.INPUT
    code = "input"


class ScenarioError(InputError):
    """A scenario file with at least one problem; `problems` has all of them."""

    code = "scenario"

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems), problems=problems)


class FormulaError(InputError):
    """A formula text that cannot be read.

    `line` and `column` count from 1; the message ends with the line and a caret below the place.
    """

    code = "formula"

    def __init__(self, message: str, text: str, line: int, column: int) -> None:
        lines = text.splitlines() or [""]
        shown = lines[min(line, len(lines)) - 1].replace("\t", " ")
        caret = " " * (column - 1) + "^"
        super().__init__(f"line {line}, column {column}: {message}\n    {shown}\n    {caret}")
        self.reason = message
        self.line = line
        self.column = column


class LogError(InputError):
    """A flight log that cannot be read."""

    code = "log"

    def __init__(self, path: Path, message: str) -> None:
        super().__init__(f"{path}: {message}", problems=[Problem(self.code, str(path), "", message)])
        self.path = path


@dataclass(frozen=True)
class Need:
    """When `drone` can be in `region` at the earliest, and by when it must be there [s, mission time]."""

    drone: str
    region: str
    needs_s: float
    by_s: float

    def __str__(self) -> str:
        if self.needs_s > self.by_s + 1e-9:
            where = f"{self.drone} cannot reach {self.region} before {self.by_s:.1f} s"
            return f"{where}: needs {self.needs_s:.1f} s, {self.needs_s - self.by_s:.1f} s too many"
        return f"{self.drone} reaches {self.region} at {self.needs_s:.1f} s, due by {self.by_s:.1f} s"

    def as_dict(self) -> dict[str, str | float]:
        """One of `times` of `conflict`."""
        return {"drone": self.drone, "region": self.region, "needs_s": self.needs_s, "by_s": self.by_s}


@dataclass(frozen=True)
class Conflict:
    """Clauses that cannot hold together (none: the limits of flight alone forbid the mission).

    `proved` tells an impossibility from a search without result; with `minimal`, a plan was found for
    the clauses without any one of them. `text` is for people; `times` has the visits concerned.
    """

    clauses: tuple[str, ...]
    proved: bool
    minimal: bool
    text: str
    times: tuple[Need, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """`conflict` of `plan --json`."""
        head = {"clauses": list(self.clauses), "proved": self.proved, "minimal": self.minimal}
        return {**head, "text": self.text, "times": [need.as_dict() for need in self.times]}


class InfeasibleError(FleetError):
    """No plan satisfies the mission, or none was found.

    `clause` is the id of a clause that cannot hold, if known; `conflict` the set of clauses that cannot
    hold together, once it was searched for.
    """

    exit_code = Exit.INFEASIBLE
    code = "infeasible"

    def __init__(self, message: str, *, clause: str | None = None, conflict: Conflict | None = None) -> None:
        named = conflict.clauses if conflict else (clause,) if clause else ()
        field = f"clause{'s' if len(named) > 1 else ''} {', '.join(named)}" if named else ""
        super().__init__(
            f"{field}: {message}" if field else message,
            problems=[Problem(self.code, "", field, message)],
        )
        self.clause = named[0] if named else None
        self.conflict = conflict


class TimeLimitError(FleetError):
    """No plan was found in the time given; that does not say that there is none."""

    exit_code = Exit.INFEASIBLE
    code = "time_limit"


class EnvironmentError_(FleetError):  # noqa: N801  (the plain name is a built-in)
    """A port, peer, process or version is not as needed."""

    exit_code = Exit.ENVIRONMENT
    code = "environment"


class InterruptedError_(FleetError):  # noqa: N801  (the plain name is a built-in)
    """Stopped by the user before there was anything to keep."""

    exit_code = Exit.INTERRUPTED
    code = "interrupted"
