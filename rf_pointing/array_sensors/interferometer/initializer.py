"""First estimate without prior knowledge, for parallel paths (PI83 chapter 3, program FHR-209).

Range: rho = sum_ij (R_ij - delay)/18 (eqs. 3-2 to 3-7, listing ERANGE).  Directions: differences of
the row means at the active array (eqs. 3-13 to 3-26, DFACT), of the column means at the passive one
(eqs. 3-27 to 3-30, DFPAS).  Roll: from the polarisation couplings.  The error is about radius/range
radians; tracking removes it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.coupling import roll_from_polarisation
from rf_pointing.array_sensors.interferometer.relative_pose import (
    attitude_from_directions,
    reverse_direction,
    roll_from_directions,
)
from rf_pointing.array_sensors.interferometer.system import ArrayParams
from rf_pointing.core.types import Array


def range_from_sum(ranges_m: ArrayLike, arrays: ArrayParams) -> Array:
    """Return the distance (...) from all nine two-way ranges (..., 3, 3) (PI83 eq. 3-7)."""
    return np.asarray(
        np.sum(np.asarray(ranges_m, dtype=np.float64) - arrays.transponder_delay_m, axis=(-2, -1))
        / 18.0
    )


def direction_cosines(centre_ranges_m: ArrayLike, radius_m: float) -> tuple[Array, Array, Array]:
    """Return s_y, s_z and 1 - s_y^2 - s_z^2 (...) from the one-way ranges (..., 3).

    Ranges to elements 1, 2, 3 (PI83 eqs. 3-22, 3-24).  The third value
    is s_x^2; negative, the ranges belong to no direction (noise at grazing, or a wrong lane).
    """
    first, second, third = np.moveaxis(np.asarray(centre_ranges_m, dtype=np.float64), -1, 0)
    along_y = (second - third) / (math.sqrt(3.0) * radius_m)
    along_z = (2.0 * first - second - third) / (3.0 * radius_m)
    return along_y, along_z, 1.0 - along_y**2 - along_z**2


def forward_direction(ranges_m: ArrayLike, range_m: ArrayLike, arrays: ArrayParams) -> Array:
    """Return xi (..., 3), x >= 0, of the passive array seen by the active one (PI83 eqs. 3-13 to
    3-26).
    """
    return _direction(ranges_m, range_m, arrays, -1, arrays.radius_active_m, 1.0)


def reverse_direction_from_ranges(
    ranges_m: ArrayLike, range_m: ArrayLike, arrays: ArrayParams
) -> Array:
    """Return eta (..., 3), x <= 0, of the active array seen by the passive one (PI83 eqs. 3-27 to
    3-30).
    """
    return _direction(ranges_m, range_m, arrays, -2, arrays.radius_passive_m, -1.0)


def _direction(
    ranges_m: ArrayLike,
    range_m: ArrayLike,
    arrays: ArrayParams,
    axis: int,
    radius_m: float,
    side: float,
) -> Array:
    # Averaging over the other array's elements leaves paths to its centre: their sum of positions
    # is zero.
    two_way = np.mean(np.asarray(ranges_m, dtype=np.float64), axis=axis)
    to_centre = two_way - arrays.transponder_delay_m - np.asarray(range_m)[..., None]
    along_y, along_z, square = direction_cosines(to_centre, radius_m)
    # The sign of x is not in the ranges: the arrays are known to face each other.
    direction = np.stack([side * np.sqrt(np.maximum(0.0, square)), along_y, along_z], axis=-1)
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry:
    """Range (...), unit vectors xi and eta (..., 3), relative roll (...).

    One state or a stack of them.
    """

    range_m: Array
    forward: Array
    reverse: Array
    roll_rad: Array

    @property
    def attitude(self) -> Array:
        """A (..., 3, 3), PI83 eq. (2-2)."""
        return attitude_from_directions(self.forward, self.reverse, self.roll_rad)

    @property
    def position_m(self) -> Array:
        """Passive array centre in the active frame (..., 3)."""
        return self.range_m[..., None] * self.forward


def geometry_from_pose(position_m: ArrayLike, attitude: ArrayLike) -> Geometry:
    """Return what both arrays see of position (..., 3) and A (..., 3, 3)."""
    position = np.asarray(position_m, dtype=np.float64)
    distance = np.linalg.norm(position, axis=-1)
    forward = position / distance[..., None]
    reverse = reverse_direction(forward, attitude)
    roll = roll_from_directions(forward, reverse, attitude)
    return Geometry(range_m=distance, forward=forward, reverse=reverse, roll_rad=roll)


def initialize(ranges_m: ArrayLike, amplitudes: ArrayLike, arrays: ArrayParams) -> Geometry:
    """Return the geometry from two-way ranges (..., 3, 3) and couplings (..., 2, 2), no prior
    needed.

    Directions outside the unit circle are put on its edge, as in the listing: ask `aperture_excess`
    first.
    """
    distance = range_from_sum(ranges_m, arrays)
    if np.any(distance <= 0.0):
        raise ValueError(f"range_m={float(np.min(distance))} from the nine ranges must be > 0")
    forward = forward_direction(ranges_m, distance, arrays)
    return Geometry(
        range_m=distance,
        forward=forward,
        reverse=reverse_direction_from_ranges(ranges_m, distance, arrays),
        roll_rad=roll_from_polarisation(amplitudes, forward),
    )


def aperture_excess(ranges_m: ArrayLike, arrays: ArrayParams) -> tuple[Array, Array]:
    """Return s_y^2 + s_z^2 - 1 (...) for the active and the passive array.

    Positive belongs to no direction.
    """
    ranges = np.asarray(ranges_m, dtype=np.float64)
    sides = ((-1, arrays.radius_active_m), (-2, arrays.radius_passive_m))
    # The cosines are made of differences: what all paths have in common drops out.
    forward, reverse = (
        -direction_cosines(np.mean(ranges, axis=axis), radius)[2] for axis, radius in sides
    )
    return forward, reverse
