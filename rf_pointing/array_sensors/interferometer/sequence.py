"""Sequenced minimum-variance tracking: range, direction, reverse direction, roll, excitation.

Each estimator improves what the next one uses (PI83 section 4.2, Fig. 4-1; listings ITER, MVLE1 to
MVLE3, GRAD2, GRAD3; excitation eqs. 4-17 to 4-19).  One joint estimator of all nine ranges settles
on wrong attitudes when it starts far away; the sequence does not.

Every step is linear: dz = B dy with B = H G^T L^-1 and H = (G^T L^-1 G)^-1 (eqs. 4-2 to 4-8), G the
gradient and L the measurement covariance.  All functions work on stacks; covariances are per unit
variance of one measurement.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.interferometer.coupling import coupling_from_two_way
from rf_pointing.array_sensors.interferometer.frames import small_rotation
from rf_pointing.array_sensors.interferometer.initializer import Geometry, range_from_sum
from rf_pointing.array_sensors.interferometer.system import (
    ArrayParams,
    two_way_gradients,
    two_way_ranges,
)
from rf_pointing.array_sensors.interferometer.variant import CORRECTED, VARIANTS, is_published
from rf_pointing.core import Params, parameter, wrap_rad
from rf_pointing.core.types import Array

# Least eigenvalue of a matrix scaled to a unit diagonal; rounding leaves 1e-15 of an exact zero.
_SMALLEST_EIGENVALUE = 1e-12
_SMALLEST_COUPLING = 1e-6
_UNIT_EXCITATION = np.ones(2)


def minimum_variance_step(
    gradient: ArrayLike, innovation: ArrayLike, covariance: ArrayLike | None = None
) -> tuple[Array, Array]:
    """Return the increment dz (..., n) and its covariance H (..., n, n).

    Parameters: `gradient` G (..., m, n), `innovation` dy (..., m), `covariance` L (..., m, m) or
    None for the unit matrix (then H is per unit variance, as in the listing).  Raises ValueError if
    L is singular or the measurements do not determine all n parameters.
    """
    g = np.asarray(gradient, dtype=np.float64)
    weighted = g if covariance is None else _weighted(g, np.asarray(covariance, dtype=np.float64))
    information = np.swapaxes(g, -1, -2) @ weighted
    scale = np.sqrt(np.einsum("...kk->...k", information))
    if np.any(scale == 0.0) or not np.all(np.isfinite(scale)):
        raise ValueError("gradient has a zero or undefined column: a parameter is not determined")
    # Scaled to a unit diagonal first: metres and radians would make a sound problem look singular.
    scaled = information / (scale[..., :, None] * scale[..., None, :])
    if np.any(np.linalg.eigvalsh(scaled)[..., 0] < _SMALLEST_EIGENVALUE):
        raise ValueError(
            "gradient is rank deficient: the measurements do not determine all parameters"
        )
    h = np.linalg.inv(scaled) / (scale[..., :, None] * scale[..., None, :])
    projected = np.einsum("...mn,...m->...n", weighted, np.asarray(innovation, dtype=np.float64))
    return np.einsum("...ij,...j->...i", h, projected), h


def _weighted(gradient: Array, covariance: Array) -> Array:
    if not _is_positive_definite(covariance):
        raise ValueError(
            "covariance is singular or not positive definite: a measurement is certain or NaN"
        )
    return np.asarray(np.linalg.solve(covariance, gradient))


def _is_positive_definite(covariance: Array) -> bool:
    # Not by Cholesky: whether it succeeds on a singular matrix is up to the last bits.
    variance = np.einsum("...kk->...k", covariance)
    if not (np.all(np.isfinite(covariance)) and np.all(variance > 0.0)):
        return False
    sigma = np.sqrt(variance)
    least = np.linalg.eigvalsh(covariance / (sigma[..., :, None] * sigma[..., None, :]))[..., 0]
    return bool(np.all(least > _SMALLEST_EIGENVALUE))


def range_step(
    ranges_m: ArrayLike,
    range_m: ArrayLike,
    forward: ArrayLike,
    attitude: ArrayLike,
    arrays: ArrayParams,
    variant: str = CORRECTED,
) -> tuple[Array, Array]:
    """Return the range (...) and its variance (...) per unit variance of one two-way range.

    "corrected": one step with true gradients d R_ij/d rho; "published": the simulation's sum/18,
    whose bias at short range is [Ra^2 (1 + cos^2) + Rp^2 (1 + cos^2)]/(8 rho).
    """
    if is_published(variant):
        distance = range_from_sum(ranges_m, arrays)
        return distance, np.full_like(distance, 1.0 / 36.0)
    forward = np.asarray(forward, dtype=np.float64)
    position = np.asarray(range_m)[..., None] * forward
    gradient = np.einsum(
        "...ijk,...k->...ij", two_way_gradients(position, attitude, arrays)[0], forward
    )
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
    """Return the direction (..., 3) and the covariance (..., 2, 2) of its azimuth and elevation
    increments.

    Three sums over the other array's elements, y_i = sum_j R_ij - 6 rho (listing RYXFER): nine
    separate ranges would let attitude errors into the direction.  For the reverse direction give
    the transposed ranges, eta, the attitude of the active array relative to the passive one (A^T)
    and `arrays.swapped()`.
    """
    distance = np.asarray(range_m, dtype=np.float64)[..., None]

    def sums(pointing: Array) -> Array:
        return np.asarray(np.sum(two_way_ranges(distance * pointing, attitude, arrays), axis=-1))

    direction = np.asarray(direction, dtype=np.float64)
    predicted = sums(direction)
    # The listing's finite dither of 10 mrad, kept so that our numbers compare with the report's.
    dithered = (
        turned_direction(direction, dither_rad, 0.0),
        turned_direction(direction, 0.0, dither_rad),
    )
    gradient = np.stack([(sums(moved) - predicted) / dither_rad for moved in dithered], axis=-1)
    increment, covariance = minimum_variance_step(
        gradient, np.sum(np.asarray(ranges_m), axis=-1) - predicted
    )
    return turned_direction(direction, increment[..., 0], increment[..., 1]), covariance


def turned_direction(
    direction: ArrayLike, azimuth_rad: ArrayLike, elevation_rad: ArrayLike
) -> Array:
    """Return the direction turned by small angles, to first order and renormalised (PI83 eqs. 4-10,
    4-11).
    """
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
    """Return the roll (...) in [-pi, pi) and its variance (...) per unit variance of one coupling
    (eq. 4-16).
    """
    gains = np.asarray(excitation, dtype=np.float64)[..., None, :]
    predicted = coupling_from_two_way(forward, reverse, roll_rad) * gains
    moved = coupling_from_two_way(forward, reverse, np.asarray(roll_rad) + dither_rad) * gains
    gradient = _flat((moved - predicted) / dither_rad)[..., None]
    increment, variance = minimum_variance_step(gradient, _flat(np.asarray(amplitudes) - predicted))
    return wrap_rad(np.asarray(roll_rad) + increment[..., 0]), variance[..., 0, 0]


def excitation_step(
    amplitudes: ArrayLike, forward: ArrayLike, reverse: ArrayLike, roll_rad: ArrayLike
) -> tuple[Array, Array]:
    """Return the two excitation factors (..., 2) and their covariance (..., 2, 2) (PI83 eqs. 4-17
    to 4-19).

    The model is linear in the factors, so one step from zero is the estimate.  Raises ValueError
    when a dipole is not received at all.
    """
    coupling = coupling_from_two_way(forward, reverse, roll_rad)
    if np.any(np.linalg.norm(coupling, axis=-2) < _SMALLEST_COUPLING):
        raise ValueError(
            f"a dipole points along the path: its coupling is below {_SMALLEST_COUPLING}"
        )
    gradient = np.zeros((*coupling.shape[:-2], 4, 2))
    gradient[..., 0, 0], gradient[..., 2, 0] = coupling[..., 0, 0], coupling[..., 1, 0]
    gradient[..., 1, 1], gradient[..., 3, 1] = coupling[..., 0, 1], coupling[..., 1, 1]
    return minimum_variance_step(gradient, _flat(np.asarray(amplitudes)))


def _flat(matrix: Array) -> Array:
    return matrix.reshape(*matrix.shape[:-2], -1)


@dataclass(frozen=True, kw_only=True)
class SequenceParams(Params):
    """How the sequence runs; the defaults are the corrected forms."""

    iterations: int = parameter(
        2, "passes through the sequence per set of measurements", low=1, high=50
    )
    dither_rad: float = parameter(0.01, "step of the numerical gradients", low=1e-6, high=0.1)
    range_estimator: str = parameter(
        CORRECTED, "published: sum/18; corrected: true gradients", choices=VARIANTS
    )
    reverse_attitude: str = parameter(
        CORRECTED, "published: the listing's A^T for A, a slip", choices=VARIANTS
    )
    estimate_excitation: bool = parameter(False, "track the two dipoles' excitation factors")


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceResult:
    """Estimate and its sensitivities per unit measurement variance.

    Range (...), directions (..., 2, 2), roll (...).
    """

    geometry: Geometry
    excitation: Array
    range_variance: Array
    forward_covariance: Array
    reverse_covariance: Array
    roll_variance: Array


def track(
    geometry: Geometry,
    ranges_m: ArrayLike,
    amplitudes: ArrayLike,
    arrays: ArrayParams,
    params: SequenceParams,
    excitation: ArrayLike = _UNIT_EXCITATION,
) -> SequenceResult:
    """Return the estimate after `params.iterations` passes from `geometry` over the same
    measurements.

    `ranges_m` (..., 3, 3), `amplitudes` (..., 2, 2), `excitation` (..., 2).  Angle errors up to 45
    deg and a range ten times too long or too short are forgiven.  Raises ValueError where the
    measurements determine no pose.
    """
    result = track_once(geometry, ranges_m, amplitudes, arrays, params, excitation)
    for _ in range(params.iterations - 1):
        result = track_once(
            result.geometry, ranges_m, amplitudes, arrays, params, result.excitation
        )
    return result


def track_once(
    geometry: Geometry,
    ranges_m: ArrayLike,
    amplitudes: ArrayLike,
    arrays: ArrayParams,
    params: SequenceParams,
    excitation: ArrayLike = _UNIT_EXCITATION,
) -> SequenceResult:
    """Return the estimate after one pass (listing ITER)."""
    ranges = np.asarray(ranges_m, dtype=np.float64)
    attitude = geometry.attitude
    distance, range_variance = range_step(
        ranges, geometry.range_m, geometry.forward, attitude, arrays, params.range_estimator
    )
    # A negative distance turns every direction round; the following steps would converge to the
    # mirror image.
    if np.any(distance <= 0.0):
        raise ValueError(
            f"range_m={float(np.min(distance))} after the range step must be > 0: measurements disagree"
        )
    forward, forward_covariance = direction_step(
        ranges, distance, geometry.forward, attitude, arrays, params.dither_rad
    )
    reverse, reverse_covariance = direction_step(
        np.swapaxes(ranges, -1, -2),
        distance,
        geometry.reverse,
        # The listing passes A where the reverse direction needs its transpose: a slip that equal
        # attitudes hide.
        attitude if is_published(params.reverse_attitude) else np.swapaxes(attitude, -1, -2),
        arrays.swapped(),
        params.dither_rad,
    )
    # Last, because both directions enter the couplings.
    roll, roll_variance = roll_step(
        amplitudes, forward, reverse, geometry.roll_rad, excitation, params.dither_rad
    )
    if params.estimate_excitation:
        excitation, _ = excitation_step(amplitudes, forward, reverse, roll)
    return SequenceResult(
        geometry=Geometry(range_m=distance, forward=forward, reverse=reverse, roll_rad=roll),
        excitation=np.asarray(excitation, dtype=np.float64),
        range_variance=range_variance,
        forward_covariance=forward_covariance,
        reverse_covariance=reverse_covariance,
        roll_variance=roll_variance,
    )
