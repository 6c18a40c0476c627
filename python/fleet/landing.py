"""From the start of a mission to drones on the ground, whatever happens in between."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from fleet.faults import environment
from fleet.interrupt import Interrupt
from fleet.processes import Child
from fleet.ship.link import Link
from fleet.ship.operator import Command, command_all
from fleet.ship.shipping import Started
from fleet.ship.watch import SILENT_S, DroneView, Watch

TAKEOFF_S = 10.0
"""Take-off begins this long before mission time 0 (design.md, Start) [s]."""
LANDING_S = 120.0
"""Longest time from the end of the mission, or from `land`, to motors off: 23 m at 0.7 m/s is 33 s [s]."""
_PERIOD_S = 0.1


class Programs(Protocol):
    """Processes of a simulated flight; none of a real one."""

    @property
    def sim(self) -> Child | None:
        """The simulator."""
        ...

    @property
    def agents(self) -> dict[str, Child]:
        """Agents by drone."""
        ...


@dataclass(frozen=True)
class FlightEnd:
    """How a flight ended: whether it was broken off, and how long it took from `start` [s]."""

    aborted: bool
    flight_s: float


@dataclass(frozen=True)
class Desk:
    """The person at the ground station: their Ctrl-C, and what they are told.

    ``progress`` gets mission time [s] and a note, ``notice`` a line for everything that happens.
    """

    interrupt: Interrupt
    progress: Callable[[float, str], None]
    notice: Callable[[str], None]


class KilledError(KeyboardInterrupt):
    """A second Ctrl-C in the air: nothing is waited for any more."""


def follow(
    link: Link,
    watch: Watch,
    started: Started,
    horizon: float,
    programs: Programs,
    desk: Desk,
) -> FlightEnd:
    """Watch until every drone is down. The first Ctrl-C in the air asks all to land, the second ends it here.

    Raises:
        KeyboardInterrupt: when interrupted before take-off, or a second time.
        EnvironmentError_: when a process ends in flight, or drones are not down in time.
    """
    interrupt = desk.interrupt
    interrupt.count_only()
    begin = time.monotonic()
    deadline = started.t0_mono_ns * 1e-9 + horizon + LANDING_S
    landing: threading.Thread | None = None
    while not all(_is_down(view, programs) for view in watch.views.values()):
        now = time.monotonic()
        mission_time = now - started.t0_mono_ns * 1e-9
        _tell_notices(watch, desk)
        desk.progress(mission_time, _summary(watch, now))
        if interrupt.asked and mission_time < -TAKEOFF_S:
            raise KeyboardInterrupt
        if interrupt.count > 1:
            raise KilledError
        if interrupt.asked and landing is None:
            landing = _command(link, watch, programs, "land", desk)
            deadline = now + LANDING_S
        _check_programs(watch, programs)
        if now > deadline:
            late = [view.drone for view in watch.views.values() if not _is_down(view, programs)]
            raise environment("late", f"{', '.join(late)} is not down in time", field=late[0])
        time.sleep(_PERIOD_S)
    _tell_notices(watch, desk)
    return FlightEnd(landing is not None, time.monotonic() - begin)


def bring_down(link: Link, watch: Watch, programs: Programs, desk: Desk) -> None:
    """Get every drone onto the ground with motors off: abort on the ground, land in the air.

    Gives up at a further Ctrl-C, without a simulator (nothing moves any more), or after two minutes; what the
    drones do then is their own failsafe's.
    """
    interrupt = desk.interrupt
    interrupt.count_only()
    flying = [
        view
        for view in watch.views.values()
        if view.armed and not _is_down(view, programs) and not _is_dead(view, programs)
    ]
    if not flying or (programs.sim is not None and programs.sim.code() is not None):
        return
    seen = interrupt.count
    airborne = any(view.airborne for view in flying)
    _command(link, watch, programs, "land" if airborne else "abort", desk)
    deadline = time.monotonic() + (LANDING_S if airborne else SILENT_S * 2)
    while not all(_is_down(view, programs) for view in flying):
        if interrupt.count > seen or (airborne and interrupt.count > 1):
            desk.notice("interrupted again: not waiting for the landing")
            return
        if time.monotonic() > deadline:
            desk.notice("not all drones are known to be down")
            return
        if programs.sim is not None and programs.sim.code() is not None:
            return
        time.sleep(_PERIOD_S)


def _tell_notices(watch: Watch, desk: Desk) -> None:
    for body in watch.take_notices():
        desk.notice(describe(body))


def describe(body: dict[str, Any]) -> str:
    """An event or replan as a line for people."""
    if body["kind"] == "unreadable":
        return f"a message on {body['key']} cannot be read: {body['error']}"
    if body["kind"] == "replan":
        rejoin = "" if body["t_rejoin"] is None else f", back on the plan at t = {body['t_rejoin']:.2f} s"
        where = f"{body['deviation']:.2f} m off at t = {body['t_event']:.2f} s"
        return f"{body['drone']}: replan {body['outcome']}, {where}{rejoin}"
    what = body["what"]
    at = "" if body["mission_time"] is None else f" at t = {body['mission_time']:.2f} s"
    if what["event"] == "mode":
        return f"{body['drone']}: {what['from']} -> {what['to']}{at} ({body['cause']})"
    words = {key: value for key, value in what.items() if key != "event"}
    details = "".join(
        f" {value:.2f}" if isinstance(value, float) else f" {value}" for value in words.values()
    )
    return f"{body['drone']}: {what['event']}{details}{at} ({body['cause']})"


def _is_down(view: DroneView, programs: Programs) -> bool:
    """Down by its own word, or because its agent, told to exit when landed, has done so."""
    agent = programs.agents.get(view.drone)
    return view.down or (agent is not None and agent.code() == 0 and view.was_armed)


def _is_dead(view: DroneView, programs: Programs) -> bool:
    """Whether its agent has ended: nobody can command it any more, its autopilot lands it by itself."""
    agent = programs.agents.get(view.drone)
    return agent is not None and agent.code() is not None


def _check_programs(watch: Watch, programs: Programs) -> None:
    for drone, agent in programs.agents.items():
        if agent.code() is not None and not _is_down(watch.views[drone], programs):
            raise agent.failed(f"ended in flight (exit code {agent.code()})")
    sim = programs.sim
    if sim is not None and sim.code() is not None and any(view.airborne for view in watch.views.values()):
        raise sim.failed(f"ended in flight (exit code {sim.code()})")


def _command(link: Link, watch: Watch, programs: Programs, name: Command, desk: Desk) -> threading.Thread:
    """Send a command to all drones that are not down; in a thread, because a silent drone takes its time."""
    drones = [view.drone for view in watch.views.values() if not _is_down(view, programs)]

    def send() -> None:
        for answer in command_all(link, drones, name):
            outcome = "accepted" if answer.error is None else f"failed: {answer.error}"
            desk.notice(f"{answer.drone}: {name} {outcome}")

    thread = threading.Thread(target=send, name=f"command-{name}", daemon=True)
    thread.start()
    return thread


def _summary(watch: Watch, now: float) -> str:
    return "  ".join(_one(view, now) for view in watch.views.values())


def _one(view: DroneView, now: float) -> str:
    if view.silence(now) > SILENT_S:
        return f"{view.drone} silent {view.silence(now):.0f} s" if view.heard else f"{view.drone} silent"
    deviation = view.telemetry.get("deviation")
    off = "" if deviation is None else f" {deviation:.2f} m"
    replans = view.telemetry.get("replans", 0)
    return f"{view.drone} {view.mode}{off}" + (f" replans {replans}" if replans else "")
