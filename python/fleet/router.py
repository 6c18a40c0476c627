"""`fleet router`: the Zenoh router as a process of its own, so that any terminal can command the fleet."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fleet.endpoint import Endpoint
from fleet.errors import EnvironmentError_
from fleet.faults import bad_input, environment
from fleet.interrupt import Interrupt
from fleet.ship.session import close, config, connect, is_router

if TYPE_CHECKING:
    import zenoh

IDLE_S = 10.0
"""A router started by `fleet fly` ends when neither agent nor ground has been connected for this long [s]."""
READY_S = 10.0
_POLL_S = 0.25
_GONE_S = 1.0
ALIVE_KEYS = "fleet/*/*/alive"
"""Liveliness tokens of all agents of all fleets (design.md, Keys)."""


def check_exposure(endpoint: Endpoint, *, insecure: bool, field: str) -> None:
    """Refuse an address that other machines can reach, unless the user has said so.

    Raises:
        InputError: when ``endpoint`` is not loopback and ``insecure`` is off.
    """
    if not (endpoint.is_loopback or insecure):
        raise bad_input(
            "exposed",
            f"{endpoint} can be reached from other machines and the link is not encrypted or authenticated; "
            "use a loopback address, or add --insecure",
            field=field,
        )


def serve(
    endpoint: Endpoint,
    *,
    interrupt: Interrupt,
    on_ready: Callable[[], None],
    exit_when_idle: float | None = None,
) -> None:
    """Route until a signal comes, or until nobody has been connected for ``exit_when_idle`` [s].

    Raises:
        EnvironmentError_: when the port cannot be had.
    """
    import zenoh

    if endpoint.accepts(1.0):
        raise _taken(endpoint, "something listens there already")
    try:
        session = zenoh.open(config("router", listen=endpoint))
    except zenoh.ZError as error:
        raise _taken(endpoint, str(error).splitlines()[0].split(" at /")[0]) from error
    try:
        interrupt.count_only()
        on_ready()
        idle_since = time.monotonic()
        while not interrupt.asked:
            time.sleep(_POLL_S)
            if exit_when_idle is None:
                continue
            now = time.monotonic()
            if session.info.transports():
                idle_since = now
            elif now - idle_since > exit_when_idle:
                return
    finally:
        close(session)


def _taken(endpoint: Endpoint, why: str) -> EnvironmentError_:
    return environment(
        "port",
        f"cannot listen on {endpoint} (port {endpoint.port}): {why}; if that is a router, use it with "
        f"--connect {endpoint}; else give another port with --listen",
        field="--listen",
    )


def ensure(endpoint: Endpoint, log: Path, interrupt: Interrupt) -> subprocess.Popen[bytes] | None:
    """Make sure that a router answers at ``endpoint``; the process, if one had to be started.

    The process is detached: it outlives a command that dies, and ends by itself once nobody is connected.

    Raises:
        EnvironmentError_: when something else holds the port, nothing answers at an address that is not of
            this machine, or the router does not come up.
    """
    if is_router(endpoint):
        return None
    if not endpoint.is_loopback:
        raise environment(
            "router",
            f"no router answers at {endpoint}; one is started only on loopback addresses",
            field="--connect",
        )
    command = [
        sys.executable,
        "-m",
        "fleet",
        "router",
        "--listen",
        str(endpoint),
        "--exit-when-idle",
        f"{IDLE_S:g}",
    ]
    with log.open("wb") as output, interrupt.shielded():
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True
        )
    try:
        _wait_until_up(process, endpoint, log)
    except BaseException:
        process.kill()
        process.wait()
        raise
    return process


def _wait_until_up(process: subprocess.Popen[bytes], endpoint: Endpoint, log: Path) -> None:
    deadline = time.monotonic() + READY_S
    while not endpoint.accepts(0.2):
        if process.poll() is not None:
            raise environment(
                "router", f"the router ended: {log.read_text(errors='replace').strip()}", field="--connect"
            )
        if time.monotonic() > deadline:
            raise environment("router", f"the router was not up within {READY_S:g} s", field="--connect")
        time.sleep(0.05)


def retire(process: subprocess.Popen[bytes], endpoint: Endpoint) -> bool:
    """End a router that this command started, unless agents still need it; whether it has ended."""
    if process.poll() is None:
        try:
            with connect(endpoint) as session:
                if _agents_stay(session):
                    return False
        except EnvironmentError_:
            # Whom it does not answer any more, it cannot serve either: it is ended like an unused one.
            pass
        process.terminate()
    try:
        process.wait(3.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    return True


def _agents_stay(session: zenoh.Session) -> bool:
    """Whether an agent is connected still after the time that the router takes to notice a closed link."""
    deadline = time.monotonic() + _GONE_S
    while any(reply.ok is not None for reply in session.liveliness().get(ALIVE_KEYS, timeout=1.0)):
        if time.monotonic() > deadline:
            return True
        time.sleep(0.05)
    return False
