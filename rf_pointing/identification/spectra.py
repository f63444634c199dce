"""Transfer function and coherence from measured sequences, averaged, detrended and Hann-windowed.

    T(f) = P_uy / P_uu,   gamma(f) = |P_uy|^2 / (P_uu P_yy)                (DSS13-ID eq. 4, 5)

Eq. (5) as printed has P_uy in the denominator twice; the coherence has P_yy.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Array, BoolArray, ComplexArray, Pair, require_between


@dataclass(frozen=True, slots=True)
class FrequencyResponse:
    """Averaged response (f,) at `frequency_hz` with its coherence."""

    frequency_hz: Array
    response: ComplexArray
    coherence: Array

    def valid(self, least_coherence: float = 0.8) -> BoolArray:
        """Return where the coherence is high enough for the data to be believed."""
        require_between("least_coherence", least_coherence, 0.0, 1.0)
        return np.asarray(self.coherence >= least_coherence)

    def valid_band_hz(self, least_coherence: float = 0.8) -> Pair:
        """Return the longest unbroken stretch (on a logarithmic scale) of valid frequencies.

        Raises ValueError if no frequency is valid.
        """
        good = np.flatnonzero(self.valid(least_coherence) & (self.frequency_hz > 0.0))
        if len(good) == 0:
            raise ValueError(f"least_coherence={least_coherence} is reached at no frequency")
        # On a logarithmic scale, as resonances are: a decade counts the same wherever it is.
        stretches = np.split(good, np.flatnonzero(np.diff(good) > 1) + 1)
        ends = [(self.frequency_hz[part[0]], self.frequency_hz[part[-1]]) for part in stretches]
        low, high = max(ends, key=lambda pair: pair[1] / pair[0])
        return float(low), float(high)


def frequency_response(inputs: ArrayLike, outputs: ArrayLike, sample_s: float) -> FrequencyResponse:
    """Return the response of `outputs` to `inputs`, both (sequences, samples)."""
    import scipy.signal

    u, y = np.atleast_2d(inputs), np.atleast_2d(outputs)
    if u.shape != y.shape:
        raise ValueError(f"inputs has shape {u.shape}, outputs has {y.shape}: must be equal")
    # Hann: the leakage of the integrator's 1/f would cover the modes.
    window = np.hanning(u.shape[1])
    spectra_u = np.fft.rfft(scipy.signal.detrend(u, axis=1) * window, axis=1)
    spectra_y = np.fft.rfft(scipy.signal.detrend(y, axis=1) * window, axis=1)
    p_uu = np.mean(np.abs(spectra_u) ** 2, axis=0)
    p_yy = np.mean(np.abs(spectra_y) ** 2, axis=0)
    # Conjugate of the input: the phase is that of the output behind it.
    p_uy = np.mean(np.conj(spectra_u) * spectra_y, axis=0)
    frequency: Array = np.asarray(np.fft.rfftfreq(u.shape[1], sample_s), dtype=np.float64)
    return FrequencyResponse(frequency, p_uy / p_uu, np.abs(p_uy) ** 2 / (p_uu * p_yy))
