"""Slope, loss and accuracy of a conical scan in closed form (CONSCAN eqs. 1-6, 20, 21, 23, 25).

h is the half-power beamwidth, r the scan radius, mu = 4 ln 2; n samples per period; sigma_p/P the relative standard
deviation of one carrier power sample; C/N0 in dB-Hz for the beam on the target.
"""

import math

from rf_pointing.core import MU, require_between

__all__ = [
    "conscan_loss",
    "conscan_sigma_eq20_rad",
    "conscan_sigma_eq21_rad",
    "conscan_sigma_eq23_rad",
    "conscan_sigma_eq25_rad",
    "conscan_slope",
]


def conscan_slope(half_power_beamwidth_rad: float, radius_rad: float) -> float:
    """Return k_s = 2 r mu / h (eq. 6): relative power modulation per beamwidth of pointing error."""
    return 2.0 * radius_rad * MU / half_power_beamwidth_rad


def conscan_loss(half_power_beamwidth_rad: float, offset_rad: float) -> float:
    """Return exp(-mu offset^2 / h^2): L1 at the scan radius, L2 at the pointing error."""
    return math.exp(-MU * (offset_rad / half_power_beamwidth_rad) ** 2)


def conscan_sigma_eq20_rad(
    half_power_beamwidth_rad: float, radius_rad: float, samples: int, relative_sigma: float, axis_error_rad: float
) -> float:
    """Return the standard deviation per axis from sigma_p / P_o, P_o the mean power received (eq. 20)."""
    require_between("samples", samples, 3, None)
    slope = conscan_slope(half_power_beamwidth_rad, radius_rad)
    scaled = slope / half_power_beamwidth_rad * axis_error_rad
    return half_power_beamwidth_rad / slope * relative_sigma * math.sqrt((scaled**2 + 2.0) / samples)


def conscan_sigma_eq21_rad(
    half_power_beamwidth_rad: float,
    radius_rad: float,
    samples: int,
    nominal_relative_sigma: float,
    axis_error_rad: float,
    total_error_rad: float,
) -> float:
    """Return the standard deviation per axis from sigma_p / P_nom with sigma_p held constant (eq. 21)."""
    loss = conscan_loss(half_power_beamwidth_rad, radius_rad) * conscan_loss(half_power_beamwidth_rad, total_error_rad)
    relative = nominal_relative_sigma / loss
    return conscan_sigma_eq20_rad(half_power_beamwidth_rad, radius_rad, samples, relative, axis_error_rad)


def conscan_sigma_eq23_rad(
    half_power_beamwidth_rad: float, radius_rad: float, samples: int, nominal_relative_sigma: float
) -> float:
    """Return the standard deviation per axis for a vanishing pointing error (eq. 23)."""
    return conscan_sigma_eq21_rad(half_power_beamwidth_rad, radius_rad, samples, nominal_relative_sigma, 0.0, 0.0)


def conscan_sigma_eq25_rad(
    half_power_beamwidth_rad: float,
    radius_rad: float,
    samples: int,
    carrier_to_noise_db_hz: float,
    integration_s: float = 1.0,
) -> float:
    """Return the standard deviation per axis for the Block V receiver (eq. 25; the paper integrates over 1 s)."""
    relative = math.sqrt(2.0 / (10.0 ** (carrier_to_noise_db_hz / 10.0) * integration_s))
    return conscan_sigma_eq23_rad(half_power_beamwidth_rad, radius_rad, samples, relative)
