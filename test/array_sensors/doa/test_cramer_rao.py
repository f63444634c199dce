"""Cramer-Rao bounds: printed closed form, the general bound against it, and against a numeric Fisher matrix."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering
from rf_pointing.array_sensors.doa.cramer_rao import (
    cosine_sigma_rad,
    direction_bound_rad2,
    effective_snr,
    polar_sigma_rad,
    search_grid_rmse,
)
from rf_pointing.papers.doa_study.directions import direction_from_polar

ARRAY = CircularArrayParams()


def test_closed_form_at_zero_decibel_and_100_snapshots() -> None:
    theta, phi = polar_sigma_rad(ARRAY, np.radians(40.0), 100, 1.0)
    expected = np.sqrt((1 + 1 / 12) / (100 * 12 * (2 * np.pi) ** 2))
    assert float(theta) == pytest.approx(expected / np.cos(np.radians(40.0)))
    assert float(phi) == pytest.approx(expected / np.sin(np.radians(40.0)))
    assert np.degrees(expected) == pytest.approx(0.274, abs=5e-4)


@pytest.mark.parametrize(
    ("elements", "theta", "phi", "snr"),
    [(12, 0.3, 0.1, 0.05), (5, 0.9, 2.0, 3.0), (9, 1.2, 4.4, 40), (12, 0.6, 0.4, 1e-8), (12, 0.6, 0.4, 1e8)],
)
def test_general_bound_is_the_closed_form_for_one_source(elements: int, theta: float, phi: float, snr: float) -> None:
    array = CircularArrayParams(elements=elements)
    bound = direction_bound_rad2(array, direction_from_polar(theta, phi)[None], np.array([[snr + 0j]]), 37)
    sigma = cosine_sigma_rad(array, 37, snr)
    assert bound == pytest.approx(sigma**2 * np.eye(2), rel=1e-6, abs=1e-6 * sigma**2)


def test_general_bound_is_the_inverse_of_the_numeric_fisher_information() -> None:
    """Slepian-Bangs over directions, source covariance and noise of two correlated sources behind a real array."""
    stream = np.random.default_rng(5)
    array = CircularArrayParams(elements=7)
    response = np.eye(7) + 0.1 * (stream.standard_normal((7, 7)) + 1j * stream.standard_normal((7, 7)))
    cosines = np.array([0.2, -0.3, 0.35, 0.4])
    source = np.array([[2.0, 0.5 + 0.3j], [0.5 - 0.3j, 1.2]])

    def model(p: np.ndarray) -> np.ndarray:
        u, v = p[:2], p[2:4]
        s = np.stack([u, v, np.sqrt(1 - u * u - v * v)], axis=-1)
        a = response @ steering(array, s).T
        covariance = np.array([[p[4], p[6] + 1j * p[7]], [p[6] - 1j * p[7], p[5]]])
        return a @ covariance @ a.conj().T + p[8] * np.eye(7)

    p = np.array([*cosines, 2.0, 1.2, 0.5, 0.3, 1.0])
    inverse = np.linalg.inv(model(p))
    h = 1e-6
    slopes = [(model(p + h * e) - model(p - h * e)) / (2 * h) for e in np.eye(9)]
    fisher = 50 * np.array([[np.trace(inverse @ a @ inverse @ b).real for b in slopes] for a in slopes])
    directions = np.stack([cosines[:2], cosines[2:], np.sqrt(1 - cosines[:2] ** 2 - cosines[2:] ** 2)], axis=-1)
    bound = direction_bound_rad2(array, directions, source, 50, response)
    assert bound == pytest.approx(np.linalg.inv(fisher)[:4, :4], rel=1e-4, abs=1e-9)


def test_effective_ratio_is_the_bound_in_phase_at_the_rim() -> None:
    assert effective_snr(ARRAY, 100, 0.1) == pytest.approx(100 * 1.2**2 / 2.2)


def test_a_source_140_db_below_another_is_not_taken_for_the_same() -> None:
    two = np.stack([direction_from_polar(0.5, 0.2), direction_from_polar(0.9, 2.0)])
    both = direction_bound_rad2(ARRAY, two, np.diag([1e10 + 0j, 1e-4]), 100)
    alone = direction_bound_rad2(ARRAY, two[1:], np.diag([1e-4 + 0j]), 100)
    assert both[1, 1] == pytest.approx(alone[0, 0], rel=0.5)


def test_two_sources_in_one_direction_are_refused() -> None:
    same = np.stack([direction_from_polar(0.5, 0.2)] * 2)
    with pytest.raises(ValueError, match="cannot be separated"):
        direction_bound_rad2(ARRAY, same, np.diag([1.0 + 0j, 1.0]), 100)


def test_sources_that_say_nothing_of_their_directions_are_refused() -> None:
    """One without power, and three that send the same: five elements see one sum of them."""
    three = np.stack([direction_from_polar(0.3 + 0.2 * k, 1.3 * k) for k in range(3)])
    for source in (np.diag([1.0 + 0j, 0.0, 1.0]), np.ones((3, 3), dtype=complex)):
        with pytest.raises(ValueError, match="the information matrix is singular"):
            direction_bound_rad2(CircularArrayParams(elements=5), three, source, 50)


@pytest.mark.parametrize(("snapshots", "snr"), [(0, 1.0), (10, 0.0), (10, np.nan)])
def test_bound_without_snapshots_or_signal_is_refused(snapshots: int, snr: float) -> None:
    with pytest.raises(ValueError, match=r"snapshots=|snr="):
        cosine_sigma_rad(ARRAY, snapshots, snr)


def test_bounds_in_polar_angles_stretch_towards_the_horizon_and_the_normal() -> None:
    sigma = cosine_sigma_rad(ARRAY, 50, 2.0)
    theta, phi = polar_sigma_rad(ARRAY, [0.0, 0.5, -0.5], 50, 2.0)
    np.testing.assert_allclose(theta, sigma / np.cos([0.0, 0.5, 0.5]))
    np.testing.assert_allclose(phi, [np.inf, sigma / np.sin(0.5), sigma / np.sin(0.5)])
    np.testing.assert_allclose(search_grid_rmse([3.0, 0.0], np.sqrt(12.0) * 4.0), [5.0, 4.0])
