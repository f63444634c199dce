"""The Earth's field, radiation and shadow, against potentials, limits and another propagator."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lpmv

from rf_pointing.core import EARTH_MU_M3_S2, EARTH_RADIUS_M, random_stream
from rf_pointing.orbit import forces
from rf_pointing.orbit.forces import AU_M, EARTH_RATE_RAD_S, Disturbances, lit_share, moon_m, sidereal_angle_rad, sun_m
from rf_pointing.orbit.geopotential import EGM96_RADIUS_M, attraction, coefficients
from rf_pointing.orbit.motion import point_mass, propagate_together
from rf_pointing.papers.satcal_motion import Gravity

EPOCH = 827385062.07


def potential(position: np.ndarray, degree: int) -> float:
    """The harmonics from degree 2 as Legendre functions of latitude and longitude."""
    radius = float(np.linalg.norm(position))
    latitude_sine, longitude = position[2] / radius, math.atan2(position[1], position[0])
    total = 0.0
    for n in range(2, degree + 1):
        for m in range(n + 1):
            # Without the phase (-1)^m that scipy has.
            legendre = (-1) ** m * lpmv(m, n, latitude_sine)
            wave = coefficients()[n, m] * np.exp(1j * m * longitude)
            total += (EGM96_RADIUS_M / radius) ** n * legendre * wave.real
    return EARTH_MU_M3_S2 / radius * total


def gradient(of: Callable[[np.ndarray], float], position: np.ndarray, step_m: float = 50.0) -> np.ndarray:
    sides = np.eye(3) * step_m
    return np.array([(of(position + side) - of(position - side)) / (2.0 * step_m) for side in sides])


def test_the_field_is_the_gradient_of_its_potential():
    places = 7.1e6 * random_stream(3, "places").standard_normal((5, 3)) + np.array([8e6, 0.0, 0.0])
    ours = attraction(places, (2, 12))[0]
    for place, found in zip(places, ours, strict=True):
        expected = gradient(lambda at: potential(at, 12), place)
        assert np.allclose(found, expected, rtol=0.0, atol=2e-7 * np.linalg.norm(expected))


def test_bands_add_up_and_the_zonal_part_is_that_of_the_closed_form():
    places = np.array([[7e6, 1e6, 2e6], [-3e6, 5e6, -4.5e6]])
    whole, low, high = attraction(places, (2, 12), (2, 7), (8, 12))
    assert np.allclose(whole, low + high, rtol=1e-12)
    zonal = Gravity().acceleration(places) - point_mass(places)
    # Longitudes average the tesseral terms out.
    turns = np.arange(24) * 2.0 * math.pi / 24
    ring = np.concatenate([forces.turned_about_pole(places, turn) for turn in turns])
    back = [
        forces.turned_about_pole(part, -turn)
        for part, turn in zip(np.split(attraction(ring, (2, 4))[0], 24), turns, strict=True)
    ]
    assert np.allclose(np.mean(back, axis=0), zonal, rtol=3e-5)


def test_the_orbit_of_another_propagator():
    """Earth-fixed Cartesian axes, potential by Legendre functions, forces written out: 0.5 m after four revolutions."""
    ours = Disturbances(
        degree=6, ballistic_m2_kg=0.02, radiation_m2_kg=0.03, panel_m_s2=1e-9, sun=True, moon=True,
        **Disturbances.air_at(5.2e5),
    )  # fmt: skip
    start = np.array([6.9e6, 1e5, 2e5, -300.0, 1000.0, 7500.0])
    end_s = 4.0 * 5700.0
    (found,) = propagate_together(start[np.newaxis], [end_s], point_mass, epoch_t_s=EPOCH, disturbances=ours)[0]

    spin = np.array([0.0, 0.0, EARTH_RATE_RAD_S])

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        place, speed = y[:3], y[3:]
        angle = float(sidereal_angle_rad(EPOCH)) + EARTH_RATE_RAD_S * t
        fixed = lambda vector: forces.turned_about_pole(vector, -angle)  # noqa: E731
        pull = -EARTH_MU_M3_S2 * place / np.linalg.norm(place) ** 3
        pull = pull + gradient(lambda at: potential(at, 6), place)
        for body, strength in ((fixed(sun_m(EPOCH + t)), 1.3271244e20), (fixed(moon_m(EPOCH + t)), 4.9028e12)):
            away = body - place
            pull += strength * (away / np.linalg.norm(away) ** 3 - body / np.linalg.norm(body) ** 3)
        height = np.linalg.norm(place) - EARTH_RADIUS_M
        pull -= 0.5 * 6.967e-13 * math.exp(-(height - 5e5) / 63822.0) * 0.02 * np.linalg.norm(speed) * speed
        sun = fixed(sun_m(EPOCH + t))
        toward = (sun - place) / np.linalg.norm(sun - place)
        behind = place @ sun < 0.0 and np.linalg.norm(np.cross(place, sun)) / np.linalg.norm(sun) < EARTH_RADIUS_M
        pull += (1e-9 - (0.0 if behind else 4.56e-6 * 0.03 * (AU_M / np.linalg.norm(sun - place)) ** 2)) * toward
        return np.concatenate([speed, pull - 2.0 * np.cross(spin, speed) - np.cross(spin, np.cross(spin, place))])

    angle = float(sidereal_angle_rad(EPOCH))
    begin = np.concatenate([forces.turned_about_pole(start[:3], -angle), forces.turned_about_pole(start[3:], -angle)])
    begin[3:] -= np.cross(spin, begin[:3])
    other = solve_ivp(slope, (0.0, end_s), begin, method="DOP853", rtol=1e-12, atol=1e-6).y[:3, -1]
    assert np.linalg.norm(forces.turned_about_pole(found[:3], -sidereal_angle_rad(EPOCH + end_s)) - other) < 0.5


def test_the_shadow_begins_where_the_discs_touch():
    sun, height_m = np.array([AU_M, 0.0, 0.0]), 7e6
    across = np.linspace(0.9, 1.1, 4001) * EARTH_RADIUS_M
    behind = np.stack([np.full_like(across, -height_m), across, np.zeros_like(across)], axis=1)
    share = lit_share(behind, sun)
    penumbra_m = 2.0 * height_m * forces.SUN_RADIUS_M / AU_M
    partial = across[(share > 0.0) & (share < 1.0)]
    assert partial[-1] - partial[0] == pytest.approx(penumbra_m, rel=0.02)
    assert np.all(np.diff(share) >= -1e-12)
    assert share[0] == 0.0
    assert share[-1] == 1.0
    assert lit_share(-behind, sun) == pytest.approx(1.0)
    on_the_line = np.outer([1.0, -1.0], 7e6 * np.array([0.6, 0.64, 0.48]))
    assert lit_share(on_the_line, AU_M * np.array([0.6, 0.64, 0.48])).tolist() == [1.0, 0.0]
    assert float(np.interp(0.5, share, across)) == pytest.approx(EARTH_RADIUS_M, rel=1e-3)
