import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.minimum_variance import minimum_variance_step


def test_scalar_from_uncorrelated_measurements_is_the_inverse_variance_mean(rng) -> None:
    values, variances = rng.normal(size=5), rng.uniform(0.5, 3.0, 5)
    step, variance = minimum_variance_step(np.ones((5, 1)), values, np.diag(variances))
    assert step[0] == pytest.approx(np.sum(values / variances) / np.sum(1.0 / variances))
    assert variance[0, 0] == pytest.approx(1.0 / np.sum(1.0 / variances))


def test_planted_parameters_return_from_correlated_measurements(rng) -> None:
    gradient, truth = rng.normal(size=(9, 4)), rng.normal(size=4)
    root = rng.normal(size=(9, 9))
    step, covariance = minimum_variance_step(gradient, gradient @ truth, root @ root.T)
    np.testing.assert_allclose(step, truth, atol=1e-9)
    np.testing.assert_allclose(covariance, np.linalg.inv(gradient.T @ np.linalg.inv(root @ root.T) @ gradient))


def test_stacks_are_solved_one_by_one(rng) -> None:
    gradient, innovation = rng.normal(size=(6, 5, 2)), rng.normal(size=(6, 5))
    stacked, _ = minimum_variance_step(gradient, innovation)
    np.testing.assert_allclose(stacked[3], minimum_variance_step(gradient[3], innovation[3])[0])


@pytest.mark.parametrize(
    ("gradient", "message"),
    [(np.zeros((3, 1)), "zero or undefined column"), (np.ones((3, 2)), "rank deficient")],
)
def test_undetermined_parameters_are_refused(gradient, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        minimum_variance_step(gradient, np.ones(3))


def test_a_covariance_singular_but_for_rounding_is_refused(rng) -> None:
    """A Cholesky factor exists or not by the last bits."""
    for root in rng.normal(size=(50, 3, 2)):
        with pytest.raises(ValueError, match="covariance is singular or not positive definite"):
            minimum_variance_step(np.array([[1.0], [2.0], [3.0]]), np.ones(3), root @ root.T)


@pytest.mark.parametrize("covariance", [np.ones((3, 3)), np.diag([1.0, -1.0, 1.0]), np.diag([1.0, 0.0, 1.0])])
def test_a_singular_covariance_is_refused(covariance) -> None:
    with pytest.raises(ValueError, match="covariance is singular or not positive definite"):
        minimum_variance_step(np.array([[1.0], [2.0], [3.0]]), np.ones(3), covariance)
