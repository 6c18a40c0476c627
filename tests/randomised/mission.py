"""Random mission formulas over a random world, from loose to impossible."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .shapes import Random
from .world import World

#: Window starts and lengths are multiples of this [s], which every T_s divides.
GRID = 0.5


def clauses(rng: Random, place: World, T: float) -> list[str]:
    """The clauses of a mission: safety, home, visits, and a few more of any kind."""
    drones, targets = len(place.homes), len(place.targets)
    out = ["@safe always[0,T] all d: d in workspace" + (" and d outside obstacles" * bool(place.obstacles))]
    if drones > 1:
        out.append("@apart always[0,T] all d != e: dist(d,e) >= delta_min")
    out.append(f"@home eventually[{'2T/3' if rng.random() < 0.8 else 'T'},T] all d: d in home")
    crossed = drones > 1 and rng.random() < 0.5
    for k in range(targets):
        out.append(f"@visit{k + 1} {visit(rng, place, T, k, crossed=crossed)}")
    more = 0 if rng.random() < 0.4 else int(rng.integers(1, 3))
    makers = [m for m in KINDS if drones > 1 or m not in PAIRED]
    for k in range(more):
        maker = makers[int(rng.integers(len(makers)))]
        out.append(f"@more{k + 1} {maker(rng, place, T)}")
    return out


def window(rng: Random, T: float, share: float = 1.0, soonest: float = 0.0) -> str:
    """A window before `share` of T, for something that takes about `soonest` [s].

    Mostly loose, some short, some at one instant, some about as early as can be, a few impossible.
    """
    mood, end = rng.random(), share * T
    if mood < 0.75:
        a, b = 0.0, rng.uniform(0.7, 1.0) * end
    elif mood < 0.85:
        a = rng.uniform(0.2, 0.7) * end
        b = a + rng.uniform(0.1, 0.5) * (end - a)
    elif mood < 0.93:
        a = b = rng.uniform(0.5, 1.0) * end
    elif mood < 0.98:
        a, b = 0.0, soonest * rng.uniform(0.9, 1.8)
    else:
        a, b = 0.0, soonest * rng.uniform(0.1, 0.6)
    low = float(np.floor(a / GRID) * GRID)
    return f"[{low:g},{max(low, float(np.floor(min(b, end) / GRID) * GRID)):g}]"


def reach(place: World, k: int, who: str = "") -> float:
    """About how long it takes `who`, or the nearest drone, to target k [s]."""
    homes = [place.homes[int(who[1:]) - 1]] if who else place.homes
    far = min(float(np.abs(h.middle - place.targets[k].middle).max()) for h in homes)
    return far / place.v_max + place.v_max / place.a_max


def duration(rng: Random, place: World) -> float:
    """Mission time T [s]: some multiple of what a tour over all targets takes, a multiple of 6 s."""
    legs = sum(reach(place, k) for k in range(len(place.targets))) / len(place.homes)
    farthest_one = max(reach(place, k) for k in range(len(place.targets)))
    return 6.0 * float(np.ceil(max(legs, 2 * farthest_one) * rng.uniform(1.5, 3.0) / 6 + 1))


def drone(rng: Random, place: World) -> str:
    """One of the drones."""
    return f"d{int(rng.integers(len(place.homes))) + 1}"


def two(rng: Random, place: World) -> tuple[str, str]:
    """Two different drones."""
    a, b = rng.permutation(len(place.homes))[:2]
    return f"d{a + 1}", f"d{b + 1}"


def target(rng: Random, place: World) -> str:
    """One of the targets."""
    return f"tr{int(rng.integers(len(place.targets))) + 1}"


def farthest(place: World, k: int) -> str:
    """The drone whose home is farthest from target k: with all targets given so, drones must cross."""
    far = [float(np.linalg.norm(h.middle - place.targets[k].middle)) for h in place.homes]
    return f"d{int(np.argmax(far)) + 1}"


def visit(rng: Random, place: World, T: float, k: int, *, crossed: bool) -> str:
    """Target k is visited, by anybody or by a named drone, with or without a dwell."""
    name, named = f"tr{k + 1}", crossed or rng.random() < 0.2
    who = farthest(place, k) if crossed else drone(rng, place)
    if rng.random() < 0.2:
        stay = float(rng.choice([1.0, 2.0, 4.0]))
        return f"eventually{window(rng, T, 0.65, reach(place, k, who))} always[0,{stay:g}] {who} in {name}"
    when = window(rng, T, 0.7, reach(place, k, who if named else ""))
    return f"eventually{when} {who} in {name}" if named else f"eventually{when} some d: d in {name}"


def part(rng: Random, T: float) -> str:
    """A part of the mission after take-off, 5 to 30 % of it."""
    a = float(np.ceil(rng.uniform(0.15, 0.5) * T / GRID) * GRID)
    return f"[{a:g},{float(np.floor((a + rng.uniform(0.05, 0.3) * T) / GRID) * GRID):g}]"


def avoid(rng: Random, place: World, T: float) -> str:
    """A target is closed to a drone for a time."""
    return f"always{part(rng, T)} {drone(rng, place)} outside {target(rng, place)}"


def high(rng: Random, place: World, T: float) -> str:
    """A drone keeps above a height for a time."""
    return f"always{part(rng, T)} {drone(rng, place)}.z >= {rng.uniform(0.2, 0.6) * place.size[2]:.1f}"


def lead(rng: Random, place: World, T: float) -> str:
    """One drone is higher than another, or on one side of it, for a time."""
    a, b = two(rng, place)
    axis, start = str(rng.choice(["x", "y", "z"])), float(np.ceil(rng.uniform(0.2, 0.5) * T))
    return f"always[{start:g},{start + float(rng.choice([0.0, 2.0, 5.0])):g}] {a}.{axis} - {b}.{axis} >= 1"


def spread(rng: Random, place: World, T: float) -> str:
    """Two drones keep farther apart for a time."""
    a, b = two(rng, place)
    return f"always{part(rng, T)} dist({a},{b}) >= {place.delta_min + rng.uniform(0.5, 4.0):.1f}"


def near(rng: Random, place: World, T: float) -> str:
    """Two drones come near each other once."""
    a, b = two(rng, place)
    far = place.delta_min + 4 * place.tube + rng.uniform(0.3, 4.0)
    return f"eventually{window(rng, T, 0.8, 0.2 * T)} dist({a},{b}) <= {far:.1f}"


def escort(rng: Random, place: World, T: float) -> str:
    """Two drones stay near each other for a time."""
    a, b = two(rng, place)
    start = float(np.ceil(rng.uniform(0.2, 0.5) * T / GRID) * GRID)
    far = place.delta_min + 4 * place.tube + rng.uniform(1.0, 6.0)
    return f"always[{start:g},{start + float(rng.choice([1.0, 3.0, 6.0])):g}] dist({a},{b}) <= {far:.1f}"


def order(rng: Random, place: World, T: float) -> str:
    """A target is closed until another one has been visited, perhaps by another drone."""
    one, two = drone(rng, place), drone(rng, place)
    end = float(np.floor(rng.uniform(0.4, 0.7) * T / GRID) * GRID)
    places = rng.permutation(len(place.targets))[:2]
    return f"(not {one} in tr{places[0] + 1}) until[0,{end:g}] {two} in tr{places[-1] + 1}"


def choice(rng: Random, place: World, T: float) -> str:
    """One of two visits, each with its own window."""
    parts = [
        f"(eventually{window(rng, T, 0.7, 0.15 * T)} {drone(rng, place)} in {target(rng, place)})"
        for _ in range(2)
    ]
    return " or ".join(parts)


def meet(rng: Random, place: World, T: float) -> str:
    """Two drones are in two targets at once."""
    a, b = two(rng, place)
    when, places = window(rng, T, 0.7, 0.2 * T), rng.permutation(len(place.targets))[:2]
    return f"eventually{when} ({a} in tr{places[0] + 1} and {b} in tr{places[-1] + 1})"


def answer(rng: Random, place: World, T: float) -> str:
    """Whenever a drone is in one target, another one is visited soon after."""
    soon = float(rng.choice([5.0, 8.0]))
    end = min(float(np.floor(0.7 * T / GRID) * GRID), T - soon)
    a, b = drone(rng, place), drone(rng, place)
    places = rng.permutation(len(place.targets))[:2]
    return f"always[0,{end:g}] ({a} in tr{places[0] + 1} -> eventually[0,{soon:g}] {b} in tr{places[-1] + 1})"


Maker = Callable[[Random, World, float], str]
#: Those that need two drones.
PAIRED: tuple[Maker, ...] = (lead, spread, near, escort, meet)
KINDS: tuple[Maker, ...] = (avoid, high, order, choice, answer, *PAIRED)
