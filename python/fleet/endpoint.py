"""Zenoh endpoints as people write them: ``tcp/127.0.0.1:7447``."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import dataclass

from fleet.faults import bad_input

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Where a router listens and clients connect unless told otherwise (Zenoh's registered port)."""

_PROTOCOLS = ("tcp", "tls", "udp")


@dataclass(frozen=True)
class Endpoint:
    """One address of the Zenoh network."""

    protocol: str
    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.protocol}/{host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def accepts(self, timeout: float) -> bool | None:
        """Whether something takes TCP connections there within ``timeout`` [s]; None for UDP."""
        if self.protocol == "udp":
            return None
        try:
            with socket.create_connection((self.host, self.port), timeout=timeout):
                return True
        except OSError:
            return False


def parse_endpoint(text: str, *, field: str) -> Endpoint:
    """Read ``PROTOCOL/HOST:PORT``; ``field`` names the option in the error.

    Raises:
        InputError: when the text is not of that form.
    """
    protocol, slash, address = text.partition("/")
    host, colon, port = address.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    legal = protocol in _PROTOCOLS and bool(slash) and bool(colon) and bool(host) and port.isdecimal()
    if not legal or not 1 <= int(port) <= 65535:
        raise bad_input(
            "endpoint",
            f"{text!r} is not an endpoint; legal is {'|'.join(_PROTOCOLS)}/HOST:PORT, "
            f"for example {DEFAULT_ENDPOINT}",
            field=field,
        )
    return Endpoint(protocol, host, int(port))
