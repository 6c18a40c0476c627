"""What planning tells while it runs, and how it is told that the time is up."""

from __future__ import annotations

from collections.abc import Callable

from fleet.errors import InfeasibleError

#: Called with the stage and the robustness reached in it [m]; what it raises ends the planning.
Progress = Callable[[str, float], None]


def silent(_stage: str, _rho: float) -> None:
    """Progress that nobody listens to."""


class TimeUp(Exception):
    """Raised by a `Progress` once the time limit has passed; `refusal` is why nothing was found so far."""

    refusal: InfeasibleError | None = None
