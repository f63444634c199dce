import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_matrix, quaternion_to_rotation_vector
from rf_pointing.array_sensors.attitude.wahba import attitude_covariance, fit_rotation, separation_rad
from rf_pointing.core import random_stream

ROUNDING = 1e-13


def unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


@pytest.fixture
def rng() -> np.random.Generator:
    return random_stream(1, "wahba test")


@pytest.mark.parametrize("count", [2, 3, 7])
def test_exact_directions_give_the_exact_rotation(rng: np.random.Generator, count: int) -> None:
    truth = Rotation.random(300, rng).as_matrix()
    reference = unit(rng.normal(size=(300, count, 3)))
    fit = fit_rotation(reference, np.einsum("nij,nlj->nli", truth, reference))
    np.testing.assert_allclose(fit.rotation, truth, atol=1e-11)
    np.testing.assert_allclose(fit.residuals, 0.0, atol=1e-11)


def test_weighted_noisy_fit_agrees_with_scipy(rng: np.random.Generator) -> None:
    for _ in range(50):
        reference = unit(rng.normal(size=(4, 3)))
        measured = unit(Rotation.random(None, rng).apply(reference) + 0.1 * rng.normal(size=(4, 3)))
        weights = rng.uniform(0.1, 3.0, size=4)
        expected = Rotation.align_vectors(measured, reference, weights=weights)[0].as_matrix()
        np.testing.assert_allclose(fit_rotation(reference, measured, weights).rotation, expected, atol=1e-10)


def test_fit_is_a_proper_rotation_although_half_of_two_direction_fits_need_the_reflection_guard(
    rng: np.random.Generator,
) -> None:
    reference = unit(rng.normal(size=(2000, 2, 3)))
    measured = unit(np.einsum("nij,nlj->nli", Rotation.random(2000, rng).as_matrix(), reference))
    fit = fit_rotation(reference, measured)
    np.testing.assert_allclose(np.linalg.det(fit.rotation), 1.0, atol=ROUNDING)
    assert 0.4 < np.mean(fit.reflected) < 0.6


def test_covariance_31_follows_monte_carlo_within_3_sigma_of_its_own_scatter(rng: np.random.Generator) -> None:
    trials, sigma_rad = 20_000, 1e-4
    truth = Rotation.random(None, rng).as_matrix()
    reference = unit(rng.normal(size=(3, 3)))
    t = reference @ truth.T
    sigmas = sigma_rad * np.array([1.0, 2.0, 0.5])
    weights = 1.0 / sigmas**2
    noise = sigmas[None, :, None] * rng.normal(size=(trials, 3, 3))
    measured = unit(t + noise)
    fit = fit_rotation(np.broadcast_to(reference, measured.shape), measured, weights)
    error = quaternion_to_rotation_vector(quaternion_from_matrix(fit.rotation @ truth.T))
    expected = attitude_covariance(t, sigmas[:, None, None] ** 2 * np.eye(3), weights)
    found = error.T @ error / trials
    scatter = np.sqrt((np.outer(np.diag(expected), np.diag(expected)) + expected**2) / trials)
    assert np.all(np.abs(found - expected) < 4.0 * scatter)


def test_two_directions_give_yaw_and_roll_variances_in_closed_form() -> None:
    sigma_rad, separation = 1e-5, np.radians(5.0)
    t = np.array([[0.0, np.sin(s), np.cos(s)] for s in (-separation / 2.0, separation / 2.0)])
    tangent = sigma_rad**2 * (np.eye(3) - t[:, :, None] * t[:, None, :])
    covariance = attitude_covariance(t, tangent)
    assert np.sqrt(covariance[2, 2]) == pytest.approx(sigma_rad / (np.sqrt(2.0) * np.sin(separation / 2.0)), rel=1e-12)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(sigma_rad / np.sqrt(2.0), rel=1e-12)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(sigma_rad / (np.sqrt(2.0) * np.cos(separation / 2.0)), rel=1e-12)


@pytest.mark.parametrize("angle_deg", [0.001, 2.5, 90.0])
def test_separation_of_two_directions_is_the_angle_between_their_lines(angle_deg: float) -> None:
    a = np.radians(angle_deg)
    directions = np.array([[0.0, 0.0, 1.0], [np.sin(a), 0.0, np.cos(a)]])
    assert separation_rad(directions) == pytest.approx(a, rel=1e-9)
    assert separation_rad(directions * [[1.0], [-1.0]]) == pytest.approx(a, rel=1e-9)


X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ("reference", "measured", "weights", "message"),
    [
        ([X], [X], None, "at least 2"),
        ([X, X], [X, Y], None, "reference directions are collinear"),
        ([X, Y], [Z, -Z], None, "measured directions are collinear"),
        ([X, 2.0 * Y], [X, Y], None, "unit length"),
        ([X, Y], [X, Y * np.nan], None, "finite"),
        ([X, Y], [X, Y], [1.0, 0.0], "weights"),
        ([X, Y], [X, Y], [1.0, np.nan], "weights"),
        ([X, Y], [X, Y], [1.0, 1.0, 1.0], "weights has shape"),
        ([X, Y, Z], [-X, -Y, -Z], None, "mirror"),
    ],
)
def test_directions_that_do_not_fix_the_attitude_are_refused(
    reference: list[np.ndarray], measured: list[np.ndarray], weights: list[float] | None, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        fit_rotation(np.array(reference), np.array(measured), weights)


def test_the_covariance_of_directions_that_are_one_is_refused() -> None:
    one = np.array([0.0, 0.6, 0.8])
    with pytest.raises(ValueError, match="directions"):
        attitude_covariance(np.array([one, one]), 1e-10 * np.tile(np.eye(3), (2, 1, 1)))
    with pytest.raises(ValueError, match=r"direction_covariances has shape \(3, 3\), must be \(\.\.\., 2, 3, 3\)"):
        attitude_covariance(np.array([one, [1.0, 0.0, 0.0]]), np.eye(3))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_mirrored_set_is_refused_whatever_its_axes_and_the_scale_of_its_weights(
    rng: np.random.Generator, scale: float
) -> None:
    for turn in Rotation.random(20, rng).as_matrix():
        with pytest.raises(ValueError, match="mirror the reference directions"):
            fit_rotation(np.eye(3), -turn.T, scale * np.array([1e4, 1.0, 1.0]))
        fit_rotation(np.eye(3), turn.T, scale * np.array([1e4, 1.0, 1.0]))


def test_a_covariance_that_is_no_number_is_refused() -> None:
    spreads = np.tile(np.eye(3), (2, 1, 1))
    spreads[1, 2, 2] = np.nan
    with pytest.raises(ValueError, match="direction_covariances"):
        attitude_covariance(np.eye(3)[:2], spreads)


def test_a_single_direction_is_too_few_as_a_vector_and_as_a_row() -> None:
    for one in (X, [X]):
        with pytest.raises(ValueError, match="1 direction given, must be at least 2"):
            separation_rad(one)


def test_three_directions_are_farthest_apart_at_right_angles() -> None:
    """Two thirds of every sum of squares lie across any line: 2 asin sqrt(2/3), 109.47 deg."""
    assert separation_rad(np.eye(3)) == pytest.approx(2.0 * np.arcsin(np.sqrt(2.0 / 3.0)))
    # Weights 1:3 of X and Y: a quarter of the squares lie across Y.
    assert separation_rad([X, Y], [1.0, 3.0]) == pytest.approx(2.0 * np.arcsin(0.5))
