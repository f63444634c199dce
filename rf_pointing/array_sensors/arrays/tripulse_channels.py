"""First stage of the station's receiver: find the common frequency shift, separate the tones, measure the noise.

Every segment is mixed with each nominal frequency and averaged over its length; tones a whole number of turns per
segment apart do not leak into each other once the shift common to all of them is taken out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.tripulse_signal import TripulseSignalParams, segment_beams

__all__ = ["Channels", "channel_values", "channelise", "find_shift_hz"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

PADDING = 8
REFINEMENTS = 2
QUIET = (-3, -2, 2, 3)
"""Channels without a tone, in tone separations from f_t."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channels:
    """Averages over each segment (n,) at f_t and at both references, and the noise density found beside them.

    `noise_density` is N_0 in units of sample power times seconds; the variance of a segment's average is N_0 / segment.
    """

    tone: ComplexArray
    lower_reference: ComplexArray
    upper_reference: ComplexArray
    noise_density: float
    shift_hz: float


def channelise(signal: TripulseSignalParams, samples: ComplexArray, largest_shift_hz: float) -> Channels:
    """Return the segment averages of a frame (n,), its common frequency shift taken out.

    Raises
    ------
    ValueError : if the frame has the wrong length, is not finite, or holds no signal at all.
    """
    _require_frame(signal, samples)
    shift_hz = find_shift_hz(signal, samples, largest_shift_hz)
    for _ in range(REFINEMENTS if signal.scheme == "two_tone" else 0):
        lower, upper = channel_values(signal, samples, shift_hz, (-1, 1)).T
        shift_hz += _slope_hz(lower * upper, signal.segment_s) / 2.0
    lower, tone, upper, *quiet = channel_values(signal, samples, shift_hz, (-1, 0, 1, *QUIET)).T
    noise_density = float(np.mean(np.abs(quiet) ** 2)) * signal.segment_s
    if not noise_density > 0.0:
        raise ValueError("the frame holds no noise: a receiver that is connected always has some")
    return Channels(
        tone=tone,
        lower_reference=lower,
        upper_reference=upper,
        noise_density=noise_density,
        shift_hz=shift_hz,
    )


def channel_values(
    signal: TripulseSignalParams, samples: ComplexArray, shift_hz: float, channels: tuple[int, ...]
) -> ComplexArray:
    """Return the averages of every segment (segments, channels) at `shift_hz` plus whole tone separations."""
    time_s = np.arange(signal.samples) / signal.sample_rate_hz
    mixed = (samples * np.exp(-2j * np.pi * shift_hz * time_s)).reshape(signal.segments, signal.samples_per_segment)
    # A separation makes whole turns per segment, so that one bank of tones serves all segments.
    turns = np.outer(time_s[: signal.samples_per_segment], signal.tone_separation_hz * np.array(channels))
    return np.asarray(mixed @ np.exp(-2j * np.pi * turns) / signal.samples_per_segment)


def find_shift_hz(signal: TripulseSignalParams, samples: ComplexArray, largest_shift_hz: float) -> float:
    """Return the frequency shift within +-`largest_shift_hz` that explains the spectrum best.

    Two tones: where both references stand, judged by the weaker, so that the tripulse tone cannot pass for one
    (up to 14 dB above them; further up, the lines of its own switching reach the references).
    Interleaved: the strongest line of the sum segments.
    """
    if not 0.0 < largest_shift_hz < 0.5 * signal.tone_separation_hz:
        raise ValueError(f"largest_shift_hz={largest_shift_hz} must be > 0 and < {0.5 * signal.tone_separation_hz}")
    two_tone = signal.scheme == "two_tone"
    gate = np.repeat(segment_beams(signal) == 0, signal.samples_per_segment)
    length = PADDING * 2 ** int(np.ceil(np.log2(signal.samples)))
    power = np.abs(np.fft.fft(samples if two_tone else samples * gate, length)) ** 2
    bin_hz = signal.sample_rate_hz / length
    reach = max(1, int(largest_shift_hz / bin_hz))
    shifts = np.arange(-reach, reach + 1)
    if two_tone:
        apart = round(signal.tone_separation_hz / bin_hz)
        score = np.minimum(power[(shifts - apart) % length], power[(shifts + apart) % length])
    else:
        score = power[shifts % length]
    return float(shifts[int(np.argmax(score))] * bin_hz)


def _slope_hz(values: ComplexArray, spacing_s: float) -> float:
    """Return the frequency of a sequence of phasors from the products of neighbours."""
    return float(np.angle(np.sum(values[1:] * values[:-1].conj()))) / (2.0 * np.pi * spacing_s)


def _require_frame(signal: TripulseSignalParams, samples: ComplexArray) -> None:
    if samples.shape != (signal.samples,):
        raise ValueError(f"samples has shape {samples.shape}, must be ({signal.samples},)")
    if not np.all(np.isfinite(samples)):
        raise ValueError("samples must be finite")
