"""Spatial covariance: equation (10), and every covariance that MUSIC must not be given."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.covariance import eigen, sample_covariance
from rf_pointing.array_sensors.doa.snapshots import complex_normal


@pytest.fixture
def snapshots() -> np.ndarray:
    return complex_normal(np.random.default_rng(3), (6, 20))


def test_covariance_is_the_mean_of_outer_products(snapshots: np.ndarray) -> None:
    direct = sum(np.outer(x, x.conj()) for x in snapshots.T) / 20
    assert sample_covariance(snapshots) == pytest.approx(direct)


def test_eigen_vectors_rebuild_the_covariance_in_descending_order(snapshots: np.ndarray) -> None:
    covariance = sample_covariance(snapshots)
    found = eigen(covariance, 6)
    assert np.all(np.diff(found.values) <= 0.0)
    assert (found.vectors * found.values) @ found.vectors.conj().T == pytest.approx(covariance)


def test_fewer_snapshots_than_sources_are_refused(snapshots: np.ndarray) -> None:
    with pytest.raises(ValueError, match="snapshots=2 must be >= sources=3"):
        sample_covariance(snapshots[:, :2], sources=3)


def test_sample_that_is_not_finite_is_refused(snapshots: np.ndarray) -> None:
    snapshots[2, 3] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        sample_covariance(snapshots)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda r: r * np.inf, "not finite"),
        (lambda r: r + 0.1j, "not Hermitian"),
        (lambda r: 0.0 * r, "rank below sources=1"),
        (lambda r: r[:5, :5], "must be \\(..., 6, 6\\)"),
    ],
)
def test_unusable_covariance_is_refused(snapshots: np.ndarray, spoil, words: str) -> None:
    with np.errstate(invalid="ignore"):
        spoiled = spoil(sample_covariance(snapshots))
    with pytest.raises(ValueError, match=words):
        eigen(spoiled, 6)


def test_two_sources_need_a_covariance_of_rank_two(snapshots: np.ndarray) -> None:
    one = np.outer(snapshots[:, 0], snapshots[:, 0].conj())
    with pytest.raises(ValueError, match="rank below sources=2"):
        eigen(one, 6, sources=2)
