"""The report's HTML page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fleet import _core
from fleet.files import write_atomic
from fleet.log.flight import Flight
from fleet.verdict import Verdict

_TEMPLATE = Path(__file__).with_name("page.html")


def write(flight: Flight, verdict: Verdict, path: Path, other: _core.Plan | None = None) -> None:
    """Write the report of `flight` as one self-contained HTML file.

    `other` is a plan of the same drones whose power is shown beside this one's.

    Raises:
        InputError: when the file cannot be written.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["metres"] = _metres
    page = environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        **_context(flight, verdict, other)
    )
    write_atomic(path, page.encode())


def _metres(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _energies(flight: Flight, verdict: Verdict, other: _core.Plan | None) -> list[dict[str, Any]]:
    """Energy of every drone in kJ: planned, share of hovering as long, of the other plan, flown."""

    def planned(plan: _core.Plan, drone: str) -> tuple[float, float]:
        part = next(d for d in plan["drones"] if d["id"] == drone)
        return _core.Trajectory.from_list(part["trajectory"]).energy()

    rows = []
    for drone in verdict.drones:
        total, hover = planned(flight.plan, drone.id)
        rows.append(
            {
                "id": drone.id,
                "planned": total / 1e3,
                "hover": 100 * hover / total,
                "other": None if other is None else planned(other, drone.id)[0] / 1e3,
                "flown": None if drone.energy_J is None else drone.energy_J / 1e3,
            }
        )
    return rows


def _context(flight: Flight, verdict: Verdict, other: _core.Plan | None) -> dict[str, Any]:
    from markupsafe import Markup
    from plotly.offline import get_plotlyjs

    from fleet.certificate import visitors
    from fleet.report import figures

    def embed(figure: Any) -> Markup | None:
        if figure is None:
            return None
        # The fragment is made by the library from numbers and names that passed `is_name`.
        html = figure.to_html(full_html=False, include_plotlyjs=False, config={"displaylogo": False})
        return Markup(html)

    notices = [(i, notice) for i, log in flight.drones.items() for notice in log.replans]
    return {
        "plan": flight.plan,
        "hash": flight.plan_hash,
        "log": flight.path.name,
        "verdict": verdict,
        "visits": visitors(flight.plan),
        "plotly": Markup(get_plotlyjs()),
        "scene": embed(figures.scene(flight)),
        "motions": [(d["id"], embed(figures.motion(flight, k))) for k, d in enumerate(flight.plan["drones"])],
        "distance": embed(figures.distance(flight)),
        "robustness": embed(figures.robustness(flight)),
        "deviation": embed(figures.deviation(flight)),
        "power": embed(figures.power(flight, other)),
        "effort": embed(figures.effort(flight, other)),
        "energies": _energies(flight, verdict, other),
        "replans": sorted(notices, key=lambda pair: (pair[1]["t_event"], pair[0])),
        "modes": [(t, i, mode, cause) for i, log in flight.drones.items() for t, mode, cause in log.modes],
    }
