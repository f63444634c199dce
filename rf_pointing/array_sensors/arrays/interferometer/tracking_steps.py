"""The four estimators of the tracking filter, each one step: range, direction, roll, excitation.

PI83 section 4.2, listing MVLE1, MVLE2/GRAD2, MVLE3/GRAD3; the excitation step is described there (eqs. 4-17 to 4-19)
but not listed.  All work on stacks; covariances are per unit variance of one measurement.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import (
    ArrayParams,
    two_way_gradients,
    two_way_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.coupling import coupling_from_two_way
from rf_pointing.array_sensors.arrays.interferometer.direction_finding import range_from_sum
from rf_pointing.array_sensors.arrays.interferometer.frames import small_rotation
from rf_pointing.array_sensors.arrays.interferometer.minimum_variance import minimum_variance_step
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, is_published
from rf_pointing.core import wrap_rad

__all__ = ["direction_step", "excitation_step", "range_step", "roll_step", "turned_direction"]

Array = NDArray[np.float64]
_SMALLEST_COUPLING = 1e-6


def range_step(
    ranges_m: ArrayLike,
    range_m: ArrayLike,
    forward: ArrayLike,
    attitude: ArrayLike,
    arrays: ArrayParams,
    variant: str = CORRECTED,
) -> tuple[Array, Array]:
    """Return the range (...) and its variance (...) per unit variance of one two-way range.

    "corrected": one step with true gradients d R_ij/d rho; "published": the simulation's sum/18, whose bias at short
    range is [Ra^2 (1 + cos^2) + Rp^2 (1 + cos^2)]/(8 rho).
    """
    if is_published(variant):
        distance = range_from_sum(ranges_m, arrays)
        return distance, np.full_like(distance, 1.0 / 36.0)
    forward = np.asarray(forward, dtype=np.float64)
    position = np.asarray(range_m)[..., None] * forward
    gradient = np.einsum("...ijk,...k->...ij", two_way_gradients(position, attitude, arrays)[0], forward)
    innovation = np.asarray(ranges_m) - two_way_ranges(position, attitude, arrays)
    increment, variance = minimum_variance_step(_flat(gradient)[..., None], _flat(innovation))
    return np.asarray(range_m) + increment[..., 0], variance[..., 0, 0]


def direction_step(
    ranges_m: ArrayLike,
    range_m: ArrayLike,
    direction: ArrayLike,
    attitude: ArrayLike,
    arrays: ArrayParams,
    dither_rad: float = 0.01,
) -> tuple[Array, Array]:
    """Return the direction (..., 3) and the covariance (..., 2, 2) of its azimuth and elevation increments.

    Three sums over the other array's elements, y_i = sum_j R_ij - 6 rho (listing RYXFER): nine separate ranges would
    let attitude errors into the direction.  For the reverse direction give the transposed ranges, eta, the attitude
    of the active array relative to the passive one (A^T) and `arrays.swapped()`.
    """
    distance = np.asarray(range_m, dtype=np.float64)[..., None]

    def sums(pointing: Array) -> Array:
        return np.asarray(np.sum(two_way_ranges(distance * pointing, attitude, arrays), axis=-1))

    direction = np.asarray(direction, dtype=np.float64)
    predicted = sums(direction)
    dithered = (turned_direction(direction, dither_rad, 0.0), turned_direction(direction, 0.0, dither_rad))
    gradient = np.stack([(sums(moved) - predicted) / dither_rad for moved in dithered], axis=-1)
    increment, covariance = minimum_variance_step(gradient, np.sum(np.asarray(ranges_m), axis=-1) - predicted)
    return turned_direction(direction, increment[..., 0], increment[..., 1]), covariance


def turned_direction(direction: ArrayLike, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> Array:
    """Return the direction turned by small angles, to first order and renormalised (PI83 eqs. 4-10, 4-11)."""
    turn = small_rotation(-np.asarray(azimuth_rad), -np.asarray(elevation_rad), 0.0)
    turned = np.einsum("...ij,...j->...i", turn, np.asarray(direction))
    return np.asarray(turned / np.linalg.norm(turned, axis=-1, keepdims=True))


def roll_step(
    amplitudes: ArrayLike,
    forward: ArrayLike,
    reverse: ArrayLike,
    roll_rad: ArrayLike,
    excitation: ArrayLike = (1.0, 1.0),
    dither_rad: float = 0.01,
) -> tuple[Array, Array]:
    """Return the roll (...) in [-pi, pi) and its variance (...) per unit variance of one coupling (eq. 4-16)."""
    gains = np.asarray(excitation, dtype=np.float64)[..., None, :]
    predicted = coupling_from_two_way(forward, reverse, roll_rad) * gains
    moved = coupling_from_two_way(forward, reverse, np.asarray(roll_rad) + dither_rad) * gains
    gradient = _flat((moved - predicted) / dither_rad)[..., None]
    increment, variance = minimum_variance_step(gradient, _flat(np.asarray(amplitudes) - predicted))
    return wrap_rad(np.asarray(roll_rad) + increment[..., 0]), variance[..., 0, 0]


def excitation_step(
    amplitudes: ArrayLike, forward: ArrayLike, reverse: ArrayLike, roll_rad: ArrayLike
) -> tuple[Array, Array]:
    """Return the two excitation factors (..., 2) and their covariance (..., 2, 2) (PI83 eqs. 4-17 to 4-19).

    The model is linear in the factors, so one step from zero is the estimate.  Raises ValueError when a dipole is
    not received at all.
    """
    coupling = coupling_from_two_way(forward, reverse, roll_rad)
    if np.any(np.linalg.norm(coupling, axis=-2) < _SMALLEST_COUPLING):
        raise ValueError(f"a dipole points along the path: its coupling is below {_SMALLEST_COUPLING}")
    gradient = np.zeros((*coupling.shape[:-2], 4, 2))
    gradient[..., 0, 0], gradient[..., 2, 0] = coupling[..., 0, 0], coupling[..., 1, 0]
    gradient[..., 1, 1], gradient[..., 3, 1] = coupling[..., 0, 1], coupling[..., 1, 1]
    return minimum_variance_step(gradient, _flat(np.asarray(amplitudes)))


def _flat(matrix: Array) -> Array:
    return matrix.reshape(*matrix.shape[:-2], -1)
