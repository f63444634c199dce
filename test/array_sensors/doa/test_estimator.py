"""Estimator: true covariance, true level, and a reason wherever a direction must not be used."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams, SnapshotBlock
from rf_pointing.array_sensors.doa.estimator import DoaEstimator, DoaEstimatorParams
from rf_pointing.papers.doa_study.directions import direction_from_polar, polar_basis

ARRAY = CircularArrayParams()


def blocks(snr_db: list[float], theta: list[float], phi: list[float], count: int, **options):
    source = ArraySource(ARRAY, ArraySourceParams(snapshots=100), seed=3, **options)
    return [source.step(0.25 * k, direction_from_polar(theta, phi), np.array(snr_db)) for k in range(count)]


def score(found, truth: np.ndarray) -> float:
    """Return the square of the error of a direction in units of its covariance; its mean is 2."""
    across = polar_basis(found.direction)[:2]
    error = across @ (found.direction - truth)
    return error @ np.linalg.solve(across @ found.covariance_rad2 @ across.T, error)


@pytest.mark.parametrize("theta", [0.02, 0.9])
def test_errors_agree_with_the_covariance_near_and_far_from_the_normal(theta: float) -> None:
    truth = direction_from_polar(theta, 2.0)
    estimator = DoaEstimator(ARRAY, DoaEstimatorParams())
    scores = []
    for block in blocks([0.0], [theta], [2.0], 400):
        (found,) = estimator.estimate(block)
        assert found.valid
        scores.append(score(found, truth))
    assert np.mean(scores) == pytest.approx(2.0, abs=0.3)


def test_covariance_has_rank_two_and_no_part_along_the_direction() -> None:
    (found,) = DoaEstimator(ARRAY, DoaEstimatorParams()).estimate(blocks([5.0], [0.7], [1.0], 1)[0])
    eigenvalues = np.linalg.eigvalsh(found.covariance_rad2)
    assert eigenvalues[0] == pytest.approx(0.0, abs=1e-12 * eigenvalues[2])
    assert found.covariance_rad2 @ found.direction == pytest.approx(0.0, abs=1e-12)


def test_levels_of_two_sources_are_told_apart() -> None:
    estimator = DoaEstimator(ARRAY, DoaEstimatorParams(sources=2))
    levels = []
    for block in blocks([0.0, 6.0], [0.4, 0.9], [0.5, 3.0], 50):
        found = sorted(estimator.estimate(block), key=lambda each: each.direction[2], reverse=True)
        assert all(each.valid for each in found)
        levels.append([each.snr_db for each in found])
    assert np.mean(levels, axis=0) == pytest.approx([0.0, 6.0], abs=0.2)


def test_pure_noise_is_marked_invalid_with_its_reason() -> None:
    source = ArraySource(ARRAY, ArraySourceParams(snapshots=100), seed=8)
    estimator = DoaEstimator(ARRAY, DoaEstimatorParams())
    for k in range(50):
        (found,) = estimator.estimate(source.step(0.25 * k, direction_from_polar([0.3], [0.0]), np.array([-60.0])))
        assert not found.valid
        assert "effective_snr=" in found.reason


def test_a_second_signal_nobody_announced_marks_the_direction_invalid() -> None:
    jammed, clean = (blocks([0.0, level], [0.4, 0.9], [0.5, 3.0], 100) for level in (3.0, -60.0))
    announced = direction_from_polar(0.4, 0.5)
    careful, trusting = (DoaEstimator(ARRAY, DoaEstimatorParams(count_signals=each)) for each in (True, False))
    refused = {careful.estimate(block)[0].reason for block in jammed}
    assert refused == {"2 signals in the channel, must be <= sources=1"}
    believed = [trusting.estimate(block)[0] for block in jammed]
    assert all(found.valid and found.direction @ announced < 0.5 for found in believed)
    assert all(careful.estimate(block)[0].valid for block in clean)


def test_direction_in_the_array_plane_is_marked_invalid() -> None:
    (found,) = DoaEstimator(ARRAY, DoaEstimatorParams()).estimate(blocks([10.0], [1.55], [1.0], 1)[0])
    assert not found.valid
    assert "cos(theta)=" in found.reason


def test_calibrated_estimator_sees_through_coupling() -> None:
    response = ArrayResponse(gain=np.ones(12, complex), coupling=np.array([0.3j, 0.15, 0.1, 0.0, 0.0, 0.0]))
    (block,) = blocks([20.0], [0.6], [1.0], 1, response=response)
    truth = direction_from_polar(0.6, 1.0)
    errors = [
        np.linalg.norm(DoaEstimator(ARRAY, DoaEstimatorParams(), response=each).estimate(block)[0].direction - truth)
        for each in (None, response)
    ]
    assert errors[1] < 0.002 < errors[0]


@pytest.mark.parametrize(("count", "sources"), [(1, 1), (2, 2)])
def test_too_few_snapshots_to_know_the_noise_are_refused(count: int, sources: int) -> None:
    block = SnapshotBlock(t_s=0.0, snapshots=np.ones((12, count), complex))
    with pytest.raises(ValueError, match=f"snapshots={count} must be > sources={sources}"):
        DoaEstimator(ARRAY, DoaEstimatorParams(sources=sources)).estimate(block)


def test_noise_free_block_is_refused_rather_than_called_perfect() -> None:
    block = SnapshotBlock(t_s=0.0, snapshots=np.ones((12, 10), complex))
    with pytest.raises(ValueError, match="noise power"):
        DoaEstimator(ARRAY, DoaEstimatorParams()).estimate(block)


@pytest.mark.parametrize("coupled", [False, True])
def test_excluded_elements_leave_an_honest_direction(coupled: bool) -> None:
    coupling = np.array([0.3j, 0.15, 0.1, 0.0, 0.0, 0.0]) if coupled else np.zeros(6, complex)
    response = ArrayResponse(gain=np.ones(12, complex), coupling=coupling)
    estimator = DoaEstimator(ARRAY, DoaEstimatorParams(excluded="3, 8"), response=response if coupled else None)
    truth, scores = direction_from_polar(0.6, 1.0), []
    for block in blocks([3.0], [0.6], [1.0], 200, response=response):
        # What a dead element and one full of interference deliver.
        block.snapshots[3], block.snapshots[8] = 0.0, 100.0 * block.snapshots[0]
        (found,) = estimator.estimate(block)
        assert found.valid
        scores.append(score(found, truth))
    assert np.mean(scores) == pytest.approx(2.0, abs=0.5)


def test_element_that_delivers_zeros_is_named() -> None:
    (block,) = blocks([0.0], [0.6], [1.0], 1)
    block.snapshots[5] = 0.0
    with pytest.raises(ValueError, match="element 5 delivers zeros only: exclude it"):
        DoaEstimator(ARRAY, DoaEstimatorParams()).estimate(block)


@pytest.mark.parametrize("excluded", ["12", "-1", "a", "0,1,2,3,4,5,6,7"])
def test_impossible_exclusions_are_refused(excluded: str) -> None:
    with pytest.raises(ValueError, match="excluded="):
        DoaEstimator(ARRAY, DoaEstimatorParams(excluded=excluded))


def test_uncertain_phases_are_a_bias_of_the_direction_cosines() -> None:
    stream, sigma = np.random.default_rng(5), 0.1
    estimator = DoaEstimator(ARRAY, DoaEstimatorParams(phase_sigma_rad=sigma))
    truth, scores = direction_from_polar(0.6, 1.0), []
    for _ in range(200):
        response = ArrayResponse(gain=np.exp(1j * sigma * stream.standard_normal(12)), coupling=np.zeros(6, complex))
        (block,) = blocks([30.0], [0.6], [1.0], 1, response=response)
        (found,) = estimator.estimate(block)
        across = polar_basis(found.direction)[:2]
        error = across @ (found.direction - truth)
        spread = across @ (found.covariance_rad2 + found.bias_rad @ found.bias_rad.T) @ across.T
        scores.append(error @ np.linalg.solve(spread, error))
    assert np.mean(scores) == pytest.approx(2.0, abs=0.5)


def test_uncertain_phases_and_several_sources_do_not_go_together() -> None:
    (block,) = blocks([10.0, 10.0], [0.4, 0.9], [0.5, 3.0], 1)
    found = DoaEstimator(ARRAY, DoaEstimatorParams(sources=2, phase_sigma_rad=0.17)).estimate(block)
    assert not any(each.valid for each in found)
    assert "phase_sigma_rad=0.17 must be <= 0.01 with 2 stations in one channel" in found[0].reason
    assert all(each.valid for each in DoaEstimator(ARRAY, DoaEstimatorParams(sources=2)).estimate(block))


def test_bounds_of_the_verdict_are_where_they_are_stated() -> None:
    (block,) = blocks([0.0], [0.7], [1.0], 1)
    (found,) = DoaEstimator(ARRAY, DoaEstimatorParams()).estimate(block)
    for share in (0.999, 1.001):
        least = DoaEstimatorParams(effective_snr_min=share * found.effective_snr)
        assert DoaEstimator(ARRAY, least).estimate(block)[0].valid is (share < 1.0)
        level = DoaEstimatorParams(boresight_cosine_min=share * float(found.direction[2]))
        assert DoaEstimator(ARRAY, level).estimate(block)[0].valid is (share < 1.0)
    # With fewer snapshots than elements signals cannot be counted, and the direction stands.
    few = SnapshotBlock(t_s=0.0, snapshots=blocks([10.0, 10.0], [0.4, 0.9], [0.5, 3.0], 1)[0].snapshots[:, :11])
    assert "signals in the channel" not in DoaEstimator(ARRAY, DoaEstimatorParams()).estimate(few)[0].reason
    with pytest.raises(ValueError, match="sources=11 must be < elements=11"):
        DoaEstimator(ARRAY, DoaEstimatorParams(sources=11, excluded="0"))
    ten = ArrayResponse(gain=np.ones(10, complex), coupling=np.zeros(5, complex))
    with pytest.raises(ValueError, match="response has 10 gains, must be elements=12"):
        DoaEstimator(ARRAY, DoaEstimatorParams(), response=ten)
    with pytest.raises(ValueError, match="snapshots of 11 elements, must be 12"):
        DoaEstimator(ARRAY, DoaEstimatorParams()).estimate(SnapshotBlock(t_s=0.0, snapshots=block.snapshots[1:]))
