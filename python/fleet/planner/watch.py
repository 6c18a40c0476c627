"""Where the time of planning went, and how much memory it took."""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import dataclass, field


def peak_memory() -> float:
    """The most memory that this process has had resident so far [MB, 1e6 bytes]; getrusage(2)."""
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size * (1.0 if sys.platform == "darwin" else 1024.0) / 1e6


@dataclass
class Watch:
    """Where the time went [s]; `mark` is the end of the last part."""

    spent: dict[str, float] = field(
        default_factory=lambda: (
            {"process": time.process_time()} | dict.fromkeys(("route", "build", "solve", "certify"), 0.0)
        )
    )
    mark: float = field(default_factory=time.perf_counter)

    def lap(self, part: str) -> None:
        """Count the time since the last lap for `part`."""
        now = time.perf_counter()
        self.spent[part] += now - self.mark
        self.mark = now

    def move(self, seconds: float, one: str, other: str) -> None:
        """Count some of the time of `one` for `other`."""
        self.spent[one] -= seconds
        self.spent[other] += seconds
