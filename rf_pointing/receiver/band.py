"""Total power in a band: for carriers that are suppressed or modulated.

    C = P - N0 B,   P = sum over the band's bins |S|^2 / (0.375 N^2)

B is the stated band, N0 the density next to it.  The band is put where it holds most power, once
that stands out of the noise in an average over 1 s, or in one over 16 s out of the bands next to
it, which no slope of the receiver's response does; until then it is where it is predicted.  The
standard deviation comes from the differences of successive blocks, which a slow change of the level
does not reach.  Where noise dominates, its bound is N0 sqrt(B / T); a constant envelope is known
better.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import Array
from rf_pointing.receiver.params import SignalSearchParams
from rf_pointing.receiver.spectrum import HANN_CORRELATION, HANN_POWER, Layout

FOLLOW_S, WEAK_S = 1.0, 16.0
SCATTER_S = 2.0


def band_bound(ratio_hz: float, band_hz: float, seconds: float) -> float:
    """Return the standard deviation of C/N0 of an ideal radiometer, noise density known."""
    return (ratio_hz + band_hz) / math.sqrt(band_hz * seconds)


class BandPower:
    """Follows a band and measures its power, block by block."""

    def __init__(self, params: SignalSearchParams, layout: Layout) -> None:
        self._params, self._layout = params, layout
        self.half_bins = max(1, round(0.5 * params.band_hz / layout.bin_hz))
        self._fast, self._slow = (_Average(layout.hop_s / each) for each in (FOLLOW_S, WEAK_S))
        self._strong = False
        self._before: float | None = None
        self._scatter, self._count = 0.0, 0
        self.centre_bins = 0.0
        self.found = False

    @property
    def band_hz(self) -> float:
        """The band that is measured, whole bins."""
        return (2 * self.half_bins + 1) * self._layout.bin_hz

    def take(self, power: NDArray[np.float32]) -> float:
        """Take a block's spectrum around the predicted frequency; return the power in the band."""
        self._fast.take(power)
        self._slow.take(power)
        middle = len(power) // 2 + round(self.centre_bins)
        inside = power[middle - self.half_bins : middle + self.half_bins + 1]
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
            return power * math.sqrt(HANN_CORRELATION / (2 * self.half_bins + 1) / blocks)
        return math.sqrt(self._scatter / blocks)

    def forget(self) -> None:
        """Begin anew with the averages in which the band is looked for."""
        self._fast.forget()
        self._slow.forget()

    def follow(self, noise: float) -> None:
        """Put the band where it holds most power; `noise` is the mean power of a bin of noise."""
        if noise <= 0.0:
            return
        before, place = self._strong, self._place(self._fast, noise)
        self._strong = place is not None
        if before and not self._strong:
            # What was strong would be seen there for long.
            self._slow.forget()
        if place is None:
            place = self._place(self._slow, noise, apart=True)
        self.found = place is not None
        if place is not None:
            self.centre_bins += 0.3 * (place - self.centre_bins)

    def _place(self, average: "_Average", noise: float, *, apart: bool = False) -> float | None:
        """Return the middle of the band that holds most, None where noise alone may give it.

        With `apart` it must hold more than the mean of the two bands next to it.
        """
        if average.looks < 5.0:
            return None
        mean, params = average.mean, self._params
        middle = len(mean) // 2
        reach = max(1, round(params.uncertainty_hz / self._layout.bin_hz))
        sums, known = (np.concatenate([[0.0], np.cumsum(each)]) for each in (mean, mean > 0.0))
        width, aside = 2 * self.half_bins + 1, 3 * self.half_bins if apart else 0
        begins = np.arange(middle - reach - self.half_bins, middle + reach - self.half_bins + 1)
        begins = begins[(begins >= aside) & (begins + width + aside < len(sums))]
        held = sums[begins + width] - sums[begins]
        if apart:
            sides = (begins + each for each in (-aside, aside))
            left, right = (sums[each + width] - sums[each] for each in sides)
            # Beyond the received span there is nothing to compare with.
            whole = known[begins + width + aside] - known[begins - aside] == width + 2 * aside
            held = np.where(whole, held - 0.5 * (left + right), 0.0)
        else:
            held = held - noise * width
        if not len(begins):
            return None
        sigma = noise * math.sqrt(
            HANN_CORRELATION * width / average.looks * (1.5 if apart else 1.0)
        )
        at = int(np.argmax(held))
        tries = 1e4 * len(begins) / width + 1e4
        if held[at] <= max(params.lock_sigmas, math.sqrt(2.0 * math.log(tries))) * sigma:
            return None
        # A flat top has no one best place: the middle of those that are as good.
        good = np.flatnonzero(held >= held[at] - sigma)
        return float(np.mean(begins[good])) + self.half_bins - middle


class _Average:
    """The mean spectrum, each block with `share`, and the blocks that it is worth."""

    def __init__(self, share: float) -> None:
        self._share = min(1.0, share)
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._sum, self._known = (np.zeros(0),) * 2
        self.looks = 0.0

    def take(self, power: NDArray[np.float32]) -> None:
        """Take a block, 0 where it is outside of the received span."""
        kept = 1.0 - self._share
        known = power > 0.0
        if self.looks:
            self._sum, self._known = kept * self._sum + power, kept * self._known + known
        else:
            self._sum, self._known = power.astype(np.float64), known.astype(np.float64)
        self.looks = kept * self.looks + 1.0

    @property
    def mean(self) -> Array:
        """The mean of the blocks in which a bin was received; 0 where it was in less than half."""
        known = self._known > 0.5 * self.looks
        return np.where(known, self._sum / np.where(known, self._known, 1.0), 0.0)
