"""A carrier in a stream of spectra: found by FFT, followed by a phase-locked loop, measured.

Search: the mean spectrum over `SEARCH_S` in a frame that follows the predicted frequency; its
largest bin counts as a carrier where chance would not give it (Wilson and Hilferty's cube root of a
gamma variate).  An FFT of the narrow channel around it then gives the frequency to a hertz.

Loop: one integration y = A exp(j phase) + n per block of T = 10 ms, E|n|^2 = N0 / T.  Third order
in phase with an assist of second order in frequency (Ward, Betz, Hegarty in Kaplan and Hegarty
2006, table 5.6), so a constant rate of the frequency leaves no error.  A loop that is off by k / T
sees the same phases; the spectrum of the block's own samples, whose bin k is there, shows it.

Power over n integrations, without the phase, so that a hertz of frequency error costs nothing:

    C = mean |y|^2 - N0 / T,   var C = (2 C N0 / T + (N0 / T)^2) / n

The Cramer-Rao bound of C from the same samples is 2 C N0 / (n T): the first term.
"""

import math
from collections import deque

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from rf_pointing.core.types import Array, ComplexArray, Pair
from rf_pointing.receiver.params import SignalSearchParams
from rf_pointing.receiver.spectrum import Layout, Spectrum

SEARCH_S = 0.25
FINE_BLOCKS, FINE_BLOCKS_STRONG, STRONG_DB_HZ = 12, 4, 38.0
LOST_S = 0.5
LOST_SIGMAS = 3.0
DRIFT_HZ_S = 1200.0
"""Largest rate of a frequency that nothing predicts: a low orbit at X band."""
JUMP_HZ = 500.0
"""A carrier found again so far from where it was is another one, or the radio was retuned."""
NATURAL = 1.0 / 0.7845
DAMPING = 1.1, 2.4
ASSIST, ASSIST_DAMPING = 1.0 / 0.53, 1.414
ASSIST_SHARE = 0.5
IMAGES, IMAGE_RATIO, IMAGE_LOOKS = 8, 4.0, 20
"""Images of the carrier on either side, and what is stronger than the loop's own frequency."""


def power_bound(ratio_hz: float, seconds: float) -> float:
    """Return the Cramer-Rao bound of the sigma of C/N0 in hertz, noise density known."""
    return math.sqrt(2.0 * max(ratio_hz, 0.0) / seconds)


class Loop:
    """The loop filter: frequency from the prediction, by errors in cycles and hertz."""

    def __init__(self, bandwidth_hz: float, step_s: float) -> None:
        self._natural, self._assist, self._step_s = (
            NATURAL * bandwidth_hz, ASSIST_SHARE * ASSIST * bandwidth_hz, step_s,
        )  # fmt: skip
        self.start(0.0)

    def start(self, frequency_hz: float, rate_hz_s: float = 0.0) -> None:
        """Begin at a frequency."""
        self._rate_hz_s, self._slow_hz, self.frequency_hz = rate_hz_s, frequency_hz, frequency_hz

    @property
    def slow_hz(self) -> float:
        """The frequency without the part that answers the newest phase."""
        return self._slow_hz

    def shift(self, frequency_hz: float) -> None:
        """Go on at another frequency, by whole turns an integration."""
        self._slow_hz += frequency_hz
        self.frequency_hz += frequency_hz

    def update(self, phase_cycles: float, frequency_hz: float) -> None:
        """Take the errors of one integration."""
        natural, assist, step_s = self._natural, self._assist, self._step_s
        self._rate_hz_s += step_s * (natural**3 * phase_cycles + assist**2 * frequency_hz)
        third, second = DAMPING
        self._slow_hz += step_s * (
            self._rate_hz_s
            + third * natural**2 * phase_cycles
            + ASSIST_DAMPING * assist * frequency_hz
        )
        self.frequency_hz = self._slow_hz + second * natural * phase_cycles


