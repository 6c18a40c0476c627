"""An operator's command to drones that fly a mission which perhaps another terminal has started."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Literal

from fleet.errors import FleetError
from fleet.faults import RejectedError
from fleet.ship.link import Link, compose

Command = Literal["arm", "hold", "resume", "return", "land", "abort", "disarm"]
COMMANDS: tuple[Command, ...] = ("arm", "hold", "resume", "return", "land", "abort", "disarm")
ANSWER_S = 3.0
_RACES = 3


@dataclass(frozen=True)
class Answer:
    """What one drone said; ``error`` is None when it accepted."""

    drone: str
    error: FleetError | None


def command(link: Link, drone: str, name: Command) -> Answer:
    """Send one command, taking mission, epoch and sequence from the drone's status.

    Two terminals may take the same sequence number; the loser is refused as stale, reads again and repeats.
    """
    for attempt in range(_RACES):
        try:
            _send(link, drone, name)
        except RejectedError as error:
            if error.reject != "stale" or attempt == _RACES - 1:
                return Answer(drone, error)
        except FleetError as error:
            return Answer(drone, error)
        else:
            break
    return Answer(drone, None)


def command_all(link: Link, drones: list[str], name: Command) -> list[Answer]:
    """Send one command to each of ``drones``; one that does not answer keeps none of the others from it."""
    return [command(link, drone, name) for drone in drones]


def _send(link: Link, drone: str, name: Command) -> None:
    status = link.status(drone, ANSWER_S)
    message = compose(
        drone,
        {"kind": "command", "command": name},
        # A drone that has not seen a mission has no id; the field has to be well formed all the same.
        mission_id=status["mission_id"] or secrets.token_hex(16),
        epoch=status["epoch"],
        seq=status["seq"] + 1,
        offset=link.offset(drone),
        valid_s=ANSWER_S,
    )
    link.request([message], within_s=ANSWER_S, what=f"the {name} command")
