"""Sequenced minimum-variance tracking: range, direction, reverse direction, roll, excitation, in this order.

Each estimator improves what the next one uses (PI83 section 4.2, Fig. 4-1, listing ITER).  One joint estimator of all
nine ranges settles on wrong attitudes when it starts far away, the sequence does not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams
from rf_pointing.array_sensors.arrays.interferometer.initializer import Geometry
from rf_pointing.array_sensors.arrays.interferometer.tracking_steps import (
    direction_step,
    excitation_step,
    range_step,
    roll_step,
)
from rf_pointing.array_sensors.arrays.interferometer.variant import CORRECTED, VARIANTS, is_published
from rf_pointing.core import Params, parameter

__all__ = ["SequenceParams", "SequenceResult", "track", "track_once"]

Array = NDArray[np.float64]
_UNIT_EXCITATION = np.ones(2)


@dataclass(frozen=True, kw_only=True)
class SequenceParams(Params):
    """How the sequence runs; the defaults are the corrected forms."""

    iterations: int = parameter(2, "passes through the sequence per set of measurements", low=1, high=50)
    dither_rad: float = parameter(0.01, "step of the numerical gradients", low=1e-6, high=0.1)
    range_estimator: str = parameter(CORRECTED, "published: sum/18; corrected: true gradients", choices=VARIANTS)
    reverse_attitude: str = parameter(CORRECTED, "published: the listing's A^T for A, a slip", choices=VARIANTS)
    estimate_excitation: bool = parameter(False, "track the two dipoles' excitation factors")


@dataclass(frozen=True, slots=True, kw_only=True)
class SequenceResult:
    """Estimate and its sensitivities per unit measurement variance: range (...), directions (..., 2, 2), roll (...)."""

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
    """Return the estimate after `params.iterations` passes from `geometry` over the same measurements.

    `ranges_m` (..., 3, 3), `amplitudes` (..., 2, 2), `excitation` (..., 2).  Angle errors up to 45 deg and a range ten
    times too long or too short are forgiven.  Raises ValueError where the measurements determine no pose.
    """
    result = track_once(geometry, ranges_m, amplitudes, arrays, params, excitation)
    for _ in range(params.iterations - 1):
        result = track_once(result.geometry, ranges_m, amplitudes, arrays, params, result.excitation)
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
    if np.any(distance <= 0.0):
        raise ValueError(f"range_m={float(np.min(distance))} after the range step must be > 0: measurements disagree")
    forward, forward_covariance = direction_step(
        ranges, distance, geometry.forward, attitude, arrays, params.dither_rad
    )
    reverse, reverse_covariance = direction_step(
        np.swapaxes(ranges, -1, -2),
        distance,
        geometry.reverse,
        attitude if is_published(params.reverse_attitude) else np.swapaxes(attitude, -1, -2),
        arrays.swapped(),
        params.dither_rad,
    )
    roll, roll_variance = roll_step(amplitudes, forward, reverse, geometry.roll_rad, excitation, params.dither_rad)
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
