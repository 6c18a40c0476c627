"""After a flight: one log from the parts, the verdict, the report."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fleet.files import PlanFile
from fleet.rundir import RunDir

if TYPE_CHECKING:
    from fleet.verdict import Verdict


CLOSE_S = 15.0
"""Longest wait for a part of the log to be closed by the process that writes it [s]."""


@dataclass(frozen=True)
class Finished:
    """Merged log, report, and the judgement."""

    log: Path
    report: Path
    verdict: Verdict


def finish(
    mission: PlanFile, parts: list[Path], t0_ns: int, run: RunDir, *, progress: Callable[[float, str], None]
) -> Finished:
    """Judge the flight, merge ``parts`` with the verdict, and write the report.

    ``t0_ns`` is mission time 0 on the log's clock.

    Raises:
        LogError: when a part is missing or cannot be read.
    """
    from fleet import report
    from fleet.log import Mission, assemble, is_complete, merge
    from fleet.verdict import judge

    # An agent that was running before the flight closes its log in its own time.
    deadline = time.monotonic() + CLOSE_S
    while not all(is_complete(part) for part in parts) and time.monotonic() < deadline:
        progress(0.0, "waiting for logs to be closed")
        time.sleep(0.1)

    about = Mission(mission.payload, t0_ns)
    progress(0.0, "reading logs")
    flight = assemble(parts, run.log, about)
    progress(0.3, "judging")
    verdict = judge(flight)
    merge(
        parts,
        run.log,
        about,
        verdict=verdict.as_dict(),
        progress=lambda done: progress(0.4 + 0.4 * done, "merging logs"),
    )
    progress(0.8, "writing the report")
    report.write(flight, verdict, run.report)
    return Finished(run.log, run.report, verdict)


def t0_of(log: Path) -> int:
    """Mission time 0 [ns] that the virtual-time simulator wrote in its own log.

    Raises:
        LogError: when the log cannot be read.
    """
    import json

    from fleet.log.flight import messages

    missions = [json.loads(data) for _, _, data in messages(log, ["/mission"])]
    return int(missions[-1]["t0_ns"])
