import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.signal import (
    TripulseFrame,
    TripulseSignalParams,
    segment_beams,
    segment_times_s,
)


def test_default_frame_gives_every_beam_80_microseconds() -> None:
    signal = TripulseSignalParams()
    for beam in range(3):
        assert signal.beam_time_s(beam) == pytest.approx(80e-6)


def test_segments_follow_the_pattern_and_their_middles_the_samples() -> None:
    signal = TripulseSignalParams(pattern="SxSy", cycles=2)
    np.testing.assert_array_equal(segment_beams(signal), [0, 1, 0, 2, 0, 1, 0, 2])
    samples_s = np.arange(signal.samples).reshape(8, -1) / signal.sample_rate_hz
    np.testing.assert_allclose(segment_times_s(signal), np.mean(samples_s, axis=1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pattern": "Sx"}, "pattern='Sx'"),
        ({"pattern": "Sxyz"}, "pattern='Sxyz'"),
        ({"tone_separation_hz": 3.9e5}, "does not separate the tones"),
        ({"tone_separation_hz": 1e3}, "does not separate the tones"),
        ({"tone_separation_hz": 8e5}, "sample_rate_hz"),
        ({"scheme": "one_tone"}, "scheme"),
    ],
)
def test_signals_that_cannot_be_received_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TripulseSignalParams(**changes)


def test_frames_without_finite_time_or_steering_are_refused() -> None:
    for t_s, steering in ((np.nan, np.zeros(2)), (0.0, np.array([np.inf, 0.0]))):
        with pytest.raises(ValueError, match="finite"):
            TripulseFrame(t_s=t_s, station="a", sequence=1, steering=steering, samples=np.zeros(1, dtype=complex))
