"""Planning against the clock: a certified plan first, better ones until the time is up.

Only here may a wall clock decide anything, and only when a time limit is asked for. The clock is looked at
whenever planning tells its progress, which is after every convex step and every iteration of IPOPT.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from fleet.errors import InfeasibleError, TimeLimitError

from .plan import improving
from .progress import Progress, TimeUp
from .result import PlanResult, Status

if TYPE_CHECKING:
    from fleet.scenario import Scenario


class End(StrEnum):
    """Why a search ended; `INTERRUPTED` is for the caller to say."""

    FIRST = "first"
    BOUND = "bound"
    EXHAUSTED = "exhausted"
    TIME_LIMIT = "time_limit"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Moment:
    """A better plan was found `t` [s] after planning began: its robustness and bound [m], energy, method."""

    t: float
    rho: float
    rho_lower: float
    method: str
    int_a2: float

    def as_dict(self) -> dict[str, Any]:
        """An entry of `history` in `--json`."""
        return asdict(self)


@dataclass
class Found:
    """What a search has found so far. The caller owns it, and so has it even when the search is broken off.

    `best` is certified; `history` has an entry for every plan that was the best in its time; `ended` says
    why the search stopped by itself, `spent` after how long [s].
    """

    best: PlanResult | None = None
    history: list[Moment] = field(default_factory=list)
    ended: End | None = None
    spent: float = 0.0

    def take(self, better: PlanResult, t: float) -> None:
        """Replace the best by a better one."""
        moment = Moment(t, better.rho, better.rho_lower, better.method, better.int_a2)
        # In this order a signal in between leaves a plan without its entry, never an entry without its plan.
        self.best = better
        self.history.append(moment)


def search(
    scenario: Scenario,
    found: Found,
    *,
    time_limit: float | None = None,
    method: str = "auto",
    progress: Progress | None = None,
    relax: bool = False,
) -> None:
    """Put the first certified plan into `found`, and with a `time_limit` [s] better ones until it has passed.

    Without a time limit this is `plan`. With one it ends earlier when the robustness is at its bound and
    nothing saves energy any more; what has been found depends on how fast the machine is. With `relax` a
    mission that cannot hold has the plan of least violation.

    Raises TimeLimitError when no plan was found in time, and else as `plan` does.
    """
    begin = time.perf_counter()

    def tell(stage: str, rho: float) -> None:
        if time_limit is not None and time.perf_counter() - begin >= time_limit:
            raise TimeUp
        if progress is not None:
            progress(stage, rho)

    try:
        further = time_limit is not None
        for better in improving(scenario, progress=tell, method=method, further=further, relax=relax):
            found.take(better, time.perf_counter() - begin)
        at_bound = found.best is not None and found.best.status is Status.OPTIMAL
        found.ended = End.BOUND if at_bound else End.EXHAUSTED
        if time_limit is None:
            found.ended = End.FIRST
    except TimeUp as end:
        if found.best is None:
            raise out_of_time(time_limit, end.refusal) from None
        found.ended = End.TIME_LIMIT
    finally:
        found.spent = time.perf_counter() - begin


def out_of_time(limit: float | None, refusal: InfeasibleError | None) -> TimeLimitError:
    """Why there is no plan: the time, and what was in the way of the attempts until then."""
    text = f"no plan within {limit:g} s (--time-limit)"
    if refusal is not None:
        text += f"; the attempts until then failed: {refusal}"
    return TimeLimitError(text)
