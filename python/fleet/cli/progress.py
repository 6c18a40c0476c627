"""Progress of anything that lasts over a second, on stderr: bars on a terminal, a line at times elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

Tell = Callable[[str], None]
_PLAIN_PERIOD_S = 5.0


@contextmanager
def spinner(console: Console, title: str) -> Iterator[Tell]:
    """A spinner with elapsed time; the block calls the yielded function with what it is doing."""
    if not console.is_terminal:
        yield _plain(console, title)
        return
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title)
        yield lambda what: progress.update(task, description=f"{title}: {what}" if what else title)


@contextmanager
def bar(console: Console, title: str, total: float) -> Iterator[Callable[[float, str], None]]:
    """A bar up to ``total``; the block calls the yielded function with how far it is and a note."""
    if not console.is_terminal:
        say = _plain(console, title)
        yield lambda done, note: say(f"{min(done / total, 1.0):.0%} {note}")
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[note]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(title, total=total, note="")
        yield lambda done, note: progress.update(task, completed=min(max(done, 0.0), total), note=note)


def _plain(console: Console, title: str) -> Tell:
    """Without a terminal: a line at most every 5 s, so that a log file stays readable."""
    last = [time.monotonic()]

    def say(what: str) -> None:
        now = time.monotonic()
        if now - last[0] >= _PLAIN_PERIOD_S:
            last[0] = now
            console.print(f"{title}: {what}", markup=False)

    return say
