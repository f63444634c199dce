"""How noise becomes phase, range, direction and roll error (PI83 sections 4.3 and 7).

Per unit variance of one two-way range:
distance 1/36; direction (4/9)/(R cos theta)^2 as the sum of the variances of the rotations about
the array's z and y axes.  Roll: 1/(g^T g) per unit variance of one coupling.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.sequence import direction_step, range_step
from rf_pointing.array_sensors.interferometer.system import ArrayParams
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import require_between


def direction_variance(
    off_boresight_rad: float, radius_m: float = 1.0, variant: str = CORRECTED
) -> float:
    """Return V^2 in rad^2 per m^2: variance of both rotation increments together (PI83 eq. 4-21).

    "published" 0.4448/cos^2 for any array (the report states 1 m diameter, its listing has 1 m
    radius); "corrected" 4/9/(R cos)^2 - the 0.4448 is the residue of the listing's finite dither.
    """
    require_between("off_boresight_rad", off_boresight_rad, 0.0, math.radians(89.9))
    if is_published(variant):
        # The listing's number, dither included; the text gives no formula.
        return 0.4448 / math.cos(off_boresight_rad) ** 2
    return 4.0 / 9.0 / (radius_m * math.cos(off_boresight_rad)) ** 2


def direction_variance_from_gradients(
    range_m: float,
    direction: ArrayLike,
    attitude: ArrayLike,
    arrays: ArrayParams,
    dither_rad: float = 0.01,
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
