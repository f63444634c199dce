"""Conscan by weighted least squares on the linearised power (CONSCAN eqs. 8-18).

P_i = g_i (C1 + C2 x_i/r + C3 y_i/r), (x, y) the beam's offset from the scan centre;
g_i = exp(-mu (x^2 + y^2 - r^2) / h^2) is 1 on the circle and lets the beam leave it.  Error =
h C_{2,3} / (k_s C1), covariance by the Jacobian of that ratio.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import MU
from rf_pointing.tracking.conscan_window import ConscanWindow, is_singular

__all__ = ["ConscanEstimate", "linear_errors_rad", "linear_estimate"]

Array = NDArray[np.float64]


class ConscanEstimate(NamedTuple):
    """Target minus scan centre (2,) with covariance (2, 2) and the mean carrier power on the circle."""

    error_rad: Array
    covariance_rad2: Array
    power_w: float


def linear_estimate(window: ConscanWindow, half_power_beamwidth_rad: float, radius_rad: float) -> ConscanEstimate:
    """Return the weighted least-squares estimate of eqs. (13)-(18); it means something only where the power is > 0.

    Raises LinAlgError where the samples do not determine both axes and the power.
    """
    rows = _rows(window, half_power_beamwidth_rad, radius_rad)
    weighted = rows / window.sigma_w**2
    information = weighted @ rows.T
    if is_singular(information):
        raise np.linalg.LinAlgError("the samples do not determine the direction: one outweighs the others")
    variance = np.linalg.inv(information)
    mean, right, up = variance @ (weighted @ window.power_w)
    scale = half_power_beamwidth_rad**2 / (2.0 * MU * radius_rad)
    jacobian = scale / mean * np.array([[-right / mean, 1.0, 0.0], [-up / mean, 0.0, 1.0]])
    return ConscanEstimate(scale / mean * np.array([right, up]), jacobian @ variance @ jacobian.T, float(mean))


def linear_errors_rad(
    window: ConscanWindow, power_w: Array, half_power_beamwidth_rad: float, radius_rad: float
) -> Array:
    """Return the errors (runs, 2) of many runs `power_w` (runs, n) at the positions and sigmas of one window."""
    rows = _rows(window, half_power_beamwidth_rad, radius_rad)
    weighted = rows / window.sigma_w**2
    solution = power_w @ (np.linalg.inv(weighted @ rows.T) @ weighted).T
    scale = half_power_beamwidth_rad**2 / (2.0 * MU * radius_rad)
    return np.asarray(scale * solution[:, 1:] / solution[:, :1])


def _rows(window: ConscanWindow, half_power_beamwidth_rad: float, radius_rad: float) -> Array:
    x, y = window.beam_cross_elevation_rad / radius_rad, window.beam_elevation_rad / radius_rad
    shape = MU * (radius_rad / half_power_beamwidth_rad) ** 2
    return np.asarray(np.exp(-shape * (x**2 + y**2 - 1.0)) * np.stack([np.ones_like(x), x, y]))
