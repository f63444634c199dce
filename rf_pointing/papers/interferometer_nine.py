"""The direction estimator that PI83 tried first: nine separate ranges instead of three sums (p. 35)."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.arrays.interferometer import (
    ArrayParams,
    attitude_from_directions,
    attitude_from_euler,
    direction_from_angles,
    euler_from_attitude,
    forward_angles,
    reverse_direction,
    two_way_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.minimum_variance import minimum_variance_step
from rf_pointing.array_sensors.arrays.interferometer.tracking_steps import turned_direction

__all__ = ["settled_error_deg"]

Array = NDArray[np.float64]
_RANGE_M = 1e4
_DITHER_RAD = 0.01
_PASSES = 20


def settled_error_deg(attitude_error_deg: float) -> tuple[float, float]:
    """Return the attitude and direction errors that remain after 20 passes; the truth is 10 deg of direction."""
    truth, arrays = math.radians(10.0), ArrayParams()
    ranges = two_way_ranges(_RANGE_M * direction_from_angles(truth, 0.0), np.eye(3), arrays)
    attitude = attitude_from_euler(math.radians(attitude_error_deg), 0.0, 0.0)
    forward = direction_from_angles(truth, 0.0)
    reverse = reverse_direction(forward, attitude)
    for _ in range(_PASSES):
        forward = _nine_range_step(ranges, forward, attitude, arrays)
        reverse = _nine_range_step(ranges.T, reverse, attitude.T, arrays.swapped())
        attitude = attitude_from_directions(forward, reverse, 0.0)
    return _degrees_off(euler_from_attitude(attitude)[0], 0.0), _degrees_off(forward_angles(forward)[0], truth)


def _degrees_off(found_rad: Array, truth_rad: float) -> float:
    return abs(math.degrees(float(found_rad) - truth_rad))


def _nine_range_step(ranges: Array, direction: Array, attitude: Array, arrays: ArrayParams) -> Array:
    predicted = two_way_ranges(_RANGE_M * direction, attitude, arrays)
    gradient = []
    for dither in ((_DITHER_RAD, 0.0), (0.0, _DITHER_RAD)):
        moved = two_way_ranges(_RANGE_M * turned_direction(direction, *dither), attitude, arrays)
        gradient.append((moved - predicted).ravel() / _DITHER_RAD)
    step, _ = minimum_variance_step(np.stack(gradient, axis=-1), (ranges - predicted).ravel())
    return turned_direction(direction, step[0], step[1])
