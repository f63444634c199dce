"""Where the antenna stands: geodetic coordinates on WGS 84, and a catalogue of stations by name.

Sources: DSN 810-005 module 301 for the Deep Space Stations (mean pole, to 0.1 m).  For the ISTRAC
stations no survey is public: they are placed to about 0.1 deg on the map, which moves a satellite
at 500 km by a degree.  Survey your antenna and make its own `Site`.
"""

import math
from dataclasses import dataclass
from functools import cached_property

from rf_pointing.core import EARTH_RADIUS_M, Params, parameter, require_choice

Vector = tuple[float, float, float]

WGS84_FLATTENING = 1.0 / 298.257223563


def earth_fixed_m(latitude_rad: float, longitude_rad: float, height_m: float) -> Vector:
    """Return the Earth-fixed position x, y, z of geodetic coordinates."""
    e2 = WGS84_FLATTENING * (2.0 - WGS84_FLATTENING)
    normal = EARTH_RADIUS_M / math.sqrt(1.0 - e2 * math.sin(latitude_rad) ** 2)
    # The ellipsoid's normal radius, not the distance from the centre.
    across = (normal + height_m) * math.cos(latitude_rad)
    up = (normal * (1.0 - e2) + height_m) * math.sin(latitude_rad)
    return across * math.cos(longitude_rad), across * math.sin(longitude_rad), up


def local_axes(latitude_rad: float, longitude_rad: float) -> tuple[Vector, Vector, Vector]:
    """Return unit vectors east, north and up of a place in Earth-fixed components."""
    sin_lat, cos_lat = math.sin(latitude_rad), math.cos(latitude_rad)
    sin_lon, cos_lon = math.sin(longitude_rad), math.cos(longitude_rad)
    east = (-sin_lon, cos_lon, 0.0)
    north = (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat)
    up = (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
    return east, north, up


@dataclass(frozen=True, kw_only=True)
class Site(Params):
    """Intersection of the axes of an antenna."""

    latitude_rad: float = parameter(description="geodetic latitude, north positive", low=-math.pi / 2, high=math.pi / 2)
    longitude_rad: float = parameter(description="longitude, east positive", low=-math.pi, high=2.0 * math.pi)
    altitude_m: float = parameter(description="height above the WGS 84 ellipsoid", low=-500.0, high=9000.0)

    @classmethod
    def from_degrees(cls, latitude_deg: float, longitude_deg: float, altitude_m: float) -> "Site":
        """Return the site at coordinates in degrees."""
        north, east = math.radians(latitude_deg), math.radians(longitude_deg)
        return cls(latitude_rad=north, longitude_rad=east, altitude_m=altitude_m)

    @cached_property
    def position_m(self) -> Vector:
        """Earth-fixed position x, y, z."""
        return earth_fixed_m(self.latitude_rad, self.longitude_rad, self.altitude_m)

    @cached_property
    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Unit vectors east, north and up in Earth-fixed components: the rows of the rotation."""
        return local_axes(self.latitude_rad, self.longitude_rad)


SITES = {
    "Goldstone DSS-13": Site.from_degrees(35.2471642, -116.7944605, 1070.444),
    "Goldstone DSS-14": Site.from_degrees(35.4259009, -116.8895382, 1001.390),
    "Canberra DSS-43": Site.from_degrees(-35.4024242, 148.9812673, 688.867),
    "Madrid DSS-63": Site.from_degrees(40.4312097, 355.7519914, 864.816),
    "Mauritius ISTRAC": Site.from_degrees(-20.34, 57.45, 400.0),
    "Bangalore ISTRAC": Site.from_degrees(13.03, 77.51, 840.0),
}


def site(name: str) -> Site:
    """Return the station of that name; an unknown name is refused with the list of names."""
    require_choice("site", name, SITES)
    return SITES[name]
