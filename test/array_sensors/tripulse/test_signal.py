import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.signal import (
    TripulseFrame,
    TripulseSignalParams,
    segment_beams,
    segment_times_s,
)


def test_segments_follow_the_pattern_and_their_middles_the_samples() -> None:
    signal = TripulseSignalParams(pattern="SxSy", cycles=2)
    np.testing.assert_array_equal(segment_beams(signal), [0, 1, 0, 2, 0, 1, 0, 2])
    samples_s = np.arange(signal.samples).reshape(8, -1) / signal.sample_rate_hz
    np.testing.assert_allclose(segment_times_s(signal), np.mean(samples_s, axis=1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"pattern": "Sx"}, "pattern='Sx'"), ({"pattern": "Sxyz"}, "pattern='Sxyz'"), ({"scheme": "one_tone"}, "scheme")],
)
def test_signals_that_cannot_be_received_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TripulseSignalParams(**changes)


def test_frames_without_finite_time_or_steering_are_refused() -> None:
    for t_s, steering in ((np.nan, np.zeros(2)), (0.0, np.array([np.inf, 0.0]))):
        with pytest.raises(ValueError, match="finite"):
            TripulseFrame(t_s=t_s, station="a", sequence=1, steering=steering, samples=np.zeros(1, dtype=complex))


def test_noise_is_measured_inside_the_band_and_tones_are_told_apart_by_whole_turns() -> None:
    """Six separations must be less than the sample rate; a segment must hold a whole number of turns."""
    TripulseSignalParams(tone_separation_hz=6e5)
    TripulseSignalParams(tone_separation_hz=1e5)
    for changes, words in (
        ({"sample_rate_hz": 2.4e6, "samples_per_segment": 24}, "sample_rate_hz=2400000.0 must be > 6 tone_separation"),
        ({"tone_separation_hz": 7e5}, "sample_rate_hz=4000000.0 must be > 6 tone_separation"),
        ({"tone_separation_hz": 1.5e5}, "does not separate the tones"),
        ({"tone_separation_hz": 1e5 * (1.0 + 1e-5)}, "does not separate the tones"),
        ({"tone_separation_hz": 1.0}, "does not separate the tones"),
    ):
        with pytest.raises(ValueError, match=words):
            TripulseSignalParams(**changes)
    # Rounding of a segment's length is no fraction of a turn.
    TripulseSignalParams(tone_separation_hz=1e5 * (1.0 + 1e-8))


def test_lengths_follow_from_pattern_and_cycles() -> None:
    signal = TripulseSignalParams(pattern="SxSSy", cycles=3, samples_per_segment=16, sample_rate_hz=3.2e6)
    assert signal.segment_s == pytest.approx(5e-6)
    assert (signal.segments, signal.samples) == (15, 240)
    assert [signal.beam_time_s(beam) for beam in range(3)] == pytest.approx([45e-6, 15e-6, 15e-6])
    np.testing.assert_array_equal(segment_beams(signal), [0, 1, 0, 0, 2] * 3)
