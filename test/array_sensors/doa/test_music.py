"""MUSIC for one source: exact without noise, at the Cramer-Rao bound with it, threshold where the page says."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa import music
from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering, steering_taylor
from rf_pointing.array_sensors.doa.cramer_rao import effective_snr, polar_sigma_rad
from rf_pointing.array_sensors.doa.music import (
    _log_fraction,
    _newton_step,
    estimate_directions,
    lattice,
    refine_peaks,
)
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
    ("snapshots", "snr_db", "theta_deg"), [(100, 0.0, 20.0), (100, 14.0, 60.0), (1000, -10.0, 40.0), (10, 3.0, 40.0)]
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


def test_a_single_snapshot_reaches_the_bound_too(stream: np.random.Generator) -> None:
    truth = direction_from_polar(np.full(6000, 0.7), stream.uniform(0, 2 * np.pi, 6000))
    covariance = draw_covariances(ARRAY, truth, 30.0, 1, stream, waveform="constant_modulus")
    theta, _, _ = polar_errors_rad(estimate_directions(ARRAY, covariance).direction, truth)
    assert np.sqrt(np.mean(theta**2)) == pytest.approx(float(polar_sigma_rad(ARRAY, 0.7, 1, 30.0)[0]), rel=0.05)


@pytest.mark.parametrize(("snr_db", "low", "high"), [(-10.0, 0.0, 0.001), (-12.0, 0.006, 0.016), (-14.0, 0.14, 0.19)])
def test_outliers_appear_below_the_threshold(
    snr_db: float, low: float, high: float, stream: np.random.Generator
) -> None:
    truth = direction_from_polar(np.full(8000, np.radians(40.0)), stream.uniform(0, 2 * np.pi, 8000))
    covariance = draw_covariances(ARRAY, truth, 10 ** (snr_db / 10), 100, stream, waveform="constant_modulus")
    cosine = np.sum(estimate_directions(ARRAY, covariance).direction * truth, axis=1)
    assert low <= np.mean(cosine < np.cos(np.radians(20.0))) <= high


def test_threshold_belongs_to_the_effective_ratio_not_to_l_m_snr(stream: np.random.Generator) -> None:
    """L M SNR = 48 in both cases; only the case with the small effective ratio has outliers."""
    truth = direction_from_polar(np.full(4000, np.radians(40.0)), stream.uniform(0, 2 * np.pi, 4000))
    shares = {}
    for snapshots, snr in ((100, 0.04), (10, 0.4)):
        covariance = draw_covariances(ARRAY, truth, snr, snapshots, stream, waveform="constant_modulus")
        cosine = np.sum(estimate_directions(ARRAY, covariance).direction * truth, axis=1)
        shares[round(effective_snr(ARRAY, snapshots, snr))] = np.mean(cosine < np.cos(np.radians(20.0)))
    assert shares[16] > 0.1
    assert shares[40] < 0.002


def test_refinement_converges_from_every_noise_peak(stream: np.random.Generator) -> None:
    truth = directions(stream, 5000, 1.5)
    peaks = estimate_directions(ARRAY, draw_covariances(ARRAY, truth, 0.01, 12, stream))
    assert peaks.converged.all()
    assert np.all(peaks.direction[:, 2] >= 0.0)


def test_refined_value_is_never_below_the_best_of_the_search_lattice(stream: np.random.Generator) -> None:
    from rf_pointing.array_sensors.doa.music import principal_eigenvectors

    covariance = draw_covariances(ARRAY, directions(stream, 500, 1.2), 0.05, 30, stream)
    peaks = estimate_directions(ARRAY, covariance)
    fine = steering(ARRAY, lattice(0.03))
    best = np.max(np.abs(principal_eigenvectors(covariance, 12).conj() @ fine.T) ** 2, axis=1) / 12
    assert np.mean(peaks.fraction >= best - 1e-9) > 0.98


@pytest.mark.parametrize("bad", [np.zeros((1, 12, 12)), np.full((1, 12, 12), np.nan), np.eye(12)])
def test_unusable_covariance_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ValueError, match="covariance"):
        estimate_directions(ARRAY, bad.astype(complex))


@pytest.mark.parametrize("calibrated", [False, True])
def test_slope_and_curvature_of_the_fraction_are_its_derivatives_by_the_direction_cosines(
    stream: np.random.Generator, calibrated: bool
) -> None:
    """log |V^H C a|^2 / |C a|^2 of two signal vectors, by differences of the steering vectors."""
    array = CircularArrayParams(elements=9, radius_m=0.13, wavelength_m=0.12)
    vectors = np.linalg.qr(complex_normal(stream, (4, 9, 2)))[0]
    response = np.eye(9) + 0.2 * complex_normal(stream, (9, 9)) if calibrated else None
    points = directions(stream, 4, 1.0)

    def fraction(cosines: np.ndarray) -> np.ndarray:
        a = steering(array, np.column_stack([cosines, np.sqrt(1.0 - np.sum(cosines**2, axis=1))]))
        heard = a if response is None else a @ response.T
        onto = np.einsum("nmk,nm->nk", vectors.conj(), heard)
        return np.sum(np.abs(onto) ** 2, axis=1) / np.sum(np.abs(heard) ** 2, axis=1)

    numerator = vectors.conj().swapaxes(-1, -2)
    found, slope, curve = _log_fraction(
        array, steering_taylor(array), numerator if response is None else numerator @ response, points, response
    )
    flat, step = points[:, :2], 1e-4
    np.testing.assert_allclose(found, fraction(flat), rtol=1e-12)
    moves = step * np.eye(2)
    here = np.log(fraction(flat))
    for i, first in enumerate(moves):
        ends = [np.log(fraction(flat + sign * first)) for sign in (1.0, -1.0)]
        np.testing.assert_allclose(slope[:, i], (ends[0] - ends[1]) / (2.0 * step), rtol=1e-4, atol=1e-3)
        np.testing.assert_allclose(curve[:, i, i], (ends[0] - 2.0 * here + ends[1]) / step**2, rtol=1e-3, atol=0.05)
        for j, second in enumerate(moves):
            if i != j:
                corners = [
                    np.log(fraction(flat + a * first + b * second)) * a * b for a in (1.0, -1.0) for b in (1.0, -1.0)
                ]
                np.testing.assert_allclose(curve[:, i, j], sum(corners) / (4.0 * step**2), rtol=1e-3, atol=0.05)


def test_a_step_climbs_by_the_size_of_each_curvature_and_no_farther_than_its_limit(
    stream: np.random.Generator,
) -> None:
    """Peaks, valleys and saddles: along each axis of the Hessian the slope over the curvature's size, on the sphere."""
    count, limit = 40, 0.05
    points = directions(stream, count, 1.5)
    gradient = stream.standard_normal((count, 2))
    hessian = 30.0 * stream.standard_normal((count, 2, 2))
    hessian = hessian + hessian.swapaxes(1, 2)
    found, length = _newton_step(points, gradient, hessian, limit)
    kinds = set()
    for k, direction in enumerate(points):
        basis = np.linalg.svd(direction[None])[2][1:]
        lifted_slope, lifted_curve = np.append(gradient[k], 0.0), np.zeros((3, 3))
        lifted_curve[:2, :2] = hessian[k]
        curve = basis @ lifted_curve @ basis.T - float(direction @ lifted_slope) * np.eye(2)
        values, axes = np.linalg.eigh(curve)
        kinds.add(tuple(values > 0.0))
        step = basis.T @ (axes @ ((axes.T @ (basis @ lifted_slope)) / np.abs(values)))
        size = np.linalg.norm(step)
        moved = direction + step * min(1.0, limit / size)
        moved[2] = abs(moved[2])
        np.testing.assert_allclose(found[k], moved / np.linalg.norm(moved), atol=1e-9)
        assert length[k] == pytest.approx(min(size, limit))
    assert kinds == {(False, False), (False, True), (True, True)}
    assert 0 < np.sum(length < limit) < count


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


def test_on_flat_ground_a_step_is_as_long_as_the_least_curvature_lets_it() -> None:
    """A curvature of 1e-6 over the square of the longest step is the least that counts."""
    for limit in (0.05, 0.2):
        _, length = _newton_step(np.array([[0.0, 0.0, 1.0]]), np.array([[3e-9, 4e-9]]), np.zeros((1, 2, 2)), limit)
        assert length[0] == pytest.approx(5e-9 * limit**2 / 1e-6)
