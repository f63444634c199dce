"""Rate-aided Kalman filter: pose, velocity and attitude rate from successive readings.

Constant velocity and constant attitude rate, driven by white accelerations.  The attitude is a
matrix; only its small error, in local coordinates, is a vector.  Ranges, path rates (Doppler) and
couplings are used together.  The fixed errors of the hardware, one for each of the 22 numbers, are
states too: taken as white, they would average down to a covariance that is far too small.  The
filter gives the report's wish of section 4.2: smoothed velocity and attitude rate instead of
differences.
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.interferometer.measurement_model import (
    SIZE,
    TrackedMotion,
    displaced,
    local_difference,
    local_gradient,
    local_steps,
    numerical_jacobian,
)
from rf_pointing.array_sensors.interferometer.motion import moved
from rf_pointing.array_sensors.interferometer.reading import Reading
from rf_pointing.array_sensors.interferometer.snapshot import Snapshot
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from rf_pointing.core import Params, parameter
from rf_pointing.core.types import Array

# The same reading updates the filter right after: its start must not count the reading twice.
_POSE_INFLATION = 100.0
HARDWARE = slice(SIZE, SIZE + 22)


@dataclass(frozen=True, kw_only=True)
class FilterParams(Params):
    """Motion model and first uncertainties."""

    acceleration_density_m_s2: float = parameter(
        0.01, "white acceleration, per root hertz", low=1e-9, high=100.0
    )
    angular_acceleration_density_rad_s2: float = parameter(
        3e-4, "white angular acceleration, per root hertz", low=1e-12, high=10.0
    )
    excitation_drift: float = parameter(
        1e-4, "random walk of the excitation factors, per root second", low=0.0, high=1.0
    )
    first_velocity_m_s: float = parameter(
        5.0, "first standard deviation of each velocity axis", low=1e-6, high=1e3
    )
    first_rate_rad_s: float = parameter(
        0.05, "first standard deviation of each angular rate", low=1e-9, high=1.0
    )
    first_excitation: float = parameter(
        0.5, "first standard deviation of the excitation factors", low=1e-3, high=10.0
    )
    track_excitation: bool = parameter(False, "treat the excitation factors as unknown")


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterState:
    """Complete state: time, motion with excitation, fixed errors of the reading (22,).

    The covariance (36, 36) is that of the local coordinates (14) and of the fixed errors.
    """

    t_s: float
    tracked: TrackedMotion
    hardware: Array
    covariance: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterUpdate:
    """State after a reading, with the innovation's chi-square and its number of measurements."""

    state: FilterState
    chi_square: float
    degrees_of_freedom: int


def start(t_s: float, snapshot: Snapshot, reading: Reading, params: FilterParams) -> FilterState:
    """Return a state around `snapshot` that knows almost nothing, ready for the update with its
    `reading`.

    The pose is given a hundred times the snapshot's sigma, so that the same reading is not counted
    twice.
    """
    covariance = np.zeros((HARDWARE.stop, HARDWARE.stop))
    pose = np.ix_([0, 1, 2, 6, 7, 8], [0, 1, 2, 6, 7, 8])
    covariance[pose] = np.diag(np.diag(snapshot.covariance)[:6]) * _POSE_INFLATION**2
    covariance[3:6, 3:6] = np.eye(3) * params.first_velocity_m_s**2
    # One reading shows no angular rate at all, and of the velocity only the part along the sight.
    covariance[9:12, 9:12] = np.eye(3) * params.first_rate_rad_s**2
    if params.track_excitation:
        covariance[12:SIZE, 12:SIZE] = np.eye(2) * params.first_excitation**2
    covariance[HARDWARE, HARDWARE] = np.diag(reading.hardware)
    return FilterState(
        t_s=t_s, tracked=snapshot.tracked, hardware=np.zeros(22), covariance=covariance
    )


