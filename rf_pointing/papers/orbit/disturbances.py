"""Accelerations besides the Earth's attraction, each optional: air drag, and the tides of Sun and Moon.

    drag    a = -1/2 rho(h) B |v_r| v_r,   v_r = v - w x r,   rho = rho_0 exp(-(h - h_0) / H)
    tide    a = GM [(s - r) / |s - r|^3 - s / s^3]

Vallado, Fundamentals of Astrodynamics, 8.6 (air of table 8-4, 800 km) and 8.7; places of Sun and Moon to a few minutes
of arc from the leading terms of their theories (Montenbruck and Gill, Satellite Orbits, 3.3.2): a tide of 1e-6 m/s^2
needs no better.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Params, parameter
from rf_pointing.core.constants import EARTH_RADIUS_M
from rf_pointing.papers.orbit.earth import EARTH_RATE_RAD_S

__all__ = ["Disturbances", "moon_m", "sun_m"]

Array = NDArray[np.float64]

SUN_MU_M3_S2, MOON_MU_M3_S2 = 1.327_124_4e20, 4.902_8e12
OBLIQUITY_RAD = np.radians(23.43929)
_J2000_T_S, _CENTURY_S = 946728000.0, 36525.0 * 86400.0
_ARC = np.radians(1.0 / 3600.0)
_MOON_LONGITUDE: Array = np.array([
    (22640, 1, 0, 0, 0), (769, 2, 0, 0, 0), (-4586, 1, 0, 0, -2), (2370, 0, 0, 0, 2), (-668, 0, 1, 0, 0),
    (-412, 0, 0, 2, 0), (-212, 2, 0, 0, -2), (-206, 1, 1, 0, -2), (192, 1, 0, 0, 2), (-165, 0, 1, 0, -2),
    (148, 1, -1, 0, 0), (-125, 0, 0, 0, 1), (-110, 1, 1, 0, 0), (-55, 0, 0, 2, -2),
], dtype=np.float64)  # fmt: skip
"""Arc seconds times the sine of multiples of l, l', F, D."""
_MOON_LATITUDE: Array = np.array([
    (-526, 0, 0, 1, -2), (44, 1, 0, 1, -2), (-31, -1, 0, 1, -2), (-25, -2, 0, 1, 0), (-23, 0, 1, 1, -2),
    (21, -1, 0, 1, 0), (11, 0, -1, 1, -2),
], dtype=np.float64)  # fmt: skip
_MOON_DISTANCE_KM: Array = np.array([
    (-20905, 1, 0, 0, 0), (-3699, -1, 0, 0, 2), (-2956, 0, 0, 0, 2), (-570, 2, 0, 0, 0), (246, 2, 0, 0, -2),
    (-205, 0, 1, 0, -2), (-171, 1, 0, 0, 2), (-152, 1, 1, 0, -2),
], dtype=np.float64)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Disturbances(Params):
    """What acts on the satellite besides the Earth; nothing by default."""

    ballistic_m2_kg: float = parameter(0.0, "drag coefficient times area over mass; 0: no drag", low=0.0, high=10.0)
    air_density_kg_m3: float = parameter(1.17e-14, "density of the air at the reference height", low=0.0, high=1e-6)
    air_height_m: float = parameter(8.0e5, "reference height of the air", low=1e5, high=2e6)
    air_scale_m: float = parameter(1.2464e5, "height in which the density falls to 1/e", low=1e3, high=1e6)
    sun: bool = parameter(False, "whether the Sun's tide acts")
    moon: bool = parameter(False, "whether the Moon's tide acts")

    def acceleration(self, t_s: float, states: Array) -> Array:
        """Return the acceleration (m, 3) of states (m, 6) at one time, m/s^2."""
        total = np.zeros((len(states), 3))
        if self.ballistic_m2_kg > 0.0:
            total += self._drag(states)
        for acts, place, strength in ((self.sun, sun_m, SUN_MU_M3_S2), (self.moon, moon_m, MOON_MU_M3_S2)):
            if acts:
                total += _tide(states[:, :3], place(t_s), strength)
        return total

    def _drag(self, states: Array) -> Array:
        position, velocity = states[:, :3], states[:, 3:]
        turning = EARTH_RATE_RAD_S * np.stack([-position[:, 1], position[:, 0], np.zeros(len(states))], axis=1)
        through = velocity - turning
        height = np.linalg.norm(position, axis=1) - EARTH_RADIUS_M
        density = self.air_density_kg_m3 * np.exp(-(height - self.air_height_m) / self.air_scale_m)
        speed = np.linalg.norm(through, axis=1)
        return np.asarray(-0.5 * self.ballistic_m2_kg * (density * speed)[:, np.newaxis] * through)


def sun_m(t_s: float) -> Array:
    """Return the geocentric place of the Sun (3,), mean equator and equinox of J2000."""
    centuries = (t_s - _J2000_T_S) / _CENTURY_S
    anomaly = np.radians(357.5256 + 35999.049 * centuries)
    longitude = np.radians(282.9400) + anomaly + _ARC * (6892.0 * np.sin(anomaly) + 72.0 * np.sin(2.0 * anomaly))
    distance = 1e9 * (149.619 - 2.499 * np.cos(anomaly) - 0.021 * np.cos(2.0 * anomaly))
    return _equatorial(longitude, 0.0, distance)


def moon_m(t_s: float) -> Array:
    """Return the geocentric place of the Moon (3,), mean equator and equinox of J2000."""
    centuries = (t_s - _J2000_T_S) / _CENTURY_S
    mean = np.radians(218.31617 + 481267.88088 * centuries - 1.3972 * centuries)
    arguments = np.radians(
        np.array([134.96292, 357.52543, 93.27283, 297.85027])
        + np.array([477198.86753, 35999.04944, 483202.01873, 445267.11135]) * centuries
    )
    _, suns, node, _ = arguments
    unequal = _ARC * _sum(_MOON_LONGITUDE, np.sin, arguments)
    up = _ARC * (412.0 * np.sin(2.0 * node) + 541.0 * np.sin(suns))
    latitude = _ARC * (18520.0 * np.sin(node + unequal + up) + _sum(_MOON_LATITUDE, np.sin, arguments))
    distance = 1e3 * (385000.0 + _sum(_MOON_DISTANCE_KM, np.cos, arguments))
    return _equatorial(mean + unequal, float(latitude), distance)


def _sum(series: Array, wave: np.ufunc, arguments: Array) -> float:
    return float(series[:, 0] @ wave(series[:, 1:] @ arguments))


def _equatorial(longitude: float, latitude: float, distance_m: float) -> Array:
    across, up = np.cos(latitude), np.sin(latitude)
    x, y, z = across * np.cos(longitude), across * np.sin(longitude), up
    cos_e, sin_e = np.cos(OBLIQUITY_RAD), np.sin(OBLIQUITY_RAD)
    return distance_m * np.array([x, cos_e * y - sin_e * z, sin_e * y + cos_e * z])


def _tide(position: Array, body_m: Array, strength: float) -> Array:
    toward = body_m - position
    pull = toward / np.linalg.norm(toward, axis=1, keepdims=True) ** 3
    return np.asarray(strength * (pull - body_m / np.linalg.norm(body_m) ** 3))
