"""Total power in a band: for carriers that are suppressed or modulated.

    C = P - N0 B,   P = sum over the band's bins |S|^2 / (0.375 N^2)

B is the stated band, N0 the density next to it.  The band is put where it holds most power, once
that stands out of the noise; until then it is where it is predicted.  The standard deviation comes
from the differences of successive blocks, which a slow change of the level does not reach.  Where
noise dominates, its bound is N0 sqrt(B / T); a constant envelope is known better.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import Array
from rf_pointing.receiver.params import SignalSearchParams
from rf_pointing.receiver.spectrum import HANN_CORRELATION, HANN_POWER, Layout

FOLLOW_S = 1.0
SCATTER_S = 2.0


def band_bound(ratio_hz: float, band_hz: float, seconds: float) -> float:
    """Return the standard deviation of C/N0 of an ideal radiometer, noise density known."""
    return (ratio_hz + band_hz) / math.sqrt(band_hz * seconds)


class BandPower:
    """Follows a band and measures its power, block by block."""

    def __init__(self, params: SignalSearchParams, layout: Layout) -> None:
        self._params, self._layout = params, layout
        self._half = max(1, round(0.5 * params.band_hz / layout.bin_hz))
        self._mean: Array | None = None
        self._looks = 0.0
        self._before: float | None = None
        self._scatter, self._count = 0.0, 0
        self.centre_bins = 0.0
        self.found = False

    @property
    def band_hz(self) -> float:
        """The band that is measured, whole bins."""
        return (2 * self._half + 1) * self._layout.bin_hz

    @property
    def half_bins(self) -> int:
        """Bins of the band on either side of its middle."""
        return self._half

    def take(self, power: NDArray[np.float32]) -> float:
        """Take a block's spectrum around the predicted frequency; return the power in the band."""
        share = min(1.0, self._layout.hop_s / FOLLOW_S)
        self._looks = (1.0 - share) * self._looks + 1.0
        self._mean = (
            power.astype(np.float64)
            if self._mean is None
            else self._mean + (power - self._mean) / self._looks
        )
        middle = len(power) // 2 + round(self.centre_bins)
        inside = power[middle - self._half : middle + self._half + 1]
        value = float(np.sum(inside, dtype=np.float64)) / (HANN_POWER * self._layout.block**2)
        if self._before is not None:
            self._count += 1
            weight = max(min(1.0, self._layout.hop_s / SCATTER_S), 1.0 / self._count)
            self._scatter += weight * (0.5 * (value - self._before) ** 2 - self._scatter)
        self._before = value
        return value

    def sigma(self, power: float, blocks: int, step_db: float = 0.0) -> float:
        """Return the standard deviation of a mean over `blocks`."""
        if step_db:
            # Differences from before a step are of another scale.
            self._before, self._count, self._scatter = None, 0, 0.0
        if self._count < 10:
            return power * math.sqrt(HANN_CORRELATION / (2 * self._half + 1) / blocks)
        return math.sqrt(self._scatter / blocks)

    def forget(self) -> None:
        """Begin anew with the average in which the band is looked for."""
        self._mean, self._looks = None, 0.0

    def follow(self, noise: float) -> None:
        """Put the band where it holds most power; `noise` is the mean power of a bin of noise."""
        if self._mean is None or noise <= 0.0 or self._looks < 5.0:
            return
        middle, reach = (
            len(self._mean) // 2,
            max(1, round(self._params.uncertainty_hz / self._layout.bin_hz)),
        )
        sums = np.concatenate([[0.0], np.cumsum(self._mean)])
        width = 2 * self._half + 1
        begins = np.arange(middle - reach - self._half, middle + reach - self._half + 1)
        begins = begins[(begins >= 0) & (begins + width < len(sums))]
        held = sums[begins + width] - sums[begins]
        sigma = noise * math.sqrt(HANN_CORRELATION * width / self._looks)
        at = int(np.argmax(held))
        limit = max(
            self._params.lock_sigmas, math.sqrt(2.0 * math.log(1e4 * len(begins) / width + 1e4))
        )
        self.found = float(held[at]) - noise * width > limit * sigma
        if self.found:
            # A flat top has no one best place: the middle of those that are as good.
            good = np.flatnonzero(held >= held[at] - sigma)
            self.centre_bins += 0.3 * (
                float(np.mean(begins[good])) + self._half - middle - self.centre_bins
            )
