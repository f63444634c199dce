"""What light and angles make of a motion, against the light-time equation solved by iteration and differences of it."""

import math

import numpy as np
import pytest

from rf_pointing.ephemeris.look_angles import angles_and_rates, delayed
from rf_pointing.ephemeris.state_vector import StateVector

LIGHT_M_S = 299792458.0
# A light second away at a ten-thousandth of the speed of light: what is left out is 1e-8 of that.
TARGET = np.array([[1.8e8, -2.0e8, 1.3e8], [2.1e4, 1.7e4, -1.1e4], [9.0, -14.0, 6.0]])
ANTENNA = np.array([[3e6, -4e6, 2e6], [300.0, 350.0, 0.0], [-0.02, 0.025, 0.0]])
AT_REST = np.array([[3e6, -4e6, 2e6], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def place(motion: np.ndarray, t_s: float) -> np.ndarray:
    return motion[0] + motion[1] * t_s + 0.5 * motion[2] * t_s**2


def state(parts: np.ndarray, jerk: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> StateVector:
    position, velocity, acceleration = (tuple(part) for part in parts.tolist())
    return StateVector(position, velocity, acceleration, jerk)


def travel_s(antenna: np.ndarray, t_s: float, sense: float) -> float:
    """Return the light time between the target at its other end and the antenna at `t_s`."""
    tau_s = 0.0
    for _ in range(12):
        apart = place(TARGET, t_s - sense * tau_s) - place(antenna, t_s)
        tau_s = float(np.linalg.norm(apart)) / LIGHT_M_S
    return tau_s


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_motion_through_light_is_that_of_the_image(sense: float) -> None:
    """Position, velocity and acceleration of target(u) as functions of t, the antenna at rest."""
    seen, range_m, rate_m_s = delayed(state(TARGET - AT_REST), state(AT_REST), sense)

    def image(t_s: float) -> np.ndarray:
        return place(TARGET, t_s - sense * travel_s(AT_REST, t_s, sense)) - AT_REST[0]

    step_s = 20.0
    a, b, here, c, d = (image(k * step_s) for k in (-2, -1, 0, 1, 2))
    np.testing.assert_allclose(seen.position, here, rtol=0.0, atol=1e-2)
    np.testing.assert_allclose(seen.velocity, (a - 8.0 * b + 8.0 * c - d) / (12.0 * step_s), rtol=0.0, atol=1e-5)
    second = (-a + 16.0 * b - 30.0 * here + 16.0 * c - d) / (12.0 * step_s**2)
    np.testing.assert_allclose(seen.acceleration, second, rtol=0.0, atol=1e-6)
    assert range_m == pytest.approx(np.linalg.norm(here), abs=1e-2)
    lengths = [float(np.linalg.norm(part)) for part in (a, b, c, d)]
    slope_m_s = (lengths[0] - 8.0 * lengths[1] + 8.0 * lengths[2] - lengths[3]) / (12.0 * step_s)
    assert rate_m_s == pytest.approx(slope_m_s, abs=1e-4)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_range_is_the_way_of_the_light_to_an_antenna_that_moves(sense: float) -> None:
    """From the target at u to the antenna at t, while the direction is that of both at u."""
    seen, range_m, rate_m_s = delayed(state(TARGET - ANTENNA), state(ANTENNA), sense)
    tau_s = travel_s(ANTENNA, 0.0, sense)
    assert range_m == pytest.approx(LIGHT_M_S * tau_s, abs=1e-2)
    step_s = 20.0
    a, b, c, d = (travel_s(ANTENNA, k * step_s, sense) for k in (-2, -1, 1, 2))
    assert rate_m_s == pytest.approx(LIGHT_M_S * (a - 8.0 * b + 8.0 * c - d) / (12.0 * step_s), abs=1e-4)
    both = place(TARGET, -sense * tau_s) - place(ANTENNA, -sense * tau_s)
    np.testing.assert_allclose(seen.position, both, rtol=0.0, atol=1e-2)


def test_the_jerk_of_a_target_counts_in_its_velocity_and_acceleration() -> None:
    """A jerk of 0.03 m/s^3 for a second of light: 15 mm/s and 30 mm/s^2."""
    jerk = np.array([0.03, -0.02, 0.01])
    plain, *_ = delayed(state(TARGET - AT_REST), state(AT_REST), 1.0)
    with_jerk, *_ = delayed(state(TARGET - AT_REST, tuple(jerk.tolist())), state(AT_REST), 1.0)
    tau_s = travel_s(AT_REST, 0.0, 1.0)
    assert with_jerk.jerk == tuple(jerk.tolist())
    np.testing.assert_allclose(np.subtract(with_jerk.velocity, plain.velocity), 0.5 * tau_s**2 * jerk, rtol=1e-3)
    np.testing.assert_allclose(np.subtract(with_jerk.acceleration, plain.acceleration), -tau_s * jerk, rtol=1e-3)


def test_angles_and_their_derivatives_are_those_of_a_path_in_closed_form() -> None:
    """Azimuth and elevation as cubics in time, the range too; the components by their derivatives."""
    azimuth, elevation, distance = (
        np.polynomial.Polynomial(one)
        for one in ([4.0, 0.3, -0.2, 0.1], [0.7, -0.4, 0.15, 0.2], [2e3, 150.0, -90.0, 40.0])
    )

    def enu(t_s: float) -> np.ndarray:
        az, el, rho = azimuth(t_s), elevation(t_s), distance(t_s)
        return rho * np.array([math.cos(el) * math.sin(az), math.cos(el) * math.cos(az), math.sin(el)])

    # Differences of the sixth order of what is of order one a second.
    h = 0.02
    around = np.array([enu(k * h) for k in (-3, -2, -1, 0, 1, 2, 3)])
    velocity = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) @ around / (60.0 * h)
    acceleration = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) @ around / (180.0 * h**2)
    motion = state(np.array([around[3], velocity, acceleration]))
    found = angles_and_rates(motion)
    # Azimuth 4 rad is -2.28 rad.
    wanted = (4.0 - 2.0 * math.pi, 0.7, 0.3, -0.4, -0.4, 0.3)
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    arrays = StateVector(*(tuple(np.array([one]) for one in part) for part in motion.derivatives()))
    np.testing.assert_allclose(np.array(angles_and_rates(arrays))[:, 0], found, rtol=1e-12)
