"""Signal-to-noise ratio after multiplying two noisy narrowband signals (PI83 eqs. 5-17 to 5-37)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published

__all__ = ["mixed_powers_w", "mixed_snr", "signal_to_noise"]

Array = NDArray[np.float64]


def signal_to_noise(amplitude: ArrayLike, noise_sigma: ArrayLike) -> Array:
    """Return the power ratio a^2/(2 sigma^2) of a sinusoid in narrowband noise (PI83 eqs. 5-22 to 5-24)."""
    return np.asarray(amplitude, dtype=np.float64) ** 2 / (2.0 * np.asarray(noise_sigma, dtype=np.float64) ** 2)


def mixed_powers_w(
    signal1_w: float, noise1_w: float, signal2_w: float, noise2_w: float, variant: str = CORRECTED
) -> tuple[float, float]:
    """Return the signal and noise power at the difference frequency of the product (PI83 eqs. 5-29 to 5-33).

    "published" (5-33) counts half of each signal x noise product: it takes the in-phase one and leaves out the
    quadrature one of the same power.
    """
    share = 0.25 if is_published(variant) else 0.5
    noise = share * (signal1_w * noise2_w + signal2_w * noise1_w) + 0.5 * noise1_w * noise2_w
    return 0.5 * signal1_w * signal2_w, noise


def mixed_snr(snr1: ArrayLike, snr2: ArrayLike, variant: str = CORRECTED) -> Array:
    """Return the power ratio after mixing: 2 R1 R2/(R1 + R2 + 2) published, R1 R2/(R1 + R2 + 1) corrected.

    For equal inputs R^2/(R + 1), PI83 eq. (5-36), against R^2/(2R + 1): 3 dB apart at high ratios.
    """
    first, second = np.asarray(snr1, dtype=np.float64), np.asarray(snr2, dtype=np.float64)
    if is_published(variant):
        return 2.0 * first * second / (first + second + 2.0)
    return first * second / (first + second + 1.0)
