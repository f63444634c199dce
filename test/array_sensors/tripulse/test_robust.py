import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.beams import closed_form_signals
from rf_pointing.array_sensors.tripulse.robust import posterior_projection_error, signal_matrix
from rf_pointing.core import random_stream

PARAMS = TripulseArrayParams()
PRIOR = np.full(2, np.radians(0.1) / 3.0)
EQUAL = np.ones(3)


def noisy(rng: np.random.Generator, error: np.ndarray, snr_db: float, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    """Return signals (trials, cycles, 3) with a phase of their own in every cycle, and the noise variances."""
    variance = PARAMS.n_total**2 / 10.0 ** (snr_db / 10.0)
    turns = np.exp(2j * np.pi * rng.uniform(size=(len(error), cycles, 1)))
    signals = closed_form_signals(PARAMS, error)[:, None, :] * turns
    noise = np.sqrt(variance / 2.0) * (rng.normal(size=signals.shape) + 1j * rng.normal(size=signals.shape))
    return signals + noise, variance * EQUAL


@pytest.mark.parametrize(("snr_db", "cycles"), [(-10.0, 1), (0.0, 1), (10.0, 1), (0.0, 300), (20.0, 5)])
def test_posterior_covariance_is_honest_and_never_worse_than_the_prior(snr_db: float, cycles: int) -> None:
    rng = random_stream(1, f"posterior {snr_db} {cycles}")
    truth = PRIOR * rng.normal(size=(3000, 2))
    signals, noises = noisy(rng, truth, snr_db, cycles)
    found = posterior_projection_error(PARAMS, signal_matrix(signals, noises), cycles, noises, PRIOR)
    error = found.projection_error - truth
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance), error)
    # Mean of 3000 chi-square values of two degrees of freedom: 2 +- 0.036.
    assert np.mean(nees) == pytest.approx(2.0, abs=0.15)
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < 1.04 * PRIOR)


def test_posterior_resolves_errors_far_below_the_prior() -> None:
    truth = np.array([[4.2e-4, -3.1e-4]])
    noises = 1e-4 * EQUAL
    matrix = signal_matrix(closed_form_signals(PARAMS, truth)[:, None, :], noises)
    found = posterior_projection_error(PARAMS, matrix, 1, noises, PRIOR)
    sigma = np.sqrt(np.diagonal(found.covariance[0]))
    np.testing.assert_allclose(found.projection_error, truth, atol=3e-7)
    snr = PARAMS.n_total**2 / 1e-4
    np.testing.assert_allclose(sigma, 4.0 / (16 * PARAMS.kd) / np.sqrt(2.0 * snr), rtol=0.05)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"prior_sigma": [0.0, 1.0]}, "prior_sigma"),
        ({"cycles": 0}, "cycles=0"),
        ({"noise_variances": [1.0, 0.0, 1.0]}, "noise_variances"),
        ({"matrix": np.full((3, 3), np.nan)}, "finite"),
        ({"matrix": np.eye(2)}, "shape"),
    ],
)
def test_bad_input_is_refused(changes: dict[str, object], message: str) -> None:
    arguments: dict[str, object] = {
        "matrix": np.eye(3), "cycles": 1, "noise_variances": EQUAL, "prior_sigma": PRIOR,
    } | changes  # fmt: skip
    with pytest.raises(ValueError, match=message):
        posterior_projection_error(PARAMS, **arguments)  # type: ignore[arg-type]


def test_signals_that_are_not_finite_or_empty_are_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        signal_matrix([[1.0, np.nan, 0.0]], EQUAL)
    with pytest.raises(ValueError, match="at least 1 cycle"):
        signal_matrix(np.empty((0, 3)), EQUAL)


