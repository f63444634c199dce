"""Noise density next to a signal, and what is not noise: lines, and steps of the gain.

Each report has its own density, the mean of the bins that are not a line; the average of several
reports is used until a report differs by more than chance: then gain or noise has stepped, and the
average begins anew.  C/N0 is a ratio, so a step of the gain leaves it as it is.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import BoolArray
from rf_pointing.receiver.spectrum import HANN_CORRELATION

LINE, LINE_SIGMAS = 3.0, 4.15
"""Bins above so many medians are lines; noise gets there once in 1e5 bins."""
STEP_SIGMAS, STEP_SHARE = 6.0, 0.05
DC_BINS = 3
LINE_REPORTED = 8.0


@dataclass(frozen=True, slots=True)
class Line:
    """A line that is not the signal: where, from the predicted frequency, and how strong."""

    offset_hz: float
    level_db_hz: float

    def __str__(self) -> str:
        at = f"{1e-3 * self.offset_hz:+.2f} kHz from the predicted frequency"
        return f"a line of {self.level_db_hz:.0f} dB-Hz at {at}"


class NoiseDensity:
    """Mean power of a bin of noise, averaged over `reports` (time constant over period)."""

    def __init__(self, reports: float) -> None:
        self._reports = max(reports, 1.0)
        self._average, self._count, self._weight = 0.0, 0, 1.0
        self.steps = 0
        self.step_db = 0.0
        self.stepped = False
        """Whether gain or noise has stepped in the newest report."""
        self.sigma = math.inf
        """Relative standard deviation of the density in use."""

    def take(self, power: NDArray[np.float32], usable: BoolArray, blocks: int) -> float:
        """Take the mean spectrum of a report over `blocks`; return the density to use for it."""
        bins = power[usable & (power > 0.0)]
        if not len(bins):
            return self._average
        quiet = bins[bins < line_ratio(blocks) * np.median(bins)]
        density = float(np.mean(quiet, dtype=np.float64))
        sigma = math.sqrt(HANN_CORRELATION / (len(quiet) * blocks))
        ratio = density / self._average if self._count else 1.0
        self.stepped = (
            abs(ratio - 1.0) > max(STEP_SIGMAS * math.hypot(sigma, self.sigma), STEP_SHARE)
            and self._count > 0
        )
        if self.stepped:
            self.steps += 1
            self.step_db = 10.0 * math.log10(ratio)
            self._count = 0
        self._count += 1
        share = max(1.0 / self._count, 1.0 / self._reports)
        self._average = (
            density if self._count == 1 else self._average + share * (density - self._average)
        )
        self._weight = 1.0 if self._count == 1 else (1.0 - share) ** 2 * self._weight + share**2
        self.sigma = sigma * math.sqrt(self._weight)
        return self._average


def line_ratio(blocks: int) -> float:
    """Return how many medians a bin that averages so many blocks exceeds as a line."""
    # Cube roots of a gamma variate are nearly normal (Wilson and Hilferty).  Cut at LINE, one
    # block of noise would lose 12 % of its bins, and read 1.5 dB low.
    middle = 1.0 - 1.0 / (9.0 * blocks)
    return max(LINE, (1.0 + LINE_SIGMAS / (3.0 * math.sqrt(blocks) * middle)) ** 3)


def strongest_line(
    power: NDArray[np.float32], usable: BoolArray, bin_hz: float, middle: int
) -> Line | None:
    """Return the strongest line of a mean spectrum among the usable bins, None without one."""
    known = usable & (power > 0.0)
    if not np.any(known):
        return None
    median = float(np.median(power[known]))
    at = int(np.argmax(np.where(known, power, 0.0)))
    ratio = float(power[at]) / median
    if ratio < LINE_REPORTED:
        return None
    return Line((at - middle) * bin_hz, 10.0 * math.log10(1.5 * bin_hz * ratio))
