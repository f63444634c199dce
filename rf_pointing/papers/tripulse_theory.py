"""Effect of noise on Tripulse: variances (17), (18), (21), integration time (22), shortest pulses.

SNR is |S|^2 / sigma^2 with sigma^2 = N_0 W the *total* variance of a complex noise sample;
gamma = |Delta / Sigma|.  `variant` is "published" for the printed formula, "corrected" for the one
that follows from the model: (17) second coefficient (1 + 2 gamma^2) instead of (1 - gamma^2); (21)
sigma_T^2 / cos^2(theta) instead of 2 sigma_T^2 / cos(2 theta), which is the mean square of the
total angle at boresight.

Shortest pulses: the variance of R_x is half of gamma_x^2 (a + 2 a^2) + b_x (1 + a), with a and b_x
the noise-to-signal ratios c/T_sum and c/T_x of the two pulses (second order in the noise, (17) with
unequal noise).  Near the steering direction gamma is small, so the sum pulse may be short: to first
order T_sum / T_x -> sqrt(gamma_x^2 + gamma_y^2).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams
from rf_pointing.array_sensors.tripulse.beams import closed_form_signals
from rf_pointing.core import as_finite_array, require_between, require_choice, require_finite
from rf_pointing.core.types import Array

VARIANTS = ("corrected", "published")
LOWEST_SUM_SNR = 10.0**1.2
"""The sum pulse is kept at 12 dB or more: below, the expansion of the variance no longer describes
the ratio."""


def ratio_variance(sum_snr: float, gamma: float, variant: str = "corrected") -> float:
    """Return var R to second order in 1/SNR, eq. (17), for beams of equal noise.

    The series is asymptotic and the true variance infinite (a ratio of Gaussians): within 3 % at 15
    dB and 5 % at 12 dB of a Monte Carlo run, of no use below 10 dB.
    """
    require_choice("variant", variant, VARIANTS)
    _require_positive("sum_snr", sum_snr)
    require_finite("gamma", gamma)
    # From E|n|^4 = 2 sigma^4 of a complex Gaussian; the printed sign belongs to no expansion of the
    # ratio.
    second = 1.0 + 2.0 * gamma**2 if variant == "corrected" else 1.0 - gamma**2
    return (1.0 + gamma**2) / (2.0 * sum_snr) + second / (2.0 * sum_snr**2)


def ratio_variance_unequal(sum_noise: float, delta_noise: float, gamma: float) -> float:
    """Return var R to second order where the two beams have noise of their own.

    `sum_noise` and `delta_noise` are sigma^2 of either beam over |S_sum|^2; (17) is the case of
    both equal.
    """
    _require_positive("sum_noise", sum_noise)
    _require_positive("delta_noise", delta_noise)
    return 0.5 * (gamma**2 * (sum_noise + 2.0 * sum_noise**2) + delta_noise * (1.0 + sum_noise))


def projection_variance(params: TripulseArrayParams, element_snr: float) -> tuple[float, float]:
    """Return var eps_x and var eps_y of the uniform array, eq. (18), for the SNR |K|^2/(N_0 W) of a
    single element.
    """
    _require_positive("element_snr", element_snr)
    variances = [
        2.0 / (math.pi * spacing * count * params.n_total) ** 2 / element_snr
        for spacing, count in (
            (params.spacing_x_wavelengths, params.n_x),
            (params.spacing_y_wavelengths, params.n_y),
        )
    ]
    return variances[0], variances[1]


def polar_angle_variance_rad2(
    variance_projection: float, theta_rad: float, variant: str = "corrected"
) -> float:
    """Return the variance of the polar angle from that of one projection, eq. (21).

    Theta well above its sigma.
    """
    require_choice("variant", variant, VARIANTS)
    _require_positive("variance_projection", variance_projection)
    require_between("theta_rad", theta_rad, 0.0, math.pi / 2.0)
    if variant == "corrected":
        return variance_projection / math.cos(theta_rad) ** 2
    # cos(2 theta) changes its sign there: the printed form would give a negative variance.
    if theta_rad >= math.pi / 4.0:
        raise ValueError(
            f"theta_rad={theta_rad} must be < pi/4: the published (21) has a pole there"
        )
    return 2.0 * variance_projection / math.cos(2.0 * theta_rad)


def integration_time_s(
    params: TripulseArrayParams, element_carrier_to_noise_db_hz: float, sigma: float
) -> float:
    """Return the time of one pulse for the standard deviation `sigma` of both projections, eq.
    (22).

    Of the two axes the slower counts.  The three pulses together take three times as long.
    """
    require_finite("element_carrier_to_noise_db_hz", element_carrier_to_noise_db_hz)
    _require_positive("sigma", sigma)
    carrier_to_noise_hz = 10.0 ** (element_carrier_to_noise_db_hz / 10.0)
    return max(projection_variance(params, carrier_to_noise_hz)) / sigma**2


def _require_positive(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name}={value} must be finite and > 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseAllocation:
    """Durations of the three pulses and the standard deviations of the projections (2,) that they
    give.
    """

    sum_s: float
    delta_x_s: float
    delta_y_s: float
    sigma: Array

    @property
    def total_s(self) -> float:
        """Time of all three pulses."""
        return self.sum_s + self.delta_x_s + self.delta_y_s


def allocate_pulses(
    params: TripulseArrayParams,
    element_carrier_to_noise_db_hz: float,
    sigma: float,
    projection_error: ArrayLike,
) -> PulseAllocation:
    """Return the pulses of least total time with standard deviation `sigma` on both projections.

    Parameters
    ----------
    element_carrier_to_noise_db_hz : |K|^2 / N_0 of a single element
    projection_error : the largest |T - T_0| expected on either axis (2,), inside lambda/(N d)
    """
    from scipy.optimize import minimize_scalar

    noise_s, gamma, allowed = _requirement(
        params, element_carrier_to_noise_db_hz, sigma, projection_error
    )
    # Shorter sum pulses leave nothing of the allowance for the delta pulse on the worse axis.
    excess = gamma**2 / (2.0 * allowed)
    least_s = noise_s * max(
        LOWEST_SUM_SNR, float(np.max(excess + np.sqrt(excess**2 + 8.0 * excess)) / 2.0) * 1.001
    )

    # In the logarithm: the optimum may lie decades above the shortest pulse.
    def total_s(log_sum_s: float) -> float:
        return math.exp(log_sum_s) + float(
            np.sum(_delta_s(math.exp(log_sum_s), noise_s, gamma, allowed))
        )

    # A sum pulse longer than the whole total at 2 least_s cannot be part of a shorter total.
    longest_s = 2.0 * least_s + float(np.sum(_delta_s(2.0 * least_s, noise_s, gamma, allowed)))
    found = minimize_scalar(
        total_s,
        bounds=(math.log(least_s), math.log(longest_s)),
        method="bounded",
        options={"xatol": 1e-9},
    )
    if not found.success:
        raise ValueError(f"sigma={sigma} has no time-optimal pulses: {found.message}")
    sum_s = math.exp(found.x)
    return _allocation(params, sum_s, _delta_s(sum_s, noise_s, gamma, allowed), noise_s, gamma)


def equal_pulses(
    params: TripulseArrayParams,
    element_carrier_to_noise_db_hz: float,
    sigma: float,
    projection_error: ArrayLike,
) -> PulseAllocation:
    """Return three pulses of one length that meet the same specification as `allocate_pulses`."""
    noise_s, gamma, allowed = _requirement(
        params, element_carrier_to_noise_db_hz, sigma, projection_error
    )
    # a (1 + g^2) + a^2 (1 + 2 g^2) = 2 V, solved for a = c/T; the root that does not cancel.
    first, second = 1.0 + gamma**2, 1.0 + 2.0 * gamma**2
    noise = 4.0 * allowed / (first + np.sqrt(first**2 + 8.0 * second * allowed))
    pulse_s = noise_s * max(LOWEST_SUM_SNR, float(np.max(1.0 / noise)))
    return _allocation(params, pulse_s, np.array([pulse_s, pulse_s]), noise_s, gamma)


def _requirement(
    params: TripulseArrayParams,
    carrier_to_noise_db_hz: float,
    sigma: float,
    projection_error: ArrayLike,
) -> tuple[float, Array, Array]:
    """Return c = sigma^2 T / |S|^2 in seconds, gamma (2,) and the variance allowed to the ratios
    (2,).
    """
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
    return np.asarray(
        noise_s * (1.0 + noise) / (2.0 * allowed - gamma**2 * (noise + 2.0 * noise**2))
    )


def _allocation(
    params: TripulseArrayParams, sum_s: float, delta_s: Array, noise_s: float, gamma: Array
) -> PulseAllocation:
    variance = [
        ratio_variance_unequal(noise_s / sum_s, noise_s / float(t_s), float(g))
        for t_s, g in zip(delta_s, gamma, strict=True)
    ]
    sigma = np.sqrt(variance) / _ratio_slope(params, gamma)
    return PulseAllocation(
        sum_s=sum_s, delta_x_s=float(delta_s[0]), delta_y_s=float(delta_s[1]), sigma=sigma
    )
