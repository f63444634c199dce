import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rf_pointing.array_sensors.attitude.two_station import (
    bisector_rotation,
    direction_covariances,
    directions_from_projections,
)
from rf_pointing.array_sensors.attitude.wahba import fit_rotation
from rf_pointing.core import random_stream

ROUNDING = 1e-12


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    t = rng.normal(size=(count, 2, 3))
    return np.asarray(t / np.linalg.norm(t, axis=-1, keepdims=True))


def test_bisector_equals_the_svd_for_two_noisy_stations() -> None:
    rng = random_stream(1, "bisector")
    reference = directions(rng, 500)
    turned = np.einsum("nij,nlj->nli", Rotation.random(500, rng=rng).as_matrix(), reference)
    noisy = turned + 0.1 * rng.normal(size=turned.shape)
    measured = noisy / np.linalg.norm(noisy, axis=-1, keepdims=True)
    svd = fit_rotation(reference, measured).rotation
    gap = np.linalg.norm(bisector_rotation(reference, measured) - svd, axis=(1, 2))
    # Nearly opposite pairs make both ill-conditioned; the rest agree to rounding.
    assert np.median(gap) < ROUNDING
    assert np.max(gap) < 1e-8


def test_bisector_leaves_directions_coplanar_with_a_common_bisector() -> None:
    rng = random_stream(1, "bisector criteria")
    reference, measured = directions(rng, 100), directions(rng, 100)
    back = np.einsum("nji,nlj->nli", bisector_rotation(reference, measured), measured)
    triple = np.einsum("ni,ni->n", np.cross(reference[:, 0], reference[:, 1]), back[:, 0])
    np.testing.assert_allclose(triple, 0.0, atol=ROUNDING)
    sums = [t.sum(axis=1) / np.linalg.norm(t.sum(axis=1), axis=-1, keepdims=True) for t in (reference, back)]
    np.testing.assert_allclose(sums[0], sums[1], atol=1e-9)


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]], "collinear"),
        ([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], "collinear"),
        ([[0.0, 0.0, 1.0], [0.0, 1.0, 1.0]], "unit length"),
        ([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], "shape"),
    ],
)
def test_stations_that_do_not_make_a_frame_are_refused(reference: list[list[float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bisector_rotation(reference, np.eye(3)[:2])


def test_directions_have_unit_length_and_their_projections() -> None:
    t = directions_from_projections([[0.3, -0.4], [0.0, 0.0]])
    np.testing.assert_allclose(t, [[0.3, -0.4, np.sqrt(0.75)], [0.0, 0.0, 1.0]])


def test_direction_covariance_follows_monte_carlo() -> None:
    rng, projection = random_stream(1, "direction covariance"), np.array([0.3, -0.4])
    covariance = 1e-8 * np.array([[2.0, 0.5], [0.5, 1.0]])
    draws = rng.multivariate_normal(projection, covariance, size=50_000)
    found = np.cov(directions_from_projections(draws).T)
    np.testing.assert_allclose(direction_covariances(projection, covariance), found, atol=0.03 * 1e-8)


@pytest.mark.parametrize("projection", [[0.8, 0.6], [1.0, 0.5], [np.nan, 0.0]])
def test_projections_without_a_direction_in_front_of_the_array_are_refused(projection: list[float]) -> None:
    with pytest.raises(ValueError, match="projections"):
        directions_from_projections(projection)


def test_a_covariance_singular_but_for_rounding_is_refused() -> None:
    rng = random_stream(2, "singular covariance")
    for line in rng.normal(size=(50, 2, 1)):
        with pytest.raises(ValueError, match="singular covariance"):
            direction_covariances([0.0, 0.0], line @ line.T)


@pytest.mark.parametrize("covariance", [np.zeros((2, 2)), [[1.0, 1.0], [1.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]]])
def test_singular_covariance_is_refused(covariance: np.ndarray) -> None:
    with pytest.raises(ValueError, match="singular covariance"):
        direction_covariances([0.0, 0.0], covariance)
