"""Complete search for fleets too large for the subsets of assign.py: OR-Tools' CP-SAT.

One circuit a drone through a depot that stands for its start and its home, with optional events, each on
exactly one circuit; the time of every event follows along the arcs that are chosen (vehicle routing with
time windows, three-index model). It finds assignments in tight windows, and proves the best one; good ones
where windows leave room are found sooner by local search (exchange.py).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as StillRunning
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from .legs import Legs, cost

#: Ticks of the model's clock in one second; legs are rounded up and windows inwards.
TICKS = 1_000_000
#: Deterministic time of each of the two searches (CP-SAT's own measure of work, about a second each).
EFFORT = 0.5
#: How often a running search looks whether the user wants it to end [s].
LOOK = 0.05

Orders = list[tuple[int, ...]]


@dataclass
class Model:
    """The CP-SAT model of some legs: literals of arcs, times of events and of coming home [ticks]."""

    legs: Legs
    cp: Any
    arcs: dict[tuple[int, int, int], Any]
    home: list[Any]
    makespan: Any

    def orders(self, value: Any) -> Orders:
        """Events of every drone in order, in a solution; `value(literal)` reads it."""
        out: Orders = []
        for d in range(self.legs.first.shape[0]):
            follow = {i: j for (k, i, j), arc in self.arcs.items() if k == d and i != j and value(arc)}
            walk, at = [], follow.get(0, 0)
            while at != 0:
                walk.append(at - 1)
                at = follow[at]
            out.append(tuple(walk))
        return out

    def hint(self, orders: Orders) -> None:
        """Start the search from an assignment."""
        self.cp.clear_hints()
        chosen = {
            (d, i, j) for d, order in enumerate(orders) for i, j in pairwise([0, *(e + 1 for e in order), 0])
        }
        served = {(d, e + 1) for d, order in enumerate(orders) for e in order}
        for (d, i, j), arc in self.arcs.items():
            self.cp.add_hint(arc, (d, i, j) in chosen if i != j or i == 0 else (d, i) not in served)


def latest(legs: Legs) -> float:
    """A time by which any tour that waits for windows to open, but nothing else, is home [s]."""
    if np.isfinite(legs.horizon):
        return legs.horizon
    every = np.concatenate([legs.first.ravel(), legs.between.ravel(), legs.last.ravel(), legs.idle])
    longest = float(every[np.isfinite(every)].max(initial=0.0))
    events = legs.first.shape[1]
    return float(legs.windows[:, 0].max(initial=0.0) + legs.dwell.sum() + (events + 1) * longest + 1.0)


def model(legs: Legs) -> Model:
    """Circuits, times and makespan of the assignment problem."""
    from ortools.sat.python import cp_model

    cp = cp_model.CpModel()
    drones, n = legs.first.shape
    end = latest(legs)
    low = np.ceil(np.maximum(legs.windows[:, 0], 0.0) * TICKS - 1e-3).astype(int)
    high = np.floor((np.minimum(legs.windows[:, 1], end) + 1e-9) * TICKS).astype(int)
    if (low > high).any():
        cp.add_bool_or([])
        high = np.maximum(low, high)
    at = [cp.new_int_var(int(low[e]), int(high[e]), f"t{e}") for e in range(n)]
    home = [cp.new_int_var(0, ticks(end), f"home{d}") for d in range(drones)]
    arcs: dict[tuple[int, int, int], Any] = {}

    def arc(d: int, i: int, j: int) -> Any:
        arcs[d, i, j] = cp.new_bool_var(f"a{d}_{i}_{j}")
        return arcs[d, i, j]

    for d in range(drones):
        if np.isfinite(legs.idle[d]):
            cp.add(home[d] >= ticks(legs.idle[d])).only_enforce_if(arc(d, 0, 0))
        for e in range(n):
            arc(d, e + 1, e + 1)
            done = at[e] + ticks(legs.dwell[e])
            if np.isfinite(legs.first[d, e]):
                cp.add(at[e] >= ticks(legs.first[d, e])).only_enforce_if(arc(d, 0, e + 1))
            if np.isfinite(legs.last[d, e]):
                cp.add(home[d] >= done + ticks(legs.last[d, e])).only_enforce_if(arc(d, e + 1, 0))
            for f in range(n):
                leg = legs.between[d, e, f]
                if f != e and np.isfinite(leg) and low[e] + ticks(legs.dwell[e] + leg) <= high[f]:
                    cp.add(at[f] >= done + ticks(leg)).only_enforce_if(arc(d, e + 1, f + 1))
        cp.add_circuit([(i, j, a) for (k, i, j), a in arcs.items() if k == d])
    for e in range(n):
        cp.add_exactly_one(arcs[d, e + 1, e + 1].Not() for d in range(drones))
    makespan = cp.new_int_var(0, ticks(end), "makespan")
    for d in range(drones):
        cp.add(makespan >= home[d])
    return Model(legs, cp, arcs, home, makespan)


def ticks(seconds: float) -> int:
    """Ticks of a duration [s], rounded up."""
    return int(np.ceil(seconds * TICKS - 1e-3))


def feasible(legs: Legs) -> Orders | None:
    """Some assignment that meets the windows; None if there is none or none is found within `EFFORT`."""
    return search(model(legs), EFFORT)


def optimal(legs: Legs, start: Orders | None) -> Orders | None:
    """The assignment of least makespan, then of least total time, proved; None if there is none.

    It takes as long as it takes; `start` is one to begin from.
    """
    whole, best = model(legs), start
    for total in (False, True):
        if best is not None:
            whole.hint(best)
        whole.cp.minimize(sum(whole.home) if total else whole.makespan)
        found = search(whole, None)
        if found is not None and (best is None or cost(legs, found) < cost(legs, best)):
            best = found
        if best is None:
            return None
        if not total:
            # Each leg may have been rounded up by a tick.
            whole.cp.add(whole.makespan <= ticks(cost(legs, best)[0]) + legs.first.shape[1] + 2)
    return best


def search(whole: Model, effort: float | None) -> Orders | None:
    """One search: the assignment found, if any.

    One worker, a fixed seed and a bound on work make it repeatable; in a thread of its own, Ctrl-C ends it.
    """
    from ortools.sat.python import cp_model

    solver = cp_model.CpSolver()
    solver.parameters.num_workers, solver.parameters.random_seed = 1, 1
    solver.parameters.catch_sigint_signal = False
    if effort is not None:
        solver.parameters.max_deterministic_time = effort
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(solver.solve, whole.cp)
        try:
            status = waited(running)
        except BaseException:
            solver.stop_search()
            raise
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return None
    orders = whole.orders(solver.boolean_value)
    return orders if np.isfinite(cost(whole.legs, orders)[0]) else None


def waited(running: Any) -> Any:
    """The result of a running search; signals are seen between looks."""
    while True:
        try:
            return running.result(timeout=LOOK)
        except StillRunning:
            continue
