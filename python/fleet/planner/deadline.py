"""How late visits must come, at the least, by the lower bounds of leg times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fleet.assign import EXACT, assign

from .necessary import Geometry
from .problem import Problem
from .reach import least_times

#: Steps of bisection over the mission's length.
BISECTIONS = 14


@dataclass(frozen=True)
class Deadlines:
    """A problem whose visits have, some of them, a deadline `due` [s] that may be put off."""

    problem: Problem
    due: Sequence[float | None]

    def least(self) -> float:
        """The least delay [s] common to all late visits; infinite when even T is too early.

        Zero for fleets whose visits are too many to assign exactly.
        """
        reach = least_times(self.problem, Geometry(self.problem))
        late = [e for e, due in enumerate(self.due) if due is not None]
        if len(reach.visits) > EXACT or not late:
            return 0.0
        was = np.array([self.due[e] for e in late], dtype=float)

        def fits(delay: float) -> bool:
            windows = reach.legs.windows.copy()
            windows[late, 1] = np.minimum(was + delay, self.problem.horizon)
            return assign(replace(reach.legs, windows=windows)) is not None

        low, high = 0.0, self.problem.horizon
        if not fits(high):
            return np.inf
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            low, high = (low, middle) if fits(middle) else (middle, high)
        return high
