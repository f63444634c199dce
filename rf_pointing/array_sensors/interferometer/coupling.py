"""Polarisation coupling of the crossed dipoles of A1 and P1, and the roll that it shows.

Short dipoles in the far field: the field keeps what is across the path, so the field at the active
array from dipole moments given in the passive frame is C = (1 - xi xi^T) A^T (PI83 eqs. 3-31, 3-33,
listing COUPLE).  Measured are the four couplings between the y and z dipoles, C[y,z][y,z], rows:
receiving active dipole.
"""

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.frames import forward_angles
from rf_pointing.array_sensors.interferometer.relative_pose import attitude_from_directions
from rf_pointing.core.types import Array

# Cosine or coupling below which the roll is rounding and not a measurement.
_SINGULAR = 1e-9


def coupling_matrix(direction: ArrayLike, attitude: ArrayLike) -> Array:
    """Return C (..., 3, 3): column k is the field in the active frame of a unit dipole along
    passive axis k.
    """
    forward = np.asarray(direction, dtype=np.float64)
    across = np.eye(3) - forward[..., :, None] * forward[..., None, :]
    return across @ np.swapaxes(np.asarray(attitude, dtype=np.float64), -1, -2)


def coupling_amplitudes(direction: ArrayLike, attitude: ArrayLike) -> Array:
    """Return the four measured couplings (..., 2, 2), y and z dipoles (listing CYXFER)."""
    return coupling_matrix(direction, attitude)[..., 1:, 1:]


def coupling_from_two_way(forward: ArrayLike, reverse: ArrayLike, roll_rad: ArrayLike) -> Array:
    """Return the four couplings (..., 2, 2) from both directions and roll (PI83 eq. 4-16)."""
    return coupling_amplitudes(forward, attitude_from_directions(forward, reverse, roll_rad))


def tracking_frame_dipole(received: ArrayLike, direction: ArrayLike) -> tuple[Array, Array]:
    """Return the y and z components across the path of a field received with y and z (..., 2) (eqs.
    3-42, 3-43).

    Raises ValueError at azimuth 1 or elevation 1 of +-90 deg, where the dipoles do not see the
    whole field.
    """
    azimuth, elevation = forward_angles(direction)
    if np.any(np.abs(np.cos(azimuth)) < _SINGULAR) or np.any(np.cos(elevation) < _SINGULAR):
        raise ValueError(
            "azimuth1 or elevation1 is +-90 deg: the y and z dipoles do not see the whole field there"
        )
    along_y, along_z = np.moveaxis(np.asarray(received, dtype=np.float64), -1, 0)
    # The dipoles are along y and z of the array; off boresight the field across the path has both
    # components in each.
    across_z = along_z / np.cos(elevation)
    return (along_y - np.sin(elevation) * np.sin(azimuth) * across_z) / np.cos(azimuth), across_z


def roll_from_polarisation(amplitudes: ArrayLike, direction: ArrayLike) -> Array:
    """Return the relative roll (...) in [-pi, pi] from the z dipole's couplings (PI83 eq. 3-49,
    listing ESTROL).

    Independent of the dipole's gain and of elevation 2.  `amplitudes` (..., 2, 2), `direction` xi
    (..., 3).  Raises ValueError when the z dipole is not received at all (elevation 2 of +-90 deg).
    """
    across_y, across_z = tracking_frame_dipole(np.asarray(amplitudes)[..., 1], direction)
    if np.any(np.hypot(across_y, across_z) < _SINGULAR):
        raise ValueError(
            "the z dipole's couplings vanish: elevation2 is +-90 deg or there is no signal"
        )
    # A ratio of two couplings of the same dipole: its gain and its excitation cancel.
    return np.arctan2(-across_y, across_z)
