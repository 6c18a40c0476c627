"""The power model of the core as Python sees it, against momentum theory solved by scipy."""

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.optimize import brentq

from fleet import _core
from tests.unit.test_core_trajectory import random_knots

MASS, GRAVITY, DENSITY = 1.7, 9.80665, 1.225
AREA = np.pi * 0.11**2


def test_level_flight_is_momentum_theory_with_drag() -> None:
    """Thrust leans against drag; Glauert's equation and the reaction torque give the shaft's power."""
    for speed in (0.0, 0.7, 3.0, 12.0):
        lean, thrust = 0.0, MASS * GRAVITY / 4
        for _ in range(50):
            rate = np.sqrt(thrust / (1.2216e-7 * (30 / np.pi) ** 2))
            frame = 0.3 * np.pi * 0.225**2 * speed**2
            across = speed * np.cos(lean)
            rotor = 4 * 8.06428e-5 * rate * across
            # Along the flight thrust sin = frame + rotor cos, upwards thrust cos = weight - rotor sin.
            ahead, up = frame + rotor * np.cos(lean), MASS * GRAVITY - rotor * np.sin(lean)
            lean, thrust = np.arctan2(ahead, up), np.hypot(ahead, up) / 4
        axial, across = speed * np.sin(lean), speed * np.cos(lean)
        rate = np.sqrt(thrust / (1.2216e-7 * (30 / np.pi) ** 2))
        square = thrust / (2 * DENSITY * AREA)
        induced = brentq(lambda v, s=square, x=axial, y=across: v * np.hypot(y, x + v) - s, 0, 50)
        profile = 0.07 * 3 * 0.11 * thrust * rate - 1.15 * thrust * np.sqrt(square)
        shaft = thrust * (axial + 1.15 * induced) + profile * (1 + (across / (rate * 0.11)) ** 2)
        found = _core.flight_power(np.array([[speed, 0.0, 0.0]]), np.zeros((1, 3)))[0]
        assert found == pytest.approx(4 * shaft / 0.72, rel=1e-9), speed
    assert _core.hover_power() == pytest.approx(_core.flight_power(np.zeros((1, 3)), np.zeros((1, 3)))[0])


def test_energy_is_the_integral_of_power() -> None:
    knots = random_knots(8, 3)
    knots[:, 1:10] *= 0.3
    knots[1:, 0] = np.cumsum(np.full(7, 2.0))
    track = _core.Trajectory(knots)
    times = np.linspace(track.start, track.end, 20_001)
    states = track.sample(times)
    power = _core.flight_power(states[:, 3:6].copy(), states[:, 6:9].copy())
    total, hover = track.energy()
    assert total == pytest.approx(float(simpson(power, x=times)), rel=1e-5)
    assert hover == pytest.approx(_core.hover_power() * (track.end - track.start))


def test_power_refuses_what_it_cannot_use() -> None:
    good = np.zeros((2, 3))
    for v, a in ((np.zeros((2, 2)), good), (good, np.zeros((3, 3))), (good, np.full((2, 3), np.nan))):
        with pytest.raises(ValueError, match=r"columns|as many|finite"):
            _core.flight_power(v, a)
