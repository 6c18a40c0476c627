"""`fleet simulate`, `fly`, `report`: missions flown in virtual time or by real processes, and judged."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fleet import files
from fleet.cli import show
from fleet.cli.planning import make_plan
from fleet.cli.progress import bar, spinner
from fleet.cli.reply import Json, Reply, reply
from fleet.endpoint import DEFAULT_ENDPOINT, parse_endpoint
from fleet.errors import Exit, Problem, ViolatedError
from fleet.faults import bad_input, environment
from fleet.interrupt import Interrupt

if TYPE_CHECKING:
    from fleet import _core

FLIGHT_KEYS = (
    "log", "report", "verdict", "rho_planned", "rho_flown", "min_pair_m", "sim_s", "wall_s", "clauses",
    "drones",
)  # fmt: skip
"""Keys that `simulate --json` and `fly --json` add (design.md, --json)."""
_FINISHED = {"satisfied": Exit.SATISFIED, "violated": Exit.VIOLATED, "aborted": Exit.VIOLATED}
MissionArgument = Annotated[
    Path, typer.Argument(metavar="SCENARIO|PLAN", help="Scenario (.toml), or a plan made by `fleet plan -o`.")
]
RunDirOption = Annotated[
    Path | None,
    typer.Option("--run-dir", help="New or empty folder for logs and report; runs/NAME-TIME if not given."),
]


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command("simulate")(simulate)
    app.command("fly")(fly)
    app.command("report")(report)


def simulate(mission: MissionArgument, run_dir: RunDirOption = None, as_json: Json = False) -> None:
    """Fly a mission in virtual time, as fast as the machine can, and judge it.

    Example: fleet simulate scenarios/power_tower.toml
    """
    from fleet import rundir

    interrupt = Interrupt()
    with reply("simulate", as_json=as_json, keys=FLIGHT_KEYS) as answer, interrupt.installed():
        plan, world = _mission(answer, mission)
        with rundir.run_dir(run_dir, plan.plan["scenario"]) as run:
            from fleet.finish import finish, t0_of
            from fleet.simulate import fly_virtual

            with bar(answer.err, "virtual flight", plan.plan["horizon"]) as progress:
                flown = fly_virtual(plan, world, run, interrupt=interrupt, progress=progress)
            answer.fields |= {"sim_s": flown.sim_s, "wall_s": flown.wall_s}
            with bar(answer.err, "log", 1.0) as progress:
                finished = finish(plan, [flown.log], t0_of(flown.log), run, progress=progress)
            _conclude(answer, plan, finished, aborted=False)


def fly(
    mission: MissionArgument,
    run_dir: RunDirOption = None,
    connect: Annotated[
        str,
        typer.Option("--connect", metavar="ENDPOINT", help="Router; one is started there if none answers."),
    ] = DEFAULT_ENDPOINT,
    simulated: Annotated[
        bool,
        typer.Option("--sim/--no-sim", help="Start simulator and agents, or use agents that run already."),
    ] = True,
    part: Annotated[
        list[Path] | None,
        typer.Option(
            "--part", help="With --no-sim: a log that an agent records on this machine, for the verdict."
        ),
    ] = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Allow a router that is not on this machine.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Fly a mission in real time and judge what was flown.

    Ctrl-C before take-off disarms and leaves nothing behind; in the air it lands all drones, a second one
    kills the simulation.

    Example: fleet fly scenarios/power_tower.toml --run-dir runs/first
    """
    from fleet import rundir
    from fleet.router import check_exposure

    interrupt = Interrupt()
    with reply("fly", as_json=as_json, keys=FLIGHT_KEYS) as answer, interrupt.installed():
        endpoint = parse_endpoint(connect, field="--connect")
        check_exposure(endpoint, insecure=insecure, field="--connect")
        for log in part or []:
            if simulated:
                raise bad_input("value", "is legal with --no-sim only", field="--part", file=str(log))
        plan, world = _mission(answer, mission)
        with rundir.run_dir(run_dir, plan.plan["scenario"]) as run:
            from fleet.fly import Surroundings

            around = Surroundings(endpoint, run, world if simulated else None, insecure)
            _fly(answer, plan, around, interrupt, part or [])


def _fly(
    answer: Reply, plan: files.PlanFile, around: Any, interrupt: Interrupt, recorded: list[Path]
) -> None:
    from fleet import fly as flight
    from fleet.finish import finish
    from fleet.landing import Desk

    def notice(text: str) -> None:
        answer.err.print(text, markup=False)

    horizon = plan.plan["horizon"]
    with bar(answer.err, "flight", horizon) as progress:
        flown = flight.fly(plan, around, Desk(interrupt, progress, notice))
    answer.fields["wall_s"] = flown.flight_s
    answer.fields["sim_s"] = flown.flight_s if around.world is not None else None
    parts = [*flown.parts, *recorded]
    if not parts:
        raise environment(
            "log",
            "all drones are down; no log to judge is here: agents record with --record, and --part names "
            "such a file to this command",
            field="--part",
        )
    with bar(answer.err, "log", 1.0) as progress:
        finished = finish(plan, parts, flown.t0_ns, around.run, progress=progress)
    _conclude(answer, plan, finished, aborted=flown.aborted)


