"""Samples of a satellite's signal as a radio delivers them: carrier, modulation, noise, lines, ADC.

    x[n] = g (sqrt(C) a(t) exp(j phase) + n),   E|n|^2 = N0 f_s,   N0 = 1

g puts the noise at `noise_dbfs`; the converter rounds and clips.  The carrier comes from the
spur-reduced oscillator, so that its own lines stay below any that a receiver must name.
"""

import math

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Array, ComplexArray, Pair, random_stream
from rf_pointing.receiver.nco import Oscillator
from rf_pointing.receiver.params import GeneratorParams
from rf_pointing.receiver.spectrum import Samples

SYMBOLS, OVERSAMPLING = 4096, 64


class SignalGenerator:
    """Makes samples piece by piece; phase and modulation go on from one to the next."""

    def __init__(self, params: GeneratorParams) -> None:
        self.params = params
        self._noise = random_stream(params.seed, "signal generator noise")
        self._oscillator = Oscillator(
            params.oscillator, random_stream(params.seed, "signal generator oscillator")
        )
        period = waveform(params, random_stream(params.seed, "signal generator symbols"))
        self._waveform = None if period is None else np.append(period, period[:1])
        self._phase, self._symbol, self._line = 0.0, 0.0, 0.0
        self.count = 0
        """Samples made so far."""

    def take(self, count: int, offset_hz: Pair, volts: ArrayLike) -> Samples:
        """Return the next samples (channels, count).

        `offset_hz` are the carrier's offsets from the centre at begin and end; `volts` (channels,)
        or (channels, count) complex amplitudes, whose square on the sum is C/N0 in hertz.
        """
        params = self.params
        n = np.arange(count)
        # The radio's own clock counts: it takes more samples in a second.
        rate_hz = params.rate_hz * (1.0 + 1e-6 * params.clock_ppm)
        begin, end = (each / rate_hz for each in offset_hz)
        turns = self._phase + begin * n + (0.5 * (end - begin) / count) * n * n
        carrier = self._oscillator.samples(turns)
        self._phase = (self._phase + 0.5 * (begin + end) * count) % 1.0
        if self._waveform is not None:
            step = params.symbol_rate_hz / rate_hz
            place = (self._symbol + step * n) % SYMBOLS * OVERSAMPLING
            low = place.astype(np.int64) % (SYMBOLS * OVERSAMPLING)
            before, after = self._waveform[low], self._waveform[low + 1]
            # Between two values: the nearest would be noise, 40 dB below the carrier.
            carrier = carrier * (before + (place - low).astype(np.float32) * (after - before))
            self._symbol = (self._symbol + step * count) % SYMBOLS
        level = np.asarray(volts, dtype=np.complex64)
        noise = self._noise.standard_normal((params.channels, 2 * count), dtype=np.float32).view(
            np.complex64
        )
        noise *= np.float32(math.sqrt(0.5 * params.rate_hz))
        signal = noise + carrier * (level[:, None] if level.ndim == 1 else level)
        if params.line_db_hz > -100.0:
            line = params.line_offset_hz / rate_hz
            tone = np.exp(2j * np.pi * (turns + self._line + line * n)).astype(np.complex64)
            self._line = (self._line + line * count) % 1.0
            signal[0] += np.float32(10.0 ** (params.line_db_hz / 20.0)) * tone
        signal *= np.float32(10.0 ** (params.noise_dbfs / 20.0) / math.sqrt(params.rate_hz))
        self.count += count
        return converted(signal, params.bits)


def converted(signal: Samples, bits: int) -> Samples:
    """Return the samples rounded and clipped to `bits` (0: as they are); full scale is 1."""
    if not bits:
        return signal
    steps = np.float32(2.0 ** (bits - 1))
    parts = signal.view(np.float32) * steps
    # Midrise, as the unsigned bytes of an RTL-SDR: 127.5 is zero.
    np.floor(parts, out=parts)
    np.clip(parts, -steps, steps - 1.0, out=parts)
    return ((parts + np.float32(0.5)) / steps).view(np.complex64)


def waveform(params: GeneratorParams, rng: "np.random.Generator") -> NDArray[np.complex64] | None:
    """Return a period of the modulation with mean power 1, `OVERSAMPLING` values a symbol."""
    if params.modulation == "cw":
        return None
    count = SYMBOLS * OVERSAMPLING
    if params.modulation == "fm":
        place = np.arange(count) / OVERSAMPLING
        return np.asarray(
            np.exp(1j * params.deviation * np.sin(2.0 * np.pi * place)), dtype=np.complex64
        )
    return pulses(symbols(params.modulation, SYMBOLS, rng), params.roll_off, OVERSAMPLING)


def symbols(modulation: str, count: int, rng: "np.random.Generator") -> ComplexArray:
    """Return random symbols of unit power."""
    if modulation == "bpsk":
        return np.asarray(2.0 * rng.integers(0, 2, count) - 1.0, dtype=np.complex128)
    return np.asarray(np.exp(0.5j * np.pi * (rng.integers(0, 4, count) + 0.5)))


def pulses(values: ComplexArray, roll_off: float, oversampling: int) -> NDArray[np.complex64]:
    """Return root-raised-cosine pulses of the symbols as one period, mean power 1."""
    count = len(values) * oversampling
    spikes = np.zeros(count, dtype=np.complex128)
    spikes[::oversampling] = values
    frequency = np.abs(np.fft.fftfreq(count, 1.0 / oversampling))
    shaped = scipy.fft.ifft(scipy.fft.fft(spikes) * _root_raised_cosine(frequency, roll_off))
    return np.asarray(shaped / math.sqrt(float(np.mean(np.abs(shaped) ** 2))), dtype=np.complex64)


def _root_raised_cosine(frequency: Array, roll_off: float) -> Array:
    """Return the spectrum at frequencies in symbol rates."""
    low, high = 0.5 * (1.0 - roll_off), 0.5 * (1.0 + roll_off)
    inside = np.clip((frequency - low) / (high - low), 0.0, 1.0)
    return np.asarray(np.cos(0.5 * np.pi * inside))
