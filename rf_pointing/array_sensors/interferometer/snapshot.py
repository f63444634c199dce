"""Pose from one reading alone, with covariance and a test of its own consistency.

Sequenced estimators from far away, then joint weighted least squares of nine ranges and four
couplings on the six pose coordinates (and two excitations): the residual has seven (five) degrees
of freedom and shows a wrong lane of a path, a disturbed loop or a wrong amplitude without any
prediction.
"""

import math
from dataclasses import dataclass

import numpy as np

from rf_pointing.array_sensors.interferometer.initializer import (
    Geometry,
    aperture_excess,
    initialize,
)
from rf_pointing.array_sensors.interferometer.measurement_model import (
    SIZE,
    TrackedMotion,
    displaced,
    local_gradient,
)
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.interferometer.reading import COUPLINGS, RANGES, RATES, Reading
from rf_pointing.array_sensors.interferometer.sequence import (
    SequenceParams,
    minimum_variance_step,
    track,
)
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from rf_pointing.core.types import Array

# Position and attitude among the fourteen local coordinates; one reading does not show the
# velocities.
_POSE = [0, 1, 2, 6, 7, 8]
# The sequence ends within the linear range; the second pass removes the rest of the curvature.
_REFINEMENTS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """Motion with its pose from one reading (rates only along the sight), pose covariance and
    residual chi-square.
    """

    tracked: TrackedMotion
    covariance: Array
    chi_square: float
    degrees_of_freedom: int


def coarse_geometry(
    reading: Reading, start: Geometry | None, system: InterferometerSystem, sequence: SequenceParams
) -> tuple[Geometry, Array]:
    """Return geometry and excitation of `reading` by the sequence, from `start` or from nothing.

    Raises ValueError if the ranges belong to no direction (beyond five sigma outside the unit
    circle).
    """
    ranges, covariance = reading.standalone_ranges()
    if start is None:
        _require_inside(ranges, float(covariance[0, 0] - covariance[0, 1]), system)
        start = initialize(ranges, reading.vector[COUPLINGS].reshape(2, 2), system.arrays)
    result = track(start, ranges, reading.vector[COUPLINGS].reshape(2, 2), system.arrays, sequence)
    return result.geometry, result.excitation


def _require_inside(ranges: Array, path_variance_m2: float, system: InterferometerSystem) -> None:
    radii = (system.arrays.radius_active_m, system.arrays.radius_passive_m)
    for side, excess, radius in zip(
        ("active", "passive"), aperture_excess(ranges, system.arrays), radii, strict=True
    ):
        # Five sigma of s_y^2 + s_z^2 at the rim, where its slope by the ranges is 2 / radius.
        allowed = 10.0 * math.sqrt(path_variance_m2) / radius
        if float(excess) > allowed:
            raise ValueError(
                f"ranges belong to no direction at the {side} array: s_y^2 + s_z^2 - 1 = {float(excess):.3g}, "
                f"must be <= {allowed:.3g} (wrong lane?)"
            )


def refine(
    geometry: Geometry,
    excitation: Array,
    reading: Reading,
    system: InterferometerSystem,
    fit_excitation: bool,
) -> Snapshot:
    """Return the joint weighted least-squares pose of the ranges and couplings, started at
    `geometry`.
    """
    columns = [*_POSE, 12, 13] if fit_excitation else _POSE
    measured, covariance = _pose_measurement(reading)
    tracked = _started(geometry, excitation, reading)
    for _ in range(_REFINEMENTS):
        expected, gradient = _pose_model(tracked, reading, system)
        step, h = minimum_variance_step(gradient[:, columns], measured - expected, covariance)
        # Residual of the linear step: its chi-square needs no further evaluation of the model.
        residual = measured - expected - gradient[:, columns] @ step
        change = np.zeros(SIZE)
        change[columns] = step
        tracked = displaced(tracked, change)
    return Snapshot(
        tracked=tracked,
        covariance=h,
        chi_square=float(residual @ np.linalg.solve(covariance, residual)),
        degrees_of_freedom=len(measured) - len(columns),
    )


def _pose_measurement(reading: Reading) -> tuple[Array, Array]:
    rows = np.r_[RANGES, COUPLINGS]
    ranges, range_covariance = reading.standalone_ranges()
    covariance = reading.covariance[np.ix_(rows, rows)].copy()
    covariance[RANGES, RANGES] = range_covariance
    return np.concatenate([ranges.ravel(), reading.vector[COUPLINGS]]), covariance


def _started(geometry: Geometry, excitation: Array, reading: Reading) -> TrackedMotion:
    # One reading shows only the range rate: w = 2 d rho/dt along the sight.
    radial = 0.5 * float(np.mean(reading.vector[RATES]))
    motion = RelativeMotion(
        position_m=geometry.position_m,
        velocity_m_s=radial * geometry.forward,
        attitude=geometry.attitude,
        rate_rad_s=np.zeros(3),
    )
    return TrackedMotion(motion=motion, excitation=excitation)


def _pose_model(
    tracked: TrackedMotion, reading: Reading, system: InterferometerSystem
) -> tuple[Array, Array]:
    # Ranges at the epoch, free of the rates: take the lever out of the full model.
    rows = np.r_[RANGES, COUPLINGS]
    expected, gradient = local_gradient(tracked, np.zeros(SIZE), reading, system)
    expected[RANGES] -= reading.lever_s * (expected[RATES] - reading.used_rates_m_s.ravel())
    gradient[RANGES] -= reading.lever_s * gradient[RATES]
    return expected[rows], gradient[rows]


def chi_square_limit(degrees_of_freedom: int, gate_sigma: float) -> float:
    """Return the chi-square value exceeded as rarely as `gate_sigma` normal deviates, one-sided.

    Wilson and Hilferty's cube: the tail is right to a tenth at three deviates, to a factor of three
    at five.
    """
    spread = 2.0 / (9.0 * degrees_of_freedom)
    return degrees_of_freedom * (1.0 - spread + gate_sigma * math.sqrt(spread)) ** 3
