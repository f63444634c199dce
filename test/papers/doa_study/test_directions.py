"""Polar angles: inverse pair, the definition of azimuth near the normal, and its error law.

The published 1-deg search: its floor, and the shortcut that gives nearly always the same nodes.

The shortcut: errors from a pool have the law of MUSIC at that direction, outliers and grid included.
"""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering
from rf_pointing.array_sensors.doa.cramer_rao import polar_sigma_rad, search_grid_rmse
from rf_pointing.array_sensors.doa.music import estimate_directions
from rf_pointing.array_sensors.doa.snapshots import draw_covariances
from rf_pointing.papers.doa_study.directions import (
    DirectionCase,
    direction_from_polar,
    draw_directions,
    error_pool,
    grid_search,
    measure_directions,
    nearest_node,
    polar_basis,
    polar_errors_rad,
    polar_from_direction,
)

ARRAY = CircularArrayParams()
STEP_RAD = np.radians(1.0)


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


@pytest.fixture
def grid_stream() -> np.random.Generator:
    return np.random.default_rng(8)


def uniform_truth(grid_stream: np.random.Generator, count: int) -> np.ndarray:
    return direction_from_polar(
        np.radians(grid_stream.uniform(25, 55, count)), grid_stream.uniform(0, 2 * np.pi, count)
    )


@pytest.mark.parametrize(("snr_db", "snapshots"), [(0.0, 100), (14.0, 100), (-6.0, 100)])
def test_nearest_node_is_what_the_full_search_returns(
    snr_db: float, snapshots: int, grid_stream: np.random.Generator
) -> None:
    truth = uniform_truth(grid_stream, 400)
    covariance = draw_covariances(ARRAY, truth, 10 ** (snr_db / 10), snapshots, grid_stream)
    full = grid_search(ARRAY, covariance, STEP_RAD)
    refined = estimate_directions(ARRAY, covariance).direction
    nearest = nearest_node(refined, STEP_RAD)
    assert np.mean(np.linalg.norm(full - nearest, axis=1) < 1e-9) > 0.97
    assert np.max(np.linalg.norm(full - nearest, axis=1)) < 1.5 * STEP_RAD


@pytest.mark.parametrize(("snr_db", "snapshots"), [(-10.0, 1000), (0.0, 100), (14.0, 100)])
def test_grid_rmse_is_bound_plus_floor_within_4_percent(
    snr_db: float, snapshots: int, grid_stream: np.random.Generator
) -> None:
    count, theta = 6000, np.radians(40.0)
    snr = 10 ** (snr_db / 10)
    angles = theta + STEP_RAD * grid_stream.uniform(-0.5, 0.5, count)
    truth = direction_from_polar(angles, grid_stream.uniform(0, 2 * np.pi, count))
    covariance = draw_covariances(ARRAY, truth, snr, snapshots, grid_stream, waveform="constant_modulus")
    refined = estimate_directions(ARRAY, covariance).direction
    found = nearest_node(refined, STEP_RAD)
    errors = polar_errors_rad(found, truth)
    for error, sigma in zip(errors[:2], polar_sigma_rad(ARRAY, theta, snapshots, snr), strict=True):
        assert np.sqrt(np.mean(error**2)) == pytest.approx(float(search_grid_rmse(sigma, STEP_RAD)), rel=0.04)


@pytest.fixture
def errors_stream() -> np.random.Generator:
    return np.random.default_rng(200)


@pytest.mark.parametrize(("snr_db", "theta_deg"), [(0.0, 50.0), (0.0, 15.0), (-13.0, 40.0)])
def test_drawn_errors_have_the_law_of_music_at_that_direction(
    snr_db: float, theta_deg: float, errors_stream: np.random.Generator
) -> None:
    case = DirectionCase(snapshots=100, snr_db=snr_db)
    spread = direction_from_polar(
        np.radians(errors_stream.uniform(5, 61, 8000)), errors_stream.uniform(0, 2 * np.pi, 8000)
    )
    pool = error_pool(ARRAY, case, spread, errors_stream)
    truth = np.tile(direction_from_polar(np.radians(theta_deg), 2.2), (6000, 1))
    drawn = draw_directions(pool, truth[:1], 6000, errors_stream)[0]
    real = measure_directions(ARRAY, case, truth, errors_stream)
    for first, second in zip(polar_errors_rad(drawn, truth), polar_errors_rad(real, truth), strict=True):
        assert np.sqrt(np.mean(first**2)) == pytest.approx(np.sqrt(np.mean(second**2)), rel=0.12)
        assert np.median(np.abs(first)) == pytest.approx(np.median(np.abs(second)), rel=0.12)


def strong(theta_rad: float, phi_rad: float) -> np.ndarray:
    received = steering(ARRAY, direction_from_polar(theta_rad, phi_rad)[None])[0]
    return (np.outer(received, received.conj()) + 1e-3 * np.eye(ARRAY.elements))[None]


@pytest.mark.parametrize(
    ("theta_steps", "limit_steps", "found_steps"), [(10, 10.0, 10), (11, 10.4, 10), (11, 10.6, 11), (30, None, 30)]
)
def test_the_search_reaches_to_the_node_nearest_to_its_limit(
    theta_steps: int, limit_steps: float | None, found_steps: int
) -> None:
    limits = () if limit_steps is None else (limit_steps * 0.05,)
    found = grid_search(ARRAY, strong(theta_steps * 0.05, 0.25), 0.05, *limits)
    theta, phi = polar_from_direction(found[0])
    assert float(theta) == pytest.approx(found_steps * 0.05)
    assert float(phi) == pytest.approx(0.25, abs=0.051)


def test_no_node_lies_beyond_a_turn() -> None:
    """126 nodes of 0.05 rad: the next one would lie 0.0168 rad beyond the first."""
    found = grid_search(ARRAY, strong(0.5, 126 * 0.05 - 2.0 * np.pi), 0.05)
    assert float(polar_from_direction(found[0])[1]) == pytest.approx(0.0, abs=1e-9)


def test_many_covariances_are_searched_in_parts() -> None:
    thetas = 0.1 * (1 + np.arange(300) % 7)
    found = grid_search(ARRAY, np.concatenate([strong(theta, 0.3) for theta in thetas]), 0.1)
    assert polar_from_direction(found)[0] == pytest.approx(thetas)


@pytest.mark.parametrize(
    ("step_rad", "limit_rad", "name"),
    [(0.9e-4, 1e-3, "step_rad"), (0.51, 1.0, "step_rad"), (0.1, 0.09, "theta_max_rad"), (0.1, 1.6, "theta_max_rad")],
)
def test_steps_and_limits_outside_their_range_are_refused(step_rad: float, limit_rad: float, name: str) -> None:
    with pytest.raises(ValueError, match=f"{name}="):
        grid_search(ARRAY, strong(0.1, 0.2), step_rad, limit_rad)
    if name == "step_rad":
        with pytest.raises(ValueError, match="step_rad="):
            nearest_node(direction_from_polar(0.1, 0.2), step_rad)
