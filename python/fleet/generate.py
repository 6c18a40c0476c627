"""Scenario files made by rule: lines of towers, for fleets of any size (docs/design.md)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from random import Random

#: Distance from tower to tower [m].
PITCH = 40.0
#: Drones and targets at every tower.
DRONES, TARGETS = 2, 4
#: Most towers of a line: a fleet has at most 64 drones.
MOST_TOWERS = 32
#: Centres of targets and homes at a tower at the origin [m]: tr1 to tr4, h1 and h2 of docs/design.md.
TARGET_CENTERS = ((-4.8, -2.0, 18.5), (4.8, 2.0, 18.5), (-2.2, -5.5, 12.0), (2.2, 5.5, 12.0))
HOME_CENTERS = ((-5.0, -7.0, 1.2), (5.0, 7.0, 1.2))
#: Half the side of targets and homes [m].
HALF = 1.0
#: Apothem and height of towers, and how far the line goes on beyond its last tower [m].
APOTHEM, HEIGHT, BEYOND = 3.0, 20.0, 9.0
#: How far targets and homes are moved at most, along every axis that may move, and how much sheds grow [m].
MOVE = 0.3


def line(towers: int, seed: int) -> str:
    """The TOML text of a line of `towers` along y, 40 m apart, with two drones and four targets each.

    Every tower has the geometry of `power_tower`, targets, homes and sheds moved by up to 0.3 m as `seed`
    says; cables hang from tower to tower. The same arguments give the same text.

    Raises:
        ValueError: not 1 to 32 towers, or a negative seed.
    """
    if not 1 <= towers <= MOST_TOWERS:
        raise ValueError(f"{towers} towers are not legal; legal is 1 to {MOST_TOWERS}")
    if not 0 <= seed < 2**63:
        raise ValueError(f"the seed {seed} is not legal; legal is 0 to 2^63 - 1")
    random = Random(seed)
    feet = [PITCH * k for k in range(towers)]
    parts = [head(towers, seed, feet)]
    parts += [part for k, y in enumerate(feet) for part in obstacles(k + 1, y, random)]
    parts += cables(feet)
    parts += [part for k, y in enumerate(feet) for part in targets(k, y, random)]
    parts += [part for k, y in enumerate(feet) for part in drones(k, y, random)]
    return "\n".join(parts)


def head(towers: int, seed: int, feet: list[float]) -> str:
    """Everything of the scenario that is there once."""
    return f"""\
# A line of towers with two drones and four targets each; lengths in metres.
# Made by: fleet generate line --towers {towers} --seed {seed}

[mission]
T = 60.0
T_s = 0.05
c = 5.0
seed = {seed}

[limits]
v_max = 3.0
a_max = 3.0
delta_min = 3.0
tube = 0.4

[workspace]
box = {box((-7.0, feet[0] - BEYOND, 0.0), (7.0, feet[-1] + BEYOND, 23.0))}
"""


def obstacles(number: int, y: float, random: Random) -> Iterator[str]:
    """The tower with its foot at (0, y), and the two sheds beside it."""
    yield f"""\
[[obstacle]]
name = "tower{number}"
prism = {{ center = [0.0, {y:.1f}], apothem = {APOTHEM}, sides = 8, z = [0.0, {HEIGHT}] }}
"""
    for name, side in (("shed_west", -1.0), ("shed_east", 1.0)):
        grown = [round(random.uniform(0.0, MOVE), 2) for _ in range(2)]
        x = sorted((side * 4.0, side * (6.2 + grown[0])))
        reach = sorted((y - side * 3.0, y - side * 6.0))
        yield f"""\
[[obstacle]]
name = "{name}{number}"
box = {box((x[0], reach[0], 0.0), (x[1], reach[1], 9.0 + grown[1]))}
"""


def cables(feet: list[float]) -> Iterator[str]:
    """Cables from tower to tower, and from the outer towers to the ends of the workspace."""
    ends = [feet[0] - BEYOND - APOTHEM, *feet, feet[-1] + BEYOND + APOTHEM]
    for k in range(len(ends) - 1):
        low, high = (-0.3, ends[k] + APOTHEM, 17.0), (0.3, ends[k + 1] - APOTHEM, 17.6)
        yield f'[[obstacle]]\nname = "cable{k + 1}"\nbox = {box(low, high)}\n'


def targets(tower: int, y: float, random: Random) -> Iterator[str]:
    """The targets of one tower; their headings look at it."""
    for k, (px, py, pz) in enumerate(TARGET_CENTERS):
        dx, dy, dz = (round(random.uniform(-MOVE, MOVE), 2) for _ in range(3))
        center = (px + dx, y + py + dy, pz + dz)
        yield f"""\
[[target]]
name = "tr{TARGETS * tower + k + 1}"
box = {cube(center)}
heading = {math.atan2(y - center[1], -center[0]):.4f}
"""


def drones(tower: int, y: float, random: Random) -> Iterator[str]:
    """The drones of one tower: home, and the pad on the ground below it; they look at the tower."""
    for k, (px, py, pz) in enumerate(HOME_CENTERS):
        dx, dy = (round(random.uniform(-MOVE, MOVE), 2) for _ in range(2))
        center = (px + dx, y + py + dy, pz)
        yield f"""\
[[drone]]
id = "d{DRONES * tower + k + 1}"
home = {{ box = {cube(center)} }}
pad = [{center[0]:.2f}, {center[1]:.2f}, 0.10]
heading = {math.atan2(y - center[1], -center[0]):.4f}
"""


def cube(center: tuple[float, float, float]) -> str:
    """The cube of side 2 m around `center` [m], as scenario files have it."""
    x, y, z = center
    return box((x - HALF, y - HALF, z - HALF), (x + HALF, y + HALF, z + HALF))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> str:
    """A box between two corners [m], as scenario files have it."""
    return "[" + ", ".join("[" + ", ".join(f"{v:.2f}" for v in corner) + "]" for corner in (low, high)) + "]"
