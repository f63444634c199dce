"""Azimuth, elevation and range with two derivatives, from the motion relative to the antenna in east-north-up axes.

    az' = (n e' - e n') / h^2,   el' = (h u' - u h') / rho^2,   h^2 = e^2 + n^2

and the second derivatives by differentiating once more.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.ephemeris.state_vector import StateVector, root

__all__ = ["LookAngles", "angles_and_rates"]

Array = NDArray[np.float64]

_LEAST_HORIZONTAL_M = 1e-3
"""Azimuth is undefined at the zenith; a millimetre added in quadrature keeps its rates finite."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LookAngles:
    """Where a target is on the sky at the times `t_s`, all of shape (n,); azimuth is continuous along the array.

    Elevation is apparent (refraction included), `true_elevation_rad` is without refraction.
    """

    t_s: Array
    azimuth_rad: Array
    elevation_rad: Array
    azimuth_rate_rad_s: Array
    elevation_rate_rad_s: Array
    azimuth_acceleration_rad_s2: Array
    elevation_acceleration_rad_s2: Array
    range_m: Array
    range_rate_m_s: Array
    true_elevation_rad: Array

    @property
    def light_time_s(self) -> Array:
        """One-way travel time of the signal."""
        return self.range_m / SPEED_OF_LIGHT_M_S

    @property
    def doppler_factor(self) -> Array:
        """Frequency received on the ground over frequency sent by the target (without clock rates, below 1e-9)."""
        return 1.0 - self.range_rate_m_s / SPEED_OF_LIGHT_M_S


def angles_and_rates(enu: StateVector) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Return azimuth in (-pi, pi], elevation, their rates [rad/s] and accelerations [rad/s^2] of rotating motion."""
    (e, n, u), (e1, n1, u1), (e2, n2, u2) = enu.position, enu.velocity, enu.acceleration
    h = root(e * e + n * n + _LEAST_HORIZONTAL_M**2)
    rho2 = h * h + u * u
    h1 = (e * e1 + n * n1) / h
    h2 = (e1 * e1 + n1 * n1 + e * e2 + n * n2 - h1 * h1) / h
    azimuth_rate = (n * e1 - e * n1) / (h * h)
    elevation_rate = (h * u1 - u * h1) / rho2
    azimuth_acceleration = (n * e2 - e * n2) / (h * h) - 2.0 * azimuth_rate * h1 / h
    elevation_acceleration = (h * u2 - u * h2) / rho2 - 2.0 * elevation_rate * (h * h1 + u * u1) / rho2
    return (
        _arctan2(e, n),
        _arctan2(u, h),
        azimuth_rate,
        elevation_rate,
        azimuth_acceleration,
        elevation_acceleration,
    )


def _arctan2(y: Any, x: Any) -> Any:
    return math.atan2(y, x) if isinstance(y, float) else np.arctan2(y, x)
