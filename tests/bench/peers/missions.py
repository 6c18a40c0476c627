"""What is put to stlpy and to fleet: shipped missions on a coarse step, and stlpy's own scenarios.

stlpy's scenarios are flat; here they stand in a room 4 m high, obstacles from floor to ceiling. fleet always
flies home as well, so its horizon is `HOMEWARD` longer; the windows of the clauses are stlpy's.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fleet.scenario import Scenario, load
from tests.bench.table import ROOT

#: Time that fleet has to fly home after a scenario of stlpy [s].
HOMEWARD = 20.0
#: Height at which a flat scenario is flown, of a room up to twice as high [m].
HEIGHT = 2.0
#: Width of the room outside stlpy's bounds on positions [m]: those count as hard, without robustness.
BESIDE = 0.5

Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True)
class Own:
    """A scenario of stlpy: rectangles (xmin, xmax, ymin, ymax) and clauses; `{end}` is the last step.

    `home` is where fleet ends, of the size of the targets, around the start and clear of obstacles.
    """

    steps: int
    start: tuple[float, float]
    size: tuple[float, float]
    obstacles: dict[str, Rectangle]
    targets: dict[str, Rectangle]
    clauses: tuple[str, ...]
    home: Rectangle


def multitarget() -> Own:
    """One obstacle and five pairs of targets, drawn as stlpy draws them with seed 0."""
    draw = np.random.RandomState(0)
    x, y = draw.uniform(0, 9), draw.uniform(0, 9)
    obstacle = {"o1": (x, x + 2, y, y + 2)}
    targets, clauses = {}, []
    for group in range(5):
        for one in "ab":
            x, y = draw.uniform(0, 9), draw.uniform(0, 9)
            targets[f"t{group + 1}{one}"] = (x, x + 1, y, y + 1)
        clauses.append(f"eventually[0,{{end}}] (d1 in t{group + 1}a or d1 in t{group + 1}b)")
    return Own(15, (5.0, 2.0), (10.0, 10.0), obstacle, targets, tuple(clauses), (4.5, 5.5, 1.5, 2.5))


def own() -> dict[str, Own]:
    """stlpy's scenarios with the parameters of the examples in its repository."""
    goal: Rectangle = (7, 8, 8, 9)
    box: Rectangle = (3, 5, 4, 6)
    square = (10.0, 10.0)
    narrow: dict[str, Rectangle] = {
        "o1": (2, 5, 4, 6),
        "o2": (5.5, 9, 3.8, 5.7),
        "o3": (4.6, 8, 0.5, 3.5),
        "o4": (2.2, 4.4, 6.4, 11),
    }
    walls: dict[str, Rectangle] = {
        "o1": (8, 15.01, -0.01, 4),
        "o2": (8, 15.01, 6, 10.01),
        "o3": (3.5, 5, -0.01, 2.5),
        "o4": (-0.01, 2.5, 4, 6),
        "o5": (3.5, 5, 7.5, 10.01),
    }
    keys: dict[str, Rectangle] = {"key1": (1, 2, 1, 2), "key2": (1, 2, 8, 9)}
    doors: dict[str, Rectangle] = {"door1": (12.8, 14, 3.99, 6.01), "door2": (11.5, 12.7, 3.99, 6.01)}
    exits: dict[str, Rectangle] = {"goal": (14.1, 14.9, 4.1, 5.9)}
    either = "eventually[0,20] (always[0,5] d1 in one or always[0,5] d1 in two)"
    twins: dict[str, Rectangle] = {"one": (1, 2, 6, 7), "two": (7, 8, 4.5, 5.5), "goal": goal}
    reach = "eventually[0,{end}] d1 in goal"
    puzzle = (
        "d1 outside door1 until[0,{end}] d1 in key1",
        "d1 outside door2 until[0,{end}] d1 in key2",
        reach,
    )
    return {
        "reach_avoid": Own(15, (1, 2), square, {"o1": box}, {"goal": goal}, (reach,), (0.5, 1.5, 1.5, 2.5)),
        "either_or": Own(25, (2, 2), square, {"o1": box}, twins, (either, reach), (1.5, 2.5, 1.5, 2.5)),
        "narrow_passage": Own(
            25,
            (3.0, 3.6),
            square,
            narrow,
            {"goal1": goal, "goal2": (9.5, 10.5, 1.5, 2.5)},
            ("eventually[0,{end}] (d1 in goal1 or d1 in goal2)",),
            (2.5, 3.5, 2.8, 3.8),
        ),
        "random_multitarget": multitarget(),
        "door_puzzle": Own(
            30, (6, 1), (15.0, 10.0), walls, keys | doors | exits, puzzle, (5.5, 6.5, 0.5, 1.5)
        ),
    }


def toml(one: Own, end: float, horizon: float) -> str:
    """A scenario file of fleet: windows up to `end`, invariants over all of `horizon` [s]."""

    def box(r: Rectangle, low: float, high: float) -> str:
        return f"box = [[{r[0]:.9f}, {r[2]:.9f}, {low:.3f}], [{r[1]:.9f}, {r[3]:.9f}, {high:.3f}]]"

    room = (-BESIDE, one.size[0] + BESIDE, -BESIDE, one.size[1] + BESIDE)
    clauses = [f"@c{k + 1} {text.format(end=f'{end:g}')}" for k, text in enumerate(one.clauses)]
    formula = "\n".join(["@avoid always[0,T] (d1 in workspace and d1 outside obstacles)", *clauses])
    parts = [f'[mission]\nT = {horizon}\nformula = """\n{formula}\n"""']
    parts.append("[limits]\nv_max = 1.0\na_max = 0.5\ntube = 0.05\ndelta_min = 1.0")
    parts.append(f"[workspace]\n{box(room, 0.0, 2 * HEIGHT)}")
    parts += [f'[[obstacle]]\nname = "{n}"\n{box(r, -1.0, 2 * HEIGHT + 1)}' for n, r in one.obstacles.items()]
    parts += [f'[[target]]\nname = "{n}"\n{box(r, HEIGHT - 1, HEIGHT + 1)}' for n, r in one.targets.items()]
    x, y = one.start
    home = f"home = {{ {box(one.home, HEIGHT - 0.5, HEIGHT + 0.5)} }}"
    parts.append(f'[[drone]]\nid = "d1"\n{home}\nstart = [{x}, {y}, {HEIGHT}]\npad = [{x}, {y}, 0.1]')
    return "\n\n".join(parts) + "\n"


def flat(name: str, folder: Path, *, homeward: bool) -> Scenario:
    """A scenario of stlpy as fleet reads it; without `homeward` its horizon is stlpy's, for judging."""
    one = own()[name]
    path = folder / f"{name}.toml"
    path.write_text(toml(one, one.steps, one.steps + (HOMEWARD if homeward else 0.0)))
    return load(path)


def shipped(name: str, dt: float) -> dict[str, Any]:
    """A shipped mission for `solve.py`, on steps of `dt` [s]; its workspace is a box."""
    scenario = load(ROOT / "scenarios" / f"{name}.toml")
    corners = scenario.workspace.vertices
    return {
        "drones": [d.id for d in scenario.drones],
        "starts": [d.start.tolist() for d in scenario.drones],
        "regions": json.loads(json.dumps(scenario.regions())),
        "clauses": [c.formula for c in scenario.clauses()],
        "dt": dt,
        "steps": round(scenario.mission.T / dt),
        "v_max": scenario.limits.v_max,
        "a_max": scenario.limits.a_max,
        "low": corners.min(axis=0).tolist(),
        "high": corners.max(axis=0).tolist(),
    }
