"""Monte Carlo of Tripulse: receiver noise, failed elements, phase errors.

The estimator is always the exact inversion (9) of the uniform array, unaware of the faults.  Every case draws from a
stream named after itself, so a sweep over cases may run anywhere (`core.sweep`).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.snapshots import complex_normal
from rf_pointing.array_sensors.arrays.tripulse_array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.arrays.tripulse_beams import (
    beam_signals,
    beam_signs,
    closed_form_signals,
    monopulse_ratios,
)
from rf_pointing.array_sensors.arrays.tripulse_inversion import invert_ratios, polar_angles_rad
from rf_pointing.core import as_finite_array, random_stream, require_finite

__all__ = [
    "ErrorStatistics",
    "failed_element_errors",
    "noise_errors",
    "phase_error_errors",
    "quantiser_errors",
    "random_failures",
]

Array = NDArray[np.float64]

CHUNK = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStatistics:
    """Mean and standard deviation of the projection errors (2,) and of theta over the trials of one case."""

    trials: int
    mean: Array
    sigma: Array
    theta_sigma_rad: float

    @property
    def three_sigma_total_rad(self) -> float:
        """Return 3 sqrt(var eps_x + var eps_y), the "3 sigma orientation error" of TRIPULSE 4.3 and 4.4."""
        return 3.0 * math.hypot(float(self.sigma[0]), float(self.sigma[1]))


def noise_errors(
    params: TripulseArrayParams,
    element_snr: float,
    steering: ArrayLike,
    projection_error: ArrayLike,
    trials: int,
    seed: int = 1,
) -> ErrorStatistics:
    """Return the errors under receiver noise for the SNR |K|^2 / sigma^2 of one element."""
    require_finite("element_snr", element_snr)
    if element_snr <= 0.0:
        raise ValueError(f"element_snr={element_snr} must be > 0")
    rng = random_stream(seed, f"tripulse noise {params} {element_snr}")
    signals = closed_form_signals(params, as_finite_array("projection_error", projection_error, (2,)))
    noise = math.sqrt(1.0 / element_snr) * complex_normal(rng, (_trials(trials), 3))
    return _statistics(params, signals + noise, steering, projection_error)


def random_failures(
    rng: np.random.Generator, params: TripulseArrayParams, failed_count: int, trials: int
) -> NDArray[np.bool_]:
    """Return masks (trials, N_x, N_y) with exactly `failed_count` dead elements each, every arrangement alike."""
    if not 0 <= failed_count < params.n_total:
        raise ValueError(f"failed_count={failed_count} must be >= 0 and < {params.n_total}")
    failed = np.zeros((trials, params.n_total), dtype=bool)
    if failed_count > 0:
        order = rng.random((trials, params.n_total), dtype=np.float32)
        dead = np.argpartition(order, failed_count - 1, axis=1)[:, :failed_count]
        np.put_along_axis(failed, dead, True, axis=1)
    return failed.reshape(trials, params.n_x, params.n_y)


def failed_element_errors(
    params: TripulseArrayParams,
    failed_count: int,
    steering: ArrayLike,
    projection_error: ArrayLike,
    trials: int = 20_000,
    seed: int = 1,
) -> ErrorStatistics:
    """Return the errors with `failed_count` dead elements, arranged anew in each trial, without noise (4.4)."""
    rng = random_stream(seed, f"tripulse failures {params} {failed_count}")
    per_element = _element_beams(params, steering, projection_error)
    parts = []
    for count in _chunks(_trials(trials)):
        alive = ~random_failures(rng, params, failed_count, count).reshape(count, -1)
        parts.append(alive.astype(np.float64) @ per_element)
    return _statistics(params, np.concatenate(parts).view(np.complex128), steering, projection_error)


def phase_error_errors(
    params: TripulseArrayParams,
    width_rad: float,
    steering: ArrayLike,
    projection_error: ArrayLike,
    trials: int,
    seed: int = 1,
) -> ErrorStatistics:
    """Return the errors with independent phase errors, uniform over a total width `width_rad` (4.3)."""
    require_finite("width_rad", width_rad)
    rng = random_stream(seed, f"tripulse phase errors {params} {width_rad}")
    per_element = np.ascontiguousarray(_element_beams(params, steering, projection_error)).view(np.complex128)
    parts = []
    for count in _chunks(_trials(trials)):
        errors = rng.uniform(-width_rad / 2.0, width_rad / 2.0, size=(count, params.n_total))
        parts.append(np.exp(1j * errors) @ per_element)
    return _statistics(params, np.concatenate(parts), steering, projection_error)


def quantiser_errors(
    params: TripulseArrayParams,
    projection_error: ArrayLike,
    largest_projection: float,
    trials: int,
    seed: int = 1,
    *,
    random_common_phase: bool = False,
) -> ErrorStatistics:
    """Return the errors of a real rounding quantiser of `params.phase_bits`, steered anew in each trial.

    Steering projections are uniform on the square of half side `largest_projection`.  `random_common_phase` adds one
    random phase to all elements of a trial before rounding, which parts the errors of mirrored elements.
    """
    rng = random_stream(seed, f"tripulse quantiser {params} {random_common_phase}")
    error = as_finite_array("projection_error", projection_error, (2,))
    signals = np.empty((_trials(trials), 3), dtype=np.complex128)
    for index in range(trials):
        steering = rng.uniform(-largest_projection, largest_projection, size=2)
        common_rad = float(rng.uniform(0.0, 2.0 * math.pi)) if random_common_phase else 0.0
        weights = element_weights(params, steering, common_phase_rad=common_rad)
        signals[index] = beam_signals(params, weights, steering + error)
    return _statistics(params, signals, np.zeros(2), error)


def _element_beams(params: TripulseArrayParams, steering: ArrayLike, projection_error: ArrayLike) -> Array:
    """Return what every element adds to the three beams, (N_tot, 6): real and imaginary parts side by side."""
    t0 = as_finite_array("steering", steering, (2,))
    error = as_finite_array("projection_error", projection_error, (2,))
    arriving = element_weights(params.replace(phase_bits=0, taper_edge=1.0), t0 + error).conj()
    field = element_weights(params, t0) * arriving
    beams = (beam_signs(params) * field).reshape(3, -1).T
    return np.ascontiguousarray(beams).view(np.float64)


def _statistics(
    params: TripulseArrayParams, signals: NDArray[np.complex128], steering: ArrayLike, projection_error: ArrayLike
) -> ErrorStatistics:
    estimate = invert_ratios(params, monopulse_ratios(signals))
    error = estimate - np.asarray(projection_error)
    theta, _ = polar_angles_rad(np.asarray(steering) + estimate)
    return ErrorStatistics(
        trials=len(error),
        mean=np.mean(error, axis=0),
        sigma=np.std(error, axis=0),
        theta_sigma_rad=float(np.std(theta)),
    )


def _trials(trials: int) -> int:
    if trials < 2:
        raise ValueError(f"trials={trials} must be >= 2")
    return trials


def _chunks(trials: int) -> list[int]:
    return [min(CHUNK, trials - start) for start in range(0, trials, CHUNK)]
