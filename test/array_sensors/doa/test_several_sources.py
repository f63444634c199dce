"""Several sources: exact without noise, at the bound with it, unresolved ones reported; and their number."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import CircularArrayParams, steering
from rf_pointing.array_sensors.doa.covariance import sample_covariance
from rf_pointing.array_sensors.doa.cramer_rao import direction_bound_rad2
from rf_pointing.array_sensors.doa.several_sources import estimate_several
from rf_pointing.array_sensors.doa.snapshots import draw_snapshots
from rf_pointing.papers.doa_study.directions import direction_from_polar

ARRAY = CircularArrayParams()
TWO = direction_from_polar(np.radians([30.0, 45.0]), np.radians([20.0, 80.0]))
EQUAL = np.diag([1.0 + 0j, 1.0])


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(77)


def test_five_noise_free_sources_are_found_exactly(stream: np.random.Generator) -> None:
    truth = direction_from_polar([0.2, 0.5, 0.8, 0.9, 1.1], [0.3, 2.0, 4.1, 5.5, 1.0])
    a = steering(ARRAY, truth).T
    powers = np.diag(stream.uniform(0.5, 3.0, 5)).astype(complex)
    found = estimate_several(ARRAY, a @ powers @ a.conj().T + 0.01 * np.eye(12), 5)
    assert found.complete
    gaps = np.linalg.norm(found.direction[:, None] - truth[None], axis=-1)
    assert gaps.min(axis=0).max() < 1e-8
    assert sorted(gaps.argmin(axis=0)) == [0, 1, 2, 3, 4]


def test_two_sources_stay_within_10_percent_of_their_bound(stream: np.random.Generator) -> None:
    errors = []
    for _ in range(300):
        x = draw_snapshots(ARRAY, TWO, EQUAL, 100, stream)
        found = estimate_several(ARRAY, sample_covariance(x, 2), 2)
        assert found.complete
        near = np.argmin(np.linalg.norm(found.direction[:, None] - TWO[None], axis=-1), axis=0)
        errors.append((found.direction[near] - TWO)[:, :2].T.ravel())
    bound = np.sqrt(np.diag(direction_bound_rad2(ARRAY, TWO, EQUAL, 100)))
    assert np.sqrt(np.mean(np.square(errors), axis=0)) == pytest.approx(bound, rel=0.10)


def test_source_that_does_not_separate_is_reported_missing() -> None:
    close = direction_from_polar(np.radians([40.0, 40.3]), np.radians([20.0, 20.0]))
    x = draw_snapshots(ARRAY, close, 0.3 * EQUAL, 30, np.random.default_rng(1))
    coherent = sample_covariance(x, 2)
    found = estimate_several(ARRAY, coherent, 2)
    assert len(found.direction) == 2 or not found.complete
    a = steering(ARRAY, close[:1]).T
    blurred = a @ a.conj().T + np.diag(np.linspace(1.0, 1.0 + 1e-9, 12))
    eight = estimate_several(ARRAY, blurred, 11)
    assert not eight.complete
    assert "of 11 sources resolved" in eight.reason


def test_as_many_sources_as_elements_are_refused() -> None:
    with pytest.raises(ValueError, match="sources=12 must be >= 1 and < elements=12"):
        estimate_several(ARRAY, np.eye(12, dtype=complex), 12)


def test_what_is_found_comes_with_its_share_of_the_signals_best_first() -> None:
    a = steering(ARRAY, TWO).T
    found = estimate_several(ARRAY, a @ np.diag([2.0, 0.5]) @ a.conj().T + 0.01 * np.eye(12), 2)
    assert (found.sources, found.reason, found.complete) == (2, "", True)
    np.testing.assert_allclose(found.fraction, [1.0, 1.0], atol=1e-9)
    # With one more than there are the third is worse than both.
    more = estimate_several(ARRAY, a @ a.conj().T + np.diag(np.linspace(0.01, 0.02, 12)), 3)
    assert np.all(np.diff(more.fraction) <= 0.0)
    assert more.sources == 3
