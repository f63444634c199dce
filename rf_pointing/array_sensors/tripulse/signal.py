"""The Tripulse signal on the air: tones, order of the beams, and one received frame of samples.

A tripulse tone at f_t steps through the beams segment by segment in the order of `pattern`,
`cycles` times over.  With the scheme "two_tone" two reference tones at f_t -+ separation, f_r1 +
f_r2 = 2 f_t, run on a static beam through the whole frame; with "interleaved" the sum segments
themselves are the reference (TRIPULSE section 1).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter, require_finite

SEGMENT_BEAMS = "Sxy"
"""Letters of a pattern, in the order of the beams: sum, delta x, delta y."""


@dataclass(frozen=True, kw_only=True)
class TripulseSignalParams(Params):
    """Signal agreed on by satellite and stations; the defaults give each beam 80 microseconds."""

    scheme: str = parameter(
        "two_tone", "phase reference of the beams", choices=("two_tone", "interleaved")
    )
    carrier_hz: float = parameter(12e9, "frequency of the tripulse tone f_t", low=1e8, high=1e11)
    tone_separation_hz: float = parameter(
        4e5, "distance of the reference tones from f_t", low=1.0, high=1e9
    )
    sample_rate_hz: float = parameter(4e6, "complex samples per second", low=10.0, high=1e10)
    samples_per_segment: int = parameter(
        40, "samples of one segment of one beam", low=8, high=1000000
    )
    pattern: str = parameter("Sxy", "order of the beams in a cycle: S sum, x and y the differences")
    cycles: int = parameter(8, "repetitions of the pattern in a frame", low=1, high=100000)

    def check_together(self) -> None:
        """Refuse patterns without all three beams and tones that a segment does not separate."""
        if set(self.pattern) != set(SEGMENT_BEAMS):
            raise ValueError(f"pattern={self.pattern!r} must contain S, x and y and nothing else")
        turns = self.tone_separation_hz * self.segment_s
        # Whole turns per segment: otherwise every tone leaks into the channels of the others.
        if turns < 0.5 or not math.isclose(turns, round(turns), abs_tol=1e-6):
            raise ValueError(
                f"tone_separation_hz={self.tone_separation_hz} times the segment of {self.segment_s} s gives {turns} "
                "turns, must be a whole number >= 1: the segment does not separate the tones"
            )
        # Quiet channels lie up to three separations on either side of f_t; beyond Nyquist they
        # would alias.
        if 6.0 * self.tone_separation_hz >= self.sample_rate_hz:
            raise ValueError(
                f"sample_rate_hz={self.sample_rate_hz} must be > 6 tone_separation_hz={self.tone_separation_hz}: "
                "the noise is measured three separations from f_t"
            )

    @property
    def segment_s(self) -> float:
        """Length of one segment."""
        return self.samples_per_segment / self.sample_rate_hz

    @property
    def segments(self) -> int:
        """Number of segments in a frame."""
        return self.cycles * len(self.pattern)

    @property
    def samples(self) -> int:
        """Number of samples in a frame."""
        return self.segments * self.samples_per_segment

    def beam_time_s(self, beam: int) -> float:
        """Return the total time of beam 0 (sum), 1 (delta x) or 2 (delta y) in a frame."""
        return self.cycles * self.pattern.count(SEGMENT_BEAMS[beam]) * self.segment_s


@dataclass(frozen=True, slots=True, kw_only=True)
class TripulseFrame:
    """One frame as received at a station.

    Complex baseband samples (n,) centred on f_t, from `t_s` on.  `steering` (2,) are the
    projections that the satellite's beams were steered to (telemetry); phases count exp(+j w t).
    """

    t_s: float
    station: str
    sequence: int
    steering: NDArray[np.float64]
    samples: NDArray[np.complex128]

    def __post_init__(self) -> None:
        require_finite("t_s", self.t_s)
        require_finite("steering", self.steering)


def segment_beams(signal: TripulseSignalParams) -> NDArray[np.intp]:
    """Return the beam of every segment of a frame: 0 sum, 1 delta x, 2 delta y."""
    return np.array(
        [SEGMENT_BEAMS.index(letter) for letter in signal.pattern] * signal.cycles, dtype=np.intp
    )


def segment_times_s(signal: TripulseSignalParams) -> NDArray[np.float64]:
    """Return the middle of every segment, counted from the first sample."""
    middles = (np.arange(signal.segments) + 0.5) * signal.segment_s - 0.5 / signal.sample_rate_hz
    return np.asarray(middles, dtype=np.float64)
