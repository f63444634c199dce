"""The published 1-deg search: its floor, and the shortcut that gives nearly always the same nodes."""

import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.circular_array import CircularArrayParams
from rf_pointing.array_sensors.arrays.cramer_rao import polar_sigma_rad, search_grid_rmse
from rf_pointing.array_sensors.arrays.music import estimate_directions
from rf_pointing.array_sensors.arrays.polar_direction import direction_from_polar, polar_errors_rad
from rf_pointing.array_sensors.arrays.search_grid import grid_search, nearest_node
from rf_pointing.array_sensors.arrays.snapshots import draw_covariances

ARRAY = CircularArrayParams()
STEP_RAD = np.radians(1.0)


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(8)


def uniform_truth(stream: np.random.Generator, count: int) -> np.ndarray:
    return direction_from_polar(np.radians(stream.uniform(25, 55, count)), stream.uniform(0, 2 * np.pi, count))


@pytest.mark.parametrize(("snr_db", "snapshots"), [(0.0, 100), (14.0, 100), (-6.0, 100)])
def test_nearest_node_is_what_the_full_search_returns(
    snr_db: float, snapshots: int, stream: np.random.Generator
) -> None:
    truth = uniform_truth(stream, 400)
    covariance = draw_covariances(ARRAY, truth, 10 ** (snr_db / 10), snapshots, stream)
    full = grid_search(ARRAY, covariance, STEP_RAD)
    refined = estimate_directions(ARRAY, covariance).direction
    nearest = nearest_node(refined, STEP_RAD)
    assert np.mean(np.linalg.norm(full - nearest, axis=1) < 1e-9) > 0.97
    assert np.max(np.linalg.norm(full - nearest, axis=1)) < 1.5 * STEP_RAD


@pytest.mark.parametrize(("snr_db", "snapshots"), [(-10.0, 1000), (0.0, 100), (14.0, 100)])
def test_grid_rmse_is_bound_plus_floor_within_4_percent(
    snr_db: float, snapshots: int, stream: np.random.Generator
) -> None:
    count, theta = 6000, np.radians(40.0)
    snr = 10 ** (snr_db / 10)
    angles = theta + STEP_RAD * stream.uniform(-0.5, 0.5, count)
    truth = direction_from_polar(angles, stream.uniform(0, 2 * np.pi, count))
    covariance = draw_covariances(ARRAY, truth, snr, snapshots, stream, waveform="constant_modulus")
    refined = estimate_directions(ARRAY, covariance).direction
    found = nearest_node(refined, STEP_RAD)
    errors = polar_errors_rad(found, truth)
    for error, sigma in zip(errors[:2], polar_sigma_rad(ARRAY, theta, snapshots, snr), strict=True):
        assert np.sqrt(np.mean(error**2)) == pytest.approx(float(search_grid_rmse(sigma, STEP_RAD)), rel=0.04)


def test_step_outside_its_range_is_refused() -> None:
    with pytest.raises(ValueError, match=r"step_rad=0.0 must be >= 0.0001"):
        grid_search(ARRAY, np.eye(12, dtype=complex)[None], 0.0)
