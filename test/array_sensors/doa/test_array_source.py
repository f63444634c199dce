"""Simulated array: seeded, stopped and resumed identically, and strict about what it is given."""

import numpy as np
import pytest

from rf_pointing.array_sensors.doa.array import ArrayResponse, CircularArrayParams
from rf_pointing.array_sensors.doa.array_source import ArraySource, ArraySourceParams
from rf_pointing.papers.doa_study.directions import direction_from_polar

ARRAY = CircularArrayParams()
TOWARDS = direction_from_polar([0.5], [1.0])
SNR_DB = np.array([3.0])


def source(seed: int = 4) -> ArraySource:
    return ArraySource(ARRAY, ArraySourceParams(snapshots=20), seed=seed)


def test_same_seed_same_snapshots_and_other_seed_others() -> None:
    first, second, other = (source(seed).step(0.0, TOWARDS, SNR_DB).snapshots for seed in (4, 4, 5))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)


def test_resuming_from_a_copied_state_gives_the_same_blocks() -> None:
    running = source()
    running.step(0.0, TOWARDS, SNR_DB)
    state = running.state
    after = [running.step(t, TOWARDS, SNR_DB).snapshots for t in (0.25, 0.5)]
    resumed = source(seed=99)
    resumed.restore(state)
    assert all(
        np.array_equal(a, resumed.step(t, TOWARDS, SNR_DB).snapshots) for a, t in zip(after, (0.25, 0.5), strict=True)
    )


def test_signal_to_noise_ratio_is_per_element() -> None:
    block = ArraySource(ARRAY, ArraySourceParams(snapshots=50_000), seed=1).step(0.0, TOWARDS, SNR_DB)
    assert np.mean(np.abs(block.snapshots) ** 2) == pytest.approx(1.0 + 10**0.3, rel=0.01)


def test_time_that_does_not_advance_is_refused() -> None:
    running = source()
    running.step(1.0, TOWARDS, SNR_DB)
    with pytest.raises(ValueError, match=r"t_s=1.0 must be > the last block's 1.0"):
        running.step(1.0, TOWARDS, SNR_DB)


def test_source_behind_the_array_is_refused() -> None:
    with pytest.raises(ValueError, match="behind the array"):
        source().step(0.0, -TOWARDS, SNR_DB)


def test_source_without_a_level_is_refused() -> None:
    with pytest.raises(ValueError, match="snr_db"):
        source().step(0.0, TOWARDS, np.array([np.nan]))


def test_response_of_another_array_is_refused() -> None:
    other = ArrayResponse(gain=np.ones(10, complex), coupling=np.zeros(5, complex))
    with pytest.raises(ValueError, match="10 gains, must be elements=12"):
        ArraySource(ARRAY, ArraySourceParams(), seed=1, response=other)
