"""Averaged response and coherence against the planted system and closed forms."""

import numpy as np
import pytest
import scipy.signal

from rf_pointing.identification.spectra import FrequencyResponse, frequency_response

SAMPLE_S = 0.02


def test_estimate_agrees_with_scipys_cross_spectrum(sequences: tuple[np.ndarray, np.ndarray]) -> None:
    inputs, outputs = sequences
    ours = frequency_response(inputs, outputs, SAMPLE_S)
    window = np.hanning(inputs.shape[1])
    options = {"fs": 1.0 / SAMPLE_S, "window": window, "nperseg": inputs.shape[1], "detrend": "linear"}
    cross = np.mean([scipy.signal.csd(u, y, **options)[1] for u, y in zip(inputs, outputs, strict=True)], axis=0)
    power = np.mean([scipy.signal.welch(u, **options)[1] for u in inputs], axis=0)
    np.testing.assert_allclose(ours.response[1:], (cross / power)[1:], rtol=1e-9)


def test_coherence_of_independent_noise_is_signal_over_total() -> None:
    random = np.random.default_rng(4)
    inputs = random.standard_normal((60, 1024))
    outputs = inputs + 0.5 * random.standard_normal((60, 1024))
    coherence = frequency_response(inputs, outputs, SAMPLE_S).coherence
    assert np.mean(coherence[5:-5]) == pytest.approx(1.0 / 1.25, abs=0.01)


def test_without_coherence_there_is_no_valid_band() -> None:
    random = np.random.default_rng(4)
    response = frequency_response(random.standard_normal((50, 256)), random.standard_normal((50, 256)), SAMPLE_S)
    with pytest.raises(ValueError, match=r"least_coherence=0\.9 is reached at no frequency"):
        response.valid_band_hz(0.9)


def test_unequal_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="must be equal"):
        frequency_response(np.zeros((2, 64)), np.zeros((3, 64)), SAMPLE_S)


@pytest.mark.parametrize("least", [-0.1, 1.1])
def test_a_coherence_that_none_can_have_is_no_bound(least: float) -> None:
    response = frequency_response(
        np.random.default_rng(1).standard_normal((2, 64)), np.ones((2, 64)).cumsum(1), SAMPLE_S
    )
    with pytest.raises(ValueError, match=f"least_coherence={least} must be"):
        response.valid(least)


@pytest.mark.parametrize("bound", [0.0, 1.0])
def test_either_end_of_the_coherence_is_a_bound(bound: float) -> None:
    response = FrequencyResponse(np.arange(3.0), np.ones(3, dtype=np.complex128), np.array([0.0, 0.5, 1.0]))
    assert response.valid(bound).tolist() == [bound == 0.0, bound == 0.0, True]


def test_the_longest_stretch_counts_in_decades_and_leaves_zero_frequency_out() -> None:
    """From 2 to 4 is an octave, from 10 to 15 less, although it holds more lines; 0 would be infinitely many."""
    frequency = np.arange(16.0)
    coherence = np.where(np.isin(frequency, [0, 2, 3, 4, 10, 11, 12, 13, 14, 15]), 0.9, 0.1)
    response = FrequencyResponse(frequency, np.ones(16, dtype=np.complex128), coherence)
    assert response.valid_band_hz(0.8) == (2.0, 4.0)
    assert response.valid_band_hz(0.9) == (2.0, 4.0)


def test_one_line_without_coherence_ends_a_stretch() -> None:
    coherence = np.full(20, 0.9)
    coherence[[1, 3, 9, 18]] = 0.1
    response = FrequencyResponse(np.arange(20.0), np.ones(20, dtype=np.complex128), coherence)
    # From 10 to 17 is less than from 4 to 8 on a logarithmic scale.
    assert response.valid_band_hz(0.8) == (4.0, 8.0)


def test_a_coherence_of_eight_tenths_is_asked_for_unless_said_otherwise() -> None:
    frequency, coherence = np.arange(6.0), np.array([0.9, 0.79, 0.8, 0.81, 0.85, 0.7])
    response = FrequencyResponse(frequency, np.ones(6, dtype=np.complex128), coherence)
    assert response.valid().tolist() == [True, False, True, True, True, False]
    assert response.valid_band_hz() == (2.0, 4.0)


def test_the_response_belongs_to_the_lines_of_a_sequence_up_to_half_the_sampling_rate() -> None:
    inputs = np.random.default_rng(3).standard_normal((2, 100))
    found = frequency_response(inputs, -3.0 * inputs, SAMPLE_S)
    np.testing.assert_allclose(found.frequency_hz, np.arange(51) / (100 * SAMPLE_S))
    np.testing.assert_allclose(found.response[1:], -3.0, rtol=1e-9)
    np.testing.assert_allclose(found.coherence[1:], 1.0, rtol=1e-9)
