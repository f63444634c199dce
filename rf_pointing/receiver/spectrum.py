"""Samples to spectra and narrow channels: one FFT of each block serves both (overlap-save).

Blocks of N samples follow each other by 3 N / 4.  The narrow channel around bin k is the inverse
FFT of M bins under a filter of N / 4 taps, so its middle 3 M / 4 samples are exact.  The power
spectrum is that of a Hann window, applied in the spectrum (1/2, -1/4, -1/4); for white noise of
density N0 its mean is 0.375 N f_s N0.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.signal import firwin

from rf_pointing.core.types import Array, ComplexArray

Samples = NDArray[np.complex64]
BLOCK_S = 0.0137
"""Wanted length of a block: its rate of 100 a second carries a loop of 10 Hz."""
CHANNEL_BINS = 128
HANN_POWER = 0.375
HANN_CORRELATION = 1.0 + 2.0 * ((2.0 / 3.0) ** 2 + (1.0 / 6.0) ** 2)
"""Variance of a sum over bins under a Hann window, relative to independent bins."""
STOPBAND_BETA = 8.0


@dataclass(frozen=True, slots=True)
class IqSamples:
    """Samples (channels, n) that arrived together; `index` counts from the start of the stream.

    `t_s` is the time of the first one where the source stamps it, `arrival_s` that of the last
    one's arrival; `clipped` the share at the end of the scale, `centre_hz` as the source states it.
    """

    samples: Samples
    rate_hz: float
    index: int
    arrival_s: float
    t_s: float | None = None
    clipped: float = 0.0
    centre_hz: float | None = None

    @property
    def taken_s(self) -> float:
        """When it arrived."""
        return self.arrival_s


class Spectrum:
    """One block: `values` (channels, N) by frequency, `first` the index of its middle part."""

    def __init__(self, values: Samples, first: int, layout: "Layout") -> None:
        self.values, self.first, self._layout = values, first, layout

    def power(self, low: int, high: int) -> NDArray[np.float32]:
        """Return the power of the first channel in the bins low <= k < high, 0 outside the span.

        Bins count from the middle of the spectrum.
        """
        half, row = self._layout.block // 2, self.values[0]
        begin, end = max(low + half, 1), min(high + half, len(row) - 1)
        found = np.zeros(high - low, dtype=np.float32)
        if end > begin:
            windowed = row[begin:end] - 0.5 * (row[begin - 1 : end - 1] + row[begin + 1 : end + 1])
            parts = windowed.view(np.float32)
            parts *= parts
            found[begin - half - low : end - half - low] = 0.25 * (parts[0::2] + parts[1::2])
        return found

    def channel(self, centre: int) -> ComplexArray:
        """Return the channel (channels, m) around a bin, mixed down by it from sample 0 on."""
        layout = self._layout
        half, width = layout.block // 2, layout.width
        begin = centre + half - width // 2
        # Beyond the ends the spectrum repeats.
        bins = np.take(self.values, np.arange(begin, begin + width), axis=1, mode="wrap")
        narrow = scipy.fft.ifft(scipy.fft.ifftshift(bins * layout.response, axes=1), axis=1)
        narrow = narrow[:, layout.edge : width - layout.edge] * (width / layout.block)
        start = self.first - layout.block // 8
        turns = (centre * start) % layout.block / layout.block
        return np.asarray(narrow * np.exp(-2j * np.pi * turns), dtype=np.complex128)


@dataclass(frozen=True)
class Layout:
    """Sizes that follow from the sample rate: block N, channel M, and the filter of the channel."""

    rate_hz: float
    block: int
    width: int
    response: Array

    @classmethod
    def of_rate(cls, rate_hz: float, width: int = CHANNEL_BINS) -> "Layout":
        """Return the layout of a sample rate, with `width` bins in the channel."""
        block = max(2 * width, 2 ** round(np.log2(rate_hz * BLOCK_S)))
        taps = np.zeros(block)
        filter_ = firwin(block // 4 + 1, 0.68 * width / block, window=("kaiser", STOPBAND_BETA))
        taps[: len(filter_)] = filter_
        # Symmetric about sample 0: no delay.
        response = scipy.fft.fft(np.roll(taps, -(len(filter_) // 2))).real
        return cls(
            rate_hz, block, width, scipy.fft.fftshift(response)[(block - width) // 2 :][:width]
        )

    @property
    def hop(self) -> int:
        """Samples from block to block."""
        return 3 * self.block // 4

    @property
    def edge(self) -> int:
        """Samples of the channel that the filter spoils at either end."""
        return self.width // 8

    @property
    def bin_hz(self) -> float:
        """Distance of two bins."""
        return self.rate_hz / self.block

    @property
    def hop_s(self) -> float:
        """Time from block to block, that of one integration."""
        return self.hop / self.rate_hz

    def density(self, power: float) -> float:
        """Return the power per hertz that gives this mean power of a bin."""
        return power / (HANN_POWER * self.block * self.rate_hz)


class SpectrumStream:
    """Cuts a stream into overlapping blocks; a gap in the index begins a new stream."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.gaps = 0
        self._kept: list[Samples] = []
        self._count, self._next = 0, -1

    def take(self, samples: Samples, index: int) -> Iterator[Spectrum]:
        """Take samples (channels, n) from `index` on; yield each block that they complete."""
        if index != self._next:
            self.gaps += self._next >= 0
            self._kept, self._count = [], 0
        self._next = index + samples.shape[1]
        self._kept.append(samples)
        self._count += samples.shape[1]
        block = self.layout.block
        if self._count < block:
            return
        joined = self._kept[0] if len(self._kept) == 1 else np.concatenate(self._kept, axis=1)
        start = self._next - self._count
        at = 0
        while at + block <= self._count:
            values = scipy.fft.fftshift(scipy.fft.fft(joined[:, at : at + block], axis=1), axes=1)
            yield Spectrum(values, start + at + block // 8, self.layout)
            at += self.layout.hop
        self._kept, self._count = [joined[:, at:]], self._count - at
