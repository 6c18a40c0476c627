"""Samples of a plan or a log as CSV, so that others can judge us."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fleet import _core
from fleet.files import replacing
from fleet.log.flight import Array, Flight

COLUMNS = ["t", "drone", "source", "px", "py", "pz", "vx", "vy", "vz", "ax", "ay", "az"]


def plan_rows(plan: _core.Plan, hz: float) -> Iterator[list[str]]:
    """Rows of every drone's planned trajectory at `hz` over [0, T]."""
    times = np.arange(round(plan["horizon"] * hz) + 1) / hz
    for drone in plan["drones"]:
        samples = _core.Trajectory.from_list(drone["trajectory"]).sample(times)
        yield from _rows(drone["id"], "plan", times, samples[:, :9])


def flight_rows(flight: Flight, hz: float) -> Iterator[list[str]]:
    """Rows of plan, estimate and truth at `hz`, each as far as the log has it.

    Accelerations of estimate and truth are central differences of the logged velocity.
    """
    yield from plan_rows(flight.plan, hz)
    for drone, log in flight.drones.items():
        for source, track in (("est", log.state), ("truth", log.truth)):
            if len(track) < 2:
                continue
            first, last = np.ceil(track[0, 0] * hz), np.floor(track[-1, 0] * hz)
            times = np.arange(first, last + 1) / hz
            yield from _rows(drone, source, times, _resample(track, times))


def write(path: Path, rows: Iterator[list[str]]) -> int:
    """Write rows under the header; returns how many.

    Raises:
        InputError: when the file cannot be written.
    """
    count = 0
    with replacing(path) as temporary, temporary.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        for row in rows:
            writer.writerow(row)
            count += 1
    return count


def _resample(track: Array, times: Array) -> Array:
    acceleration = np.gradient(track[:, 4:7], track[:, 0], axis=0)
    columns = np.column_stack([track[:, 1:7], acceleration])
    return np.column_stack([np.interp(times, track[:, 0], columns[:, k]) for k in range(9)])


def _rows(drone: str, source: str, times: Array, values: Array) -> Iterator[list[str]]:
    for t, row in zip(times.tolist(), values.tolist(), strict=True):
        yield [f"{t:.6f}", drone, source, *(f"{x:.6f}" for x in row)]
