"""Spur-reduced sinusoid: phase accumulator, dither, truncation, table (NCO section VII).

A phase of b bits makes lines; M uniform dithers before the truncation turn them into white noise:
lines fall by 6 (M + 1) dB per phase bit (NCO abstract), the noise is 1 / (4 pi^2 Var eps) below the
carrier (NCO after eq. 5).
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.types import Array, IntArray
from rf_pointing.receiver.params import OscillatorParams


class Oscillator:
    """Exponentials of phases in cycles; every dither comes from `rng`."""

    def __init__(self, params: OscillatorParams, rng: "np.random.Generator") -> None:
        self.params, self._rng = params, rng
        table = np.exp(2j * np.pi * np.arange(2**params.phase_bits) / 2**params.phase_bits)
        if params.table_bits:
            # Two output steps below full scale: the dither never needs more (NCO section X).
            full = 2.0 ** (params.table_bits - 1)
            scale = full - (
                2.0 ** (params.table_bits - params.amplitude_bits + 1)
                if params.amplitude_bits
                else 1.0
            )
            table = (np.rint(scale * table.real) + 1j * np.rint(scale * table.imag)) / full
        self._table = table.astype(np.complex64)

    def words(self, cycles: Array) -> IntArray:
        """Return the dithered and truncated phases of these cycles (n,), as table addresses."""
        params = self.params
        place = cycles * 2.0**params.phase_bits
        for _ in range(params.dithers):
            place += self._rng.random(len(cycles), dtype=np.float32)
        # Rounding: without dither to the nearest, and each dither has a mean of half a step.
        place += 0.5 * (1 - params.dithers)
        return np.asarray(np.floor(place).astype(np.int64) & (2**params.phase_bits - 1))

    def samples(self, cycles: Array) -> NDArray[np.complex64]:
        """Return exp(2 pi j cycles) (n,) as the words of the oscillator make it."""
        found: NDArray[np.complex64] = self._table[self.words(cycles)]
        if not self.params.amplitude_bits:
            return found
        steps = 2.0 ** (self.params.amplitude_bits - 1)
        parts = found.view(np.float32).reshape(-1, 2) * np.float32(steps)
        parts = np.floor(parts + self._rng.random(parts.shape, dtype=np.float32)) / np.float32(
            steps
        )
        words = np.ascontiguousarray(parts, dtype=np.float32).view(np.complex64)
        return np.asarray(words[:, 0])
