"""How long each of the three pulses should last: the shortest total time that meets a specification.

The variance of R_x is half of gamma_x^2 (a + 2 a^2) + b_x (1 + a), with a and b_x the noise-to-signal ratios
c/T_sum and c/T_x of the two pulses (second order in the noise, TRIPULSE (17) with unequal noise).  Near the steering
direction gamma is small, so the sum pulse may be short: to first order T_sum / T_x -> sqrt(gamma_x^2 + gamma_y^2).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.arrays.tripulse_array import TripulseArrayParams
from rf_pointing.array_sensors.arrays.tripulse_beams import closed_form_signals
from rf_pointing.array_sensors.arrays.tripulse_theory import ratio_variance_unequal
from rf_pointing.core import as_finite_array, require_finite

__all__ = ["LOWEST_SUM_SNR", "PulseAllocation", "allocate_pulses", "equal_pulses", "interleaved_pattern"]

Array = NDArray[np.float64]

LOWEST_SUM_SNR = 10.0**1.2
"""The sum pulse is kept at 12 dB or more: below, the expansion of the variance no longer describes the ratio."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseAllocation:
    """Durations of the three pulses and the standard deviations of the projections (2,) that they give."""

    sum_s: float
    delta_x_s: float
    delta_y_s: float
    sigma: Array

    @property
    def total_s(self) -> float:
        """Time of all three pulses."""
        return self.sum_s + self.delta_x_s + self.delta_y_s


def allocate_pulses(
    params: TripulseArrayParams, element_carrier_to_noise_db_hz: float, sigma: float, projection_error: ArrayLike
) -> PulseAllocation:
    """Return the pulses of least total time with standard deviation `sigma` on both projections.

    Parameters
    ----------
    element_carrier_to_noise_db_hz : |K|^2 / N_0 of a single element
    projection_error : the largest |T - T_0| expected on either axis (2,), inside lambda/(N d)
    """
    from scipy.optimize import minimize_scalar

    noise_s, gamma, allowed = _requirement(params, element_carrier_to_noise_db_hz, sigma, projection_error)
    # Shorter sum pulses leave nothing of the allowance for the delta pulse on the worse axis.
    excess = gamma**2 / (2.0 * allowed)
    least_s = noise_s * max(LOWEST_SUM_SNR, float(np.max(excess + np.sqrt(excess**2 + 8.0 * excess)) / 2.0) * 1.001)

    def total_s(log_sum_s: float) -> float:
        return math.exp(log_sum_s) + float(np.sum(_delta_s(math.exp(log_sum_s), noise_s, gamma, allowed)))

    longest_s = 2.0 * least_s + float(np.sum(_delta_s(2.0 * least_s, noise_s, gamma, allowed)))
    found = minimize_scalar(
        total_s, bounds=(math.log(least_s), math.log(longest_s)), method="bounded", options={"xatol": 1e-9}
    )
    if not found.success:
        raise ValueError(f"sigma={sigma} has no time-optimal pulses: {found.message}")
    sum_s = math.exp(found.x)
    return _allocation(params, sum_s, _delta_s(sum_s, noise_s, gamma, allowed), noise_s, gamma)


def equal_pulses(
    params: TripulseArrayParams, element_carrier_to_noise_db_hz: float, sigma: float, projection_error: ArrayLike
) -> PulseAllocation:
    """Return three pulses of one length that meet the same specification as `allocate_pulses`."""
    noise_s, gamma, allowed = _requirement(params, element_carrier_to_noise_db_hz, sigma, projection_error)
    # a (1 + g^2) + a^2 (1 + 2 g^2) = 2 V, solved for a = c/T; the root that does not cancel.
    first, second = 1.0 + gamma**2, 1.0 + 2.0 * gamma**2
    noise = 4.0 * allowed / (first + np.sqrt(first**2 + 8.0 * second * allowed))
    pulse_s = noise_s * max(LOWEST_SUM_SNR, float(np.max(1.0 / noise)))
    return _allocation(params, pulse_s, np.array([pulse_s, pulse_s]), noise_s, gamma)


def interleaved_pattern(allocation: PulseAllocation, segment_s: float) -> str:
    """Return segments of `segment_s` in an even mix, "S", "x" or "y" each, that last at least as long as the pulses."""
    if not segment_s > 0.0:
        raise ValueError(f"segment_s={segment_s} must be > 0")
    durations = {"S": allocation.sum_s, "x": allocation.delta_x_s, "y": allocation.delta_y_s}
    slots = []
    for beam, duration_s in durations.items():
        # A pulse that fills its segments to rounding must not cost one more.
        count = math.ceil(duration_s / segment_s - 1e-9)
        slots += [((index + 0.5) / count, beam) for index in range(count)]
    return "".join(beam for _, beam in sorted(slots))


def _requirement(
    params: TripulseArrayParams, carrier_to_noise_db_hz: float, sigma: float, projection_error: ArrayLike
) -> tuple[float, Array, Array]:
    """Return c = sigma^2 T / |S|^2 in seconds, gamma (2,) and the variance allowed to the ratios (2,)."""
    require_finite("element_carrier_to_noise_db_hz", carrier_to_noise_db_hz)
    require_finite("sigma", sigma)
    if sigma <= 0.0:
        raise ValueError(f"sigma={sigma} must be > 0")
    error = np.abs(as_finite_array("projection_error", projection_error, (2,)))
    if np.any(error >= params.unambiguous_projection):
        raise ValueError(f"projection_error={error} must be < {params.unambiguous_projection}")
    signals = closed_form_signals(params, error)
    gamma = np.abs(signals[1:] / signals[0])
    noise_s = 1.0 / (float(abs(signals[0])) ** 2 * 10.0 ** (carrier_to_noise_db_hz / 10.0))
    return noise_s, gamma, (sigma * _ratio_slope(params, gamma)) ** 2


def _ratio_slope(params: TripulseArrayParams, gamma: Array) -> Array:
    counts = np.array([params.n_x, params.n_y])
    return np.asarray(params.kd * counts / 4.0 * (1.0 + gamma**2))


def _delta_s(sum_s: float, noise_s: float, gamma: Array, allowed: Array) -> Array:
    noise = noise_s / sum_s
    return np.asarray(noise_s * (1.0 + noise) / (2.0 * allowed - gamma**2 * (noise + 2.0 * noise**2)))


def _allocation(
    params: TripulseArrayParams, sum_s: float, delta_s: Array, noise_s: float, gamma: Array
) -> PulseAllocation:
    variance = [
        ratio_variance_unequal(noise_s / sum_s, noise_s / float(t_s), float(g))
        for t_s, g in zip(delta_s, gamma, strict=True)
    ]
    sigma = np.sqrt(variance) / _ratio_slope(params, gamma)
    return PulseAllocation(sum_s=sum_s, delta_x_s=float(delta_s[0]), delta_y_s=float(delta_s[1]), sigma=sigma)
