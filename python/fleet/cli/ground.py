"""`fleet router`, `status` and the operator's commands: usable from any terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from fleet.cli.reply import Json, Reply, reply
from fleet.endpoint import DEFAULT_ENDPOINT, parse_endpoint
from fleet.errors import FleetError
from fleet.faults import bad_input, environment

if TYPE_CHECKING:
    from fleet.ship.link import Link
    from fleet.ship.operator import Command

Connect = Annotated[str, typer.Option("--connect", help="Router to use.", metavar="ENDPOINT")]
Fleet = Annotated[str, typer.Option("--fleet", help="Name of the fleet, as in the scenario.")]
Drones = Annotated[
    list[str] | None,
    typer.Argument(metavar="[DRONE]...", help="Drone ids; all connected drones when left out."),
]
_TEXTS: dict[Command, str] = {
    "arm": "Run the pre-flight checks and arm.",
    "hold": "Stop and hover.",
    "resume": "Leave hold and rejoin the plan.",
    "return": "Fly home and land.",
    "land": "Land here.",
    "abort": "On the ground: disarm. In the air: descend level and land at once.",
    "disarm": "Disarm; refused in the air.",
}


def register(app: typer.Typer) -> None:
    """Add the commands of this module."""
    app.command("router")(router)
    app.command("status")(status)
    for name, text in _TEXTS.items():
        app.command(name, help=_help(name, text))(_operator(name))


def _help(name: str, text: str) -> str:
    return f"{text}\n\nThe drones acknowledge.\n\nExample: fleet {name} d1 --connect {DEFAULT_ENDPOINT}"


def router(
    listen: Annotated[
        str, typer.Option("--listen", help="Where to listen.", metavar="ENDPOINT")
    ] = DEFAULT_ENDPOINT,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Allow an address that is not loopback.")
    ] = False,
    exit_when_idle: Annotated[
        float | None, typer.Option(help="End when nobody has been connected for this many seconds.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Run the Zenoh router that joins ground and drones; Ctrl-C ends it.

    Example: fleet router --listen tcp/127.0.0.1:7447
    """
    from fleet.interrupt import Interrupt
    from fleet.router import check_exposure, serve

    with reply("router", as_json=as_json, keys=("endpoint",)) as answer:
        endpoint = parse_endpoint(listen, field="--listen")
        check_exposure(endpoint, insecure=insecure, field="--listen")
        if exit_when_idle is not None and exit_when_idle <= 0:
            raise bad_input(
                "value", f"{exit_when_idle:g} is not legal; legal is > 0 s", field="--exit-when-idle"
            )
        answer.fields["endpoint"] = str(endpoint)
        interrupt = Interrupt()

        def ready() -> None:
            if as_json:
                sys.stdout.write(json.dumps({"ready": True, "endpoint": str(endpoint)}) + "\n")
                sys.stdout.flush()
            else:
                answer.say(f"routing on {endpoint}; Ctrl-C ends it")

        with interrupt.installed():
            serve(endpoint, interrupt=interrupt, on_ready=ready, exit_when_idle=exit_when_idle)


@contextmanager
def _linked(connect_to: str, fleet: str, drones: list[str] | None) -> Iterator[Link]:
    from fleet import _core
    from fleet.ship.link import Link
    from fleet.ship.session import connect

    endpoint = parse_endpoint(connect_to, field="--connect")
    _check_name(fleet, "--fleet", _core.is_name)
    for drone in drones or []:
        _check_name(drone, "DRONE", _core.is_name)
    with connect(endpoint) as session:
        link = Link(session, fleet)
        try:
            yield link
        finally:
            link.close()


def _check_name(name: str, field: str, is_name: Callable[[str], bool]) -> None:
    if not is_name(name):
        raise bad_input(
            "name",
            f"{name!r} is not a name; legal is a letter, then up to 31 letters, digits or _",
            field=field,
        )


def _chosen(link: Link, drones: list[str] | None) -> list[str]:
    chosen = drones or link.drones()
    if not chosen:
        raise environment(
            "peer", f"no drone of fleet {link.fleet!r} is connected to this router", field="DRONE"
        )
    return chosen


def status(
    drones: Drones = None, connect: Connect = DEFAULT_ENDPOINT, fleet: Fleet = "fleet", as_json: Json = False
) -> None:
    """Show mode, mission, plan and pre-flight checks of the drones.

    Example: fleet status --connect tcp/127.0.0.1:7447
    """
    with (
        reply("status", as_json=as_json, keys=("drones",)) as answer,
        _linked(connect, fleet, drones) as link,
    ):
        found = [link.status(drone, 3.0) for drone in _chosen(link, drones)]
        answer.fields["drones"] = found
        if not as_json:
            answer.out.print(_status_table(found))


def _status_table(found: list[dict[str, Any]]) -> Table:
    table = Table(box=None, pad_edge=False)
    for column in ("drone", "mode", "mission", "epoch", "seq", "plan", "start", "pre-flight"):
        table.add_column(column)
    for one in found:
        table.add_row(
            one["drone"],
            one["mode"],
            one["mission_id"][:8] or "-",
            str(one["epoch"]),
            str(one["seq"]),
            one["hash"][:8] or "-",
            "-" if one["t0"] is None else "set",
            "; ".join(one["preflight"]) or "ok",
        )
    return table


def _operator(name: Command) -> Callable[..., None]:
    def command(
        drones: Drones = None,
        connect: Connect = DEFAULT_ENDPOINT,
        fleet: Fleet = "fleet",
        as_json: Json = False,
    ) -> None:
        from fleet.ship.operator import command_all

        with (
            reply(name, as_json=as_json, keys=("drones",)) as answer,
            _linked(connect, fleet, drones) as link,
        ):
            answers = command_all(link, _chosen(link, drones), name)
            answer.fields["drones"] = [{"id": one.drone, "accepted": one.error is None} for one in answers]
            for one in answers:
                if one.error is None:
                    answer.say(f"{one.drone}: accepted")
            _fail_all(answer, [one.error for one in answers if one.error is not None])

    return command


def _fail_all(answer: Reply, errors: list[FleetError]) -> None:
    problems = []
    for error in errors:
        answer.fail(error)
        problems += error.problems
    answer.problems = problems
