"""MUSIC for one source: exact without noise, at the Cramer-Rao bound with it, threshold where the page says."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa import music
from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering
from rf_pointing.array_sensors.doa.cramer_rao import polar_sigma_rad
from rf_pointing.array_sensors.doa.music import estimate_directions, lattice, refine_peaks
from rf_pointing.array_sensors.doa.snapshots import complex_normal, draw_covariances
from rf_pointing.papers.doa_study.directions import direction_from_polar, polar_errors_rad

ARRAY = CircularArrayParams()
EXACT_RAD = 1e-9


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(62)


def directions(stream: np.random.Generator, count: int, theta_max: float) -> np.ndarray:
    return direction_from_polar(stream.uniform(0.0, theta_max, count), stream.uniform(0.0, 2 * np.pi, count))


@pytest.mark.parametrize("elements", [7, 12, 15])
def test_noise_free_direction_is_found_to_a_billionth_of_a_radian(elements: int, stream: np.random.Generator) -> None:
    array = CircularArrayParams(elements=elements, radius_m=0.10)
    truth = np.concatenate([directions(stream, 300, 1.5), [[0.0, 0.0, 1.0]]])
    a = steering(array, truth)
    covariance = a[:, :, None] * a[:, None, :].conj() + 0.1 * np.eye(elements)
    peaks = estimate_directions(array, covariance)
    assert np.linalg.norm(peaks.direction - truth, axis=1).max() < EXACT_RAD
    assert peaks.converged.all()
    assert peaks.fraction == pytest.approx(1.0)


def test_source_in_the_array_plane_is_found_at_the_horizon() -> None:
    truth = direction_from_polar(np.pi / 2, np.linspace(0.0, 6.0, 7))
    a = steering(ARRAY, truth)
    peaks = estimate_directions(ARRAY, a[:, :, None] * a[:, None, :].conj())
    assert np.linalg.norm(peaks.direction[:, :2] - truth[:, :2], axis=1).max() < 1e-6


@pytest.mark.parametrize(
    ("snapshots", "snr_db", "theta_deg"),
    [(100, 0.0, 20.0), (100, 14.0, 60.0), (1000, -10.0, 40.0), (10, 3.0, 40.0), (1, 15.0, 40.0)],
)
def test_rmse_follows_the_bound_within_5_percent_above_threshold(
    snapshots: int, snr_db: float, theta_deg: float, stream: np.random.Generator
) -> None:
    count = 6000
    snr = 10 ** (snr_db / 10)
    truth = direction_from_polar(np.full(count, np.radians(theta_deg)), stream.uniform(0, 2 * np.pi, count))
    covariance = draw_covariances(ARRAY, truth, snr, snapshots, stream, waveform="constant_modulus")
    theta, phi, _ = polar_errors_rad(estimate_directions(ARRAY, covariance).direction, truth)
    theta_bound, phi_bound = polar_sigma_rad(ARRAY, np.radians(theta_deg), snapshots, snr)
    assert np.sqrt(np.mean(theta**2)) == pytest.approx(float(theta_bound), rel=0.05)
    assert np.sqrt(np.mean(phi**2)) == pytest.approx(float(phi_bound), rel=0.05)


@pytest.mark.parametrize(("snr_db", "low", "high"), [(-10.0, 0.0, 0.001), (-12.0, 0.006, 0.016), (-14.0, 0.14, 0.19)])
def test_outliers_appear_below_the_threshold(
    snr_db: float, low: float, high: float, stream: np.random.Generator
) -> None:
    truth = direction_from_polar(np.full(8000, np.radians(40.0)), stream.uniform(0, 2 * np.pi, 8000))
    covariance = draw_covariances(ARRAY, truth, 10 ** (snr_db / 10), 100, stream, waveform="constant_modulus")
    cosine = np.sum(estimate_directions(ARRAY, covariance).direction * truth, axis=1)
    assert low <= np.mean(cosine < np.cos(np.radians(20.0))) <= high


def test_refinement_converges_from_every_noise_peak(stream: np.random.Generator) -> None:
    truth = directions(stream, 5000, 1.5)
    peaks = estimate_directions(ARRAY, draw_covariances(ARRAY, truth, 0.01, 12, stream))
    assert peaks.converged.all()
    assert np.all(peaks.direction[:, 2] >= 0.0)


def test_the_lattice_fills_the_unit_circle_of_cosines_evenly() -> None:
    points = lattice(0.25)
    expected = {(u / 4.0, v / 4.0) for u in range(-4, 5) for v in range(-4, 5) if u * u + v * v <= 16}
    assert {tuple(point) for point in points[:, :2]} == expected
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0)
    assert np.all(points[:, 2] >= 0.0)


def test_calibrated_arrays_find_the_direction_that_an_ideal_one_would(stream: np.random.Generator) -> None:
    truth = directions(stream, 40, 1.3)
    response = np.diag(np.exp(0.5j * stream.standard_normal(12))) + 0.05 * complex_normal(stream, (12, 12))
    heard = steering(ARRAY, truth) @ response.T
    covariance = heard[:, :, None] * heard[:, None, :].conj() + 0.1 * np.eye(12)
    peaks = estimate_directions(ARRAY, covariance, response)
    assert np.linalg.norm(peaks.direction - truth, axis=1).max() < EXACT_RAD
    # Fewer elements than the array has: those that are left out are rows of the response that are left out.
    kept = estimate_directions(ARRAY, covariance[:, 2:, 2:], response[2:])
    assert np.linalg.norm(kept.direction - truth, axis=1).max() < 1e-7


def test_a_start_that_has_not_arrived_is_flagged(stream: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    truth = directions(stream, 3, 1.0)
    signal = steering(ARRAY, truth)[:, :, None] / np.sqrt(12.0)
    starts = truth.copy()
    starts[1] += [0.02, -0.01, 0.0]
    starts[1] /= np.linalg.norm(starts[1])
    assert refine_peaks(ARRAY, signal, starts).converged.tolist() == [True, True, True]
    monkeypatch.setattr(music, "MAX_ITERATIONS", 1)
    assert refine_peaks(ARRAY, signal, starts).converged.tolist() == [True, False, True]
