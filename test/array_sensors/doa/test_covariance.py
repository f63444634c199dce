"""Spatial covariance: equation (10), and every covariance that MUSIC must not be given."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.covariance import count_sources, eigen, sample_covariance
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


@pytest.mark.parametrize("count", [6, 12, 60])
def test_number_of_sources_is_the_shortest_description(count: int) -> None:
    """Sources near the noise: the count is decided by the last part of the penalty.  Written out with loops."""
    stream, found = np.random.default_rng(count), []
    for _ in range(150):
        steering = complex_normal(stream, (6, 2)) * np.sqrt(stream.uniform(0.0, 1.5, 2))
        received = steering @ complex_normal(stream, (2, count)) + complex_normal(stream, (6, count))
        covariance = sample_covariance(received)
        values = np.sort(np.linalg.eigvalsh(covariance))[::-1]
        lengths = []
        for sources in range(6):
            rest = values[sources:]
            arithmetic, geometric = sum(rest) / len(rest), np.prod(rest) ** (1.0 / len(rest))
            fit = count * (6 - sources) * np.log(arithmetic / geometric)
            lengths.append(fit + 0.5 * sources * (12 - sources) * np.log(count))
        found.append(int(count_sources(covariance[None], count)[0]))
        assert found[-1] == int(np.argmin(lengths))
    assert len(set(found)) >= 3


def test_fewer_snapshots_than_elements_do_not_count_sources(snapshots: np.ndarray) -> None:
    covariance = sample_covariance(snapshots)[None]
    with pytest.raises(ValueError, match="snapshots=5 must be >= elements=6 to count sources"):
        count_sources(covariance, 5)
    # Without noise: what is left is rounding, and no source.
    for sources in (1, 2):
        assert count_sources(sample_covariance(snapshots[:, :sources])[None], 6).tolist() == [sources]


@pytest.mark.parametrize("sources", [0, 6])
def test_a_subspace_of_no_signal_or_of_no_noise_is_refused(snapshots: np.ndarray, sources: int) -> None:
    with pytest.raises(ValueError, match=f"sources={sources} must be >= 1 and < elements=6"):
        eigen(sample_covariance(snapshots), 6, sources=sources)


def test_one_sample_and_a_vector_of_samples_are_told_apart(snapshots: np.ndarray) -> None:
    single = snapshots[:, :1]
    np.testing.assert_allclose(sample_covariance(single), single @ single.conj().T)
    with pytest.raises(ValueError, match=r"snapshots has shape \(6,\), must be \(\.\.\., elements, snapshots\)"):
        sample_covariance(snapshots[:, 0])
    with pytest.raises(ValueError, match="snapshots=0 must be >= sources=0"):
        sample_covariance(snapshots[:, :0], sources=0)
