"""Heading of every drone: quintic rest-to-rest turns that fill the legs between its visits."""

from __future__ import annotations

import numpy as np

from fleet.errors import InfeasibleError
from fleet.route import turn_time

from .knots import Array
from .problem import Problem
from .schedule import Itinerary
from .turns import shortest_turn


def headings(problem: Problem, itinerary: Itinerary, drone: int, times: Array) -> Array:
    """Heading, rate and acceleration (n, 3) [rad; s] at the knot times of one drone.

    The heading is at rest at the wanted value at every visit that wants one, over its dwell, and is
    not wrapped. Knots sample one quintic a leg, which the quintics between the knots reproduce.
    Raises InfeasibleError when a turn would exceed the heading rate.
    """
    out = np.zeros((len(times), 3))
    psi, since = float(problem.psi[drone]), 0.0
    out[:, 0] = psi
    for stop in itinerary.stops[drone]:
        wanted = problem.headings.get(stop.region)
        if wanted is None:
            continue
        turn = shortest_turn(psi, wanted)
        need = turn_time(turn, problem.heading_rate)
        if need > stop.t - since + 1e-9:
            turns = f"{problem.ids[drone]} turns {np.degrees(turn):.0f} deg to {stop.region}"
            text = f"{turns} in {stop.t - since:.2f} s"
            why = f"it needs {need:.2f} s at {np.degrees(problem.heading_rate):.0f} deg/s"
            raise InfeasibleError(f"{text}: {why}", clause=stop.visit.clause)
        out[times >= since - 1e-9] = quintic_turn(psi, turn, since, stop.t, times[times >= since - 1e-9])
        psi, since = psi + turn, stop.t + stop.visit.dwell
    return out


def quintic_turn(psi: float, turn: float, start: float, end: float, times: Array) -> Array:
    """Heading, rate, acceleration (n, 3) of the rest-to-rest quintic from psi over [start, end]."""
    h = end - start
    u = np.clip((times - start) / h, 0.0, 1.0)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    rate = 30 * u**2 * (1 - u) ** 2 / h
    acceleration = 60 * u * (1 - u) * (1 - 2 * u) / h**2
    return np.column_stack([psi + turn * s, turn * rate, turn * acceleration])