class CarrierTracker:
    """Finds and follows one carrier; `offset_hz` is its offset from the predicted frequency."""

    def __init__(self, params: SignalSearchParams, layout: Layout, channels: int) -> None:
        self.params, self._layout, self._channels = params, layout, channels
        self._loop = Loop(params.loop_bandwidth_hz, layout.hop_s)
        self._phase = 0.0
        self._mean: Array | None = None
        self._looks = 0.0
        self._fine: deque[ComplexArray] = deque()
        self._candidate_hz: float | None = None
        self._wanted = FINE_BLOCKS
        self._before: complex | None = None
        self._angle, self._tracked = 0.0, 0
        self._images = np.zeros(2 * IMAGES + 1)
        # Size of the integrations and frequency since shortly before a loss can be known.
        self._recent: deque[Pair] = deque(maxlen=round(LOST_S / layout.hop_s))
        self._last_hz: float | None = None
        self.tracking = False
        self.jumps = 0
        self.jump_hz = 0.0
        self.losses = 0

    @property
    def offset_hz(self) -> float | None:
        """Offset of the carrier from the predicted one, None until it was found."""
        return self._loop.slow_hz if self.tracking else self._last_hz

    @property
    def locked(self) -> bool:
        """Whether the phase is held: the mean cosine of twice its error is above 0.4."""
        return self.tracking and self._tracked * self._layout.hop_s > LOST_S and self._angle > 0.4

    def take(
        self, block: Spectrum, predicted_hz: Pair, frame: int, power: NDArray[np.float32],
        noise: float, drifts: bool = False,
    ) -> ComplexArray:  # fmt: skip
        """Take a block; return its integration (channels,) at the carrier.

        `predicted_hz` are the frequencies at the begin and end of its middle part, from the centre
        of the spectrum; `power` is its spectrum around bin `frame`, and `noise` the mean power of
        a bin of noise, 0 while it is unknown.  A carrier that `drifts` has a rate that is not
        predicted: it is searched up to `DRIFT_HZ_S`.
        """
        if not self.tracking:
            self._search(block, predicted_hz, frame, power, drifts)
        offset_hz = self._loop.frequency_hz if self.tracking else (self._last_hz or 0.0)
        samples, turns = self._mixed(block, predicted_hz, offset_hz, self._phase)
        self._phase = (self._phase + turns) % 1.0
        prompt: ComplexArray = np.mean(samples, axis=1)
        if self.tracking:
            self._follow(complex(prompt[0]), noise)
            self._leave_image(samples[0])
        return prompt

    def _mixed(
        self, block: Spectrum, predicted_hz: Pair, offset_hz: float, phase: float
    ) -> tuple[ComplexArray, float]:
        """Return the channel (channels, m) without the given frequency, and the turns it takes."""
        layout = self._layout
        begin, end = predicted_hz[0] + offset_hz, predicted_hz[1] + offset_hz
        centre = round(0.5 * (begin + end) / layout.bin_hz)
        samples = block.channel(centre)
        m = np.arange(samples.shape[1])
        # Less the mixing of the channel, which counts from sample 0.
        start = phase - (centre * block.first) % layout.block / layout.block
        slope = begin / layout.bin_hz / layout.width - centre / layout.width
        curve = (
            0.5
            * (end - begin)
            / (layout.hop_s * (layout.rate_hz * layout.width / layout.block) ** 2)
        )
        turns = start + slope * m + curve * m * m
        return samples * np.exp(-2j * np.pi * turns), 0.5 * (begin + end) * layout.hop_s

    def _search(
        self, block: Spectrum, predicted_hz: Pair, frame: int, power: NDArray[np.float32],
        drifts: bool,
    ) -> None:  # fmt: skip
        if self._candidate_hz is not None:
            self._fine.append(
                self._mixed(block, predicted_hz, self._candidate_hz, self._phase)[0][0]
            )
            if len(self._fine) >= self._wanted:
                self._lock(drifts)
            return
        share = min(1.0, self._layout.hop_s / SEARCH_S)
        self._looks = (1.0 - share) * self._looks + 1.0
        self._mean = (
            power.astype(np.float64)
            if self._mean is None
            else self._mean + (power - self._mean) / self._looks
        )
        if self._looks < 3.0:
            return
        found = significant_peak(self._mean, self._looks, self.params, self._layout.bin_hz)
        if found is not None:
            bin_, ratio = found
            # The prediction moves within the frame of a whole bin.
            within = frame - 0.5 * sum(predicted_hz) / self._layout.bin_hz
            self._candidate_hz = (bin_ + within) * self._layout.bin_hz
            strong = 10.0 * math.log10(max(ratio, 1e-3) * 1.5 * self._layout.bin_hz) > STRONG_DB_HZ
            self._wanted = FINE_BLOCKS_STRONG if strong and not drifts else FINE_BLOCKS

    def _lock(self, drifts: bool) -> None:
        """Find the frequency of the candidate to a fraction of a bin and start the loop there."""
        layout = self._layout
        series = np.concatenate(self._unrotated())
        size = 4 * scipy.fft.next_fast_len(len(series))
        rate_hz = layout.rate_hz * layout.width / layout.block
        seconds = len(series) / rate_hz
        steps = math.ceil(DRIFT_HZ_S * seconds**2 / 0.5) if drifts else 0
        # The candidate of a drifting carrier is of the middle of its search.
        near = max(
            2,
            round(
                (1.5 * layout.bin_hz + (DRIFT_HZ_S * (SEARCH_S + seconds) if drifts else 0.0))
                / rate_hz
                * size
            ),
        )
        bins = np.arange(-min(near, size // 2 - 1), min(near, size // 2 - 1) + 1)
        t_s = np.arange(len(series)) / rate_hz - seconds
        drift_hz_s, values = 0.0, np.zeros(len(bins))
        for each in np.arange(-steps, steps + 1) * (DRIFT_HZ_S / max(steps, 1)):
            spectrum = (
                np.abs(scipy.fft.fft(series * np.exp(-1j * np.pi * each * t_s**2), size)[bins]) ** 2
            )
            if np.max(spectrum) > np.max(values):
                drift_hz_s, values = float(each), spectrum
        at = int(np.argmax(values))
        place = float(bins[at])
        if 0 < at < len(values) - 1:
            left, middle, right = (math.log(max(values[at + k], 1e-300)) for k in (-1, 0, 1))
            place += 0.5 * (left - right) / (left - 2.0 * middle + right)
        assert self._candidate_hz is not None
        found_hz = self._candidate_hz + place * rate_hz / size
        if self._last_hz is not None and abs(found_hz - self._last_hz) > JUMP_HZ:
            self.jumps += 1
            self.jump_hz = found_hz - self._last_hz
        self._loop.start(found_hz, drift_hz_s)
        self.tracking, self._before, self._tracked = True, None, 0
        self._angle = 0.0
        self._recent.clear()
        self.begin_search()

    def _unrotated(self) -> list[ComplexArray]:
        """Return the blocks with the turns of the candidate from block to block taken out."""
        assert self._candidate_hz is not None
        last = self._last_hz or 0.0
        # While searching, the phase advances by the frequency found before, not the candidate's.
        step = (self._candidate_hz - last) * self._layout.hop_s
        return [
            part * np.exp(-2j * np.pi * step * number) for number, part in enumerate(self._fine)
        ]

    def _follow(self, prompt: complex, noise: float) -> None:
        before, self._before = self._before, prompt
        step_s = self._layout.hop_s
        turn = prompt * before.conjugate() if before is not None else 1.0
        rate_hz = math.atan2(turn.imag, turn.real) / (2.0 * math.pi * step_s)
        self._loop.update(math.atan2(prompt.imag, prompt.real) / (2.0 * math.pi), rate_hz)
        self._tracked += 1
        share = max(min(1.0, step_s / LOST_S), 1.0 / self._tracked)
        size = prompt.real**2 + prompt.imag**2
        self._recent.append((size, self._loop.slow_hz))
        cosine = (prompt.real**2 - prompt.imag**2) / size if size > 0.0 else 0.0
        self._angle += share * (cosine - self._angle)
        if noise > 0.0 and len(self._recent) == self._recent.maxlen:
            variance = self._layout.density(noise) / step_s
            limit = variance * (1.0 + LOST_SIGMAS / math.sqrt(len(self._recent)))
            if sum(level for level, _ in self._recent) / len(self._recent) < limit:
                self.lose()

    def _leave_image(self, samples: ComplexArray) -> None:
        """Go to the carrier if the loop holds an image of it, as after a jump of a few hertz."""
        near = np.abs(scipy.fft.fft(samples)[np.arange(-IMAGES, IMAGES + 1)]) ** 2
        self._images += (near - self._images) / min(self._tracked, IMAGE_LOOKS)
        best = int(np.argmax(self._images))
        if self._tracked >= IMAGE_LOOKS and self._images[best] > IMAGE_RATIO * self._images[IMAGES]:
            self._loop.shift((best - IMAGES) / self._layout.hop_s)
            self._before, self._tracked = None, 0
            self._recent.clear()

    def lose(self) -> None:
        """Search again; the power goes on being measured where the carrier was."""
        if self.tracking:
            self.losses += 1
            # Meanwhile the loop has followed noise.
            self._last_hz = self._recent[0][1] if self._recent else self._loop.slow_hz
        self.tracking = False
        self.begin_search()

    def begin_search(self) -> None:
        """Forget what a search has found so far."""
        self._candidate_hz, self._mean, self._looks = None, None, 0.0
        self._fine.clear()


def significant_peak(
    mean: Array, looks: float, params: SignalSearchParams, bin_hz: float
) -> Pair | None:
    """Return bin (from the middle, with its fraction) and height over the noise of the top peak.

    None where noise alone may give it.
    """
    middle, reach = len(mean) // 2, max(1, round(params.uncertainty_hz / bin_hz))
    inside = mean[middle - reach : middle + reach + 1]
    known = mean[mean > 0.0]
    if not len(known):
        return None
    noise = float(np.median(known))
    at = int(np.argmax(inside))
    ratio = float(inside[at]) / noise
    # A gamma variate of shape `looks`; its median is nearly its mean.
    sigmas = (ratio ** (1.0 / 3.0) - 1.0 + 1.0 / (9.0 * looks)) * 3.0 * math.sqrt(looks)
    if sigmas < max(params.lock_sigmas, math.sqrt(2.0 * math.log(1e4 * len(inside)))):
        return None
    place = float(at)
    if 0 < at < len(inside) - 1:
        left, here, right = (
            math.sqrt(max(float(inside[at + k]) / noise - 1.0, 0.0)) for k in (-1, 0, 1)
        )
        side = 1.0 if right > left else -1.0
        share = max(left, right) / here
        place += side * min(max((2.0 * share - 1.0) / (share + 1.0), 0.0), 0.5)
    return place - reach, ratio - 1.0
