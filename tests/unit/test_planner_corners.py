"""Missions at the corners of the language, on the site of `crossing`."""

from __future__ import annotations

from pathlib import Path

import pytest

from fleet.certificate import verify
from fleet.errors import InfeasibleError
from fleet.planner import plan
from fleet.scenario import Scenario, load

CROSSING = Path(__file__).parents[2] / "scenarios" / "crossing.toml"
SAFE = "@safe always[0,T] all d: d in workspace and d outside obstacles"
APART = "@apart always[0,T] all d != e: dist(d,e) >= delta_min"
HOME = "@home eventually[2T/3,T] all d: d in home"


def mission(tmp_path: Path, *clauses: str) -> Scenario:
    """The site and fleet of `crossing` with other clauses, nothing assigned by hand."""
    head, _, rest = CROSSING.read_text().partition("[limits]")
    limits, _, _ = rest.partition("[assignment]")
    timing = [line for line in head.splitlines() if line.startswith(("T =", "T_s =", "c =", "seed ="))]
    text = "\n".join(("[mission]", *timing, 'formula = """', SAFE, APART, *clauses, HOME, '"""', "[limits]"))
    path = tmp_path / "corner.toml"
    path.write_text(text + limits)
    return load(path)


@pytest.mark.parametrize(
    "clause",
    [
        "@r eventually[0,0] d1 in home",
        "@r eventually[0,0] stay 2 d1 in home",
        "@r some d: eventually[0,0] d in home",
        "@r eventually[0,15] stay 3 d1 in home",
    ],
)
def test_a_visit_where_the_drone_is_already_takes_no_time(tmp_path: Path, clause: str) -> None:
    found = plan(mission(tmp_path, clause, "@n eventually[0,15] d1 in north"))
    assert found.rho >= 0.95 * found.rho_bound
    assert verify(found.data).ok


@pytest.mark.parametrize(
    ("clauses", "named"),
    [
        (("@a always[6,9] d1 in north", "@b always[8,12] d1 in south"), {"a", "b"}),
        (
            (
                "@n eventually[0,15] d1 in north",
                "@never always[0,T] d1 outside north",
                "@both eventually[0,15] (d1 in north and d1 in south)",
            ),
            {"both"},
        ),
        (("@a eventually[0,3] d1 in north", "@g always[0,T] d2 outside tower"), {"a"}),
    ],
)
def test_the_conflict_is_the_smallest(tmp_path: Path, clauses: tuple[str, ...], named: set[str]) -> None:
    with pytest.raises(InfeasibleError) as caught:
        plan(mission(tmp_path, *clauses))
    conflict = caught.value.conflict
    assert conflict is not None
    assert conflict.proved
    assert set(conflict.clauses) == named


@pytest.mark.parametrize("weight", ["2", "20"])
def test_weights_change_nothing_where_nothing_conflicts(tmp_path: Path, weight: str) -> None:
    north = "eventually[0,15] d1 in north"
    plain = plan(mission(tmp_path, f"@n {north}"))
    weighed = plan(mission(tmp_path, f"@n {{weight {weight}}} {north}"))
    assert weighed.rho == pytest.approx(plain.rho, abs=1e-6)
    assert weighed.rho >= 0.95 * weighed.rho_bound
