"""Relative pose of two spacecraft, and the attitude that both directions and the roll make.

A = Tz(pi - a2) Ty(b2) Tx(roll) Ty(b1) Tz(a1), PI83 eq. (2-2); the direction back is eta = -A xi,
eq. (4-14).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude.quaternion import require_rotation
from rf_pointing.array_sensors.interferometer.frames import (
    azimuth_rotation,
    elevation_rotation,
    forward_angles,
    reverse_angles,
    roll_rotation,
)
from rf_pointing.core import as_finite_array
from rf_pointing.core.types import Array

# Elevation 2 of +-90 deg: azimuth 2 and roll turn about one axis there.
_POLE_COSINE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativePose:
    """Passive array centre in the active frame (3,), and A (3, 3) with v_passive = A v_active."""

    position_m: Array
    attitude: Array

    def __post_init__(self) -> None:
        position = as_finite_array("position_m", self.position_m, (3,))
        # The direction to the other array would be undefined, and every estimator starts from it.
        if not np.any(position):
            raise ValueError(f"position_m={position} must be away from the active array")
        object.__setattr__(self, "position_m", position)
        attitude = as_finite_array("attitude", self.attitude, (3, 3))
        object.__setattr__(self, "attitude", require_rotation("attitude", attitude))

    @property
    def range_m(self) -> float:
        """Distance between the array centres."""
        return float(np.linalg.norm(self.position_m))

    @property
    def direction(self) -> Array:
        """Unit vector xi (3,) to the passive array, in the active frame."""
        return self.position_m / np.linalg.norm(self.position_m)


def reverse_direction(direction: ArrayLike, attitude: ArrayLike) -> Array:
    """Return eta = -A xi (..., 3), the active array seen from the passive one (PI83 eq. 4-14)."""
    return np.asarray(-np.einsum("...ij,...j->...i", np.asarray(attitude), np.asarray(direction)))


def attitude_from_two_way(
    azimuth1_rad: ArrayLike,
    elevation1_rad: ArrayLike,
    azimuth2_rad: ArrayLike,
    elevation2_rad: ArrayLike,
    roll_rad: ArrayLike,
) -> Array:
    """Return A (..., 3, 3) (PI83 eq. 2-2, listing A2COMP)."""
    # pi - a2: facing each other, the passive array sees the active one at azimuth 180 deg.
    seen_by_passive = azimuth_rotation(np.pi - np.asarray(azimuth2_rad)) @ elevation_rotation(
        elevation2_rad
    )
    seen_by_active = elevation_rotation(elevation1_rad) @ azimuth_rotation(azimuth1_rad)
    return seen_by_passive @ roll_rotation(roll_rad) @ seen_by_active


def attitude_from_directions(forward: ArrayLike, reverse: ArrayLike, roll_rad: ArrayLike) -> Array:
    """Return A (..., 3, 3) from the unit vectors xi, eta (..., 3) and the relative roll."""
    return attitude_from_two_way(*forward_angles(forward), *reverse_angles(reverse), roll_rad)


def roll_from_directions(forward: ArrayLike, reverse: ArrayLike, attitude: ArrayLike) -> Array:
    """Return the relative roll from Tx(roll) = Ty(-b2) Tz(a2 - pi) A Tz(-a1) Ty(-b1)."""
    reverse = np.asarray(reverse, dtype=np.float64)
    if np.any(np.hypot(reverse[..., 0], reverse[..., 1]) < _POLE_COSINE):
        raise ValueError(
            "elevation2 is +-90 deg: azimuth 2 and relative roll are not defined there"
        )
    azimuth1, elevation1 = forward_angles(forward)
    azimuth2, elevation2 = reverse_angles(reverse)
    left = elevation_rotation(-elevation2) @ azimuth_rotation(azimuth2 - np.pi)
    middle = (
        left @ np.asarray(attitude) @ azimuth_rotation(-azimuth1) @ elevation_rotation(-elevation1)
    )
    return np.asarray(np.arctan2(middle[..., 1, 2], middle[..., 2, 2]))
