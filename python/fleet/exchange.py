"""Local search over assignments of large fleets: OR-Tools' routing library, down to a local optimum.

Events are moved, swapped and chains of them exchanged between drones while that helps (the library's default
operators); without a metaheuristic the search ends by itself, so that no clock bounds it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .legs import Legs, cost
from .vehicles import TICKS, Orders, latest, ticks

#: What a second of makespan weighs against a second of total time.
MAKESPAN = 1000


def improved(legs: Legs, start: Orders) -> Orders:
    """An assignment at least as good as `start`, which must be feasible: makespan first, then total time."""
    from ortools.constraint_solver import pywrapcp

    drones, n = legs.first.shape
    depots = list(range(n, n + 2 * drones))
    manager = pywrapcp.RoutingIndexManager(n + 2 * drones, drones, depots[:drones], depots[drones:])
    routing = pywrapcp.RoutingModel(manager)
    end = ticks(latest(legs))
    transit = [routing.RegisterTransitMatrix(durations(legs, d, 2 * end + 1)) for d in range(drones)]
    for d in range(drones):
        routing.SetVehicleUsedWhenEmpty(True, d)
    routing.AddDimensionWithVehicleTransits(transit, end, end, True, "time")
    time = routing.GetDimensionOrDie("time")
    for e in range(n):
        low = int(np.ceil(max(legs.windows[e, 0], 0.0) * TICKS - 1e-3))
        high = min(int((min(legs.windows[e, 1], latest(legs)) + 1e-9) * TICKS), end)
        if low > high:
            return start
        time.CumulVar(manager.NodeToIndex(e)).SetRange(low, high)
    time.SetGlobalSpanCostCoefficient(MAKESPAN)
    time.SetSpanCostCoefficientForAllVehicles(1)
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    routing.CloseModelWithParameters(parameters)
    given = routing.ReadAssignmentFromRoutes([[int(e) for e in order] for order in start], True)
    if given is None:  # rounding to ticks broke a window that is met to the tick
        return start
    found = routing.SolveFromAssignmentWithParameters(given, parameters)
    if found is None:
        return start
    orders = [walk(routing, manager, found, d) for d in range(drones)]
    return orders if cost(legs, orders) < cost(legs, start) else start


def durations(legs: Legs, drone: int, never: int) -> list[list[int]]:
    """Ticks from node to node for one drone, stays at events included: events, all starts, all homes.

    `never` stands for where the drone cannot go; it is more than the clock holds.
    """
    drones, n = legs.first.shape
    out = np.full((n + 2 * drones, n + 2 * drones), np.inf)
    start, home = n + drone, n + drones + drone
    out[:n, :n] = legs.between[drone] + legs.dwell[:, None]
    out[start, :n], out[start, home] = legs.first[drone], legs.idle[drone]
    out[:n, home] = legs.last[drone] + legs.dwell
    finite = np.isfinite(out)
    rounded = np.ceil(np.where(finite, out, 0.0) * TICKS - 1e-3)
    table = np.where(finite, rounded, never).astype(np.int64)
    np.fill_diagonal(table, 0)
    rows: list[list[int]] = table.tolist()
    return rows


def walk(routing: Any, manager: Any, found: Any, drone: int) -> tuple[int, ...]:
    """Events of one drone in order in a solution of the library."""
    out, at = [], found.Value(routing.NextVar(routing.Start(drone)))
    while not routing.IsEnd(at):
        out.append(int(manager.IndexToNode(at)))
        at = found.Value(routing.NextVar(at))
    return tuple(out)
