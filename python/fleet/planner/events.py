"""Visit times as unknowns: how far each may move, what keeps them apart, and the knots that move along."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fleet.route import turn_time

from .knots import SAME_KNOT, Array, Ints
from .problem import Problem
from .schedule import Itinerary
from .setup import marks
from .turns import shortest_turn

#: Least time between two visits of a drone [s], and between a visit and the end of a window of an
#: invariant unless they coincide: the wire's shortest segment is 0.05 s.
GAP = 0.1


@dataclass(frozen=True)
class Events:
    """The visits of an itinerary as unknown times, in samples of `sample` [s].

    `who` (drone, stop) of every event; `t`, `low`, `high` (n,) times and where they may be; `links`
    (m, 3): event, later event of the same drone, least difference, sorted by the later event.
    """

    sample: float
    who: tuple[tuple[int, int], ...]
    t: Array
    low: Ints
    high: Ints
    links: Ints


def samples(t: float, sample: float) -> int:
    """A duration [s] in samples, rounded up."""
    return int(np.ceil(t / sample - 1e-6))


def events(problem: Problem, itinerary: Itinerary) -> Events:
    """Windows, order, dwell and turns of heading as bounds on visit times and their differences.

    The heading is reached before the visit: between two visits that want headings lies the time of the
    turn (heading.py). Where the itinerary itself is tighter than `GAP`, it may stay so.
    """
    T_s, end = problem.sample, round(problem.horizon / problem.sample)
    who: list[tuple[int, int]] = []
    t, low, high, links = [], [], [], []
    for d, stops in enumerate(itinerary.stops):
        first, psi, turned = len(who), float(problem.psi[d]), -1
        for k, stop in enumerate(stops):
            e, stay = first + k, samples(stop.visit.dwell, T_s)
            at = round(stop.t / T_s)
            after = 0 if k == 0 else round((stops[k - 1].t + stops[k - 1].visit.dwell) / T_s)
            room = max(min(samples(GAP, T_s), at - after), 0)
            least, most = samples(stop.visit.window[0], T_s), int(stop.visit.window[1] / T_s + 1e-6)
            wanted = problem.headings.get(stop.region)
            turn = 0.0 if wanted is None else shortest_turn(psi, wanted)
            need = samples(turn_time(turn, problem.heading_rate), T_s)
            if k > 0:
                links.append((e - 1, e, samples(stops[k - 1].visit.dwell, T_s) + room))
            if turned >= 0:
                links.append((turned, e, samples(stops[turned - first].visit.dwell, T_s) + need))
            who.append((d, k))
            t.append(stop.t / T_s)
            low.append(max(least, room if k == 0 else 0, need if turned < 0 else 0))
            high.append(min(most, end - stay - min(samples(GAP, T_s), max(end - stay - at, 0))))
            if wanted is not None:
                psi, turned = psi + turn, e
    return Events(
        T_s,
        tuple(who),
        np.array(t, dtype=float),
        np.array(low, dtype=int),
        np.array(high, dtype=int),
        np.array(links, dtype=int).reshape(-1, 3),
    )


def snapped(found: Events, t: Array) -> Array | None:
    """Whole samples (n,) nearest to `t` (n,) that keep all bounds and links; None when there are none."""
    least, most = found.low.copy(), found.high.copy()
    for i, j, gap in found.links:
        least[j] = max(least[j], least[i] + gap)
    for i, j, gap in found.links[::-1]:
        most[i] = min(most[i], most[j] - gap)
    if (least > most).any():
        return None
    out = np.floor(t + 0.5).astype(int)
    for e in range(len(out)):
        mine = found.links[found.links[:, 1] == e]
        floor = max([int(least[e]), *(int(out[i] + gap) for i, _, gap in mine)])
        out[e] = min(max(int(out[e]), floor), int(most[e]))
    return out.astype(float)


def moved(itinerary: Itinerary, found: Events, t: Array) -> Itinerary:
    """The itinerary with its events at `t` (n,) [samples]."""
    stops = [list(mine) for mine in itinerary.stops]
    for (d, k), at in zip(found.who, t, strict=True):
        stops[d][k] = replace(stops[d][k], t=round(float(at) * found.sample, 9))
    return replace(itinerary, stops=tuple(tuple(mine) for mine in stops))


def off_marks(problem: Problem, itinerary: Itinerary, found: Events, t: Array) -> Array:
    """Times (n,) [samples] with those that are nearly at the end of an invariant's window put there."""
    out = t.copy()
    for e, (d, k) in enumerate(found.who):
        ends = np.array(sorted(marks(problem, d))) / found.sample
        stay = itinerary.stops[d][k].visit.dwell / found.sample
        for shift in (0.0, stay):
            off = ends - (t[e] + shift)
            nearest = int(np.abs(off).argmin())
            if SAME_KNOT < abs(off[nearest]) * found.sample < GAP:
                out[e] = t[e] + off[nearest]
                break
    return out


def anchors(problem: Problem, itinerary: Itinerary, drone: int) -> tuple[Array, Ints]:
    """Times (k,) [s] between which a drone's knots keep their proportions, and the stop of each or -1."""
    stops = itinerary.stops[drone]
    all_times = [(t, -1) for t in marks(problem, drone)]
    all_times += [(t, k) for k, s in enumerate(stops) for t in {s.t, s.t + s.visit.dwell}]
    times: list[float] = []
    owner: list[int] = []
    for t, k in sorted(all_times):
        if times and t - times[-1] <= SAME_KNOT:
            owner[-1] = max(owner[-1], k)
            continue
        times.append(t)
        owner.append(k)
    return np.array(times), np.array(owner, dtype=int)
