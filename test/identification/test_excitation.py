"""The inputs keep to amplitude, band and travel."""

import math

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.identification import ExcitationParams, excitation_rad_s, predicted_travel_rad


def test_white_sequence_has_the_stated_mean_and_rms_and_stays_one_sided() -> None:
    params = ExcitationParams()
    sequence = excitation_rad_s(params, random_stream(1, "excitation"))
    assert np.mean(sequence) == pytest.approx(params.mean_rad_s, rel=1e-9)
    assert np.std(sequence) == pytest.approx(params.rms_rad_s, rel=1e-9)
    assert np.min(sequence) > 0.0


def test_multisine_has_its_power_in_the_band_only() -> None:
    params = ExcitationParams(kind="multisine", low_hz=0.5, high_hz=8.0, mean_rad_s=0.0)
    sequence = excitation_rad_s(params, random_stream(1, "excitation"))
    power = np.abs(np.fft.rfft(sequence)) ** 2
    frequency = np.fft.rfftfreq(params.samples, params.sample_s)
    outside = (frequency < 0.49) | (frequency > 8.01)
    assert np.sum(power[outside]) < 1e-20 * np.sum(power)


def test_peak_is_never_exceeded() -> None:
    params = ExcitationParams(kind="multisine", mean_rad_s=0.0, rms_rad_s=4e-4, peak_rad_s=7e-4)
    assert np.max(np.abs(excitation_rad_s(params, random_stream(1, "excitation")))) <= 7e-4


def test_predicted_travel_is_the_integral_of_the_rate() -> None:
    rate = np.array([1.0, 1.0, -4.0, 1.0])
    assert predicted_travel_rad(rate, 0.5) == (-1.0, 1.0)


def test_rms_beyond_the_peak_is_refused() -> None:
    with pytest.raises(ValueError, match=r"together must be <= 0\.001"):
        ExcitationParams(mean_rad_s=math.radians(0.05), rms_rad_s=math.radians(0.03), peak_rad_s=0.001)


def test_a_band_above_half_the_sampling_rate_is_refused() -> None:
    with pytest.raises(ValueError, match=r"high_hz=30\.0 must be <= 25\.0"):
        ExcitationParams(kind="multisine", high_hz=30.0)
