"""The paper's figures from a flight: scene, motion against bounds, mutual distance, robustness over time."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from fleet import _core
from fleet.consumption import flown_power, planned_power, sample_times
from fleet.log.flight import Array, Flight
from fleet.log.scene import hull_triangles, role, vertices
from fleet.report import palette
from fleet.verdict import mission_times, positions_at

_AXES = ("x", "y", "z")
_MARGIN = {"l": 60, "r": 20, "t": 40, "b": 45}


def scene(flight: Flight) -> go.Figure:
    """3-D scene: regions, planned paths (dashed) and flown paths."""
    plan = flight.plan
    figure = go.Figure()
    for region in plan["regions"]:
        kind = role(region["name"], plan)
        if kind != "workspace":
            figure.add_trace(_mesh(region, kind))
    for index, drone in enumerate(plan["drones"]):
        color, name = palette.drone_color(index), drone["id"]
        planned = _planned(plan, index)
        figure.add_trace(_path(planned[:, :3], f"{name} planned", color, dash="dash"))
        flown = _flown(flight, name)
        figure.add_trace(_path(flown[::5, 1:4], f"{name} flown", color, dash="solid"))
    figure.update_layout(
        height=640,
        margin={"l": 0, "r": 0, "t": 10, "b": 0},
        scene={"aspectmode": "data", "xaxis_title": "x [m]", "yaxis_title": "y [m]", "zaxis_title": "z [m]"},
        legend={"orientation": "h"},
    )
    return figure


def motion(flight: Flight, index: int) -> go.Figure:
    """Position, velocity and acceleration of one drone, planned and flown, with bounds and task windows."""
    plan = flight.plan
    drone = plan["drones"][index]
    times = mission_times(plan)
    planned = _planned(plan, index)
    flown = _flown(flight, drone["id"])[::5]
    bounds = (None, plan["limits"]["v_max"], plan["limits"]["a_max"])
    names = ("position [m]", "velocity [m/s]", "acceleration [m/s²]")
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.04)
    acceleration = np.gradient(flown[:, 4:7], flown[:, 0], axis=0) if len(flown) > 1 else np.empty((0, 3))
    for row in range(3):
        measured = (flown[:, 1:4], flown[:, 4:7], acceleration)[row]
        for axis in range(3):
            color = palette.DRONES[axis]
            figure.add_trace(
                go.Scatter(
                    x=times, y=planned[:, 3 * row + axis], name=f"{_AXES[axis]} planned",
                    legendgroup=_AXES[axis],
                    line={"color": color, "dash": "dash", "width": 1}, showlegend=row == 0,
                ),
                row=row + 1, col=1,
            )  # fmt: skip
            figure.add_trace(
                go.Scatter(
                    x=flown[:, 0], y=measured[:, axis], name=f"{_AXES[axis]} flown",
                    legendgroup=_AXES[axis],
                    line={"color": color, "width": 1.5}, showlegend=row == 0,
                ),
                row=row + 1, col=1,
            )  # fmt: skip
        limit = bounds[row]
        if limit is not None:
            for sign in (-1, 1):
                figure.add_hline(y=sign * limit, line={"color": "#888", "dash": "dot"}, row=row + 1, col=1)
        figure.update_yaxes(title_text=names[row], row=row + 1, col=1)
    for visit in drone["visits"]:
        figure.add_vrect(x0=visit["window"][0], x1=visit["window"][1], fillcolor=palette.WINDOW, line_width=0)
        figure.add_vline(x=visit["t"], line={"color": palette.TARGET}, annotation_text=visit["region"])
    figure.update_xaxes(title_text="mission time [s]", row=3, col=1)
    figure.update_layout(height=720, margin=_MARGIN, legend={"orientation": "h"})
    return figure


def distance(flight: Flight) -> go.Figure | None:
    """Mutual distance of every pair against delta_min; none for a single drone."""
    plan = flight.plan
    ids = [d["id"] for d in plan["drones"]]
    if len(ids) < 2:
        return None
    times = mission_times(plan)
    flown = {i: positions_at(_flown(flight, i), times) for i in ids}
    figure = go.Figure()
    for number, (a, b) in enumerate(combinations(ids, 2)):
        gap = np.linalg.norm(flown[a] - flown[b], axis=1)
        figure.add_trace(
            go.Scatter(x=times, y=gap, name=f"{a}, {b}", line={"color": palette.drone_color(number)})
        )
    minimum = plan["limits"]["delta_min"]
    figure.add_hline(y=minimum, line={"color": "#c00", "dash": "dash"}, annotation_text="delta_min")
    _finish(figure, "distance [m]")
    return figure


def robustness(flight: Flight) -> go.Figure:
    """What each clause measures over time, flown: the operand of its outermost always or eventually."""
    plan = flight.plan
    ids = [d["id"] for d in plan["drones"]]
    fleet = _core.Fleet(ids, plan["regions"])
    times = mission_times(plan)
    positions = np.stack([positions_at(_flown(flight, i), times) for i in ids])
    figure = go.Figure()
    for number, clause in enumerate(plan["clauses"]):
        formula: Any = clause["formula"]
        operand = formula["f"] if formula["op"] in ("always", "eventually") else formula
        trace = fleet.robustness(operand, positions, plan["sample"])
        figure.add_trace(
            go.Scatter(
                x=times[: len(trace)], y=trace, name=clause["id"], line={"color": palette.drone_color(number)}
            )
        )
    figure.add_hline(y=0.0, line={"color": "#c00", "dash": "dash"})
    _finish(figure, "robustness [m]")
    return figure


def deviation(flight: Flight) -> go.Figure:
    """Distance between state and committed reference against eta, with the local replans."""
    plan = flight.plan
    figure = go.Figure()
    for index, drone in enumerate(plan["drones"]):
        log = flight.drones[drone["id"]]
        rows = log.setpoint[(log.setpoint[:, 0] >= 0) & (log.setpoint[:, 0] <= plan["horizon"])][::5]
        color = palette.drone_color(index)
        figure.add_trace(go.Scatter(x=rows[:, 0], y=rows[:, 6], name=drone["id"], line={"color": color}))
        for notice in log.replans:
            figure.add_vline(x=notice["t_event"], line={"color": color, "dash": "dot"})
    figure.add_hline(y=plan["replan"]["eta"], line={"color": "#c00", "dash": "dash"}, annotation_text="eta")
    _finish(figure, "deviation [m]")
    return figure


def power(flight: Flight, other: _core.Plan | None = None) -> go.Figure:
    """Power over time of every drone, planned and flown, and planned by another plan of the same drones."""
    plan = flight.plan
    figure = go.Figure()
    times = sample_times(plan["horizon"])
    for index, drone in enumerate(plan["drones"]):
        color, name = palette.drone_color(index), drone["id"]
        flown = _flown(flight, name)
        if len(flown) > 1:
            _line(figure, times, flown_power(flown, times), f"{name} flown", color, "solid")
        planned = planned_power(_core.Trajectory.from_list(drone["trajectory"]), times)
        _line(figure, times, planned, f"{name} planned", color, "dash")
        if other is not None:
            track = _core.Trajectory.from_list(_drone_of(other, name)["trajectory"])
            clock = sample_times(other["horizon"])
            _line(figure, clock, planned_power(track, clock), f"{name} other plan", color, "dot")
    hover = _core.hover_power()
    figure.add_hline(y=hover, line={"color": "#888", "dash": "dash"}, annotation_text="hover")
    _finish(figure, "electrical power [W]")
    return figure


def effort(flight: Flight, other: _core.Plan | None = None) -> go.Figure:
    """|a|^2 over time, planned, of every drone: what the energy-aware plan makes small."""
    figure = go.Figure()
    for plan, name, dash in ((flight.plan, "planned", "solid"), (other, "other plan", "dot")):
        if plan is None:
            continue
        times = sample_times(plan["horizon"])
        for index, drone in enumerate(flight.plan["drones"]):
            track = _core.Trajectory.from_list(_drone_of(plan, drone["id"])["trajectory"])
            squared = (track.sample(times)[:, 6:9] ** 2).sum(axis=1)
            _line(figure, times, squared, f"{drone['id']} {name}", palette.drone_color(index), dash)
    _finish(figure, "|a|² [m²/s⁴]")
    return figure


def _drone_of(plan: _core.Plan, drone: str) -> _core.DronePlan:
    return next(d for d in plan["drones"] if d["id"] == drone)


def _line(figure: go.Figure, x: Array, y: Array, name: str, color: str, dash: str) -> None:
    figure.add_trace(go.Scatter(x=x, y=y, name=name, line={"color": color, "dash": dash, "width": 1.3}))


def _finish(figure: go.Figure, label: str) -> None:
    figure.update_layout(
        height=380,
        margin=_MARGIN,
        legend={"orientation": "h"},
        xaxis_title="mission time [s]",
        yaxis_title=label,
    )


def _planned(plan: _core.Plan, index: int) -> Array:
    trajectory = _core.Trajectory.from_list(plan["drones"][index]["trajectory"])
    return trajectory.sample(mission_times(plan))


def _flown(flight: Flight, drone: str) -> Array:
    log = flight.drones[drone]
    return log.truth if len(log.truth) else log.state


def _path(points: Array, name: str, color: str, dash: str) -> go.Scatter3d:
    x, y, z = points.T
    width = 5 if dash == "solid" else 3
    return go.Scatter3d(
        x=x, y=y, z=z, mode="lines", name=name, line={"color": color, "width": width, "dash": dash}
    )


def _mesh(region: Any, kind: str) -> go.Mesh3d:
    corners = vertices(region)
    i, j, k = hull_triangles(corners).T
    x, y, z = corners.T
    color = {"obstacle": palette.OBSTACLE, "target": palette.TARGET, "home": palette.HOME}[kind]
    return go.Mesh3d(
        x=x, y=y, z=z, i=i, j=j, k=k, color=color, opacity=0.85 if kind == "obstacle" else 0.2,
        flatshading=True, name=region["name"], hoverinfo="name", showlegend=False,
    )  # fmt: skip
