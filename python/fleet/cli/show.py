"""Tables for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rich.table import Table

from fleet.cli.reply import Reply

if TYPE_CHECKING:
    from fleet.stl import Clause
    from fleet.verdict import Verdict


def formula(answer: Reply, clauses: Iterable[Clause]) -> None:
    """The mission formula, a clause a line."""
    from fleet.stl import attributes_text

    answer.say("mission formula")
    for clause in clauses:
        attributes = attributes_text(clause.weight, clause.priority)
        answer.say("  " + "  ".join(part for part in (f"@{clause.id}", attributes, clause.text) if part))


def plan(answer: Reply, plan: dict[str, Any], fields: dict[str, Any]) -> None:
    """Who visits what when, robustness per clause, and where the time went."""
    visits = _table("drone", "region", "t [s]", "window [s]", "slack [s]")
    for event in fields["events"]:
        low, high = event["window"]
        visits.add_row(
            event["drone"], event["region"], _f(event["t"]), f"{low:g} .. {high:g}", _f(event["slack_s"])
        )
    answer.out.print(visits)
    answer.out.print(_clauses(plan, fields["clauses"], ("rho", "rho_lower", "t_tightest")))
    spent = ", ".join(
        f"{name} {value:.2f} s" for name, value in fields["time_s"].items() if value is not None
    )
    answer.say(
        f"{plan['scenario']}: {plan['status']} ({plan['method']}), rho {_f(plan['rho'])} m, "
        f"continuous-time bound {_f(plan['rho_lower'])} m, upper bound {_f(plan['rho_bound'])} m"
    )
    answer.say(f"energy: {_energies(fields)}; integral of |a|^2 {fields['int_a2']:.3f} m^2/s^3")
    for note in fields["notes"]:
        answer.say(note)
    answer.say(f"time: {spent}")
    if fields["plan"]:
        answer.say(f"plan: {fields['plan']}  sha256 {fields['hash'][:16]}...")


def proof(answer: Reply, plan: Mapping[str, Any]) -> None:
    """What `fleet verify` found in a plan."""
    found = answer.fields
    answer.out.print(_clauses(plan, found["clauses"], ("rho", "rho_lower", "t_tightest")))
    for problem in found["problems"]:
        answer.say(f"problem: {problem}")
    bound = _f(found["rho_lower"])
    answer.say(f"{found['verdict']}: rho {_f(found['rho'])} m, continuous-time bound {bound} m")


def word(verdict: Verdict) -> str:
    """The verdict in one word."""
    return "satisfied" if verdict.satisfied else "violated"


def verdict(answer: Reply, plan: Mapping[str, Any], verdict: Verdict) -> None:
    """The judgement of a flight, per clause and per drone."""
    found = verdict.as_dict()
    columns = ("rho_planned", "rho_lower", "rho_flown", "t_tightest")
    answer.out.print(_clauses(plan, found["clauses"], columns))
    per_drone = ("rmse_m", "max_m", "replans", "min_clearance_m", "energy_J", "gap_max_ms", "end")
    drones = _table("drone", *per_drone)
    for drone in found["drones"]:
        drones.add_row(drone["id"], *(_f(drone[column]) for column in per_drone))
    answer.out.print(drones)
    for problem in verdict.problems:
        answer.say(f"problem: {problem}")
    answer.say(
        f"{word(verdict)} (judged on {verdict.source}): rho flown {_f(verdict.rho_flown)} m, "
        f"planned {_f(verdict.rho_planned)} m, least pair distance {_f(verdict.min_pair_m)} m"
    )


def _energies(fields: Mapping[str, Any]) -> str:
    """Electrical energy of a plan: fleet, then drone by drone, with the share that hovering would take."""
    fleet = f"{fields['energy_J'] / 1e3:.3f} kJ (hovering {100 * fields['hover_share']:.2f} %)"
    each = [
        f"{d['id']} {d['energy_J'] / 1e3:.3f} kJ ({100 * d['hover_share']:.2f} %)" for d in fields["drones"]
    ]
    return f"{fleet}: {', '.join(each)}" if len(each) > 1 else fleet


_HEADS = {
    "rho": "rho",
    "rho_planned": "planned",
    "rho_lower": "certified",
    "rho_flown": "flown",
    "t_tightest": "tightest at",
}
"""Headings that leave the table readable in 80 columns."""


def _clauses(plan: Mapping[str, Any], clauses: list[dict[str, Any]], columns: tuple[str, ...]) -> Table:
    from fleet.certificate import visitors

    visits = visitors(plan)
    table = _table("clause", "kind", "drones", "visited by", *(_HEADS[column] for column in columns))
    for clause in clauses:
        table.add_row(
            f"@{clause['id']}",
            clause["kind"],
            " ".join(clause["drones"]),
            " ".join(dict.fromkeys(drone for drone, _ in visits[clause["id"]])) or "-",
            *(_f(clause[column]) for column in columns),
        )
    return table


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False)
    for column in columns:
        table.add_column(
            column, justify="left" if column in {"drone", "region", "clause", "kind"} else "right"
        )
    return table


def _f(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)
