"""How noise becomes phase, range, direction and roll error (PI83 sections 4.3 and 7).

sigma_rho = c sigma_phi/(2 pi f) (eqs. 7-2 to 7-12).  Per unit variance of one two-way range:
distance 1/36; direction (4/9)/(R cos theta)^2 as the sum of the variances of the rotations about
the array's z and y axes.  Roll: 1/(g^T g) per unit variance of one coupling.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.interferometer.frames import direction_from_angles
from rf_pointing.array_sensors.interferometer.measurement import phase_variance
from rf_pointing.array_sensors.interferometer.sequence import direction_step, range_step, roll_step
from rf_pointing.array_sensors.interferometer.system import ArrayParams, CarrierPlan
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import require_between

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RangeNoise:
    """Variances of the two-way ranges.

    The part common to all nine, and the part of each path (3, 3).
    """

    common_m2: float
    path_m2: Array


def two_way_phase_variance(snr_forward: ArrayLike, snr_return: ArrayLike) -> Array:
    """Return the variance in rad^2 of a phase after both links (PI83 eqs. 7-4, 7-5)."""
    return phase_variance(snr_forward) + phase_variance(snr_return)


def two_way_range_sigma(frequency_hz: float, phase_variance_rad2: ArrayLike, speed_of_light_m_s: float) -> Array:
    """Return the standard deviation in metres of the two-way length (PI83 eq. 7-12)."""
    require_between("frequency_hz", frequency_hz, 1e-3, None)
    return np.asarray(speed_of_light_m_s / (2.0 * np.pi * frequency_hz) * np.sqrt(np.asarray(phase_variance_rad2)))


def range_noise(snr_forward: ArrayLike, snr_return: ArrayLike, plan: CarrierPlan) -> RangeNoise:
    """Return the noise of ranges from carriers 1 and K, `snr_forward` (K,) and `snr_return` (K, 3,
    3).
    """
    # The range is made from carriers 1 and K: one turn is the finest lane.
    scale = (plan.ambiguities_m[-1] / (2.0 * np.pi)) ** 2
    forward, back = phase_variance(snr_forward), phase_variance(snr_return)
    return RangeNoise(common_m2=float(scale * (forward[0] + forward[-1])), path_m2=scale * (back[0] + back[-1]))


def range_covariance(noise: RangeNoise) -> Array:
    """Return the covariance (9, 9) of the ranges in row order 11, 12, 13, 21, ..."""
    return np.diag(np.ravel(noise.path_m2)) + noise.common_m2


def range_variance_from_nine(common_m2: float, path_m2: float, variant: str = CORRECTED) -> float:
    """Return the variance of the distance estimated from nine ranges of variance common + path.

    "published": PI83 eq. (4-20) as printed, 0.278 times the variance of one range - 1/36 with the
    decimal point slipped, and for independent noise; "corrected": (common + path/9)/4, the forward
    noise being shared.
    """
    if is_published(variant):
        # 1/36 is 0.0278: the report's decimal point slipped, and its independent noise is not.
        return 0.278 * (common_m2 + path_m2)
    return 0.25 * (common_m2 + path_m2 / 9.0)


def direction_variance(off_boresight_rad: float, radius_m: float = 1.0, variant: str = CORRECTED) -> float:
    """Return V^2 in rad^2 per m^2: variance of both rotation increments together (PI83 eq. 4-21).

    "published" 0.4448/cos^2 for any array (the report states 1 m diameter, its listing has 1 m
    radius); "corrected" 4/9/(R cos)^2 - the 0.4448 is the residue of the listing's finite dither.
    """
    require_between("off_boresight_rad", off_boresight_rad, 0.0, math.radians(89.9))
    if is_published(variant):
        # The listing's number, dither included; the text gives no formula.
        return 0.4448 / math.cos(off_boresight_rad) ** 2
    return 4.0 / 9.0 / (radius_m * math.cos(off_boresight_rad)) ** 2


def chord_variance(off_boresight_rad: float, radius_m: float = 1.0) -> float:
    """Return the variance in rad^2 per m^2 of the pointing error itself, (2/9)(1 + 1/cos^2)/R^2.

    Less than `direction_variance` off boresight: a rotation about the z or y axis moves the
    direction by its cosine.
    """
    require_between("off_boresight_rad", off_boresight_rad, 0.0, math.radians(89.9))
    return 2.0 / 9.0 * (1.0 + 1.0 / math.cos(off_boresight_rad) ** 2) / radius_m**2


def direction_variance_from_gradients(
    range_m: float, direction: ArrayLike, attitude: ArrayLike, arrays: ArrayParams, dither_rad: float = 0.01
) -> float:
    """Return V^2 = 3 trace(H) of the direction estimator (three ranges a sum), rad^2 per m^2."""
    # The covariance depends on the geometry alone, so any ranges serve.
    ranges = np.zeros((3, 3))
    _, covariance = direction_step(ranges, range_m, direction, attitude, arrays, dither_rad)
    # Each sum has three ranges: per unit variance of a range the sums have three.
    return 3.0 * float(np.trace(covariance))


def range_variance_from_gradients(
    range_m: float, direction: ArrayLike, attitude: ArrayLike, arrays: ArrayParams
) -> float:
    """Return the variance of the distance per unit variance of nine independent two-way ranges."""
    return float(range_step(np.zeros((3, 3)), range_m, direction, attitude, arrays)[1])


def roll_variance(azimuth1_rad: float, azimuth2_offset_rad: float, roll_rad: float = 0.0) -> float:
    """Return V_psi^2 for offsets in azimuth only, 1/[(ca^2 + cb^2) cos^2 + (1 + ca^2 cb^2) sin^2]
    of the roll.

    `azimuth2_offset_rad` counts from the passive array's boresight.  Below 2 while one of the two
    is within 45 deg.
    """
    ca, cb = math.cos(azimuth1_rad) ** 2, math.cos(azimuth2_offset_rad) ** 2
    return 1.0 / ((ca + cb) * math.cos(roll_rad) ** 2 + (1.0 + ca * cb) * math.sin(roll_rad) ** 2)


def roll_variance_from_gradients(
    azimuth1_rad: float, azimuth2_offset_rad: float, roll_rad: float = 0.0, dither_rad: float = 1e-4
) -> float:
    """Return V_psi^2 of the roll estimator, per unit variance of one coupling (largest coupling
    one).
    """
    forward = direction_from_angles(azimuth1_rad, 0.0)
    # The passive array sees the active one behind azimuth 180 deg at zero offset.
    reverse = direction_from_angles(math.pi + azimuth2_offset_rad, 0.0)
    return float(roll_step(np.zeros((2, 2)), forward, reverse, roll_rad, dither_rad=dither_rad)[1])


def sum_range_bias_m(range_m: ArrayLike, off_active_rad: float, off_passive_rad: float, arrays: ArrayParams) -> Array:
    """Return the bias of sum/18 at short range, [Ra^2 (1 + cos^2) + Rp^2 (1 + cos^2)]/(8 rho)."""
    active = arrays.radius_active_m**2 * (1.0 + math.cos(off_active_rad) ** 2)
    passive = arrays.radius_passive_m**2 * (1.0 + math.cos(off_passive_rad) ** 2)
    return (active + passive) / (8.0 * np.asarray(range_m, dtype=np.float64))