def report(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Merged flight log (.mcap).")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="HTML file; beside the log if not given.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="PNG", help="Also draw the flown paths as a picture.")
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="PLAN", help="Show the power of this plan beside the flight's."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write the report of a flight as one HTML file that needs no network.

    Example: fleet report runs/power_tower/flight.mcap
    """
    with reply("report", as_json=as_json, keys=("log", "report", "verdict", "picture")) as answer:
        if files.kind(log) != "log":
            raise bad_input("log", "is not a flight log (MCAP)", file=str(log))
        path = output if output is not None else log.with_suffix(".html")
        for file, field in ((path, "--output"), (picture, "--picture")):
            if file is not None and not file.parent.is_dir():
                raise bad_input("file", "the folder does not exist", file=str(file), field=field)
        other = None if against is None else _other_plan(against)
        from fleet import report as writer
        from fleet.log import read
        from fleet.verdict import judge

        with spinner(answer.err, f"reading {log.name}") as tell:
            flight = read(log)
            if other is not None:
                _same_drones(flight.plan, other, against)
            verdict = judge(flight)
            tell("writing")
            writer.write(flight, verdict, path, other)
            if picture is not None:
                tell("drawing")
                writer.draw(flight, picture)
                answer.fields["picture"] = str(picture)
        answer.scenario, answer.seed = flight.plan["scenario"], flight.plan["seed"]
        answer.fields |= {"log": str(log), "report": str(path), "verdict": show.word(verdict)}
        answer.say(f"report: {path}")


def _other_plan(path: Path) -> _core.Plan:
    """The plan to show beside the flight's."""
    if files.kind(path) != "plan":
        raise bad_input("plan", "is not a plan, as `fleet plan -o` writes", file=str(path), field="--against")
    return files.read_plan(path).plan


def _same_drones(plan: _core.Plan, other: _core.Plan, path: Path | None) -> None:
    missing = {d["id"] for d in plan["drones"]} - {d["id"] for d in other["drones"]}
    if missing:
        text = f"has no drone {', '.join(sorted(missing))}; legal is a plan for the drones that flew"
        raise bad_input("plan", text, file=str(path), field="--against")


def _mission(answer: Reply, path: Path) -> tuple[files.PlanFile, str]:
    """The plan of a scenario or plan file, and the simulator's world for it."""
    from fleet.world import world_config, world_of_plan

    if files.kind(path) == "scenario":
        scenario = files.read_scenario(path)
        answer.scenario, answer.seed = scenario.name, scenario.mission.seed
        made = make_plan(answer, scenario)
        return files.plan_of(made.bytes), world_config(scenario)
    if files.kind(path) == "log":
        raise bad_input("plan", "is a flight log; legal is a scenario or a plan", file=str(path))
    plan = files.read_plan(path)
    answer.scenario, answer.seed = plan.plan["scenario"], plan.plan["seed"]
    _refuse_violating(plan, path)
    return plan, world_of_plan(plan.plan)


def _refuse_violating(plan: files.PlanFile, path: Path) -> None:
    """No drone accepts a plan that violates its mission (crates/core admission): say so before any is asked.

    Raises ViolatedError.
    """
    if plan.plan["status"] != "violated":
        return
    broken = [c["id"] for c in plan.plan["clauses"] if c["result"]["rho_lower"] <= 0]
    which = f" (clause {', '.join(broken)})" if broken else ""
    text = f"the plan violates its mission{which}, and no drone accepts such a plan; to fly it, "
    text += "write what gave way into the scenario's formula and plan that mission"
    raise ViolatedError(f"{path}: {text}", problems=[Problem("violated", str(path), "", text)])


def _conclude(answer: Reply, plan: files.PlanFile, finished: Any, *, aborted: bool) -> None:
    verdict = finished.verdict
    word = "aborted" if aborted else show.word(verdict)
    judged = verdict.as_dict()
    answer.fields |= {
        key: judged[key] for key in ("rho_planned", "rho_flown", "min_pair_m", "clauses", "drones")
    }
    answer.fields |= {"log": str(finished.log), "report": str(finished.report), "verdict": word}
    answer.exit = int(_FINISHED[word])
    if not answer.as_json:
        show.verdict(answer, plan.plan, verdict)
        if aborted:
            answer.say("aborted: the flight was broken off")
        answer.say(f"log:    {finished.log}")
        answer.say(f"report: {finished.report}")
