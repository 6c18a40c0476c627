"""Planning with the best plan kept: a live table of robustness against time, a time limit, Ctrl-C."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from fleet.cli.reply import Reply
from fleet.faults import bad_input
from fleet.interrupt import Interrupt

if TYPE_CHECKING:
    from fleet.planner import PlanResult
    from fleet.planner.anytime import Found
    from fleet.planner.progress import Progress
    from fleet.scenario import Scenario

LONGEST_S = 86_400.0
"""Longest time limit [s]: a day."""
_BARS = "▁▂▃▄▅▆▇█"
_WIDTH = 32
_ROWS = 6
_PER_SECOND = 8.0
_ENDED = {
    "first": "no better one was asked for",
    "bound": "rho is at its bound and nothing more saves energy",
    "exhausted": "nothing is left to try",
    "time_limit": "the time limit has passed",
    "interrupted": "interrupted",
}
"""The `ended` of `--json` in words."""


def keep_best(
    answer: Reply,
    interrupt: Interrupt,
    scenario: Scenario,
    method: str,
    time_limit: float | None,
    *,
    relax: bool = False,
) -> PlanResult:
    """The first certified plan, or the best one by the time limit; a signal keeps the best so far.

    From here on signals are only counted, so that what was found is also written. The search is told to
    people on stderr and becomes `history` in `--json`.

    Raises KeyboardInterrupt when a signal came before there was a plan.
    """
    from fleet.planner import anytime
    from fleet.planner.watch import peak_memory

    if time_limit is not None and not 0 < time_limit <= LONGEST_S:
        text = f"{time_limit:g} is not a legal time limit; legal is above 0 up to {LONGEST_S:g} s"
        raise bad_input("value", text, field="--time-limit")
    found = anytime.Found()
    try:
        with shown(answer.err, f"planning {scenario.name}", found) as tell:
            anytime.search(scenario, found, time_limit=time_limit, method=method, progress=tell, relax=relax)
            interrupt.count_only()
    except KeyboardInterrupt:
        if found.best is None:
            raise
        found.ended = anytime.End.INTERRUPTED
    assert found.best is not None, "a search without a plan raises"
    answer.fields["history"] = [moment.as_dict() for moment in found.history]
    answer.fields["ended"] = str(found.ended)
    answer.fields["memory_mb"] = peak_memory()
    if found.ended is anytime.End.INTERRUPTED:
        answer.err.print(f"interrupted: kept the best plan, rho {found.best.rho:.3f} m", markup=False)
    if time_limit is not None:
        answer.err.print(summary(found), markup=False)
    return found.best


def summary(found: Found) -> str:
    """First and best plan, and why the search ended, in a line."""
    first, best = found.history[0], found.history[-1]
    parts = [f"first plan after {first.t:.1f} s: rho {first.rho:.3f} m, int|a|^2 {first.int_a2:.3f} m^2/s^3"]
    if best is not first:
        parts.append(f"best after {best.t:.1f} s: rho {best.rho:.3f} m, int|a|^2 {best.int_a2:.3f} m^2/s^3")
    return "; ".join(parts) + f"; ended after {found.spent:.1f} s: {_ENDED[str(found.ended)]}"


@contextmanager
def shown(console: Console, title: str, found: Found) -> Iterator[Progress]:
    """Show a search while it runs: a live table on a terminal, a line for every better plan elsewhere."""
    view = View(title, found)
    if not console.is_terminal:
        yield view.saying(console)
        return
    with Live(get_renderable=view.table, console=console, transient=True, refresh_per_second=_PER_SECOND):
        yield view.note


class View:
    """What a search is doing: certified plans so far, the stage it is in, and the robustness of late."""

    def __init__(self, title: str, found: Found) -> None:
        """Nothing told yet."""
        self.title = title
        self.found = found
        self.begin = time.perf_counter()
        self.stage, self.rho = "start", 0.0
        self.trace: list[float] = []
        self.bound: float | None = None

    def note(self, stage: str, rho: float) -> None:
        """Take up what planning tells; its first word is the upper bound."""
        self.bound = rho if self.bound is None else self.bound
        self.stage, self.rho = stage, rho
        if stage not in ("route", "build") and math.isfinite(rho):
            self.trace.append(rho)
            del self.trace[:-_WIDTH]

    def table(self) -> Group:
        """Elapsed time, stage, robustness and bound of certified plans; the last line is the present."""
        table = Table(box=None, pad_edge=False)
        for name in ("t [s]", "stage", "rho", "certified", "bound", "int|a|^2"):
            table.add_column(name, justify="left" if name == "stage" else "right")
        bound = _f(self.bound)
        for one in self.found.history[-_ROWS:]:
            numbers = (f"{one.rho:.3f}", f"{one.rho_lower:.3f}", bound, f"{one.int_a2:.3f}")
            table.add_row(f"{one.t:.1f}", one.method, *numbers)
        elapsed = time.perf_counter() - self.begin
        table.add_row(f"{elapsed:.1f}", self.stage, _f(self.rho), "-", bound, "-", style="dim")
        return Group(Text(self.title), table, Text(sparkline(self.trace, self.bound)))

    def saying(self, console: Console) -> Progress:
        """Progress that prints a line for every better plan."""
        told = 0

        def tell(stage: str, rho: float) -> None:
            nonlocal told
            self.note(stage, rho)
            for one in self.found.history[told:]:
                told += 1
                line = f"{one.t:.1f} s: rho {one.rho:.3f} m of {_f(self.bound)} m, int|a|^2 {one.int_a2:.3f}"
                console.print(f"{self.title}: {line} ({one.method})", markup=False)

        return tell


def _f(value: float | None) -> str:
    return f"{value:.3f}" if value is not None and math.isfinite(value) else "-"


def sparkline(values: list[float], bound: float | None) -> str:
    """A bar for each value between 0 and the bound (or the largest value)."""
    top = max([bound or 0.0, *values], default=0.0)
    if not 0 < top < float("inf"):
        return ""
    return "".join(_BARS[min(int(max(v, 0.0) / top * len(_BARS)), len(_BARS) - 1)] for v in values)
