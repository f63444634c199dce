"""Coherent detection with two reference tones: the phase of f_t is the mean of the phases of f_r1 and f_r2.

Doppler and clock phases are linear in frequency, and f_r1 + f_r2 = 2 f_t, so half the phase of r_1 r_2 is the phase of
the tripulse tone but for a constant (TRIPULSE section 1).  Halving leaves a sign open.  It is common to all pulses, and
cancels in the ratios, as long as the phase is followed from each segment to the next; once lock is lost in between, the
ratio may have either sign, so a loss is reported and never bridged.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["ReferencePhase", "detect_with_references", "reference_phase"]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LARGEST_STEP_RAD = 2.0
"""Of the phase of r_1 r_2 between segments; noise and clocks move it by tenths, a slip of r_1 or r_2 by pi."""
SMALLEST_AMPLITUDE = 0.3
"""Of a reference in one segment against its median over the frame."""
SMALLEST_SNR = 10.0
"""Of each reference in one segment: 10 dB, below which its phase cannot be followed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferencePhase:
    """Phase of the tripulse tone (n,) but for a constant; `lost` says where lock was lost first, or is empty."""

    phase_rad: Array
    lost: str


def reference_phase(lower: ComplexArray, upper: ComplexArray, noise_variance: float) -> ReferencePhase:
    """Return the followed half phase of lower * upper; `noise_variance` is that of each reference's values."""
    product = lower * upper
    steps = np.angle(product[1:] * product[:-1].conj())
    phase = 0.5 * (np.angle(product[0]) + np.concatenate([[0.0], np.cumsum(steps)]))
    return ReferencePhase(phase_rad=phase, lost=_first_loss(lower, upper, steps, noise_variance))


def detect_with_references(
    tone: ComplexArray, lower: ComplexArray, upper: ComplexArray, noise_variance: float
) -> tuple[ComplexArray, str]:
    """Return the tripulse tone (n,) with the phase of the references taken out, and the reason of a lost lock or ""."""
    reference = reference_phase(lower, upper, noise_variance)
    return np.asarray(tone * np.exp(-1j * reference.phase_rad)), reference.lost


def _first_loss(lower: ComplexArray, upper: ComplexArray, steps: Array, noise_variance: float) -> str:
    for name, values in (("lower", lower), ("upper", upper)):
        amplitude = np.abs(values)
        median = float(np.median(amplitude))
        if median**2 < SMALLEST_SNR * noise_variance:
            return f"{name} reference has SNR {median**2 / noise_variance} in a segment, must be >= {SMALLEST_SNR}"
        faded = np.flatnonzero(amplitude < SMALLEST_AMPLITUDE * median)
        if len(faded):
            left = amplitude[faded[0]] / median
            return f"lost lock in segment {faded[0]}: {name} reference faded to {left} of its median"
    jumps = np.flatnonzero(np.abs(steps) > LARGEST_STEP_RAD)
    if len(jumps):
        first = int(jumps[0])
        return f"lost lock between segments {first} and {first + 1}: references jumped by {steps[first]} rad"
    return ""
