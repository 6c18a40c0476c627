"""Random places: workspace, obstacles, homes and targets that a scenario file may have."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .shapes import Array, Random, Shape, apart, box, cube, obstacle, polyhedron

#: Attempts to place a shape before it is left out.
TRIES = 60


@dataclass
class World:
    """Half the workspace's width, depth (x, y) and its height [m]; shapes; limits in SI units."""

    size: Array
    tube: float
    delta_min: float
    v_max: float
    a_max: float
    obstacles: list[Shape] = field(default_factory=list)
    targets: list[Shape] = field(default_factory=list)
    headings: list[float | None] = field(default_factory=list)
    homes: list[Shape] = field(default_factory=list)

    @property
    def workspace(self) -> Shape:
        """The workspace, its floor at z = 0."""
        return box(np.array([-self.size[0], -self.size[1], 0.0]), self.size)

    def free(self, shape: Shape, margin: float) -> bool:
        """Whether a shape is off all obstacles by `margin` [m]."""
        return all(apart(shape, other, margin) for other in self.obstacles)


def world(rng: Random) -> World:
    """A place with limits, 0 to 6 obstacles, 1 to 4 homes and 1 to 6 targets.

    A third has a wall with a narrow gap, homes on both sides of it.
    """
    size = np.round([*rng.uniform(7, 13, 2), rng.uniform(8, 20)], 1)
    place = World(
        size,
        tube=float(rng.choice([0.2, 0.3, 0.4])),
        delta_min=float(rng.choice([1.0, 1.5, 2.0, 3.0])),
        v_max=float(rng.choice([2.0, 3.0, 4.0])),
        a_max=float(rng.choice([2.0, 3.0, 4.0])),
    )
    walled = rng.random() < 1 / 3
    if walled:
        wall(rng, place)
    drones, targets = int(rng.integers(1, 5)), int(rng.integers(1, 7))
    for k in range(drones):
        side = (1.0 if k % 2 else -1.0) if walled else 0.0
        settle(rng, place, side)
    scatter(rng, place, int(rng.integers(0, 4 if walled else 7)))
    for _ in range(targets):
        aim(rng, place)
    return place


def wall(rng: Random, place: World) -> None:
    """A wall across y, from floor to ceiling, that leaves a gap (now and then too narrow for the tube)."""
    x, _, z = place.size
    width = float(rng.uniform(1.5, 3.5)) * 2 * place.tube + (float(rng.choice([0.0, 1.0])))
    middle, thick = float(rng.uniform(-0.6, 0.6)) * x, float(rng.uniform(0.4, 1.5))
    low, high = np.array([-x, -thick / 2, 0.0]), np.array([x, thick / 2, z])
    left, right = high.copy(), low.copy()
    left[0], right[0] = middle - width / 2, middle + width / 2
    place.obstacles += [box(low, left), box(right, high)]
    if rng.random() < 0.5:
        # Half of them leave the gap between a sill and the ceiling.
        sill = np.array([right[0], thick / 2, z * float(rng.uniform(0.2, 0.6))])
        place.obstacles.append(box(np.array([left[0], -thick / 2, 0.0]), sill))


def settle(rng: Random, place: World, side: float) -> None:
    """A home on the ground, off the others; on one `side` in y where that is not 0."""
    for _ in range(TRIES):
        x, y = rng.uniform(-1, 1, 2) * (place.size[:2] - 1.6)
        y = side * (2.2 + abs(y) * (place.size[1] - 3.8) / (place.size[1] - 1.6)) if side else y
        home = cube(np.round([x, y, 1.2], 2), 1.0)
        near = [np.linalg.norm(home.middle - other.middle) for other in place.homes]
        if min(near, default=np.inf) > place.delta_min + 2 * place.tube + 1 and place.free(home, place.tube):
            place.homes.append(home)
            return


def scatter(rng: Random, place: World, count: int) -> None:
    """Obstacles anywhere, off homes by the tube and more."""
    for _ in range(count):
        for _ in range(TRIES):
            middle = rng.uniform(-1, 1, 3) * place.size * 0.9
            middle[2] = rng.uniform(0.5, place.size[2])
            thing = obstacle(rng, np.round(middle, 2), float(rng.uniform(1.0, 5.0)))
            if all(apart(thing, home, place.tube + 0.3) for home in place.homes):
                place.obstacles.append(thing)
                break


def aim(rng: Random, place: World) -> None:
    """A target: a cube, box or polyhedron in the workspace, off obstacles by about the tube."""
    for _ in range(TRIES):
        half = float(rng.uniform(0.7, 1.3))
        middle = np.round(rng.uniform(-1, 1, 3) * (place.size - half), 2)
        middle[2] = round(float(rng.uniform(half + 0.1, place.size[2] - half)), 2)
        kind = rng.choice(["cube", "box", "polyhedron"])
        if kind == "cube":
            target = cube(middle, half)
        elif kind == "box":
            reach = half * rng.uniform(0.8, 1.5, 3)
            target = box(middle - reach, middle + reach)
        else:
            target = polyhedron(rng, middle, half)
        if place.free(target, float(rng.choice([0.0, place.tube]))):
            place.targets.append(target)
            turn = float(np.round(rng.uniform(-np.pi, np.pi), 3))
            place.headings.append(turn if rng.random() < 0.4 else None)
            return
