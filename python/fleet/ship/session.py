"""The Zenoh session of a ground command: a client of explicit endpoints, nothing discovered."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from fleet.endpoint import Endpoint
from fleet.faults import environment

if TYPE_CHECKING:
    import zenoh

RETRY = {"period_init_ms": 200, "period_max_ms": 200, "period_increase_factor": 1}
"""Reconnection of a lost link (design.md, Zenoh: every 200 ms; Zenoh's own default grows to 4 s)."""
_PROBE_S = 1.0
_HANDSHAKE_S = 3.0
_CLOSE_S = 1.0


def config(mode: str, *, listen: Endpoint | None = None, connect: Endpoint | None = None) -> zenoh.Config:
    """Zenoh configuration without any scouting."""
    import zenoh

    settings = zenoh.Config()
    settings.insert_json5("mode", json.dumps(mode))
    settings.insert_json5("scouting/multicast/enabled", "false")
    settings.insert_json5("scouting/gossip/enabled", "false")
    # Zenoh waits this long for scouting when it opens; there is none to wait for.
    settings.insert_json5("scouting/delay", "0")
    if listen is not None:
        settings.insert_json5("listen/endpoints", json.dumps([str(listen)]))
        settings.insert_json5("listen/timeout_ms", "0")
        settings.insert_json5("listen/exit_on_failure", "true")
    if connect is not None:
        settings.insert_json5("connect/endpoints", json.dumps([str(connect)]))
        # These bound the first connection only: a router that restarts later is looked for without end.
        settings.insert_json5("connect/timeout_ms", str(round(_HANDSHAKE_S * 1e3)))
        settings.insert_json5("connect/exit_on_failure", "true")
        settings.insert_json5("connect/retry", json.dumps(RETRY))
    return settings


@contextmanager
def connect(endpoint: Endpoint) -> Iterator[zenoh.Session]:
    """Open a client session to the router at ``endpoint`` and close it at the end.

    Raises:
        EnvironmentError_: when nothing answers there, or what answers is not a Zenoh router.
    """
    import zenoh

    if endpoint.accepts(_PROBE_S) is False:
        raise environment(
            "router",
            f"no router answers at {endpoint}: start one with `fleet router --listen {endpoint}`, "
            "or give the right address with --connect",
            field="--connect",
        )
    try:
        session = zenoh.open(config("client", connect=endpoint))
    except zenoh.ZError as error:
        raise environment(
            "router",
            f"what listens at {endpoint} is not a Zenoh router of this version "
            f"(no handshake within {_HANDSHAKE_S:g} s)",
            field="--connect",
        ) from error
    try:
        yield session
    finally:
        close(session)


def close(session: zenoh.Session) -> None:
    """Close ``session``; a silent peer may not hold up the caller by more than 1 s."""
    closing = threading.Thread(target=session.close, name="zenoh-close", daemon=True)
    closing.start()
    closing.join(_CLOSE_S)


def is_router(endpoint: Endpoint) -> bool:
    """Whether a Zenoh router answers at ``endpoint``; False when nothing does.

    Raises:
        EnvironmentError_: when something else listens there.
    """
    if endpoint.accepts(_PROBE_S) is False:
        return False
    with connect(endpoint):
        return True
