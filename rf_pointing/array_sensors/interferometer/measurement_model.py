"""Expected reading of a relative motion and its gradient in local coordinates.

Local coordinates are fourteen small changes in which the measurements are nearly linear: range and
two cross-track lengths (angle times range), velocity in the line-of-sight frame turned along with
the direction, rotation vector of A in the passive frame, angular rate, two excitation factors.
Cartesian changes are not linear enough: at 100 km a cross-track error of 70 m lengthens the range
by 25 mm, forty sigma.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.attitude.rotations import cross_product, tangent_rows
from rf_pointing.array_sensors.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.interferometer.frames import frame_rotation, rotation_vector
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion, moved
from rf_pointing.array_sensors.interferometer.reading import Reading, rate_weights
from rf_pointing.array_sensors.interferometer.system import (
    InterferometerSystem,
    path_accelerations_m_s2,
    path_rates_m_s,
    two_way_ranges,
)
from rf_pointing.core.types import Array

SIZE = 14
POSITION, VELOCITY, ATTITUDE, RATE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
EXCITATION = slice(12, 14)
_ANGLE_STEP_RAD = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedMotion:
    """A relative motion and the excitation factors (..., 2) of the passive y and z dipoles."""

    motion: RelativeMotion
    excitation: Array


def sight_axes(position_m: Array) -> Array:
    """Return the matrix (..., 3, 3) whose columns are the direction and two axes across it,
    right-handed.
    """
    forward = position_m / np.linalg.norm(position_m, axis=-1, keepdims=True)
    rows = np.concatenate([forward[..., None, :], tangent_rows(forward)], axis=-2)
    return np.swapaxes(rows, -1, -2)


def displaced(tracked: TrackedMotion, change: Array) -> TrackedMotion:
    """Return the motion changed by local coordinates (..., 14); inverse of `local_difference`."""
    motion = tracked.motion
    axes = sight_axes(motion.position_m)
    distance = np.linalg.norm(motion.position_m, axis=-1)
    # Cross-track lengths over the distance are angles about the other two axes: hence the exchange
    # and the sign.
    turn = (
        np.stack([np.zeros_like(change[..., 0]), -change[..., 2], change[..., 1]], axis=-1)
        / distance[..., None]
    )
    turning = _vector_rotation(_apply(axes, turn))
    velocity = motion.velocity_m_s + _apply(axes, change[..., VELOCITY])
    return TrackedMotion(
        motion=RelativeMotion(
            position_m=(distance + change[..., 0])[..., None] * _apply(turning, axes[..., 0]),
            velocity_m_s=_apply(turning, velocity),
            attitude=frame_rotation(change[..., ATTITUDE]) @ motion.attitude,
            rate_rad_s=motion.rate_rad_s + change[..., RATE],
        ),
        excitation=tracked.excitation + change[..., EXCITATION],
    )


def local_difference(tracked: TrackedMotion, reference: TrackedMotion) -> Array:
    """Return the local coordinates (..., 14) that lead from `reference` to `tracked`."""
    there, here = tracked.motion, reference.motion
    axes = sight_axes(here.position_m)
    distance = np.linalg.norm(here.position_m, axis=-1)
    unit = there.position_m / np.linalg.norm(there.position_m, axis=-1, keepdims=True)
    cross = cross_product(axes[..., 0], unit)
    sine, cosine = np.linalg.norm(cross, axis=-1), np.sum(axes[..., 0] * unit, axis=-1)
    # Angle over sine, one in the limit: the vector stays exact for large angles and regular at
    # zero.
    scale = np.where(sine > 0.0, np.arctan2(sine, cosine) / np.where(sine > 0.0, sine, 1.0), 1.0)
    turn = cross * scale[..., None]
    back = np.swapaxes(axes, -1, -2)
    local_turn = _apply(back, turn)
    # The velocity is compared in the line-of-sight frame of the reference: turned back with the
    # direction.
    velocity = _apply(_vector_rotation(-turn), there.velocity_m_s) - here.velocity_m_s
    along = np.linalg.norm(there.position_m, axis=-1) - distance
    position = np.stack(
        [along, distance * local_turn[..., 2], -distance * local_turn[..., 1]], axis=-1
    )
    attitude = rotation_vector(there.attitude @ np.swapaxes(here.attitude, -1, -2))
    parts = [position, _apply(back, velocity), attitude, there.rate_rad_s - here.rate_rad_s]
    return np.concatenate([*parts, tracked.excitation - reference.excitation], axis=-1)


def cartesian_jacobian(motion: RelativeMotion) -> Array:
    """Return d(position, velocity, rotation vector, rate)/d(local), (12, 12), of one motion."""
    axes = sight_axes(motion.position_m)
    jacobian = np.eye(12)
    jacobian[POSITION, POSITION] = jacobian[VELOCITY, VELOCITY] = axes
    turns = np.stack([np.zeros(3), axes[:, 2], -axes[:, 1]]) / np.linalg.norm(motion.position_m)
    jacobian[VELOCITY, POSITION] = cross_product(turns, motion.velocity_m_s).T
    return jacobian


def cartesian_covariance(motion: RelativeMotion, covariance: Array) -> Array:
    """Return the covariance (12, 12) of position, velocity, rotation vector and rate about `motion`
    from that of the local coordinates.

    To first order, and along the sight to second: a cross-track error c shortens the way along it
    by c^2/(2 rho), which far away exceeds the error of the range, and turns an error of the
    velocity across into one along.
    """
    jacobian, distance = cartesian_jacobian(motion), np.linalg.norm(motion.position_m)
    # z^T A z for both, z the cross-track position and velocity: <qp qv> = tr(A_p Z) tr(A_v Z) +
    # 2 tr(A_p Z A_v Z) of a Gaussian z.
    form = np.zeros((2, 4, 4))
    form[0, :2, :2] = -0.5 / distance * np.eye(2)
    form[1, :2, 2:] = form[1, 2:, :2] = -0.5 / distance * np.eye(2)
    across = covariance[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])]
    products = form @ across
    traces = np.einsum("kii->k", products)
    along = np.zeros((12, 2))
    along[POSITION, 0] = along[VELOCITY, 1] = motion.position_m / distance
    bent = np.outer(traces, traces) + 2.0 * np.einsum("kij,lji->kl", products, products)
    return np.asarray(jacobian @ covariance[:12, :12] @ jacobian.T + along @ bent @ along.T)


def _apply(matrix: Array, vector: Array) -> Array:
    return np.asarray(np.einsum("...ij,...j->...i", matrix, vector))


def _vector_rotation(vector_rad: Array) -> Array:
    return np.swapaxes(frame_rotation(vector_rad), -1, -2)


def expected_path_rates_m_s(tracked: TrackedMotion, system: InterferometerSystem) -> Array:
    """Return w (..., 3, 3) = g_F d rho_00/dt + g_R d rho_ij/dt, what the phase rates show of each
    path: the mean over the sequence at constant velocity and rate.
    """
    # At the rms of the slots' times from the epoch, before and after: the mean of all to the third
    # power of time.
    half_s = float(np.sqrt(np.mean(system.schedule.offsets_s(system.plan) ** 2)))
    rates = [
        path_rates_m_s(*_of_motion(moved(tracked.motion, dt_s)), system.arrays)
        for dt_s in (-half_s, half_s)
    ]
    return _weighted(0.5 * (rates[0] + rates[1]), system)


def expected_path_accelerations_m_s2(tracked: TrackedMotion, system: InterferometerSystem) -> Array:
    """Return dw/dt (..., 3, 3) at constant velocity and rate."""
    return _weighted(path_accelerations_m_s2(*_of_motion(tracked.motion), system.arrays), system)


def _of_motion(motion: RelativeMotion) -> tuple[Array, Array, Array, Array]:
    return motion.position_m, motion.velocity_m_s, motion.attitude, motion.rate_rad_s


def _weighted(paths: Array, system: InterferometerSystem) -> Array:
    forward, back = rate_weights(system)
    return forward * paths[..., :1, :1] + back * paths[..., 1:, 1:]


def expected_reading(
    tracked: TrackedMotion, reading: Reading, system: InterferometerSystem
) -> Array:
    """Return the expected vector (..., 22) of `reading`.

    Ranges as its phases were treated, path rates, couplings.
    """
    motion = tracked.motion
    rates = expected_path_rates_m_s(tracked, system)
    ranges = two_way_ranges(motion.position_m, motion.attitude, system.arrays)
    # The reading brought its phases to the epoch with its own rates: a wrong rate shows in the
    # range through the lever.
    ranges = ranges + reading.lever_s * (rates - reading.used_rates_m_s)
    forward = motion.position_m / np.linalg.norm(motion.position_m, axis=-1, keepdims=True)
    couplings = coupling_amplitudes(forward, motion.attitude) * tracked.excitation[..., None, :]
    parts = [array.reshape(*array.shape[:-2], -1) for array in (ranges, rates, couplings)]
    return np.concatenate(parts, axis=-1)


def local_gradient(
    tracked: TrackedMotion, change: Array, reading: Reading, system: InterferometerSystem
) -> tuple[Array, Array]:
    """Return the expected vector (22,) at `tracked` displaced by `change` (14,), and its gradient
    (22, 14) there.
    """
    steps = local_steps(tracked)
    moves = np.diag(steps)
    # One call for all displacements: 29 stacked evaluations cost little more than one.
    values = expected_reading(
        displaced(tracked, change + np.concatenate([np.zeros((1, SIZE)), moves, -moves])),
        reading,
        system,
    )
    return values[0], ((values[1 : SIZE + 1] - values[SIZE + 1 :]) / (2.0 * steps[:, None])).T


def local_steps(tracked: TrackedMotion) -> Array:
    """Return the step of each local coordinate for numerical gradients, (14,)."""
    distance = float(np.linalg.norm(tracked.motion.position_m))
    steps = np.full(SIZE, _ANGLE_STEP_RAD)
    # Cross-track steps of one angle at every range; a fixed length would be no change at 100 km and
    # a large one at 5 m.
    steps[:3] *= distance
    # Path rates are linear in the velocity, so the step is free: large against rounding.
    steps[3:6] = 0.1
    return steps


def numerical_jacobian(function: Callable[[Array], Array], steps: Array) -> Array:
    """Return d function/d x at zero, (m, n), by central differences.

    `function` takes a stack (2n, n) at once.
    """
    moves = np.diag(steps)
    values = function(np.concatenate([moves, -moves]))
    return ((values[: len(steps)] - values[len(steps) :]) / (2.0 * steps[:, None])).T
