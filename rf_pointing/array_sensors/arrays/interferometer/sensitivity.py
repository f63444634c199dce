"""How measurement noise becomes range, direction and roll error (PI83 section 4.3).

Per unit variance of one two-way range: distance 1/36; direction (4/9)/(R cos theta)^2 as the sum of the variances of
the rotations about the array's z and y axes; roll 1/(g^T g) per unit variance of one coupling.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams
from rf_pointing.array_sensors.arrays.interferometer.frames import direction_from_angles
from rf_pointing.array_sensors.arrays.interferometer.tracking_steps import direction_step, range_step, roll_step
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import require_between

__all__ = [
    "chord_variance",
    "direction_variance",
    "direction_variance_from_gradients",
    "range_variance_from_gradients",
    "roll_variance",
    "roll_variance_from_gradients",
    "sum_range_bias_m",
]

Array = NDArray[np.float64]


def direction_variance(off_boresight_rad: float, radius_m: float = 1.0, variant: str = CORRECTED) -> float:
    """Return V^2 in rad^2 per m^2: variance of both rotation increments together (PI83 eq. 4-21).

    "published" 0.4448/cos^2 for any array (the report speaks of 1 m diameter, its listing has 1 m radius);
    "corrected" 4/9/(R cos)^2 - the 0.4448 is the residue of the listing's finite dither.
    """
    require_between("off_boresight_rad", off_boresight_rad, 0.0, math.radians(89.9))
    if is_published(variant):
        return 0.4448 / math.cos(off_boresight_rad) ** 2
    return 4.0 / 9.0 / (radius_m * math.cos(off_boresight_rad)) ** 2


def chord_variance(off_boresight_rad: float, radius_m: float = 1.0) -> float:
    """Return the variance in rad^2 per m^2 of the pointing error itself, (2/9)(1 + 1/cos^2)/R^2.

    Less than `direction_variance` off boresight: a rotation about the z or y axis moves the direction by its cosine.
    """
    require_between("off_boresight_rad", off_boresight_rad, 0.0, math.radians(89.9))
    return 2.0 / 9.0 * (1.0 + 1.0 / math.cos(off_boresight_rad) ** 2) / radius_m**2


def direction_variance_from_gradients(
    range_m: float, direction: ArrayLike, attitude: ArrayLike, arrays: ArrayParams, dither_rad: float = 0.01
) -> float:
    """Return V^2 = 3 trace(H) of the direction estimator (three ranges in each sum), rad^2 per m^2."""
    ranges = np.zeros((3, 3))
    _, covariance = direction_step(ranges, range_m, direction, attitude, arrays, dither_rad)
    return 3.0 * float(np.trace(covariance))


def range_variance_from_gradients(
    range_m: float, direction: ArrayLike, attitude: ArrayLike, arrays: ArrayParams
) -> float:
    """Return the variance of the distance per unit variance of nine independent two-way ranges."""
    return float(range_step(np.zeros((3, 3)), range_m, direction, attitude, arrays)[1])


def roll_variance(azimuth1_rad: float, azimuth2_offset_rad: float, roll_rad: float = 0.0) -> float:
    """Return V_psi^2 for offsets in azimuth only, 1/[(ca^2 + cb^2) cos^2 + (1 + ca^2 cb^2) sin^2] of the roll.

    `azimuth2_offset_rad` counts from the passive array's boresight.  Below 2 while one of the two is within 45 deg.
    """
    ca, cb = math.cos(azimuth1_rad) ** 2, math.cos(azimuth2_offset_rad) ** 2
    return 1.0 / ((ca + cb) * math.cos(roll_rad) ** 2 + (1.0 + ca * cb) * math.sin(roll_rad) ** 2)


def roll_variance_from_gradients(
    azimuth1_rad: float, azimuth2_offset_rad: float, roll_rad: float = 0.0, dither_rad: float = 1e-4
) -> float:
    """Return V_psi^2 of the roll estimator, per unit variance of one coupling (largest coupling one)."""
    forward = direction_from_angles(azimuth1_rad, 0.0)
    reverse = direction_from_angles(math.pi + azimuth2_offset_rad, 0.0)
    return float(roll_step(np.zeros((2, 2)), forward, reverse, roll_rad, dither_rad=dither_rad)[1])


def sum_range_bias_m(range_m: ArrayLike, off_active_rad: float, off_passive_rad: float, arrays: ArrayParams) -> Array:
    """Return the bias of sum/18 at short range, [Ra^2 (1 + cos^2) + Rp^2 (1 + cos^2)]/(8 rho)."""
    active = arrays.radius_active_m**2 * (1.0 + math.cos(off_active_rad) ** 2)
    passive = arrays.radius_passive_m**2 * (1.0 + math.cos(off_passive_rad) ** 2)
    return (active + passive) / (8.0 * np.asarray(range_m, dtype=np.float64))
