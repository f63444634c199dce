"""Polar angles: inverse pair, the definition of azimuth near the normal, and its error law."""

import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.polar_direction import (
    azimuth_rmse_rad,
    direction_from_polar,
    polar_basis,
    polar_errors_rad,
    polar_from_direction,
)


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(20140424)


def test_angles_come_back_from_the_unit_vector(stream: np.random.Generator) -> None:
    theta, phi = stream.uniform(1e-6, np.pi - 1e-6, 500), stream.uniform(0, 2 * np.pi, 500)
    theta_back, phi_back = polar_from_direction(direction_from_polar(theta, phi))
    assert theta_back == pytest.approx(theta, abs=1e-12)
    assert np.cos(phi_back - phi) == pytest.approx(1.0, abs=1e-12)


def test_azimuth_on_the_normal_is_zero_by_definition() -> None:
    theta, phi = polar_from_direction(np.array([0.0, 0.0, 1.0]))
    assert (float(theta), float(phi)) == (0.0, 0.0)


def test_polar_basis_is_a_rotation_with_the_direction_last(stream: np.random.Generator) -> None:
    direction = direction_from_polar(stream.uniform(0, np.pi, 200), stream.uniform(0, 2 * np.pi, 200))
    basis = polar_basis(np.concatenate([direction, [[0.0, 0.0, 1.0]]]))
    assert basis @ basis.swapaxes(-1, -2) == pytest.approx(np.broadcast_to(np.eye(3), basis.shape), abs=1e-12)
    assert np.linalg.det(basis) == pytest.approx(1.0)
    assert basis[:-1, 2] == pytest.approx(direction, abs=1e-12)


def test_azimuth_errors_wrap_and_cross_error_is_an_angle_on_the_sky() -> None:
    estimate, truth = direction_from_polar(0.5, 0.01), direction_from_polar(0.5, 2 * np.pi - 0.01)
    polar, azimuth, cross = polar_errors_rad(estimate, truth)
    assert float(polar) == pytest.approx(0.0, abs=1e-12)
    assert float(azimuth) == pytest.approx(0.02)
    assert float(cross) == pytest.approx(0.02 * np.sin(0.5))


@pytest.mark.parametrize("theta_over_sigma", [0.0, 0.5, 2.0, 6.0, 40.0])
def test_azimuth_rmse_is_that_of_a_displaced_gaussian(theta_over_sigma: float, stream: np.random.Generator) -> None:
    sigma = 0.003
    theta = np.arcsin(theta_over_sigma * sigma)
    points = sigma * stream.standard_normal((400_000, 2)) + [theta_over_sigma * sigma, 0.0]
    measured = np.sqrt(np.mean(np.arctan2(points[:, 1], points[:, 0]) ** 2))
    assert azimuth_rmse_rad(theta, sigma) == pytest.approx(measured, rel=0.01)


def test_azimuth_rmse_is_the_bound_far_out_and_104_degrees_on_the_normal() -> None:
    assert azimuth_rmse_rad(0.7, 1e-3) == pytest.approx(1e-3 / np.sin(0.7), rel=1e-4)
    assert np.degrees(azimuth_rmse_rad(0.0, 1e-3)) == pytest.approx(180 / np.sqrt(3), rel=1e-5)
