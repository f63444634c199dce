"""From a frame of samples to its tones: common frequency shift, channels, noise, phase reference.

Every segment is mixed with each nominal frequency and averaged over its length.  Tones a whole
number of turns per segment apart do not leak into each other once the shift common to all of them
is taken out.

Phase reference: Doppler and clock phases are linear in frequency, and f_r1 + f_r2 = 2 f_t, so half
the phase of r_1 r_2 is the phase of the tripulse tone but for a constant (TRIPULSE section 1).
Halving leaves a sign open.  It is common to all pulses and cancels in the ratios, as long as the
phase is followed from each segment to the next.  Once lock is lost in between, the ratio may have
either sign: a loss is reported and never bridged.
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams, segment_beams
from rf_pointing.core.types import Array, ComplexArray

# Zero padding of the spectrum: the line is found to an eighth of a bin, the segments refine it.
PADDING = 8
# Each pass removes the shift that the spectrum and the pass before left over.
REFINEMENTS = 2
QUIET = (-3, -2, 2, 3)
"""Channels without a tone, in tone separations from f_t."""
LARGEST_STEP_RAD = 2.0
"""Largest step of the phase of r_1 r_2 between segments; noise and clocks move it by tenths, a slip
of r_1 or r_2 by pi."""
SMALLEST_AMPLITUDE = 0.3
"""Least amplitude of a reference in one segment against its median over the frame."""
SMALLEST_SNR = 10.0
"""Least SNR of each reference in one segment: 10 dB, below which its phase cannot be followed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channels:
    """Averages over each segment (n,) at f_t and at both references, and the noise density found
    next to them.

    `noise_density` is N_0 in units of sample power times seconds; the variance of a segment's
    average is N_0 / segment.
    """

    tone: ComplexArray
    lower_reference: ComplexArray
    upper_reference: ComplexArray
    noise_density: float
    shift_hz: float


def channelise(
    signal: TripulseSignalParams, samples: ComplexArray, largest_shift_hz: float
) -> Channels:
    """Return the segment averages of a frame (n,), its common frequency shift taken out.

    Raises
    ------
    ValueError : if the frame has the wrong length, is not finite, or holds no signal at all.
    """
    _require_frame(signal, samples)
    shift_hz = find_shift_hz(signal, samples, largest_shift_hz)
    for _ in range(REFINEMENTS if signal.scheme == "two_tone" else 0):
        lower, upper = channel_values(signal, samples, shift_hz, (-1, 1)).T
        # The product of both references turns with twice the common shift and is free of the
        # modulation.
        shift_hz += _slope_hz(lower * upper, signal.segment_s) / 2.0
    lower, tone, upper, *quiet = channel_values(signal, samples, shift_hz, (-1, 0, 1, *QUIET)).T
    noise_density = float(np.mean(np.abs(quiet) ** 2)) * signal.segment_s
    # Every covariance divides by it; a receiver without any noise is not connected.
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
    """Return the averages of every segment (segments, channels) at `shift_hz` plus whole tone
    separations.
    """
    time_s = np.arange(signal.samples) / signal.sample_rate_hz
    mixed = (samples * np.exp(-2j * np.pi * shift_hz * time_s)).reshape(
        signal.segments, signal.samples_per_segment
    )
    # A separation makes whole turns per segment, so that one bank of tones serves all segments.
    turns = np.outer(
        time_s[: signal.samples_per_segment], signal.tone_separation_hz * np.array(channels)
    )
    return np.asarray(mixed @ np.exp(-2j * np.pi * turns) / signal.samples_per_segment)


def find_shift_hz(
    signal: TripulseSignalParams, samples: ComplexArray, largest_shift_hz: float
) -> float:
    """Return the frequency shift within +-`largest_shift_hz` that explains the spectrum best.

    Two tones: where both references stand, judged by the weaker, so that the tripulse tone cannot
    pass for one (up to 14 dB above them; further up, the lines of its own switching reach the
    references). Interleaved: the strongest line of the sum segments.
    """
    if not 0.0 < largest_shift_hz < 0.5 * signal.tone_separation_hz:
        raise ValueError(
            f"largest_shift_hz={largest_shift_hz} must be > 0 and < {0.5 * signal.tone_separation_hz}"
        )
    two_tone = signal.scheme == "two_tone"
    # Only the sum segments: with the delta segments the line would have sidelobes at the switching
    # rate.
    gate = np.repeat(segment_beams(signal) == 0, signal.samples_per_segment)
    length = PADDING * 2 ** int(np.ceil(np.log2(signal.samples)))
    power = np.abs(np.fft.fft(samples if two_tone else samples * gate, length)) ** 2
    bin_hz = signal.sample_rate_hz / length
    reach = max(1, int(largest_shift_hz / bin_hz))
    shifts = np.arange(-reach, reach + 1)
    if two_tone:
        apart = round(signal.tone_separation_hz / bin_hz)
        # The weaker of both references decides, so that the tripulse tone cannot pass for one of
        # them.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferencePhase:
    """Phase of the tripulse tone (n,) but for a constant.

    `lost` says where lock was lost first, or is empty.
    """

    phase_rad: Array
    lost: str


def reference_phase(
    lower: ComplexArray, upper: ComplexArray, noise_variance: float
) -> ReferencePhase:
    """Return the followed half phase of lower * upper.

    `noise_variance` is that of each reference's values.
    """
    product = lower * upper
    steps = np.angle(product[1:] * product[:-1].conj())
    phase = 0.5 * (np.angle(product[0]) + np.concatenate([[0.0], np.cumsum(steps)]))
    return ReferencePhase(phase_rad=phase, lost=_first_loss(lower, upper, steps, noise_variance))


def detect_with_references(
    tone: ComplexArray, lower: ComplexArray, upper: ComplexArray, noise_variance: float
) -> tuple[ComplexArray, str]:
    """Return the tripulse tone (n,) with the phase of the references taken out, and the reason of a
    lost lock or "".
    """
    reference = reference_phase(lower, upper, noise_variance)
    return np.asarray(tone * np.exp(-1j * reference.phase_rad)), reference.lost


def _first_loss(
    lower: ComplexArray, upper: ComplexArray, steps: Array, noise_variance: float
) -> str:
    for name, values in (("lower", lower), ("upper", upper)):
        amplitude = np.abs(values)
        median = float(np.median(amplitude))
        # Below it the phase of a segment may slip by pi unseen, and the ratio changes its sign.
        if median**2 < SMALLEST_SNR * noise_variance:
            return f"{name} reference has SNR {median**2 / noise_variance} in a segment, must be >= {SMALLEST_SNR}"
        faded = np.flatnonzero(amplitude < SMALLEST_AMPLITUDE * median)
        if len(faded):
            left = amplitude[faded[0]] / median
            return (
                f"lost lock in segment {faded[0]}: {name} reference faded to {left} of its median"
            )
    jumps = np.flatnonzero(np.abs(steps) > LARGEST_STEP_RAD)
    if len(jumps):
        first = int(jumps[0])
        return f"lost lock between segments {first} and {first + 1}: references jumped by {steps[first]} rad"
    return ""
