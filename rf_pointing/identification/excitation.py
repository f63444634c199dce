"""Rate inputs that shake the antenna: white noise and multisine, bounded in amplitude and in travel.

The published experiment drove one axis with white noise between 0.1 and 1.3 V, always to one side:
the friction never reverses and the travel limits the number of sequences (DSS13-ID Sec. II-C).
`mean_rad_s` is that one-sided part.  The travel is known before the antenna moves: the input's own
integral tells where a perfect antenna would go.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter, require_between

__all__ = ["ExcitationParams", "excitation_rad_s", "predicted_travel_rad"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ExcitationParams(Params):
    """One sequence of rate input."""

    kind: str = parameter("white", "white noise or multisine", choices=("white", "multisine"))
    samples: int = parameter(8192, "samples per sequence", low=64, high=1_048_576)
    sample_s: float = parameter(0.02, "time between samples", low=1e-3, high=1.0)
    mean_rad_s: float = parameter(math.radians(0.056), "mean of the rate input", low=-0.1, high=0.1)
    rms_rad_s: float = parameter(math.radians(0.028), "rms of the rate input about its mean", low=1e-9, high=0.1)
    peak_rad_s: float = parameter(
        math.radians(0.2), "largest rate input; what exceeds it is clipped", low=1e-9, high=0.2
    )
    idle_rate_rad_s: float = parameter(
        0.0, "constant rate of the other axis, which keeps its friction from sticking", low=-1e-3, high=1e-3
    )
    low_hz: float = parameter(0.01, "lowest frequency of the multisine", low=1e-5, high=100.0)
    high_hz: float = parameter(12.0, "highest frequency of the multisine", low=1e-4, high=500.0)

    def check_together(self) -> None:
        """Refuse a mean beyond the peak and a multisine band that is empty or above half the sampling rate."""
        if abs(self.mean_rad_s) + self.rms_rad_s > self.peak_rad_s:
            raise ValueError(
                f"mean_rad_s={self.mean_rad_s} and rms_rad_s={self.rms_rad_s} together must be <= {self.peak_rad_s}"
            )
        if self.low_hz >= self.high_hz:
            raise ValueError(f"low_hz={self.low_hz} must be < high_hz={self.high_hz}")
        if self.kind == "multisine" and self.high_hz > 0.5 / self.sample_s:
            raise ValueError(f"high_hz={self.high_hz} must be <= {0.5 / self.sample_s} (half the sampling rate)")

    @property
    def duration_s(self) -> float:
        """Length of one sequence."""
        return self.samples * self.sample_s


def excitation_rad_s(params: ExcitationParams, random: np.random.Generator) -> Array:
    """Return one sequence (samples,) in rad/s; white noise is uniform, so it stays within sqrt(3) times its rms."""
    if params.kind == "white":
        sequence = random.uniform(-1.0, 1.0, params.samples)
    else:
        sequence = _multisine(params, random)
    sequence = sequence - np.mean(sequence)
    sequence *= params.rms_rad_s / np.sqrt(np.mean(sequence**2))
    return np.clip(params.mean_rad_s + sequence, -params.peak_rad_s, params.peak_rad_s)


def predicted_travel_rad(rate_rad_s: Array, sample_s: float) -> tuple[float, float]:
    """Return how far a rate input carries the axis below and above its start, (lowest, highest), lowest <= 0."""
    require_between("sample_s", sample_s, 1e-6, None)
    path = np.cumsum(rate_rad_s) * sample_s
    return min(0.0, float(np.min(path))), max(0.0, float(np.max(path)))


def _multisine(params: ExcitationParams, random: np.random.Generator) -> Array:
    """Return equal amplitudes on every line of the band with random phases (periodic in the sequence)."""
    frequency = np.fft.rfftfreq(params.samples, params.sample_s)
    spectrum = np.zeros(len(frequency), dtype=np.complex128)
    band = (frequency >= params.low_hz) & (frequency <= params.high_hz)
    spectrum[band] = np.exp(2j * np.pi * random.random(int(np.count_nonzero(band))))
    return np.fft.irfft(spectrum, params.samples)
