"""Faults of the surroundings and of the command line, each with its code and the field it is about."""

from __future__ import annotations

from fleet.errors import EnvironmentError_, InputError, Problem


def environment(code: str, message: str, *, field: str = "") -> EnvironmentError_:
    """A port, peer, process or version is not as needed; ``field`` names the option or drone."""
    return EnvironmentError_(message, problems=[Problem(code, "", field, message)])


def bad_input(code: str, message: str, *, file: str = "", field: str = "") -> InputError:
    """Something on the command line or in a file is not legal."""
    problem = Problem(code, file, field, message)
    return InputError(str(problem), problems=[problem])


class RejectedError(EnvironmentError_):
    """A drone refused what it was asked.

    ``reject`` is the `RejectCode` of the wire, ``of`` what was refused: `plan`, `commit` or a command's name.
    """

    def __init__(self, drone: str, of: str, reject: str, reason: str) -> None:
        """Keep the drone's own words."""
        message = f"{drone} refused {of}: {reason} ({reject})"
        super().__init__(message, problems=[Problem(f"rejected_{reject}", "", drone, message)])
        self.drone = drone
        self.of = of
        self.reject = reject
        self.reason = reason
