"""What the links' signal-to-noise ratios do to phases, ranges and the distance.

sigma_phi^2 = 1/(2R) per link, 1/(2RF) + 1/(2RR) for the way out and back; sigma_rho = c sigma_phi/(2 pi f) (PI83
eqs. 7-2 to 7-12).  Noise of the forward link is common to all nine paths.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import require_between

__all__ = [
    "RangeNoise",
    "phase_rate_sigma_rad_s",
    "phase_variance",
    "range_covariance",
    "range_noise",
    "range_variance_from_nine",
    "two_way_phase_variance",
    "two_way_range_sigma",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeNoise:
    """Variances of the two-way ranges: the part common to all nine, and the part of each path (3, 3)."""

    common_m2: float
    path_m2: Array


def phase_variance(snr: ArrayLike) -> Array:
    """Return the phase variance 1/(2R) in rad^2 of one link (PI83 eq. 7-3); refuses R <= 0."""
    ratio = np.asarray(snr, dtype=np.float64)
    if not np.all(ratio > 0.0):
        raise ValueError(f"snr={float(np.min(ratio))} must be > 0")
    return 0.5 / ratio


def phase_rate_sigma_rad_s(phase_sigma_rad: ArrayLike, dwell_s: float) -> Array:
    """Return sqrt(12) sigma_phi/T: the Cramer-Rao bound of a tone's frequency, phase held at the dwell's middle.

    The power ratio counts for the whole dwell, as if the bandwidth were 1/T: pessimistic when it is wider.
    """
    return np.asarray(np.sqrt(12.0) * np.asarray(phase_sigma_rad, dtype=np.float64) / dwell_s)


def two_way_phase_variance(snr_forward: ArrayLike, snr_return: ArrayLike) -> Array:
    """Return the variance in rad^2 of a phase after both links (PI83 eqs. 7-4, 7-5)."""
    return phase_variance(snr_forward) + phase_variance(snr_return)


def two_way_range_sigma(frequency_hz: float, phase_variance_rad2: ArrayLike, speed_of_light_m_s: float) -> Array:
    """Return the standard deviation in metres of the two-way length (PI83 eq. 7-12)."""
    require_between("frequency_hz", frequency_hz, 1e-3, None)
    return np.asarray(speed_of_light_m_s / (2.0 * np.pi * frequency_hz) * np.sqrt(np.asarray(phase_variance_rad2)))


def range_noise(snr_forward: ArrayLike, snr_return: ArrayLike, plan: CarrierPlan) -> RangeNoise:
    """Return the noise of ranges from carriers 1 and K, `snr_forward` (K,) and `snr_return` (K, 3, 3)."""
    scale = (plan.ambiguities_m[-1] / (2.0 * np.pi)) ** 2
    forward, back = phase_variance(snr_forward), phase_variance(snr_return)
    return RangeNoise(common_m2=float(scale * (forward[0] + forward[-1])), path_m2=scale * (back[0] + back[-1]))


def range_covariance(noise: RangeNoise) -> Array:
    """Return the covariance (9, 9) of the ranges in row order 11, 12, 13, 21, ..."""
    return np.diag(np.ravel(noise.path_m2)) + noise.common_m2


def range_variance_from_nine(common_m2: float, path_m2: float, variant: str = CORRECTED) -> float:
    """Return the variance of the distance estimated from nine ranges of variance common + path.

    "published": PI83 eq. (4-20) as printed, 0.278 times the variance of one range - 1/36 with the decimal point
    slipped, and for independent noise; "corrected": (common + path/9)/4, the forward noise being shared.
    """
    if is_published(variant):
        return 0.278 * (common_m2 + path_m2)
    return 0.25 * (common_m2 + path_m2 / 9.0)
