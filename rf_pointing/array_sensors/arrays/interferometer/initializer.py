"""First estimate without prior knowledge: range, both directions, then roll (PI83 chapter 3, program FHR-209).

The estimate holds for parallel paths, so its error is about radius/range radians; tracking removes it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams
from rf_pointing.array_sensors.arrays.interferometer.coupling import roll_from_polarisation
from rf_pointing.array_sensors.arrays.interferometer.direction_finding import (
    direction_cosines,
    forward_direction,
    range_from_sum,
    reverse_direction_from_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.relative_pose import (
    attitude_from_directions,
    reverse_direction,
    roll_from_directions,
)

__all__ = ["Geometry", "aperture_excess", "geometry_from_pose", "initialize"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry:
    """Range (...), unit vectors xi and eta (..., 3), relative roll (...): one state or a stack of them."""

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
    """Return the geometry from two-way ranges (..., 3, 3) and couplings (..., 2, 2), no prior needed.

    Directions outside the unit circle are put on its edge, as in the listing: ask `aperture_excess` first.
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
    """Return s_y^2 + s_z^2 - 1 (...) for the active and the passive array: positive belongs to no direction."""
    ranges = np.asarray(ranges_m, dtype=np.float64)
    distance = range_from_sum(ranges, arrays)
    sides = ((-1, arrays.radius_active_m), (-2, arrays.radius_passive_m))
    forward, reverse = (
        -direction_cosines(np.mean(ranges, axis=axis) - arrays.transponder_delay_m - distance[..., None], radius)[2]
        for axis, radius in sides
    )
    return forward, reverse
