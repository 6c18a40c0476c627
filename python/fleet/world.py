"""The world of the simulator, as its TOML file: vehicles on their pads, wind, force pulses, obstacles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fleet.scenario import Scenario

FIRST_SYSTEM = 101
"""MAVLink system id of the first drone: never 1, which every stock autopilot on the network uses."""
EPHEMERAL = "127.0.0.1:0"
PARAMETERS = {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 5}
"""The configured vehicle (safety.md, finding 1): a setpoint expires after 0.5 s, then the vehicle holds."""


def world_config(scenario: Scenario) -> str:
    """The simulator's TOML for a scenario: one vehicle a drone, on its pad."""
    return _toml(
        seed=scenario.mission.seed,
        fleet=scenario.mission.fleet,
        wind={"velocity": list(scenario.wind.velocity), "turbulence": scenario.wind.turbulence},
        gusts=[
            {"t": gust.t, "duration": gust.duration, "velocity": list(gust.velocity)}
            for gust in scenario.gusts
        ],
        pads={drone.id: ([float(x) for x in drone.pad], drone.pad_heading) for drone in scenario.drones},
        pulses=[
            {"drone": one.drone, "t": one.t, "duration": one.duration, "force": list(one.force)}
            for one in scenario.disturbances
        ],
        obstacles=[{"name": one.name, "faces": one.faces} for one in scenario.obstacles],
    )


def world_of_plan(plan: Mapping[str, Any]) -> str:
    """The simulator's TOML for a plan alone, which knows no wind and no disturbances: calm air."""
    shapes = {region["name"]: region["shape"] for region in plan["regions"]}
    return _toml(
        seed=plan["seed"],
        fleet=plan["fleet"],
        wind={"velocity": [0.0, 0.0, 0.0]},
        gusts=[],
        pads={drone["id"]: (list(drone["pad"]["p"]), drone["pad"]["psi"]) for drone in plan["drones"]},
        pulses=[],
        obstacles=[{"name": name, "faces": list(shapes[name])} for name in plan["obstacles"]],
    )


def _toml(
    *,
    seed: int,
    fleet: str,
    wind: dict[str, Any],
    gusts: list[dict[str, Any]],
    pads: Mapping[str, tuple[list[float], float]],
    pulses: list[dict[str, Any]],
    obstacles: list[dict[str, Any]],
) -> str:
    import tomli_w

    vehicles = [
        {
            "id": drone,
            "system": FIRST_SYSTEM + k,
            "pad": pad,
            "psi": psi,
            "mavlink": EPHEMERAL,
            "params": PARAMETERS,
        }
        for k, (drone, (pad, psi)) in enumerate(pads.items())
    ]
    world: dict[str, Any] = {"seed": seed, "fleet": fleet, "wind": wind, "vehicle": vehicles}
    world |= {"gust": gusts} if gusts else {}
    world |= {"pulse": pulses} if pulses else {}
    world |= {"obstacle": obstacles} if obstacles else {}
    return tomli_w.dumps(world)
