"""A flight in virtual time: `fleet-sim virtual` with the agents inside, as fast as it can."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet.files import PlanFile, write_atomic
from fleet.interrupt import Interrupt
from fleet.processes import Children, find_program
from fleet.rundir import RunDir
from fleet.world import world_config

__all__ = ["VirtualFlight", "fly_virtual", "world_config"]

_SILENCE_S = 60.0
"""The simulator reports at most 5 times a second; one that says nothing for this long hangs [s]."""


@dataclass(frozen=True)
class VirtualFlight:
    """How a virtual flight ended: simulated and wall time [s], how each drone ended, and its log."""

    sim_s: float
    wall_s: float
    end: dict[str, str]
    log: Path


def fly_virtual(
    mission: PlanFile,
    world: str,
    run: RunDir,
    *,
    interrupt: Interrupt,
    progress: Callable[[float, str], None],
) -> VirtualFlight:
    """Fly ``mission`` in the simulator's ``world``; ``progress`` gets mission time [s].

    Raises:
        EnvironmentError_: when the simulator is missing, fails or hangs.
    """
    program = find_program("fleet-sim")
    write_atomic(run.plan, mission.payload)
    write_atomic(run.world, world.encode())
    log = run.part("virtual")
    argv = [str(program), "virtual", "--config", str(run.world), "--plan", str(run.plan), "--log", str(log)]
    with Children(interrupt) as children:
        child = children.start("fleet-sim", argv, run.stderr("sim"))
        last: dict[str, Any] = {}
        while not last.get("done"):
            try:
                line = child.next_line(_SILENCE_S)
            except TimeoutError:
                raise child.failed(f"said nothing for {_SILENCE_S:g} s") from None
            if line is None:
                child.wait(2.0)
                raise child.failed(f"ended (exit code {child.code()}) before the flight did")
            last = line
            if "t" in line:
                progress(float(line["t"]), "")
        if not child.wait(_SILENCE_S) or child.code() != 0:
            raise child.failed(f"did not end well (exit code {child.code()})")
    return VirtualFlight(float(last["sim_s"]), float(last["wall_s"]), dict(last["end"]), log)
