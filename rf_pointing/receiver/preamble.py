"""A known sequence in a burst: found by correlation over time and frequency, its power measured.

    C = |sum x conj(p)|^2 / (sum |p|^2)^2 - N0 / T,   var C = 2 C N0 / T + (N0 / T)^2

p is the sequence with root-raised-cosine pulses at the rate of a channel that holds it and the
frequency uncertainty; the trial frequencies are 1 / (2 T) apart, which costs 0.9 dB at most, and
the peak over three of them is interpolated.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.fft

from rf_pointing.core.types import Array, ComplexArray
from rf_pointing.receiver.generator import pulses
from rf_pointing.receiver.params import SignalSearchParams
from rf_pointing.receiver.spectrum import Layout, Spectrum

ROLL_OFF = 0.35
FALSE_SHARE = 1e-6
"""Chance of a burst in one look at noise; there are 100 looks a second."""
# Frequencies that are transformed together: quicker than one by one, in bounded memory.
AT_ONCE = 32


@dataclass(frozen=True, slots=True)
class Burst:
    """A sequence that was found: index of its end, frequency offset, C/N0 in hertz and sigma."""

    end: int
    offset_hz: float
    ratio_hz: float
    sigma_hz: float
    seconds: float


def constellation(text: str) -> ComplexArray:
    """Return the symbols that a text means; ValueError for another one."""
    if len(text) < 8 or set(text) - set("0123"):
        raise ValueError(f"signal.preamble={text!r} must be at least 8 of the symbols 0 to 3")
    if set(text) <= set("01"):
        return np.array([1.0 - 2.0 * int(each) for each in text], dtype=np.complex128)
    return np.asarray(np.exp(0.5j * np.pi * (np.array([int(each) for each in text]) + 0.5)))


class PreambleDetector:
    """Looks for the sequence in the channel around the predicted frequency."""

    def __init__(self, params: SignalSearchParams, layout: Layout) -> None:
        symbols, rate = constellation(params.preamble), params.symbol_rate_hz
        needed_hz = 1.5 * ((1.0 + ROLL_OFF) * rate + 2.0 * params.uncertainty_hz)
        width = 2 ** math.ceil(math.log2(max(needed_hz / layout.bin_hz, 32.0)))
        self.layout = Layout.of_rate(layout.rate_hz, min(width, layout.block // 2))
        if self.layout.block != layout.block:
            raise ValueError(
                f"signal.symbol_rate_hz={rate} does not fit into iq.rate_hz={layout.rate_hz}"
            )
        self._rate_hz = layout.rate_hz * self.layout.width / layout.block
        # One period holds the sequence and silence: its pulses do not wrap into it.  Of both the
        # mean power is 1; that of the sequence counts.
        whole = np.concatenate([symbols, np.zeros(8)])
        shape = pulses(whole, ROLL_OFF, 64) * np.float32(math.sqrt(len(symbols) / len(whole)))
        place = np.arange(int(len(symbols) * self._rate_hz / rate)) * rate / self._rate_hz * 64
        self._template = shape[place.astype(int)].astype(np.complex128)
        self.seconds = len(self._template) / self._rate_hz
        self._energy = float(np.sum(np.abs(self._template) ** 2))
        self._kept: ComplexArray = np.zeros(0, dtype=np.complex128)
        self._pending: Burst | None = None
        self._size = scipy.fft.next_fast_len(4 * len(self._template))
        self._conjugate = np.conj(scipy.fft.fft(self._template, self._size))
        # Half of what the sequence resolves, and two bins of the transform.
        self._step_hz = 2.0 * self._rate_hz / self._size
        self._trials = math.ceil(params.uncertainty_hz / self._step_hz)

    def take(self, block: Spectrum, predicted_hz: float, density: float) -> list[Burst]:
        """Take a block; return the sequences that end in it. `density` is N0, 0: unknown."""
        layout = self.layout
        centre = round(predicted_hz / layout.bin_hz)
        channel = Spectrum(block.values, block.first, layout).channel(centre)[0]
        per = layout.block // layout.width
        end = block.first + len(channel) * per
        self._kept = np.concatenate([self._kept, channel])
        found = []
        length, size = len(self._template), self._size
        away_hz = predicted_hz - centre * layout.bin_hz
        while len(self._kept) >= size:
            start = end - len(self._kept) * per
            if density > 0.0:
                found += self._strongest(self._look(self._kept[:size], start, away_hz, density))
            self._kept = self._kept[size - length :]
        return found

    def _strongest(self, burst: Burst | None) -> list[Burst]:
        """Return the burst before, unless this one is the same one, found better or worse."""
        before, self._pending = self._pending, burst
        if before is None or burst is None:
            return [] if before is None else [before]
        if burst.end - before.end > self.seconds * self.layout.rate_hz:
            return [before]
        self._pending = max(before, burst, key=lambda each: each.ratio_hz)
        return []

    def _look(
        self, series: ComplexArray, start: int, away_hz: float, density: float
    ) -> Burst | None:
        size, length = len(series), len(self._template)
        turn = -2j * np.pi * away_hz / self._rate_hz
        mixed = scipy.fft.fft(series * np.exp(turn * np.arange(size)))

        def heights(trials: range) -> Array:
            # Another frequency is the same transform, bins further on.
            moved = np.stack([np.roll(mixed, -2 * trial) for trial in trials]) * self._conjugate
            return np.asarray(np.abs(scipy.fft.ifft(moved)[:, : size - length]) / self._energy)

        trials, best_of = range(-self._trials, self._trials + 1), []
        for first in range(0, len(trials), AT_ONCE):
            some = trials[first : first + AT_ONCE]
            shown = heights(some)
            row, at = divmod(int(np.argmax(shown)), size - length)
            best_of.append((float(shown[row, at]), some[row], at))
        middle, trial, at = max(best_of)
        noise, top = density / self.seconds, middle**2
        if top / noise < math.log(len(trials) * (size - length) / FALSE_SHARE):
            return None
        shift, best = 0.0, top
        if abs(trial) < self._trials:
            left, right = map(float, heights(range(trial - 1, trial + 2, 2))[:, at])
            curve = left - 2.0 * middle + right
            if curve < 0.0:
                shift = 0.5 * (left - right) / curve
                best = (middle - 0.25 * (left - right) * shift) ** 2
        power = best - noise
        sigma = math.sqrt(2.0 * power * noise + noise**2) / density
        per = self.layout.block // self.layout.width
        offset_hz = (trial + shift) * self._step_hz
        return Burst(start + (at + length) * per, offset_hz, power / density, sigma, self.seconds)
