"""RRT* over the states of a double integrator, from rest to rest (Webb and van den Berg 2013, Algorithm 1).

A sample becomes a node where an optimal connection from a near node reaches it; then nodes near it, and
the goal, are led through it where that costs less. Each node has the time at which the drone is there, so
that moving corridors can be avoided; rewiring that would lead a branch into a corridor is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from . import connection
from .forbidden import Connections, Forbidden
from .knots import Array, Ints

#: Share of samples that are drawn around the straight line to the goal rather than anywhere.
ALONG = 0.3
#: Standard deviation of those samples [m].
ASIDE = 2.0
#: Nodes near a new one are the `NEAR` * log(nodes) of least cost (Karaman and Frazzoli 2011, k-nearest RRT*).
NEAR = 2 * np.e
#: Samples drawn at once.
BATCH = 64
#: Costs nearer than this are one [s].
SAME = 1e-6


@dataclass(frozen=True)
class Leg:
    """One leg: from a point (3,) left at `begin` [s] to another, both at rest, inside a box of points.

    `weight` [s^4/m^2] of squared acceleration; `held(t)` duration [s] of the stay after an arrival at t.
    """

    start: Array
    goal: Array
    begin: float
    low: Array
    high: Array
    v_max: float
    a_max: float
    weight: float
    forbidden: Forbidden
    held: Callable[[float], float]


@dataclass
class Tree:
    """Nodes in rows: 0 is the start, 1 the goal, which has no branches; capacity is fixed.

    `state` (n, 6), `parent` (n,), `cost` (n,) from the start [s], `tau` (n,) of the connection from the
    parent [s], `time` (n,) of being there [s].
    """

    leg: Leg
    capacity: int
    count: int = 2
    state: Array = field(init=False)
    parent: Ints = field(init=False)
    cost: Array = field(init=False)
    tau: Array = field(init=False)
    time: Array = field(init=False)

    def __post_init__(self) -> None:
        self.state = np.zeros((self.capacity + 2, 6))
        self.state[0, :3], self.state[1, :3] = self.leg.start, self.leg.goal
        self.parent = np.full(self.capacity + 2, -1)
        self.cost = np.full(self.capacity + 2, np.inf)
        self.tau, self.time = np.zeros(self.capacity + 2), np.zeros(self.capacity + 2)
        self.cost[0], self.time[0] = 0.0, self.leg.begin

    @property
    def found(self) -> float:
        """Cost of the best way to the goal [s]; infinite while there is none."""
        return float(self.cost[1])

    def path(self) -> Ints:
        """Nodes from the start to the goal."""
        walk = [1]
        while walk[-1] != 0:
            walk.append(int(self.parent[walk[-1]]))
        return np.array(walk[::-1])

    def free(self, start: Array, end: Array, tau: Array, begin: Array) -> Array:
        """Which connections keep limits and keep clear, checked from the cheapest test to the dearest."""
        good = connection.admissible(start, end, tau, self.leg.v_max, self.leg.a_max)
        some = np.flatnonzero(good)
        if len(some):
            tried = Connections(start[some], end[some], tau[some], begin[some])
            good[some] = ~self.leg.forbidden.crossed(tried)
        return np.asarray(good)

    def adopt(self, sample: Array) -> int | None:
        """Put a sample (6,) into the tree under the parent of least cost; its number, or None."""
        tree = np.append(0, np.arange(2, self.count))
        cost, tau = connection.optimal(self.state[tree], sample[None], self.leg.weight)
        near = self.nearest(cost)
        order = near[np.argsort(self.cost[tree[near]] + cost[near], kind="stable")]
        k = self.first_free(tree[order], np.repeat(sample[None], len(order), axis=0), tau[order])
        if k is None:
            return None
        new, parent = self.count, int(tree[order[k]])
        self.count += 1
        self.state[new], self.parent[new], self.tau[new] = sample, parent, tau[order[k]]
        self.cost[new] = self.cost[parent] + cost[order[k]]
        self.time[new] = self.time[parent] + self.tau[new]
        return new

    def nearest(self, cost: Array) -> Ints:
        """Indices of the least costs, as many as k-nearest RRT* looks at."""
        k = int(np.ceil(NEAR * np.log(self.count)))
        return np.arange(len(cost)) if len(cost) <= k else np.argpartition(cost, k)[:k]

    def first_free(self, parents: Ints, ends: Array, tau: Array) -> int | None:
        """Index of the first connection that is free, or None."""
        start = self.state[parents]
        good = connection.admissible(start, ends, tau, self.leg.v_max, self.leg.a_max)
        for k in np.flatnonzero(good):
            one = slice(k, k + 1)
            tried = Connections(start[one], ends[one], tau[one], self.time[parents[one]])
            if not self.leg.forbidden.crossed(tried)[0]:
                return int(k)
        return None

    def rewire(self, new: int) -> None:
        """Lead the goal and the nodes near `new` through it where that costs less."""
        others = np.arange(1, new)
        cost, tau = connection.optimal(self.state[new][None], self.state[others], self.leg.weight)
        gain = self.cost[new] + cost < self.cost[others] - SAME
        near = np.union1d(self.nearest(cost), [0])
        pick = near[gain[near]]
        if len(pick) == 0:
            return
        begin = np.full(len(pick), self.time[new])
        good = self.free(
            np.repeat(self.state[new][None], len(pick), axis=0), self.state[others[pick]], tau[pick], begin
        )
        for k in pick[good]:
            node = int(others[k])
            # A node led anew may have made this one dearer or cheaper meanwhile: never grow a loop.
            if self.cost[new] + cost[k] < self.cost[node] - SAME and self.may_move(node, new, float(tau[k])):
                self.move(node, new, float(tau[k]), float(self.cost[new] + cost[k]))

    def may_move(self, node: int, parent: int, tau: float) -> bool:
        """Whether all that hangs on `node`, and the stay at the goal, keep clear at the new times."""
        shift = float(self.time[parent]) + tau - float(self.time[node])
        if node == 1:
            return self.stays(float(self.time[parent]) + tau)
        if len(self.leg.forbidden.apart) == 0:
            return True
        branch = self.branch(node)
        if len(branch) == 0:
            return True
        up = self.parent[branch]
        tried = Connections(self.state[up], self.state[branch], self.tau[branch], self.time[up] + shift)
        if self.leg.forbidden.meets(tried).any():
            return False
        return 1 not in branch or self.stays(float(self.time[1]) + shift)

    def stays(self, arrival: float) -> bool:
        """Whether the goal is clear for the stay that follows an arrival at `arrival` [s]."""
        rest = self.state[1:2]
        tried = Connections(rest, rest, np.array([self.leg.held(arrival)]), np.array([arrival]))
        return not self.leg.forbidden.meets(tried)[0]

    def branch(self, node: int) -> Ints:
        """All nodes below `node`."""
        out: list[int] = []
        layer = np.array([node])
        while len(layer):
            layer = np.flatnonzero(np.isin(self.parent[: self.count], layer))
            out += layer.tolist()
        return np.array(out, dtype=int)

    def move(self, node: int, parent: int, tau: float, cost: float) -> None:
        """Hang `node` below `parent`; everything below it comes along in cost and time."""
        gain = cost - float(self.cost[node])
        shift = float(self.time[parent]) + tau - float(self.time[node])
        if np.isfinite(gain):
            below = self.branch(node)
            self.cost[below] += gain
            self.time[below] += shift
        self.parent[node], self.tau[node] = parent, tau
        self.cost[node], self.time[node] = cost, self.time[parent] + tau


def samples(leg: Leg, rng: np.random.Generator) -> Array:
    """Random states (BATCH, 6) in the box of the leg, some around the straight line to the goal."""
    p = rng.uniform(leg.low, leg.high, (BATCH, 3))
    line = leg.start + rng.uniform(0, 1, (BATCH, 1)) * (leg.goal - leg.start)
    line += rng.normal(0, ASIDE, (BATCH, 3))
    along = rng.uniform(0, 1, BATCH) < ALONG
    p[along] = line[along]
    v = rng.uniform(-leg.v_max, leg.v_max, (BATCH, 3))
    keep = (p @ leg.forbidden.room[:, :3].T <= leg.forbidden.room[:, 3]).all(axis=1)
    for faces in leg.forbidden.obstacles:
        keep &= (p @ faces[:, :3].T - faces[:, 3]).max(axis=1) >= 0
    return np.column_stack([p, v])[keep]


def grow(leg: Leg, rng: np.random.Generator, least: int, most: int, tell: Callable[[int], None]) -> Tree:
    """The tree after `least` samples, or as many more, up to `most`, as it takes to reach the goal at all.

    Samples through which no way could cost less than the one found are passed over, as they cost
    nothing but their draw, and so count a tenth. `tell(samples)` is called now and then.
    """
    tree = Tree(leg, most)
    if (direct := straight(tree)) is not None:
        tree.move(1, 0, *direct)
    spent = 0.0
    while spent < least or (not np.isfinite(tree.found) and spent < most):
        tell(int(spent))
        for sample in useful(tree, samples(leg, rng)):
            spent += 1
            new = tree.adopt(sample)
            if new is not None:
                tree.rewire(new)
            if tree.count >= most + 2:
                return tree
        spent += BATCH / 10
    return tree


def straight(tree: Tree) -> tuple[float, float] | None:
    """Duration and cost of the connection from start to goal, if it is free."""
    cost, tau = connection.optimal(tree.state[:1], tree.state[1:2], tree.leg.weight)
    if not tree.free(tree.state[:1], tree.state[1:2], tau, tree.time[:1])[0]:
        return None
    return (float(tau[0]), float(cost[0])) if tree.stays(float(tree.time[0] + tau[0])) else None


def useful(tree: Tree, drawn: Array) -> Array:
    """The samples through which a way could cost less than the one found."""
    if not np.isfinite(tree.found) or len(drawn) == 0:
        return drawn
    there, _ = connection.optimal(tree.state[:1], drawn, tree.leg.weight)
    back, _ = connection.optimal(drawn, tree.state[1:2], tree.leg.weight)
    return drawn[there + back < tree.found - SAME]
