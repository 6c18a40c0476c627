"""A flight in real time: router, simulator, agents, shipping, take-off, landing.

Every way out leaves drones on the ground and no process behind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet.endpoint import Endpoint
from fleet.faults import environment
from fleet.files import PlanFile, write_atomic
from fleet.interrupt import Interrupt
from fleet.landing import Desk, KilledError, bring_down, follow
from fleet.processes import Child, Children, find_program
from fleet.router import ensure, retire
from fleet.rundir import RunDir
from fleet.ship.link import Link
from fleet.ship.session import connect
from fleet.ship.shipping import Shipment, Started
from fleet.ship.watch import Watch

READY_S = 15.0
"""Longest wait for the ready line of a started program [s]."""
FLUSH_S = 15.0
"""Longest wait for programs to write their logs and end by themselves after landing [s]."""
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Flown:
    """A flight that has ended on the ground; ``t0_ns`` is mission time 0 [unix ns], ``parts`` the logs."""

    t0_ns: int
    parts: list[Path]
    aborted: bool
    flight_s: float


@dataclass(frozen=True)
class Surroundings:
    """Where and with what a plan is flown; without ``world`` the agents run already, on real vehicles."""

    endpoint: Endpoint
    run: RunDir
    world: str | None
    insecure: bool = False


@dataclass(frozen=True)
class Programs:
    """Processes of a simulated flight; none of a real one."""

    sim: Child | None
    agents: dict[str, Child]


def fly(
    mission: PlanFile,
    around: Surroundings,
    desk: Desk,
) -> Flown:
    """Fly ``mission``, from the router to drones on the ground.

    Raises:
        FleetError: when something is missing, refused or fails before take-off, or drones did not come down.
        KeyboardInterrupt: when interrupted before take-off; nothing is left running.
    """
    drones = [drone["id"] for drone in mission.plan["drones"]]
    run, interrupt = around.run, desk.interrupt

    def tell(what: str) -> None:
        desk.progress(0.0, what)

    if around.world is not None:
        # Before anything is started: a missing program is found at once.
        find_program("fleet-sim"), find_program("fleet-agent")
    write_atomic(run.plan, mission.payload)
    with ExitStack() as stack:
        tell("router")
        stack.enter_context(_router(around, interrupt))
        # Entered after the router, so left before it: the router may end once no agent is connected.
        children = stack.enter_context(Children(interrupt))
        if around.world is not None:
            _refuse_connected(around.endpoint, mission.plan["fleet"], drones)
        programs = _start_programs(mission, around, children, tell)
        session = stack.enter_context(connect(around.endpoint))
        link = Link(session, mission.plan["fleet"])
        watch = Watch(session, mission.plan["fleet"], drones)
        stack.callback(link.close)
        stack.callback(watch.close)
        try:
            started = _ship(mission, link, watch, tell)
            if programs.sim is not None:
                programs.sim.tell({"t0_unix_ns": started.t0_unix_ns})
            horizon = mission.plan["horizon"]
            end = follow(link, watch, started, horizon, programs, desk)
        except KilledError:
            raise
        except BaseException:
            bring_down(link, watch, programs, desk)
            raise
        _flush(programs, desk.notice)
    parts = (
        [run.part("sim"), *(run.part(drone) for drone in programs.agents)] if around.world is not None else []
    )
    return Flown(started.t0_unix_ns, parts, end.aborted, end.flight_s)


@contextmanager
def _router(around: Surroundings, interrupt: Interrupt) -> Iterator[None]:
    """A router at the endpoint; one started here ends with the flight, unless agents still need it."""
    process = ensure(around.endpoint, around.run.stderr("router"), interrupt)
    try:
        yield
    finally:
        if process is not None:
            interrupt.count_only()
            retire(process, around.endpoint)


def _refuse_connected(endpoint: Endpoint, fleet: str, drones: list[str]) -> None:
    with connect(endpoint) as session:
        link = Link(session, fleet)
        taken = sorted(set(link.drones()) & set(drones))
        link.close()
    if taken:
        raise environment(
            "busy",
            f"{', '.join(taken)} of fleet {fleet!r} is connected to {endpoint} already: use --no-sim, "
            "or use another --connect, or another fleet name in [mission]",
            field=taken[0],
        )


def _start_programs(mission: PlanFile, around: Surroundings, children: Children, tell: Tell) -> Programs:
    """Start simulator and agents and wait for their ready lines; nothing without a world."""
    if around.world is None:
        return Programs(None, {})
    sim_program, agent_program = find_program("fleet-sim"), find_program("fleet-agent")
    run = around.run
    write_atomic(run.world, around.world.encode())
    tell("simulator")
    argv = [
        str(sim_program),
        "run",
        "--config",
        str(run.world),
        "--log",
        str(run.part("sim")),
        "--exit-when-landed",
    ]
    sim = children.start("fleet-sim", argv, run.stderr("sim"))
    vehicles = {vehicle["id"]: vehicle for vehicle in sim.ready(READY_S)["vehicles"]}
    agents = {}
    for drone in (one["id"] for one in mission.plan["drones"]):
        tell(f"agent of {drone}")
        argv = _agent_argv(agent_program, drone, vehicles[drone], mission, around)
        agents[drone] = children.start(f"fleet-agent {drone}", argv, run.stderr(drone))
    for child in agents.values():
        child.ready(READY_S)
    return Programs(sim, agents)


def _agent_argv(
    program: Path, drone: str, vehicle: dict[str, Any], mission: PlanFile, around: Surroundings
) -> list[str]:
    options = {
        "--fleet": mission.plan["fleet"],
        "--drone": drone,
        "--zenoh": str(around.endpoint),
        "--mavlink": f"udpout:{vehicle['mavlink']}",
        "--system": str(vehicle["system"]),
        "--record": str(around.run.part(drone)),
        "--state-dir": str(around.run.state),
    }
    flags = ["--exit-when-landed", "--exit-when-orphaned", *(["--insecure"] if around.insecure else [])]
    return [str(program), *(word for pair in options.items() for word in pair), *flags]


def _ship(mission: PlanFile, link: Link, watch: Watch, tell: Tell) -> Started:
    shipment = Shipment(link, mission.plan, mission.payload, mission.hash)
    shipment.meet(tell)
    tell("offering the plan")
    shipment.offer()
    shipment.wait_for_preflight(tell)
    tell("arming")
    shipment.arm(watch)
    tell("starting")
    return shipment.start()


def _flush(programs: Programs, notice: Tell) -> None:
    """Let the programs end by themselves, so that their logs are whole."""
    sim = [programs.sim] if programs.sim is not None else []
    for child in [*programs.agents.values(), *sim]:
        if not child.wait(FLUSH_S):
            notice(f"{child.name} did not end by itself after landing; it is ended now")
        elif child.code() != 0:
            notice(str(child.failed(f"ended with exit code {child.code()}")))
