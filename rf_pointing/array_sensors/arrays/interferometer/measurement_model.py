"""Expected ranges, path rates and couplings of a relative motion, and their gradients in local coordinates."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import path_rates_m_s, two_way_ranges
from rf_pointing.array_sensors.arrays.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.arrays.interferometer.local_coordinates import SIZE, TrackedMotion, displaced
from rf_pointing.array_sensors.arrays.interferometer.reading import Reading, rate_weights
from rf_pointing.array_sensors.arrays.interferometer.system import InterferometerSystem

__all__ = ["expected_path_rates_m_s", "expected_reading", "local_gradient", "local_steps", "numerical_jacobian"]

Array = NDArray[np.float64]
_ANGLE_STEP_RAD = 1e-3


def expected_path_rates_m_s(tracked: TrackedMotion, system: InterferometerSystem) -> Array:
    """Return w (..., 3, 3) = g_F d rho_00/dt + g_R d rho_ij/dt, what the phase rates show of each path."""
    motion = tracked.motion
    rates = path_rates_m_s(motion.position_m, motion.velocity_m_s, motion.attitude, motion.rate_rad_s, system.arrays)
    forward, back = rate_weights(system)
    return forward * rates[..., :1, :1] + back * rates[..., 1:, 1:]


def expected_reading(tracked: TrackedMotion, reading: Reading, system: InterferometerSystem) -> Array:
    """Return the expected vector (..., 22) of `reading`: ranges as its phases were treated, path rates, couplings."""
    motion = tracked.motion
    rates = expected_path_rates_m_s(tracked, system)
    ranges = two_way_ranges(motion.position_m, motion.attitude, system.arrays)
    ranges = ranges + reading.lever_s * (rates - reading.used_rates_m_s)
    forward = motion.position_m / np.linalg.norm(motion.position_m, axis=-1, keepdims=True)
    couplings = coupling_amplitudes(forward, motion.attitude) * tracked.excitation[..., None, :]
    parts = [array.reshape(*array.shape[:-2], -1) for array in (ranges, rates, couplings)]
    return np.concatenate(parts, axis=-1)


def local_gradient(
    tracked: TrackedMotion, change: Array, reading: Reading, system: InterferometerSystem
) -> tuple[Array, Array]:
    """Return the expected vector (22,) at `tracked` displaced by `change` (14,), and its gradient (22, 14) there."""
    steps = local_steps(tracked)
    moves = np.diag(steps)
    values = expected_reading(
        displaced(tracked, change + np.concatenate([np.zeros((1, SIZE)), moves, -moves])), reading, system
    )
    return values[0], ((values[1 : SIZE + 1] - values[SIZE + 1 :]) / (2.0 * steps[:, None])).T


def local_steps(tracked: TrackedMotion) -> Array:
    """Return the step of each local coordinate for numerical gradients, (14,)."""
    distance = float(np.linalg.norm(tracked.motion.position_m))
    steps = np.full(SIZE, _ANGLE_STEP_RAD)
    steps[:3] *= distance
    steps[3:6] = 0.1
    return steps


def numerical_jacobian(function: Callable[[Array], Array], steps: Array) -> Array:
    """Return d function/d x at zero, (m, n), by central differences; `function` takes a stack (2n, n) at once."""
    moves = np.diag(steps)
    values = function(np.concatenate([moves, -moves]))
    return ((values[: len(steps)] - values[len(steps) :]) / (2.0 * steps[:, None])).T