def predict(state: FilterState, t_s: float, params: FilterParams) -> FilterState:
    """Return the state at `t_s`, not before the state's own time."""
    dt_s = t_s - state.t_s
    if dt_s < 0.0:
        raise ValueError(f"t_s={t_s} must be >= the state's t_s={state.t_s}")
    later = _later(state.tracked, dt_s)
    # Numerical, because position, direction frame and attitude are coupled in local coordinates.
    transition = numerical_jacobian(
        lambda change: local_difference(_later(displaced(state.tracked, change), dt_s), later),
        local_steps(state.tracked),
    )
    covariance = _transformed(transition, state.covariance)
    covariance[:SIZE, :SIZE] += _process_noise(dt_s, params)
    return FilterState(t_s=t_s, tracked=later, hardware=state.hardware, covariance=covariance)


def _transformed(local: Array, covariance: Array) -> Array:
    """Return the covariance after a linear change `local` (14, 14) of the local coordinates."""
    whole = np.eye(HARDWARE.stop)
    whole[:SIZE, :SIZE] = local
    changed = whole @ covariance @ whole.T
    return 0.5 * (changed + changed.T)


def _later(tracked: TrackedMotion, dt_s: float) -> TrackedMotion:
    return TrackedMotion(motion=moved(tracked.motion, dt_s), excitation=tracked.excitation)


def _process_noise(dt_s: float, params: FilterParams) -> Array:
    noise = np.zeros((SIZE, SIZE))
    # White acceleration integrated once and twice: the discrete noise of a constant-velocity model.
    block = np.array([[dt_s**3 / 3.0, dt_s**2 / 2.0], [dt_s**2 / 2.0, dt_s]])
    densities = (
        (0, params.acceleration_density_m_s2),
        (6, params.angular_acceleration_density_rad_s2),
    )
    for first, density in densities:
        noise[first : first + 6, first : first + 6] = np.kron(block, np.eye(3)) * density**2
    if params.track_excitation:
        noise[12:, 12:] = np.eye(2) * params.excitation_drift**2 * dt_s
    return noise


def update(
    state: FilterState,
    reading: Reading,
    system: InterferometerSystem,
    around: TrackedMotion | None = None,
) -> FilterUpdate:
    """Return the state corrected by `reading`, linearised at `around` (default: the predicted
    motion).

    `around` from the snapshot keeps the update right when the prediction is degrees off after a
    gap.
    """
    # Linearised where the reading is, not where the prediction was: after a gap they are degrees
    # apart.
    change = np.zeros(SIZE) if around is None else local_difference(around, state.tracked)
    expected, gradient = local_gradient(state.tracked, change, reading, system)
    innovation = reading.vector - expected + gradient @ change - state.hardware
    gradient = np.concatenate([gradient, np.eye(22)], axis=1)
    spread = gradient @ state.covariance @ gradient.T + reading.noise
    gain = np.linalg.solve(spread, gradient @ state.covariance).T
    correction = gain @ innovation
    keep = np.eye(HARDWARE.stop) - gain @ gradient
    # Joseph form: positive whatever rounding does to the gain, with ranges of 1e5 m and errors of
    # 1e-3 m.
    covariance = keep @ state.covariance @ keep.T + gain @ reading.noise @ gain.T
    return FilterUpdate(
        state=_recentred(state, correction, covariance),
        chi_square=float(innovation @ np.linalg.solve(spread, innovation)),
        degrees_of_freedom=len(innovation),
    )


def _recentred(state: FilterState, correction: Array, covariance: Array) -> FilterState:
    # The local axes move with the direction: express the covariance in those of the corrected
    # motion.
    local = correction[:SIZE]
    tracked = displaced(state.tracked, local)
    turning = numerical_jacobian(
        lambda change: local_difference(displaced(state.tracked, local + change), tracked),
        local_steps(state.tracked),
    )
    hardware = state.hardware + correction[HARDWARE]
    return FilterState(
        t_s=state.t_s,
        tracked=tracked,
        hardware=hardware,
        covariance=_transformed(turning, covariance),
    )
