"""Visits that one drone may make in several regions ("d1 in a or d1 in b"): which region it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, product

from .problem import Problem
from .spec import Visit
from .survey import Map, places

#: Combinations of regions that are looked at, the first of each visit first.
MOST = 64


def ambiguous(visit: Visit) -> bool:
    """Whether some drone may make the visit in more than one region."""
    drones = [drone for drone, _ in visit.options]
    return len(set(drones)) < len(drones)


def alternatives(visit: Visit) -> list[Visit]:
    """The visit in each of its regions, for whoever can make it there; one drone makes it in one of them."""
    if not ambiguous(visit):
        return [visit]
    regions = dict.fromkeys(region for _, region in visit.options)
    return [replace(visit, options=tuple(o for o in visit.options if o[1] == r)) for r in regions]


def chosen(problem: Problem, world: Map) -> Iterator[tuple[Problem, Map]]:
    """The problem with every visit in one region a drone, and its map, for up to `MOST` combinations."""
    if not any(ambiguous(visit) for visit in problem.spec.visits):
        yield problem, world
        return
    number = {name: k for k, name in enumerate(world.names)}
    for visits in islice(product(*(alternatives(v) for v in problem.spec.visits)), MOST):
        one = replace(problem, spec=replace(problem.spec, visits=list(visits)))
        yield one, replace(world, place=places(one, number))
