"""The two arrays and the paths between their elements.

Element 0 sits in the centre, elements 1, 2, 3 on a circle of the array's radius, 120 deg apart, in the y-z plane
(PI83 eqs. 2-6 to 2-13).  A two-way range is the path out from the active centre to the passive centre and back from
passive element j to active element i: R_ij = rho_ij + rho_00 + delay, eq. (3-1).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.rotations import cross_product
from rf_pointing.core import Params, parameter

__all__ = [
    "ArrayParams",
    "element_positions",
    "path_lengths",
    "path_rates_m_s",
    "path_vectors",
    "two_way_gradients",
    "two_way_ranges",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ArrayParams(Params):
    """Sizes of the two arrays and the transponder's delay, known from calibration."""

    radius_active_m: float = parameter(1.0, "circle of the active array's three elements", low=1e-3, high=100.0)
    radius_passive_m: float = parameter(1.0, "circle of the passive array's three elements", low=1e-3, high=100.0)
    transponder_delay_m: float = parameter(0.0, "transponder and cable delay, as a length of path", low=0.0)

    def swapped(self) -> "ArrayParams":
        """Return the same system with the two arrays exchanged, for the reverse direction."""
        return self.replace(radius_active_m=self.radius_passive_m, radius_passive_m=self.radius_active_m)


def element_positions(radius_m: float) -> Array:
    """Return elements 0 to 3 in their own array's frame, (4, 3) (PI83 eqs. 2-6 to 2-9)."""
    half_root3 = math.sqrt(3.0) / 2.0
    unit = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -half_root3, 0.5], [0.0, half_root3, 0.5]]
    return radius_m * np.array(unit)


def path_vectors(position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams) -> Array:
    """Return r + A^T p_j - a_i for all sixteen pairs, (..., 4, 4, 3), in the active frame.

    Parameters: `position_m` (..., 3) of the passive centre, `attitude` A (..., 3, 3).
    """
    active = element_positions(arrays.radius_active_m)
    passive = element_positions(arrays.radius_passive_m) @ np.asarray(attitude, dtype=np.float64)
    ends = np.asarray(position_m, dtype=np.float64)[..., None, :] + passive
    return ends[..., None, :, :] - active[:, None, :]


def path_lengths(position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams) -> Array:
    """Return the sixteen one-way lengths rho_ij, (..., 4, 4): active element i, passive element j (listing PATH2)."""
    return np.asarray(np.linalg.norm(path_vectors(position_m, attitude, arrays), axis=-1))


def two_way_ranges(position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams) -> Array:
    """Return the nine two-way ranges R_ij, (..., 3, 3) (PI83 eq. 3-1, listing PATHES)."""
    lengths = path_lengths(position_m, attitude, arrays)
    return lengths[..., 1:, 1:] + lengths[..., :1, :1] + arrays.transponder_delay_m


def path_rates_m_s(
    position_m: ArrayLike, velocity_m_s: ArrayLike, attitude: ArrayLike, rate_rad_s: ArrayLike, arrays: ArrayParams
) -> Array:
    """Return d rho_ij/dt of all sixteen pairs, (..., 4, 4): u_ij . (v + A^T (omega x p_j))."""
    vectors = path_vectors(position_m, attitude, arrays)
    units = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    rate = np.asarray(rate_rad_s, dtype=np.float64)[..., None, :]
    swing = cross_product(rate, element_positions(arrays.radius_passive_m)) @ np.asarray(attitude, dtype=np.float64)
    moving = np.asarray(velocity_m_s, dtype=np.float64)[..., None, :] + swing
    return np.asarray(np.einsum("...ijk,...jk->...ij", units, moving))


def two_way_gradients(position_m: ArrayLike, attitude: ArrayLike, arrays: ArrayParams) -> tuple[Array, Array]:
    """Return dR_ij/dr (..., 3, 3, 3) and dR_ij/dtheta (..., 3, 3, 3), last axis x, y, z.

    theta is the frame rotation vector in the passive frame, A = frame_rotation(theta) A0:
    d rho_ij/dtheta = p_j x (A u_ij) with u_ij the unit vector along the path.
    """
    attitude = np.asarray(attitude, dtype=np.float64)
    vectors = path_vectors(position_m, attitude, arrays)
    units = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    seen = np.einsum("...ab,...ijb->...ija", attitude, units[..., 1:, 1:, :])
    turning = cross_product(element_positions(arrays.radius_passive_m)[1:], seen)
    return units[..., 1:, 1:, :] + units[..., :1, :1, :], turning
