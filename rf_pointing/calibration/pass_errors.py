"""Errors of the reference orbit and of the clock during one pass, as extra parameters with priors.

A satellite displaced by d (along its track, across it, radially) is seen displaced by

    dAz = (cos Az, -sin Az, 0) . d / (rho cos El)
    dEl = (-sin El sin Az, -sin El cos Az, cos El) . d / rho

and a clock error tau by (Az', El') tau.  Without these parameters an orbit error of 200 m, the same
all through a pass, ends in the mount terms while the residuals look fine.  They need priors: a
clock error free in every pass is exactly the velocity lags, and free along, cross and radial
offsets leave the lags nothing to explain.
"""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration.observations import Observations
from rf_pointing.core import Params, parameter

Array = NDArray[np.float64]

_EARTH_RADIUS_M = 6.371e6


@dataclass(frozen=True, kw_only=True)
class PassPriors(Params):
    """Standard deviations of one pass's errors before the data; zero leaves an error out.

    The drifts let an error change through the pass, linearly from its middle.
    """

    along_track_m: float = parameter(0.0, "orbit error along the track", low=0.0, high=1e6)
    cross_track_m: float = parameter(0.0, "orbit error across the track", low=0.0, high=1e6)
    radial_m: float = parameter(0.0, "orbit error in height", low=0.0, high=1e6)
    along_track_drift_m_s: float = parameter(0.0, "change of the along-track error", low=0.0, high=1e3)
    cross_track_drift_m_s: float = parameter(0.0, "change of the cross-track error", low=0.0, high=1e3)
    radial_drift_m_s: float = parameter(0.0, "change of the height error", low=0.0, high=1e3)
    clock_s: float = parameter(0.0, "time tag error of the station", low=0.0, high=10.0)

    @classmethod
    def of_orbit(cls, size_m: float) -> "PassPriors | None":
        """Return orbit errors of one size along, across and radially; None for a size of zero."""
        return cls(along_track_m=size_m, cross_track_m=size_m, radial_m=size_m) if size_m != 0.0 else None

    def check_together(self) -> None:
        """Refuse an empty set."""
        if not self.names:
            raise ValueError("pass priors are all zero: give at least one a standard deviation, or leave them out")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the errors that are estimated."""
        return tuple(item.name for item in fields(self) if getattr(self, item.name) > 0.0)

    @cached_property
    def sigma(self) -> Array:
        """Return their prior standard deviations."""
        return np.array([getattr(self, name) for name in self.names])


def pass_partials(observations: Observations, names: tuple[str, ...]) -> tuple[Array, Array]:
    """Return the partials (n, len(names)) of azimuth and of elevation, radians per metre or second.

    Raises ValueError if an orbit error is named and the observations have no range or range rate.
    """
    # A clock error alone needs no range: the rates are enough.
    columns = {}
    if any(not name.startswith("clock") for name in names):
        columns = _orbit_columns(observations)
    columns["clock_s"] = np.stack([observations.azimuth_rate_rad_s, observations.elevation_rate_rad_s])
    both = np.stack([columns[name] for name in names], axis=-1)
    return both[0], both[1]


def track_axes(observations: Observations) -> tuple[Array, Array, Array]:
    """Return unit vectors (n, 3) along, across and radial to the track, east-north-up."""
    position, velocity = _topocentric_motion(observations)
    up = position + np.array([0.0, 0.0, _EARTH_RADIUS_M])
    # From a sphere's centre: an ellipsoid turns the axes, and so the prior, by 0.2 deg.
    radial = up / np.linalg.norm(up, axis=1, keepdims=True)
    # Along the track as seen from the rotating Earth, where the station is.
    across = np.cross(radial, velocity)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.cross(across, radial), across, radial


def _orbit_columns(data: Observations) -> dict[str, Array]:
    elapsed, columns = (data.t_s - _middle_of_pass(data))[:, np.newaxis], {}
    for name, axis in zip(("along_track", "cross_track", "radial"), track_axes(data), strict=True):
        columns[f"{name}_m"] = _seen(data, axis)
        columns[f"{name}_drift_m_s"] = _seen(data, axis * elapsed)
    return columns


def _topocentric_motion(data: Observations) -> tuple[Array, Array]:
    if data.range_m is None or data.range_rate_m_s is None:
        raise ValueError("range_m=None or range_rate_m_s=None: orbit errors of a pass need both")
    toward, clockwise, upward, cos_el = _sight(data)
    distance = data.range_m[:, np.newaxis]
    turning = clockwise * (data.azimuth_rate_rad_s * cos_el)[:, np.newaxis]
    turning = turning + upward * data.elevation_rate_rad_s[:, np.newaxis]
    return distance * toward, data.range_rate_m_s[:, np.newaxis] * toward + distance * turning


def _sight(data: Observations) -> tuple[Array, Array, Array, Array]:
    sin_az, cos_az = np.sin(data.true_azimuth_rad), np.cos(data.true_azimuth_rad)
    sin_el, cos_el = np.sin(data.true_elevation_rad), np.cos(data.true_elevation_rad)
    toward = np.stack([cos_el * sin_az, cos_el * cos_az, sin_el], axis=1)
    clockwise = np.stack([cos_az, -sin_az, np.zeros_like(sin_az)], axis=1)
    upward = np.stack([-sin_el * sin_az, -sin_el * cos_az, cos_el], axis=1)
    return toward, clockwise, upward, cos_el


def _seen(data: Observations, displacement: Array) -> Array:
    _, clockwise, upward, cos_el = _sight(data)
    distance = np.asarray(data.range_m)
    azimuth = np.sum(clockwise * displacement, axis=1) / (distance * cos_el)
    return np.stack([azimuth, np.sum(upward * displacement, axis=1) / distance])


def _middle_of_pass(data: Observations) -> Array:
    # Drifts count from here: from the first point they would be correlated with the offsets.
    numbers, place = np.unique(data.pass_id, return_inverse=True)
    first, last = np.full(len(numbers), np.inf), np.full(len(numbers), -np.inf)
    np.minimum.at(first, place, data.t_s)
    np.maximum.at(last, place, data.t_s)
    return np.asarray(0.5 * (first + last)[place])
