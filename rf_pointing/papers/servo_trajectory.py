"""A low-orbit pass with exact rates and accelerations: circular orbit over a spherical Earth that
stands still.

BWG Fig. 3 shows its trajectory only as a plot; this one has the same character (one culmination,
azimuth rate largest there) and analytic derivatives, so no table or differencing can pass for servo
error.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core.types import Array

_MU_M3_S2 = 3.986004418e14
_EARTH_M = 6.371e6


@dataclass(frozen=True, slots=True)
class MotionTable:
    """Joint angles, rates and accelerations, each (n, 2) in the order azimuth, elevation, at `t_s`
    (n,).
    """

    t_s: Array
    position_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LowOrbitPass:
    """Pass of a satellite at `altitude_m` culminating at `culmination_rad` at t = 0, flying towards
    `heading_rad`.
    """

    altitude_m: float = 1000e3
    culmination_rad: float = math.radians(70.0)
    heading_rad: float = math.radians(-70.0)

    def at(self, t_s: ArrayLike) -> MotionTable:
        """Return the motion at `t_s` (n,) seconds from culmination; azimuth is continuous."""
        t = np.atleast_1d(np.asarray(t_s, dtype=np.float64))
        position, velocity, acceleration = self._vectors(t)
        along, across, up = position
        ground = np.hypot(along, across)
        (va, vc, vu), (aa, ac, au) = velocity, acceleration
        azimuth = self.heading_rad + np.arctan2(across, along)
        spin = along * vc - across * va
        azimuth_rate = spin / ground**2
        ground_rate = (along * va + across * vc) / ground
        azimuth_acceleration = (
            along * ac - across * aa
        ) / ground**2 - 2.0 * azimuth_rate * ground_rate / ground
        ground_acceleration = (va**2 + vc**2 + along * aa + across * ac - ground_rate**2) / ground
        distance = np.hypot(ground, up)
        elevation_rate = (ground * vu - up * ground_rate) / distance**2
        distance_rate = (ground * ground_rate + up * vu) / distance
        elevation_acceleration = (ground * au - up * ground_acceleration) / distance**2
        elevation_acceleration -= 2.0 * elevation_rate * distance_rate / distance
        return MotionTable(
            t,
            np.column_stack([azimuth, np.arctan2(up, ground)]),
            np.column_stack([azimuth_rate, elevation_rate]),
            np.column_stack([azimuth_acceleration, elevation_acceleration]),
        )

    def _vectors(self, t: Array) -> tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]:
        """Return position, velocity and acceleration as (along track, to its right, up) at the
        station.
        """
        radius = _EARTH_M + self.altitude_m
        rate = math.sqrt(_MU_M3_S2 / radius**3)
        nadir = math.acos(_EARTH_M * math.cos(self.culmination_rad) / radius) - self.culmination_rad
        c, s = np.cos(rate * t), np.sin(rate * t)
        offset = radius * math.sin(nadir)
        height = radius * math.cos(nadir)
        ones = np.ones_like(t)
        position = (radius * s, offset * c, height * c - _EARTH_M * ones)
        velocity = (radius * rate * c, -offset * rate * s, -height * rate * s)
        acceleration = (-radius * rate**2 * s, -offset * rate**2 * c, -height * rate**2 * c)
        return position, velocity, acceleration
