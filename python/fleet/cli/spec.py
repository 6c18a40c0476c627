"""`fleet spec`: what the planner reads in a mission formula."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fleet import files
from fleet.cli.reply import Json, Reply, reply

if TYPE_CHECKING:
    from fleet.planner.spec import Invariant, Specification
    from fleet.scenario import Scenario


def register(app: typer.Typer) -> None:
    """Add the command of this module."""
    app.command("spec")(spec)


def spec(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenario file (.toml).")],
    as_json: Json = False,
) -> None:
    """Print the parsed formula, its normal form, and clauses that cannot hold or say nothing.

    Example: fleet spec scenarios/power_tower.toml
    """
    with reply("spec", as_json=as_json, keys=("clauses", "normal_form", "warnings")) as answer:
        loaded = files.read_scenario(scenario)
        answer.scenario, answer.seed = loaded.name, loaded.mission.seed
        from fleet.doubts import doubts
        from fleet.planner.spec import specification

        form = specification(loaded.clauses(), float(loaded.mission.T))
        answer.fields["clauses"] = parsed(loaded, form)
        answer.fields["normal_form"] = normal_form(form)
        answer.fields["warnings"] = [
            {"clause": d.clause, "code": d.code, "message": d.message, "others": list(d.others)}
            for d in doubts(loaded)
        ]
        if not as_json:
            show(answer)


def parsed(scenario: Scenario, form: Specification) -> list[dict[str, Any]]:
    """Clauses as written and as read: quantifiers expanded, windows in seconds."""
    from fleet.stl import drones_of, to_text

    return [
        {
            "id": c.id,
            "text": c.text,
            "formula": to_text(c.formula),
            "kind": form.kinds[c.id],
            "drones": drones_of(c.formula),
            "weight": c.weight,
            "priority": c.priority,
        }
        for c in scenario.clauses()
    ]


def normal_form(form: Specification) -> dict[str, list[dict[str, Any]]]:
    """Events, invariants and rest; a home is an event at the end of the mission."""
    from fleet.stl import to_text

    visits = [
        {
            "clause": v.clause,
            "choices": [{"drone": d, "region": r} for d, r in v.options],
            "window": list(v.window),
            "dwell": v.dwell,
        }
        for v in form.visits
    ]
    homes = [
        {
            "clause": h.clause,
            "choices": [{"drone": h.drone, "region": h.region}],
            "window": None,
            "dwell": 0.0,
        }
        for h in form.homes
    ]
    invariants = [
        {"clause": i.clause, "text": invariant(i), "drones": list(i.drones), "window": list(i.window)}
        for i in form.invariants
    ]
    rest = [{"clause": r.clause, "formula": to_text(r.formula)} for r in form.rest]
    return {"events": [*visits, *homes], "invariants": invariants, "rest": rest}


def invariant(i: Invariant) -> str:
    """What an invariant asks, in the text syntax."""
    if i.kind == "apart":
        return f"dist({i.drones[0]}, {i.drones[1]}) >= {i.value:g}"
    if i.kind == "linear":
        sides = zip(i.row, "xyz", strict=False)
        terms = " + ".join(f"{c:g}*{i.drones[0]}.{axis}" for c, axis in sides if c != 0)
        return f"{terms} >= {-i.row[3] + 0.0:g}"
    return f"{i.drones[0]} {'in' if i.kind == 'inside' else 'outside'} {i.region}"


def attributes(clause: Mapping[str, Any]) -> str:
    """Weight and priority of a clause as they are written, with a blank before; empty at the defaults."""
    from fleet.stl import attributes_text

    text = attributes_text(clause["weight"], clause["priority"])
    return f" {text}" if text else ""


def show(answer: Reply) -> None:
    """The same for people."""
    answer.say("formula")
    for clause in answer.fields["clauses"]:
        head = f"  @{clause['id']}{attributes(clause)} ({clause['kind']})"
        answer.say(f"{head}  {clause['formula']}")
    form = answer.fields["normal_form"]
    answer.say("events")
    for event in form["events"]:
        choices = " or ".join(f"{c['drone']} in {c['region']}" for c in event["choices"])
        window = event["window"]
        when = f"within [{window[0]:g}, {window[1]:g}] s" if window else "at the end"
        stay = f", for {event['dwell']:g} s" if event["dwell"] else ""
        answer.say(f"  @{event['clause']}  {choices}  {when}{stay}")
    answer.say("invariants")
    for one in form["invariants"]:
        answer.say(f"  @{one['clause']}  {one['text']}  over [{one['window'][0]:g}, {one['window'][1]:g}] s")
    answer.say("rest")
    for one in form["rest"]:
        answer.say(f"  @{one['clause']}  {one['formula']}")
    for one in answer.fields["warnings"]:
        answer.say(f"warning: @{one['clause']} is {one['code']}: {one['message']}")
    if not answer.fields["warnings"]:
        answer.say(
            "no clause is contradictory, vacuous or implied by others, as far as can be told without planning"
        )
