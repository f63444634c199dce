"""The turning Earth under the orbit: sidereal angle, and a station's place and axes.

Precession, nutation, polar motion and UT1-UTC are left out: inertial axes here are "true equator, mean equinox of
date" to a few arc seconds, the same for simulated and estimated orbits.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.core import Params, parameter
from rf_pointing.core.constants import EARTH_RADIUS_M

__all__ = ["EARTH_RATE_RAD_S", "Site", "sidereal_angle_rad", "to_earth_fixed", "to_inertial"]

Array = NDArray[np.float64]

EARTH_RATE_RAD_S = 7.292115855e-5
"""Sidereal turning rate with respect to the equinox of date (IAU 1982)."""
_FLATTENING = 1.0 / 298.257223563
_J2000_T_S = 946728000.0


def sidereal_angle_rad(t_s: ArrayLike) -> Array:
    """Return Greenwich mean sidereal time at UTC seconds since 1970 (IAU 1982 to first order, UT1 = UTC)."""
    days = (np.asarray(t_s, dtype=np.float64) - _J2000_T_S) / 86400.0
    return np.mod(np.radians(280.46061837 + 360.98564736629 * days), 2.0 * np.pi)


def to_earth_fixed(vector: Array, t_s: ArrayLike) -> Array:
    """Return inertial vectors (n, 3) in Earth-fixed axes; `to_inertial` is the inverse."""
    return _turned(vector, -sidereal_angle_rad(t_s))


def to_inertial(vector: Array, t_s: ArrayLike) -> Array:
    """Return Earth-fixed vectors (n, 3) in inertial axes."""
    return _turned(vector, sidereal_angle_rad(t_s))


@dataclass(frozen=True, kw_only=True)
class Site(Params):
    """A tracking station on the WGS-84 ellipsoid."""

    name: str = parameter(description="station name")
    latitude_rad: float = parameter(description="geodetic latitude", low=-math.pi / 2.0, high=math.pi / 2.0)
    longitude_rad: float = parameter(description="longitude, east positive", low=-math.pi, high=2.0 * math.pi)
    height_m: float = parameter(0.0, "height above the ellipsoid", low=-500.0, high=9000.0)

    def position_m(self) -> Array:
        """Return the Earth-fixed position (3,)."""
        eccentricity2 = _FLATTENING * (2.0 - _FLATTENING)
        sin_lat, cos_lat = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        normal = EARTH_RADIUS_M / math.sqrt(1.0 - eccentricity2 * sin_lat**2)
        across = (normal + self.height_m) * cos_lat
        up = (normal * (1.0 - eccentricity2) + self.height_m) * sin_lat
        return np.array([across * math.cos(self.longitude_rad), across * math.sin(self.longitude_rad), up])

    def axes(self) -> Array:
        """Return the rotation (3, 3) from Earth-fixed axes to east, north, up."""
        sin_lat, cos_lat = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        sin_lon, cos_lon = math.sin(self.longitude_rad), math.cos(self.longitude_rad)
        return np.array(
            [
                [-sin_lon, cos_lon, 0.0],
                [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
                [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
            ]
        )


def _turned(vector: Array, angle_rad: Array) -> Array:
    sine, cosine = np.sin(angle_rad), np.cos(angle_rad)
    x, y, z = np.moveaxis(vector, -1, 0)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)
