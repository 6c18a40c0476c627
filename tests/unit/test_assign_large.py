"""Assignment beyond the exact search: against it where both can, and its own claims where it cannot."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from fleet.assign import EXACT, assign, exact, insert, large
from fleet.legs import Legs, cost, tour_time
from fleet.planner import Status, plan
from fleet.planner.problem import problem
from fleet.planner.schedule import schedules
from fleet.scenario import load

from .test_planner_assign import random_legs

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SEEDS = range(60)


def instance(seed: int) -> Legs:
    """1 to 3 drones and 2 to 9 events in windows of all widths; some legs are missing."""
    rng = np.random.default_rng(seed)
    legs = random_legs(rng, int(rng.integers(1, 4)), int(rng.integers(2, 10)), float(rng.uniform(8, 30)))
    if seed % 3 == 0:
        legs.first[rng.uniform(size=legs.first.shape) < 0.15] = np.inf
        legs.between[rng.uniform(size=legs.between.shape) < 0.1] = np.inf
    return legs


def keeps(legs: Legs, orders: list[tuple[int, ...]]) -> None:
    """Every event once, and nothing late: judged by the legs alone."""
    assert sorted(e for order in orders for e in order) == list(range(legs.first.shape[1]))
    for d, order in enumerate(orders):
        clock = float(legs.idle[d]) if not order else 0.0
        for k, e in enumerate(order):
            leg = legs.first[d, e] if k == 0 else legs.between[d, order[k - 1], e]
            clock = max(clock + leg, legs.windows[e, 0])
            assert clock <= legs.windows[e, 1] + 1e-6
            clock += legs.dwell[e]
        clock += legs.last[d, order[-1]] if order else 0.0
        assert clock <= legs.horizon + 1e-6


def test_feasible_if_and_only_if_the_exact_search_says_so_and_at_nearly_its_cost() -> None:
    worse, feasible, missed = [], 0, 0
    for seed in SEEDS:
        legs = instance(seed)
        best, found = exact(legs), large(legs, proved=False)
        assert (found is None) == (best is None), f"seed {seed}"
        if best is None or found is None:
            continue
        keeps(legs, found)
        feasible += 1
        missed += insert(legs) is None
        worse.append(cost(legs, found)[0] / cost(legs, best)[0])
    assert 10 < feasible < len(SEEDS) - 5
    assert missed >= 1, "the complete search has to have been needed"
    assert max(worse) < 1.25
    assert np.mean(worse) < 1.03


def test_the_proved_best_is_that_of_the_exact_search() -> None:
    for seed in SEEDS:
        legs = instance(seed)
        best, found = exact(legs), large(legs, proved=True)
        assert (found is None) == (best is None), f"seed {seed}"
        if best is not None and found is not None:
            keeps(legs, found)
            assert cost(legs, found) == pytest.approx(cost(legs, best), abs=1e-4), f"seed {seed}"


@pytest.mark.parametrize(("drones", "events", "tight"), [(4, 24, 60.0), (4, 24, 30.0), (8, 64, 100.0)])
def test_large_fleets_do_better_than_cheapest_insertion(drones: int, events: int, tight: float) -> None:
    legs = random_legs(np.random.default_rng(7), drones, events, tight)
    before, found = insert(legs), assign(legs)
    assert before is not None and found is not None
    keeps(legs, found)
    assert cost(legs, found)[0] < 0.95 * cost(legs, before)[0]
    assert found == assign(legs)


def crowded(seed: int, late: bool) -> str:
    """The TOML of 4 drones and 24 targets around one tower; half of the windows open late with `late`."""
    rng = np.random.default_rng(seed)
    text = (SCENARIOS / "power_tower_4.toml").read_text()
    head = text[: text.index("[[target]]")].replace("T = 60.0", "T = 150.0")
    drones = text[text.index("[[drone]]") :].split("[assignment]")[0]
    clauses, targets = [], []
    for k in range(24):
        angle, out = rng.uniform(0, 2 * np.pi), rng.uniform(5.3, 5.8)
        x, y, z = out * np.cos(angle), out * np.sin(angle), rng.uniform(11.0, 15.0)
        low, high = (40, 100) if late and k % 2 else (0, 100)
        clauses.append(f"@v{k} eventually[{low},{high}] some d: d in v{k}")
        corner = (
            f"[{x - 0.8:.3f}, {y - 0.8:.3f}, {z - 0.8:.3f}], [{x + 0.8:.3f}, {y + 0.8:.3f}, {z + 0.8:.3f}]"
        )
        targets.append(f'[[target]]\nname = "v{k}"\nbox = [{corner}]\n')
    rules = ["@safe always[0,T] all d: d in workspace and d outside obstacles", *clauses]
    rules += ["@apart always[0,T] all d != e: dist(d,e) >= delta_min"]
    rules += ["@home eventually[2T/3,T] all d: d in home"]
    formula = 'formula = """\n' + "\n".join(rules) + '\n"""\n'
    return head.replace("[mission]\n", "[mission]\n" + formula, 1) + "\n".join(targets) + "\n" + drones


@pytest.mark.parametrize("late", [False, True])
def test_a_random_fleet_of_24_visits_has_an_itinerary(tmp_path: Path, late: bool) -> None:
    path = tmp_path / "crowded.toml"
    path.write_text(crowded(5, late))
    task = problem(load(path))
    assert len(task.spec.visits) == 24 > EXACT
    way = next(iter(schedules(task, 0.8)))
    stops = [stop for stops in way.stops for stop in stops]
    assert sorted(s.region for s in stops) == sorted(f"v{k}" for k in range(24))
    assert all(s.visit.window[0] <= s.t <= s.visit.window[1] for s in stops)
    assert all(a.t < b.t for stops in way.stops for a, b in pairwise(stops))


def test_the_papers_split_deals_targets_in_turn(tmp_path: Path) -> None:
    """The first and third target to one drone, the second and fourth to the other, near or not."""
    text = (SCENARIOS / "power_tower.toml").read_text()
    head, one, two, three, rest = text.split("[[target]]")
    path = tmp_path / "shuffled.toml"
    path.write_text("[[target]]".join([head, one, three, two, rest]))
    free = plan(load(path))
    assert {frozenset(mine) for mine in free.assignment.values()} == {
        frozenset({"tr1", "tr3"}),
        frozenset({"tr2", "tr4"}),
    }
    path.write_text("[[target]]".join([head, one, three, two, rest]) + '\n[planner]\nassignment = "paper"\n')
    dealt = plan(load(path))
    assert {d: set(mine) for d, mine in dealt.assignment.items()} == {
        "d1": {"tr1", "tr2"},
        "d2": {"tr3", "tr4"},
    }
    assert dealt.status is not Status.VIOLATED


def test_orders_by_hand_go_before_the_papers_split(tmp_path: Path) -> None:
    text = (SCENARIOS / "power_tower.toml").read_text()
    path = tmp_path / "hand.toml"
    hand = {"d1": ["tr4", "tr2"], "d2": ["tr3", "tr1"]}
    tables = "\n".join(f"{d} = {order}" for d, order in hand.items())
    path.write_text(f'{text}\n[planner]\nassignment = "paper"\n\n[assignment]\n{tables}\n')
    assert plan(load(path)).assignment == hand


@pytest.mark.parametrize("text", ["d1 in tr1 or d1 in tr4", "d1 in tr4 or d1 in tr1"])
def test_of_two_regions_of_one_drone_the_one_in_reach_is_taken(tmp_path: Path, text: str) -> None:
    """tr4 cannot be reached in 8 s; that it is named last is no reason to give up, let alone a proof."""
    rules = ["@safe always[0,T] all d: d outside obstacles", f"@one eventually[0,8] ({text})"]
    formula = 'seed = 1\nformula = """\n' + "\n".join(rules) + '\n"""\n'
    path = tmp_path / "either.toml"
    path.write_text((SCENARIOS / "power_tower.toml").read_text().replace("seed = 1\n", formula, 1))
    found = plan(load(path))
    assert found.assignment == {"d1": ["tr1"], "d2": []}
    assert found.rho > 0.9


def test_ctrl_c_ends_a_proof_that_would_take_for_ever() -> None:
    code = (
        "import numpy as np\nfrom fleet.assign import large\n"
        "from tests.unit.test_planner_assign import random_legs\n"
        "legs = random_legs(np.random.default_rng(7), 6, 40, 200.0)\n"
        "print('ready', flush=True)\nlarge(legs, proved=True)\n"
    )
    root = Path(__file__).parents[2]
    running = subprocess.Popen(
        [sys.executable, "-c", code], cwd=root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stdout is not None
    assert running.stdout.readline().strip() == "ready"
    time.sleep(2.0)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert "KeyboardInterrupt" in said
    assert running.returncode == -signal.SIGINT


def test_one_tour_is_timed_alike_by_all() -> None:
    """The clock of this file's oracle is that of the code."""
    legs = instance(1)
    found = exact(legs)
    assert found is not None
    keeps(legs, found)
    assert all(np.isfinite(tour_time(legs, d, order)) for d, order in enumerate(found))
