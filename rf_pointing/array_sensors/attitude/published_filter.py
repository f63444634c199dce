"""The attitude filter as printed: DOA eqs. (26)-(33), kept beside ours for comparison.

State x = [w, q] with q the vector part of the quaternion; P belongs to it.  A = (29), Phi = E + A dt (28),
H = [0, 2 [S x]] (33) with S = C_bo S_o, additive update of q.  What the paper leaves open is fixed here:

* (29) and the 2 in (33) are the derivatives by a multiplicative error, but the update adds to q: exact near q = 0 only.
* Six states hold no scalar part: it is carried by the propagation (27) and, after an update, set to sqrt(1 - |q|^2);
  an update that leaves |q| > 1 is scaled back to 1 with scalar 0.
* R_W is diagonal, though the error of a unit vector has rank two.
All functions accept leading batch axes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, RigidInertia, propagate, rate_jacobian
from rf_pointing.array_sensors.attitude.rotations import cross_matrix, matrix_from_quaternion

__all__ = ["PublishedState", "published_predict", "published_update"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PublishedState:
    """rate_rad_s (..., 3), quaternion (..., 4) scalar last, covariance (..., 6, 6) of [rate, vector part]."""

    rate_rad_s: Array
    quaternion: Array
    covariance: Array


def published_predict(
    inertia: RigidInertia,
    process_noise: Array,
    state: PublishedState,
    known: KnownTorque,
    frame_rate: Array,
    dt_s: float,
) -> PublishedState:
    """Return the state after one step of (27)-(29); `process_noise` (6, 6) is Q, added once per step."""
    rate = state.rate_rad_s
    slope = np.zeros((*rate.shape[:-1], 6, 6))
    slope[..., :3, :3] = rate_jacobian(inertia, rate, known.wheel_momentum_n_m_s)
    slope[..., 3:, :3] = 0.5 * np.eye(3)
    slope[..., 3:, 3:] = -cross_matrix(rate)
    transition = np.eye(6) + dt_s * slope
    covariance = transition @ state.covariance @ transition.swapaxes(-1, -2) + process_noise
    quaternion, moved = propagate(inertia, state.quaternion, rate, known, frame_rate, dt_s)
    return PublishedState(moved, quaternion, covariance)


def published_update(
    state: PublishedState, measured: Array, measurement_noise: Array, reference: Array
) -> PublishedState:
    """Return the state after one direction (30)-(33); `measurement_noise` (..., 3, 3) is R_W of (22)."""
    expected = np.einsum("...ji,...j->...i", matrix_from_quaternion(state.quaternion), reference)
    slope = 2.0 * cross_matrix(expected)
    crossed = state.covariance[..., :, 3:] @ slope.swapaxes(-1, -2)
    spread = slope @ crossed[..., 3:, :] + measurement_noise
    gain = crossed @ np.linalg.inv(spread)
    change = np.einsum("...ij,...j->...i", gain, measured - expected)
    covariance = state.covariance - gain @ crossed.swapaxes(-1, -2)
    return PublishedState(
        state.rate_rad_s + change[..., :3],
        _with_scalar(state.quaternion, change[..., 3:]),
        0.5 * (covariance + covariance.swapaxes(-1, -2)),
    )


def _with_scalar(quaternion: Array, change: Array) -> Array:
    # q and -q are one attitude: add to the one whose scalar the square root will give back
    vector = quaternion[..., :3] * np.where(quaternion[..., 3:] < 0.0, -1.0, 1.0) + change
    squared = np.sum(vector**2, axis=-1, keepdims=True)
    vector = vector / np.sqrt(np.maximum(squared, 1.0))
    return np.concatenate([vector, np.sqrt(np.maximum(0.0, 1.0 - squared))], axis=-1)
