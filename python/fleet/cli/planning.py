"""`fleet plan`, `check`, `verify`, `export`: everything that needs no drone."""

from __future__ import annotations

from collections.abc import Mapping
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fleet import files
from fleet.cli import show
from fleet.cli.progress import bar, spinner
from fleet.cli.reply import Json, Reply, reply
from fleet.cli.searching import keep_best
from fleet.errors import Exit, InfeasibleError
from fleet.faults import bad_input
from fleet.interrupt import Interrupt

if TYPE_CHECKING:
    from fleet.planner import PlanResult
    from fleet.scenario import Scenario

PLAN_KEYS = (
    "plan", "hash", "status", "method", "rho", "rho_lower", "rho_bound", "clauses", "assignment", "events",
    "time_s", "int_a2", "energy_J", "hover_share", "drones", "conflict", "relaxed", "notes", "history",
    "ended", "memory_mb",
)  # fmt: skip
"""Keys that `plan --json` adds (design.md, --json)."""
ENERGY = ("lexicographic", "weighted")
METHODS = ("auto", "convex", "nlp", "paper", "rrt")
ASSIGNMENTS = ("auto", "exact", "paper")
ScenarioArgument = Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenario file (.toml).")]


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command("plan")(plan)
    app.command("check")(check)
    app.command("verify")(verify)
    app.command("export")(export)


