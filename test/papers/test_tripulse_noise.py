import math

import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.tripulse.beams import beam_signals, invert_ratios, monopulse_ratios
from rf_pointing.core import random_stream
from rf_pointing.papers.tripulse_noise import failed_element_errors, noise_errors, phase_error_errors, random_failures
from rf_pointing.papers.tripulse_theory import projection_variance

PARAMS = TripulseArrayParams()
OFFSET = np.array([np.radians(0.1), 0.0])


def test_masks_have_the_exact_count_and_every_element_fails_alike() -> None:
    failed = random_failures(random_stream(1, "masks"), TripulseArrayParams(n_x=4, n_y=4), 5, 20_000)
    assert set(np.sum(failed, axis=(1, 2))) == {5}
    share = np.mean(failed, axis=0)
    np.testing.assert_allclose(share, 5.0 / 16.0, atol=4.0 * math.sqrt(5.0 / 16.0 * 11.0 / 16.0 / 20_000))


def test_noise_errors_follow_18_within_monte_carlo_error() -> None:
    found = noise_errors(PARAMS, 1.0, [0.05, 0.02], [1e-4, 1e-4], 40_000)
    expected = np.sqrt(projection_variance(PARAMS, 1.0))
    np.testing.assert_allclose(found.sigma, expected, rtol=4.0 / math.sqrt(2.0 * 40_000))


def test_failed_elements_equal_a_direct_simulation() -> None:
    params, rng = TripulseArrayParams(n_x=6, n_y=4, taper_edge=0.5, phase_bits=4), random_stream(1, "direct")
    steering = np.array([0.031, -0.017])
    failed = random_failures(rng, params, 4, 4000)
    signals = beam_signals(params, element_weights(params, steering, failed=failed), steering + OFFSET)
    direct = invert_ratios(params, monopulse_ratios(signals)) - OFFSET
    fast = failed_element_errors(params, 4, steering, OFFSET, 4000)
    np.testing.assert_allclose(fast.sigma, np.std(direct, axis=0), rtol=0.06)
    np.testing.assert_allclose(fast.mean, np.mean(direct, axis=0), atol=5.0 * np.max(fast.sigma) / math.sqrt(4000))


def test_no_failures_and_no_phase_error_leave_no_error() -> None:
    for found in (
        failed_element_errors(PARAMS, 0, [0.01, 0.0], OFFSET, 10),
        phase_error_errors(PARAMS, 0.0, [0.01, 0.0], OFFSET, 10),
    ):
        np.testing.assert_allclose([found.mean, found.sigma], 0.0, atol=1e-13)


@pytest.mark.parametrize("count", [-1, 256])
def test_impossible_failure_counts_are_refused(count: int) -> None:
    with pytest.raises(ValueError, match=f"failed_count={count}"):
        failed_element_errors(PARAMS, count, [0.0, 0.0], OFFSET, 10)


def test_impossible_noise_and_trials_are_refused() -> None:
    for snr in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match=f"element_snr={snr}"):
            noise_errors(PARAMS, snr, [0.0, 0.0], OFFSET, 10)
    with pytest.raises(ValueError, match="width_rad=nan"):
        phase_error_errors(PARAMS, math.nan, [0.0, 0.0], OFFSET, 10)
    with pytest.raises(ValueError, match="trials=1"):
        noise_errors(PARAMS, 1.0, [0.0, 0.0], OFFSET, 1)
