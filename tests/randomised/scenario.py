"""Random scenarios as the text of scenario files: the same number gives the same text."""

from __future__ import annotations

import numpy as np

from .mission import clauses, duration
from .shapes import numbers
from .world import World, world

#: Seed of the set; scenario k is made from (SEED, k).
SEED = 4
#: How many scenarios the set has.
COUNT = 200


def scenario(k: int) -> str:
    """Scenario number k of the set, as TOML."""
    rng = np.random.default_rng([SEED, k])
    place = world(rng)
    while not place.homes or not place.targets:
        place = world(rng)
    T = duration(rng, place)
    formula = "\n".join(clauses(rng, place, T))
    sample = float(rng.choice([0.05, 0.1]))
    return "\n".join([head(place, T, sample, formula, k), *bodies(place)])


def head(place: World, T: float, sample: float, formula: str, k: int) -> str:
    """Mission, limits and workspace."""
    return f'''\
[mission]
T = {T}
T_s = {sample}
seed = {k}
formula = """
{formula}
"""

[limits]
v_max = {place.v_max}
a_max = {place.a_max}
delta_min = {place.delta_min}
tube = {place.tube}

[workspace]
{place.workspace.toml}
'''


def bodies(place: World) -> list[str]:
    """Obstacles, targets and drones."""
    out = [f'[[obstacle]]\nname = "o{k + 1}"\n{s.toml}\n' for k, s in enumerate(place.obstacles)]
    for k, (s, turn) in enumerate(zip(place.targets, place.headings, strict=True)):
        heading = "" if turn is None else f"heading = {turn}\n"
        out.append(f'[[target]]\nname = "tr{k + 1}"\n{s.toml}\n{heading}')
    for k, home in enumerate(place.homes):
        pad = numbers(np.array([home.middle[0], home.middle[1], 0.1]))
        out.append(f'[[drone]]\nid = "d{k + 1}"\nhome = {{ {home.toml} }}\npad = {pad}\n')
    return out
