"""The low pass against the triangle of Earth's centre, station and satellite, and its rates against differences."""

import math

import numpy as np
import pytest

from rf_pointing.papers.servo_trajectory import LowOrbitPass

EARTH_M, MU_M3_S2 = 6.371e6, 3.986004418e14
TIMES_S = np.array([-420.0, -200.0, -31.0, -4.0, 0.0, 7.0, 90.0, 333.0])
ORBITS = [
    LowOrbitPass(),
    LowOrbitPass(altitude_m=520e3, culmination_rad=0.7, heading_rad=0.4),
    LowOrbitPass(altitude_m=2e6, culmination_rad=1.45, heading_rad=2.9),
]


@pytest.mark.parametrize("orbit", ORBITS, ids=str)
def test_angles_are_those_of_a_circular_orbit_over_a_round_earth(orbit: LowOrbitPass) -> None:
    radius = EARTH_M + orbit.altitude_m
    turned = math.sqrt(MU_M3_S2 / radius**3) * TIMES_S
    # Angle at the centre between station and track, from the law of sines.
    offset = 0.5 * math.pi - orbit.culmination_rad - math.asin(EARTH_M / radius * math.cos(orbit.culmination_rad))
    away = np.arccos(math.cos(offset) * np.cos(turned))
    elevation = np.arctan2(np.cos(away) - EARTH_M / radius, np.sin(away))
    azimuth = orbit.heading_rad + np.arctan2(math.sin(offset) * np.cos(turned), np.sin(turned))
    found = orbit.at(TIMES_S)
    np.testing.assert_array_equal(found.t_s, TIMES_S)
    np.testing.assert_allclose(found.position_rad, np.column_stack([azimuth, elevation]), rtol=1e-9)


@pytest.mark.parametrize("orbit", ORBITS, ids=str)
def test_rates_and_accelerations_are_derivatives_of_the_angles(orbit: LowOrbitPass) -> None:
    step = 0.05
    tables = {k: orbit.at(TIMES_S + k * step) for k in (-2, -1, 1, 2)}
    here = orbit.at(TIMES_S)

    def derivative(name: str) -> np.ndarray:
        values = {k: getattr(table, name) for k, table in tables.items()}
        return (8.0 * (values[1] - values[-1]) - values[2] + values[-2]) / (12.0 * step)

    np.testing.assert_allclose(here.velocity_rad_s, derivative("position_rad"), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(here.acceleration_rad_s2, derivative("velocity_rad_s"), rtol=1e-6, atol=1e-12)
