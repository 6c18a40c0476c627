"""Weights of clauses: conflicting margins are shared out by them; the verdict is not weighted."""

from __future__ import annotations

from pathlib import Path

import pytest

from fleet.certificate import verify
from fleet.planner import PlanResult, plan
from fleet.scenario import Scenario, load

CORRIDOR = """
[mission]
T = 24.0
formula = '''
{formula}
'''
[workspace]
box = [[-8.0, -5.0, 0.0], [8.0, 25.0, 12.0]]
[[obstacle]]
name = "west"
box = [[-8.0, 8.0, 0.0], [-1.2, 12.0, 12.0]]
[[obstacle]]
name = "east"
box = [[1.2, 8.0, 0.0], [8.0, 12.0, 12.0]]
[[target]]
name = "far"
box = [[-2.0, 18.0, 3.0], [2.0, 22.0, 7.0]]
[[drone]]
id = "d1"
home = {{ box = [[-2.0, -2.0, 0.2], [2.0, 2.0, 4.2]] }}
pad = [0.0, 0.0, 0.1]
"""
"""Two walls 2.4 m apart; everything else leaves 2 m."""

WALLS = {
    "regions": ("always[0,T] d1 outside west", "always[0,T] d1 outside east"),
    "coordinates": ("always[6,18] d1.x >= -1.2", "always[6,18] d1.x <= 1.2"),
    # Of no normal form: nobody can get as high as the other branch asks.
    "branches": ("always[6,18] (d1.x >= -1.2 or d1.z >= 40)", "always[6,18] (d1.x <= 1.2 or d1.z >= 40)"),
}


def corridor(tmp_path: Path, kind: str, west: str = "", east: str = "") -> Scenario:
    """A drone that flies to `far` and back between two walls, each with a clause and its attributes."""
    first, second = WALLS[kind]
    formula = (
        f"@room always[0,T] d1 in workspace\n@west {west} {first}\n@east {east} {second}\n"
        "@there eventually[8,12] d1 in far\n@home eventually[20,T] d1 in home"
    )
    path = tmp_path / "corridor.toml"
    path.write_text(CORRIDOR.format(formula=formula))
    return load(path)


def margins(result: PlanResult) -> dict[str, float]:
    return {c["id"]: c["result"]["rho"] for c in result.plan["clauses"]}


@pytest.mark.parametrize("kind", WALLS)
def test_conflicting_margins_are_shared_out_by_weight(tmp_path: Path, kind: str) -> None:
    result = plan(corridor(tmp_path, kind, east="{weight 2}"), method="convex")
    found = margins(result)
    assert found["west"] == pytest.approx(0.8, abs=0.01)
    assert found["east"] == pytest.approx(1.6, abs=0.01)
    # What is said of the plan is said of the clauses as they are written.
    assert result.rho == min(found.values())
    assert result.rho_bound == pytest.approx(2.0)
    assert verify(result.data).ok


def test_both_methods_share_alike(tmp_path: Path) -> None:
    found = margins(plan(corridor(tmp_path, "regions", east="{weight 2}"), method="nlp"))
    assert (found["west"], found["east"]) == pytest.approx((0.8, 1.6), abs=0.01)


def test_a_light_clause_keeps_the_tube(tmp_path: Path) -> None:
    """A tenth of the margin would be 0.22 m; the tube asks for 0.4 m of every clause."""
    found = margins(plan(corridor(tmp_path, "regions", west="{weight 0.1}"), method="convex"))
    assert 0.4 - 1e-6 <= found["west"] < 0.45
    assert found["east"] > 1.9


def test_only_ratios_of_weights_matter(tmp_path: Path) -> None:
    plain = plan(corridor(tmp_path, "regions"))
    assert margins(plain)["west"] == pytest.approx(1.2, abs=0.01)
    text = (tmp_path / "corridor.toml").read_text()
    for name in ("room", "west", "east", "there", "home"):
        text = text.replace(f"@{name} ", f"@{name} {{weight 7}} ")
    (tmp_path / "corridor.toml").write_text(text)
    heavy = plan(load(tmp_path / "corridor.toml"))
    assert [c["weight"] for c in heavy.plan["clauses"]] == [7.0] * 5
    assert heavy.plan["drones"] == plain.plan["drones"]


def test_weight_and_priority_are_in_the_plan(tmp_path: Path) -> None:
    result = plan(corridor(tmp_path, "regions", east="{priority 3, weight 1.5}"))
    carried = {c["id"]: (c["weight"], c["priority"]) for c in result.plan["clauses"]}
    assert carried["east"] == (1.5, 3)
    assert carried["west"] == (1.0, 0)