def plan(
    scenario: ScenarioArgument,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the plan to this file.")
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            help="How to plan: auto, convex, nlp; or a baseline: rrt (kinodynamic RRT*), "
            "paper (log-sum-exp over samples, IPOPT; minutes)."
        ),
    ] = "auto",
    assignment: Annotated[
        str | None,
        typer.Option(
            help="Who visits what: auto, exact (the proved best, however long it takes) or paper (targets "
            "dealt in turn); orders in the scenario go first. As \\[planner] says if not given."
        ),
    ] = None,
    energy: Annotated[
        str | None,
        typer.Option(
            help="Spend robustness on energy: lexicographic, weighted, or off; as \\[energy] of the scenario "
            "says if not given."
        ),
    ] = None,
    floor: Annotated[
        float | None, typer.Option(metavar="M", help="Least robustness that --energy leaves, in metres.")
    ] = None,
    time_limit: Annotated[
        float | None,
        typer.Option("--time-limit", help="Look for better plans for this long, seconds of planning."),
    ] = None,
    relax: Annotated[
        bool,
        typer.Option(
            "--relax",
            help="If the mission cannot hold, plan the least violation: visits late, else skipped; exit 1.",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Plan a mission and prove that the plan satisfies it.

    The first certified plan is the answer, always the same one. With --time-limit better ones (larger rho, to
    1 mm; then less energy) take its place while there is time. Ctrl-C keeps the best plan so far.

    Example: fleet plan scenarios/power_tower.toml -o power_tower.plan.cbor

    Example: fleet plan scenarios/crossing.toml --time-limit 10 -o crossing.plan.cbor
    """
    interrupt = Interrupt()
    with interrupt.installed(), reply("plan", as_json=as_json, keys=PLAN_KEYS) as answer:
        loaded = assigning(saving(files.read_scenario(scenario), energy, floor), assignment)
        answer.scenario, answer.seed = loaded.name, loaded.mission.seed
        if not as_json:
            show.formula(answer, loaded.clauses())
        result = make_plan(answer, loaded, method, interrupt, time_limit, relax=relax)
        answer.fields |= plan_fields(result)
        answer.fields["relaxed"] = [gave.as_dict() for gave in result.relaxed] if relax else None
        if output is not None:
            files.write_atomic(output, result.bytes)
            answer.fields["plan"] = str(output)
        answer.exit = exit_of_plan(result.plan)
        if not as_json:
            show.plan(answer, result.plan, answer.fields)
            for gave in result.relaxed:
                answer.say(f"gave way: {gave}")


def assigning(scenario: Scenario, assignment: str | None) -> Scenario:
    """The scenario with the assignment that the option asks for.

    Raises InputError when it is not legal.
    """
    from dataclasses import replace

    if assignment is None:
        return scenario
    if assignment not in ASSIGNMENTS:
        legal = ", ".join(ASSIGNMENTS)
        raise bad_input("value", f"{assignment!r} is not legal; must be {legal}", field="--assignment")
    return replace(scenario, planner=scenario.planner.model_copy(update={"assignment": assignment}))


def saving(scenario: Scenario, energy: str | None, floor: float | None) -> Scenario:
    """The scenario with the energy objective that options ask for.

    Raises InputError when an option is not legal.
    """
    from dataclasses import replace

    from fleet.scenario.tables import Energy

    if energy not in (None, "off", *ENERGY):
        legal = ", ".join((*ENERGY, "off"))
        raise bad_input("value", f"{energy!r} is not legal; must be {legal}", field="--energy")
    goal = scenario.energy
    if energy is not None:
        goal = None if energy == "off" else goal or Energy.model_validate({})
    if floor is not None and goal is None:
        raise bad_input("value", "is legal with --energy lexicographic or weighted only", field="--floor")
    tube = scenario.limits.tube
    if floor is not None and not tube <= floor <= 1e6:
        text = f"{floor:g} m is not legal; must be at least the tube, {tube:g} m"
        raise bad_input("value", text, field="--floor")
    if goal is None:
        return replace(scenario, energy=None)
    chosen: dict[str, object] = {} if energy is None else {"objective": energy}
    chosen |= {} if floor is None else {"floor": floor}
    return replace(scenario, energy=goal.model_copy(update=chosen))


def make_plan(
    answer: Reply,
    scenario: Scenario,
    method: str = "auto",
    interrupt: Interrupt | None = None,
    time_limit: float | None = None,
    *,
    relax: bool = False,
) -> PlanResult:
    """Plan with progress on stderr; an infeasible mission leaves why in `conflict`.

    With `interrupt` its signals keep the best plan so far (`keep_best`).
    """
    from fleet import planner

    if method not in METHODS:
        raise bad_input(
            "method", f"{method!r} is not a method; legal is {', '.join(METHODS)}", field="--method"
        )
    try:
        if interrupt is not None:
            return keep_best(answer, interrupt, scenario, method, time_limit, relax=relax)
        with spinner(answer.err, f"planning {scenario.name}") as tell:
            return planner.plan(
                scenario,
                method=method,
                relax=relax,
                progress=lambda stage, rho: tell(stage if isnan(rho) else f"{stage}, rho {rho:.2f} m"),
            )
    except InfeasibleError as error:
        if "conflict" in answer.fields:
            answer.fields["conflict"] = error.conflict.as_dict() if error.conflict else None
        raise


def plan_fields(result: PlanResult) -> dict[str, Any]:
    """The keys of `plan --json` that follow from a planner's result."""
    plan = result.plan
    fields = {key: plan[key] for key in ("status", "method", "rho", "rho_lower", "rho_bound")}
    return fields | {
        "hash": result.hash,
        "clauses": [planned_clause(clause, clause["result"]) for clause in plan["clauses"]],
        "assignment": result.assignment,
        "events": result.events,
        "time_s": dict(result.timings),
        "int_a2": result.int_a2,
        "energy_J": result.energy,
        "hover_share": result.hover_share,
        "drones": [
            {"id": name, "energy_J": total, "hover_share": hover / total}
            for name, (total, hover) in result.energies.items()
        ],
        "notes": list(result.notes),
    }


def planned_clause(clause: Mapping[str, Any], result: Mapping[str, float]) -> dict[str, Any]:
    """A clause of a plan as `--json` has it, with ``result`` as its robustness."""
    head = {key: clause[key] for key in ("id", "text", "kind", "drones", "weight", "priority")}
    return head | {key: result[key] for key in ("rho", "rho_lower", "t_tightest")}


def exit_of_plan(plan: dict[str, Any]) -> int:
    """1 when a clause of the plan is violated, else 0."""
    return int(Exit.VIOLATED if plan["status"] == "violated" else Exit.SATISFIED)


def check(scenario: ScenarioArgument, as_json: Json = False) -> None:
    """Check a scenario and name all of its problems at once.

    Example: fleet check scenarios/crossing.toml
    """
    with reply("check", as_json=as_json) as answer:
        loaded = files.read_scenario(scenario)
        answer.scenario, answer.seed = loaded.name, loaded.mission.seed
        answer.fields["clauses"] = [{"id": clause.id, "text": clause.text} for clause in loaded.clauses()]
        answer.say(
            f"{scenario}: no problems; {len(loaded.drones)} drones, {len(loaded.targets)} targets, "
            f"{len(loaded.obstacles)} obstacles, T = {loaded.mission.T:g} s"
        )
        if not as_json:
            show.formula(answer, loaded.clauses())


def verify(
    file: Annotated[Path, typer.Argument(metavar="PLAN|LOG", help="Plan file or merged flight log.")],
    as_json: Json = False,
) -> None:
    """Prove a plan again, or judge a flight again, from the file alone.

    Example: fleet verify power_tower.plan.cbor
    """
    with reply(
        "verify", as_json=as_json, keys=("clauses", "rho", "rho_lower", "hash", "verdict", "problems")
    ) as answer:
        if files.kind(file) == "log":
            _verify_log(answer, file)
            return
        if files.kind(file) == "scenario":
            raise bad_input("file", "is a scenario; `fleet check` reads those", file=str(file))
        found = files.read_plan(file)
        from fleet import certificate

        proof = certificate.verify(found.payload)
        answer.scenario, answer.seed = found.plan["scenario"], found.plan["seed"]
        answer.fields |= {
            "hash": found.hash,
            "rho": proof.rho,
            "rho_lower": proof.rho_lower,
            "clauses": [
                planned_clause(clause, proof.clauses[clause["id"]]) for clause in found.plan["clauses"]
            ],
            "verdict": "satisfied" if proof.ok else "violated",
            "problems": proof.problems,
        }
        answer.exit = int(Exit.SATISFIED if proof.ok else Exit.VIOLATED)
        if not as_json:
            show.proof(answer, found.plan)


def _verify_log(answer: Reply, file: Path) -> None:
    from fleet.log import read
    from fleet.verdict import judge

    with spinner(answer.err, f"reading {file.name}"):
        flight = read(file)
        verdict = judge(flight)
    answer.scenario, answer.seed = flight.plan["scenario"], flight.plan["seed"]
    lower = [clause.rho_lower for clause in verdict.clauses]
    answer.fields |= {
        "hash": flight.plan_hash,
        "rho": verdict.rho_flown,
        "rho_lower": min(lower) if lower else None,
        "clauses": verdict.as_dict()["clauses"],
        "verdict": show.word(verdict),
        "problems": verdict.problems,
    }
    answer.exit = int(Exit.SATISFIED if verdict.satisfied else Exit.VIOLATED)
    if not answer.as_json:
        show.verdict(answer, flight.plan, verdict)


def export(
    file: Annotated[Path, typer.Argument(metavar="PLAN|LOG", help="Plan file or merged flight log.")],
    csv: Annotated[Path, typer.Option("--csv", help="CSV file to write.")],
    hz: Annotated[float, typer.Option("--hz", help="Samples a second, 0.1 to 1000.")] = 50.0,
    as_json: Json = False,
) -> None:
    """Write samples of a plan or a flight as CSV, so that others can judge us.

    Columns: t,drone,source(plan|est|truth),px,py,pz,vx,vy,vz,ax,ay,az in seconds and metres, scenario frame.

    Example: fleet export runs/power_tower/flight.mcap --hz 50 --csv flight.csv
    """
    with reply("export", as_json=as_json, keys=("csv", "rows")) as answer:
        if not 0.1 <= hz <= 1000.0:
            raise bad_input("value", f"{hz:g} is not a legal rate; legal is 0.1 to 1000", field="--hz")
        if not csv.parent.is_dir():
            raise bad_input("file", "the folder does not exist", file=str(csv), field="--csv")
        is_log = files.kind(file) == "log"
        from fleet import export as table

        with bar(answer.err, f"exporting {file.name}", 1.0):
            if is_log:
                from fleet.log import read

                flight = read(file)
                plan, rows = flight.plan, table.flight_rows(flight, hz)
            else:
                plan = files.read_plan(file).plan
                rows = table.plan_rows(plan, hz)
            answer.scenario, answer.seed = plan["scenario"], plan["seed"]
            answer.fields |= {"csv": str(csv), "rows": table.write(csv, rows)}
        answer.say(f"{csv}: {answer.fields['rows']} rows")
