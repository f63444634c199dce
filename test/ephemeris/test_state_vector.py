"""Derivatives of a motion against complex arithmetic, polynomials and finite differences."""

import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.ephemeris.look_angles import moved_across
from rf_pointing.ephemeris.state_vector import (
    OFFSETS,
    StateVector,
    Vector,
    motion_from_positions,
    seen_from_rotating_axes,
    turned_about_z,
)


def test_derivatives_in_rotating_axes_are_those_of_a_complex_number() -> None:
    """z = x + i y of turning axes is exp(-i w t) Z: its n-th derivative at t = 0 is (D - i w)^n Z."""
    drawn, rate = random_stream(11, "inertial motion").standard_normal((4, 3)), 0.7
    turned = seen_from_rotating_axes(StateVector(*(tuple(part) for part in drawn.tolist())), rate)
    inertial = drawn[:, 0] + 1j * drawn[:, 1]
    for order, seen in enumerate(turned.derivatives()):
        wanted = sum(math.comb(order, k) * (-1j * rate) ** (order - k) * inertial[k] for k in range(order + 1))
        np.testing.assert_allclose(complex(seen[0], seen[1]), wanted, rtol=1e-13)
        assert seen[2] == drawn[order, 2]


def test_a_target_moved_across_moves_as_its_positions_do() -> None:
    """Position by the definition, r cos d + (v x r) / |v x r| |r| sin d; the rest by differences of it."""
    powers = random_stream(12, "cubic motion").uniform(-1.0, 1.0, (4, 3))
    powers[0] = 3.0, 1.0, 2.0
    offset_rad = 0.4

    def motion(t_s: float) -> StateVector:
        def derivative(order: int) -> Vector:
            x, y, z = (np.polynomial.Polynomial(column).deriv(order)(t_s) for column in powers.T)
            return float(x), float(y), float(z)

        return StateVector(*(derivative(order) for order in range(4)))

    def position(t_s: float) -> np.ndarray:
        r, v = (np.array(part) for part in motion(t_s).derivatives()[:2])
        across = np.cross(v, r)
        return r * math.cos(offset_rad) + across / np.linalg.norm(across) * np.linalg.norm(r) * math.sin(offset_rad)

    moved = moved_across(motion(0.1), offset_rad)
    np.testing.assert_allclose(moved.position, position(0.1), rtol=1e-12)
    step = 2e-3
    at = [position(0.1 + k * step) for k in (-2, -1, 0, 1, 2)]
    velocity = (at[0] - 8.0 * at[1] + 8.0 * at[3] - at[4]) / (12.0 * step)
    acceleration = (-at[0] + 16.0 * at[1] - 30.0 * at[2] + 16.0 * at[3] - at[4]) / (12.0 * step**2)
    np.testing.assert_allclose(moved.velocity, velocity, atol=1e-6)
    np.testing.assert_allclose(moved.acceleration, acceleration, atol=1e-6)


def drawn_motion(name: str) -> tuple[np.ndarray, StateVector]:
    parts = random_stream(13, name).standard_normal((4, 3))
    return parts, StateVector(*(tuple(part) for part in parts.tolist()))


@pytest.mark.parametrize("angle", [0.7, np.array(0.7)])
def test_the_earths_angle_turns_and_its_pole_tilts_all_derivatives_alike(angle: Any) -> None:
    """R3(angle), then R1(-y) R2(-x) to first order in the pole, as matrices."""
    parts, motion = drawn_motion("turned")
    turn = np.array([[math.cos(0.7), math.sin(0.7), 0.0], [-math.sin(0.7), math.cos(0.7), 0.0], [0.0, 0.0, 1.0]])
    x, y = 2e-6, -3e-6
    tilt = np.array([[1.0, 0.0, x], [0.0, 1.0, -y], [-x, y, 1.0]])
    found = turned_about_z(motion, angle, x, y)
    for part, value in zip(parts, found.derivatives(), strict=True):
        np.testing.assert_allclose(np.array(value, dtype=float), tilt @ turn @ part, rtol=1e-12)


def test_five_positions_give_a_quartic_exactly_and_its_jerk_too() -> None:
    """Also the jerk: its error is of the fifth derivative, which a quartic does not have."""
    powers = random_stream(13, "quartic").standard_normal((5, 3))
    curve = [np.polynomial.Polynomial(column) for column in powers.T]
    step_s, now = 0.3, 0.2
    positions = [tuple(float(one(now + k * step_s)) for one in curve) for k in OFFSETS]
    found = motion_from_positions(positions, step_s, 1e3)
    for order, value in enumerate(found.derivatives()):
        wanted = [1e3 * one.deriv(order)(now) if order else 1e3 * one(now) for one in curve]
        np.testing.assert_allclose(value, wanted, rtol=1e-9)