def on_a_fine_grid(
    params: TripulseArrayParams, matrix: np.ndarray, cycles: int, noises: np.ndarray, prior: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """p ~ exp(kappa v'Mv / v'v) times the prior, v = (1, tan(N_x k d_x T_x / 4), tan(...)) over the noises' roots."""
    reach = np.minimum(5.0 * prior, 0.999999999 * params.unambiguous_projection)
    x, y = np.meshgrid(*(np.linspace(-each, each, 601) for each in reach), indexing="ij")
    quarter = np.array([params.n_x, params.n_y]) * params.kd / 4.0
    v = np.stack([np.ones_like(x), np.tan(quarter[0] * x), np.tan(quarter[1] * y)], axis=-1) / np.sqrt(noises)
    kappa = 1.0 - min(1.0, max(cycles - 2, 0) / np.linalg.eigvalsh(matrix)[-1])
    log_mass = kappa * np.einsum("ija,ab,ijb->ij", v, matrix, v) / np.sum(v**2, axis=-1)
    log_mass -= 0.5 * ((x / prior[0]) ** 2 + (y / prior[1]) ** 2)
    mass = np.exp(log_mass - np.max(log_mass))
    mass /= np.sum(mass)
    mean = np.array([np.sum(mass * x), np.sum(mass * y)])
    apart = [x - mean[0], y - mean[1]]
    return mean, np.array([[np.sum(mass * a * b) for b in apart] for a in apart])


@pytest.mark.parametrize(
    ("cycles", "snr_db", "wide"), [(1, 3.0, False), (2, 0.0, False), (6, 0.0, False), (1, -10.0, True), (1, 0.0, True)]
)
@pytest.mark.parametrize("share", [[0.3, -0.3], [-0.9, 0.5]])
def test_posterior_is_that_of_a_fine_grid_for_an_array_and_noises_that_differ_by_axis(
    cycles: int, snr_db: float, wide: bool, share: list[float]
) -> None:
    """A prior wider than the unambiguous region leaves mass at both of its edges, which count once."""
    params = TripulseArrayParams(n_x=12, n_y=8, spacing_x_wavelengths=3.0, spacing_y_wavelengths=2.0)
    limit, rng = params.unambiguous_projection, random_stream(2, f"grid {cycles} {share}")
    prior = np.array([3.0, 2.0]) * limit if wide else np.array([1.5e-3, 3e-3])
    noises = params.n_total**2 / 10.0 ** (snr_db / 10.0) * np.array([1.0, 0.4, 2.0])
    turns = np.exp(2j * np.pi * rng.uniform(size=(cycles, 1)))
    scatter = rng.normal(size=(cycles, 3)) + 1j * rng.normal(size=(cycles, 3))
    truth = np.array(share) * (limit if wide else 2.0 * prior)
    matrix = signal_matrix(closed_form_signals(params, truth) * turns + np.sqrt(noises / 2.0) * scatter, noises)
    found = posterior_projection_error(params, matrix, cycles, noises, prior)
    mean, covariance = on_a_fine_grid(params, matrix, cycles, noises, prior)
    sigma = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(found.projection_error / sigma, mean / sigma, atol=0.02)
    np.testing.assert_allclose(
        found.covariance / np.outer(sigma, sigma), covariance / np.outer(sigma, sigma), atol=0.04
    )


def test_what_says_nothing_leaves_the_prior_and_its_mean_of_zero() -> None:
    prior = np.array([4e-4, 7e-4])
    found = posterior_projection_error(PARAMS, np.zeros((2, 3, 3, 3)), 1, EQUAL, prior)
    np.testing.assert_allclose(found.projection_error, np.zeros((2, 3, 2)), atol=1e-9)
    np.testing.assert_allclose(
        found.covariance, np.broadcast_to(np.diag(prior**2), (2, 3, 2, 2)), rtol=1e-2, atol=1e-12
    )
    # As many cycles as their power: noise alone, from which nothing follows.
    noise = posterior_projection_error(PARAMS, np.diag([6.0, 1.0, 2.0]), 8, EQUAL, prior)
    np.testing.assert_allclose(noise.covariance, np.diag(prior**2), rtol=1e-2, atol=1e-12)
