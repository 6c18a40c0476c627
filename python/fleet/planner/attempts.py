"""What is tried until there is a plan: itineraries as they are, then the nearest misses with more effort."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from fleet.assign import EXACT

from . import groups
from .convex import Margins
from .improve import Attempt, Lead
from .knots import Array
from .problem import Problem
from .progress import Progress
from .schedule import Itinerary
from .setup import Setup
from .timing import raised

#: Planning methods by name.
METHODS: dict[str, groups.Method] = {"convex": groups.steps, "nlp": groups.nonlinear}
#: Near misses whose visits are moved; as many are then flown with segments of half the length.
NEAREST = 2


def attempts(task: Problem, ways: Sequence[Itinerary], method: str, lead: Lead) -> Iterator[Attempt]:
    """Itineraries and methods in the order in which they are tried, until something leads."""
    name = "convex" if method == "auto" else method
    fallback = groups.Fallback()
    run = fallback.steps if method == "auto" else METHODS[name]
    if len(task.spec.visits) > EXACT and not task.spec.changing(task.horizon):
        # A large fleet is not flown anew for visits that are only earlier or later (`schedules`).
        ways = [*ways[:1], *ways[3:]]
    yield from (Attempt(task, way, name, run, if_kept if name == "convex" else None) for way in ways)
    if name != "convex":
        return
    yield from (replace(one, timing=raised) for one in nearest(lead))
    # A piece is beyond one face of each obstacle: shorter ones get round corners that longer ones cannot.
    fine = replace(task, segment=task.segment / 2)
    yield from (replace(one, task=fine, timing=if_kept) for one in nearest(lead))
    if method == "auto":
        yield Attempt(task, ways[0], "nlp", fallback.last_resort)


def nearest(lead: Lead) -> list[Attempt]:
    """The attempts that came nearest to what limits and the tube ask; the first of equal ones."""
    ranked = sorted(lead.tried, key=lambda t: (t[1].share > 1, -t[1].tube))
    return [one for one, _ in ranked[:NEAREST]]


def if_kept(
    stage: Setup, x: Array, margins: Margins, progress: Progress | None
) -> tuple[Setup, Array, Margins]:
    """Visits are moved for more robustness where limits and the tube are kept already: it takes long."""
    if margins.share > 1 or margins.tube < -1e-6:
        return stage, x, margins
    return raised(stage, x, margins, progress)
