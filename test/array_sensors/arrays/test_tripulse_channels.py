import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.tripulse_channels import channelise, find_shift_hz
from rf_pointing.array_sensors.arrays.tripulse_signal import TripulseSignalParams, segment_beams
from rf_pointing.core import random_stream

LARGEST_HZ = 5e4


def composite(signal: TripulseSignalParams, shift_hz: float, beams: np.ndarray) -> np.ndarray:
    time_s = np.arange(signal.samples) / signal.sample_rate_hz
    sent = np.repeat(beams[segment_beams(signal)], signal.samples_per_segment)
    offsets = np.exp(2j * np.pi * signal.tone_separation_hz * time_s)
    references = offsets + offsets.conj() if signal.scheme == "two_tone" else 0.0
    return np.asarray((sent + references) * np.exp(2j * np.pi * shift_hz * time_s))


def noise(signal: TripulseSignalParams, variance: float) -> np.ndarray:
    return np.sqrt(variance / 2.0) * random_stream(1, "channels").normal(size=(signal.samples, 2)) @ [1.0, 1j]


@pytest.mark.parametrize("shift_hz", [-31234.5, 0.0, 17.0, 45000.0])
def test_tones_are_separated_exactly_under_any_shift(shift_hz: float) -> None:
    signal, beams = TripulseSignalParams(), np.array([2.0, 0.3j, -0.1j])
    found = channelise(signal, composite(signal, shift_hz, beams) + noise(signal, 1e-16), LARGEST_HZ)
    assert found.shift_hz == pytest.approx(shift_hz, abs=1e-3)
    np.testing.assert_allclose(np.abs(found.tone), np.abs(beams[segment_beams(signal)]), atol=1e-6)
    np.testing.assert_allclose(np.abs(found.lower_reference), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.abs(found.upper_reference), 1.0, atol=1e-6)


def test_tripulse_tone_14_db_above_the_references_does_not_pass_for_a_reference() -> None:
    signal = TripulseSignalParams()
    samples = composite(signal, 12e3, np.array([5.0, 0.5, 0.5]))
    assert find_shift_hz(signal, samples, 1.9e5) == pytest.approx(12e3, abs=500.0)


def test_interleaved_frames_are_found_by_their_sum_segments() -> None:
    signal = TripulseSignalParams(scheme="interleaved", pattern="SxSy")
    samples = composite(signal, -23e3, np.array([1.0, 0.1j, 0.1j]))
    assert find_shift_hz(signal, samples, LARGEST_HZ) == pytest.approx(-23e3, abs=500.0)


def test_noise_density_is_measured_beside_the_tones() -> None:
    signal = TripulseSignalParams(cycles=400)
    variance = 0.04
    found = channelise(signal, composite(signal, 8e3, np.ones(3)) + noise(signal, variance), LARGEST_HZ)
    # 4800 complex values: 1.4 % each.
    assert found.noise_density == pytest.approx(variance / signal.sample_rate_hz, rel=0.06)


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (np.ones(10, dtype=complex), "shape"),
        (np.full(960, np.nan, dtype=complex), "finite"),
        (np.zeros(960, dtype=complex), "no noise"),
    ],
)
def test_frames_that_cannot_be_real_are_refused(samples: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        channelise(TripulseSignalParams(), samples, LARGEST_HZ)


def test_search_wider_than_the_tone_spacing_is_refused() -> None:
    with pytest.raises(ValueError, match="largest_shift_hz"):
        find_shift_hz(TripulseSignalParams(), np.ones(960, dtype=complex), 3e5)
