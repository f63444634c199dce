"""Ground stations as the satellite sees them, and the network of stations by name (DOA (13)-(17)).

S_o = D / |D| with D = station - satellite, both places counted from the Earth's centre.  DOA prints
D = G - S, but its vectors run from station and satellite to the centre: in the printed order the
reference would point the other way.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.orbits import Orbit, SunSynchronousOrbitParams, orbit_point
from rf_pointing.core import Params, parameter, require_between
from rf_pointing.core.constants import EARTH_RADIUS_M
from rf_pointing.core.types import Array
from rf_pointing.ephemeris import Site

# A name becomes a ROS namespace, whose grammar allows no more.
_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundStation:
    """A transmitter on the spherical Earth."""

    name: str
    latitude_rad: float
    longitude_rad: float

    def __post_init__(self) -> None:
        require_between("latitude_rad", self.latitude_rad, -math.pi / 2.0, math.pi / 2.0)
        require_between("longitude_rad", self.longitude_rad, -2.0 * math.pi, 2.0 * math.pi)

    @property
    def position_m(self) -> Array:
        """Earth-fixed position (3,)."""
        level = math.cos(self.latitude_rad)
        return EARTH_RADIUS_M * np.array(
            [
                level * math.cos(self.longitude_rad),
                level * math.sin(self.longitude_rad),
                math.sin(self.latitude_rad),
            ]
        )

    @property
    def zenith(self) -> Array:
        """Unit vector (3,) up from it: on a sphere, the place itself."""
        return self.position_m / EARTH_RADIUS_M


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyedStation:
    """A transmitter on the WGS 84 ellipsoid."""

    name: str
    site: Site

    @property
    def position_m(self) -> Array:
        """Earth-fixed position (3,)."""
        return np.array(self.site.position_m)

    @property
    def zenith(self) -> Array:
        """Unit vector (3,) up from it."""
        return np.array(self.site.axes[2])


GroundPlace = GroundStation | SurveyedStation


@dataclass(frozen=True, slots=True, kw_only=True)
class StationView:
    """Directions satellite to station in F_o (..., N, 3), elevation of the satellite there and
    range (..., N).
    """

    reference: Array
    elevation_rad: Array
    range_m: Array

    def visible(self, elevation_min_rad: float) -> NDArray[np.bool_]:
        """Return whether each station sees the satellite above `elevation_min_rad`, (..., N)."""
        return self.elevation_rad >= elevation_min_rad


def view_stations(orbit: Orbit, stations: Sequence[GroundPlace], t_s: ArrayLike) -> StationView:
    """Return how the satellite sees `stations` at UTC times `t_s` (...)."""
    point = orbit.point(t_s)
    if not stations:
        raise ValueError("stations is empty, must have at least 1")
    places = np.stack([station.position_m for station in stations])
    away = places - point.position_m[..., None, :]
    distance = np.linalg.norm(away, axis=-1)
    # The line of sight seen from the station is -away.
    sine = -np.sum(away * np.stack([station.zenith for station in stations]), axis=-1) / distance
    reference = np.einsum("...ij,...nj->...ni", point.frame, away) / distance[..., None]
    # Straight overhead rounding gives a sine of 1 + 1e-16, and arcsin would return NaN.
    return StationView(
        reference=reference, elevation_rad=np.arcsin(np.clip(sine, -1.0, 1.0)), range_m=distance
    )


def place_slopes(orbit: Orbit, stations: Sequence[GroundPlace], t_s: float) -> Array:
    """Return by how much a metre north, and one east, turn the direction to each of `stations` in
    F_o, (N, 3, 2).
    """
    point = orbit.point(t_s)
    slopes = []
    for station in stations:
        up = station.zenith
        # Where the axis of the Earth is up, any longitude serves.
        longitude = math.atan2(up[1], up[0])
        east = np.array([-math.sin(longitude), math.cos(longitude), 0.0])
        away = station.position_m - point.position_m
        distance = float(np.linalg.norm(away))
        across = np.eye(3) - np.outer(away, away) / distance**2
        slopes.append(
            point.frame @ across @ np.stack([np.cross(up, east), east], axis=-1) / distance
        )
    return np.array(slopes)


def largest_nadir_angle_rad(orbit: SunSynchronousOrbitParams, elevation_min_rad: float) -> float:
    """Return the nadir angle of a station at `elevation_min_rad`.

    61.05 deg (800 km, 10 deg), not the printed 62.
    """
    ratio = EARTH_RADIUS_M / (EARTH_RADIUS_M + orbit.altitude_m)
    return math.asin(ratio * math.cos(elevation_min_rad))


def stations_along_track(
    orbit: SunSynchronousOrbitParams,
    start_s: float,
    *,
    count: int = 8,
    spacing_s: float = 625.0,
    aside_rad: float = 0.02,
) -> list[GroundStation]:
    """Return `count` stations under the orbit, passed every `spacing_s`, by turns `aside_rad` right
    and left of it.

    The paper's eight stations are not published; these keep one in view all the time and are not
    under the track, because stations on the track see pitch from one plane only.
    """
    stations = []
    for index in range(count):
        point = orbit_point(orbit, start_s + (index + 0.5) * spacing_s)
        # By turns right and left: stations on the track show pitch from one plane only, and yaw
        # stays weak.
        side = math.copysign(aside_rad, 0.5 - index % 2)
        place = -point.frame[2] * math.cos(side) + point.frame[1] * math.sin(side)
        latitude = math.asin(float(place[2]))
        longitude = math.atan2(float(place[1]), float(place[0]))
        stations.append(
            GroundStation(
                name=f"station_{index + 1}", latitude_rad=latitude, longitude_rad=longitude
            )
        )
    return stations


def require_names(what: str, names: tuple[str, ...]) -> None:
    """Refuse names of stations that are not namespaces, or not different."""
    for name in names:
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise ValueError(
                f"{what} has {name!r}, must be lower-case letters, digits and underscores"
            )
    if len(set(names)) != len(names) or not names:
        raise ValueError(f"{what}={names} must be different, and at least one")


@dataclass(frozen=True, kw_only=True)
class GroundNetworkParams(Params):
    """Stations on the spherical Earth.

    The defaults are 12 deg apart as seen from 19 deg E in GEO.
    """

    names: tuple[str, ...] = parameter(
        ("usingen", "hartebeesthoek"), "stations; each name is a namespace"
    )
    latitude_rad: tuple[float, ...] = parameter(
        (math.radians(50.33), math.radians(-25.89)),
        "latitude of each",
        low=-math.pi / 2.0,
        high=math.pi / 2.0,
    )
    longitude_rad: tuple[float, ...] = parameter(
        (math.radians(8.48), math.radians(27.69)),
        "longitude of each, east",
        low=-2.0 * math.pi,
        high=2.0 * math.pi,
    )

    def check_together(self) -> None:
        """Refuse names that are not namespaces, double names, and places without a name."""
        require_names("names", self.names)
        for field in ("latitude_rad", "longitude_rad"):
            if len(getattr(self, field)) != len(self.names):
                raise ValueError(
                    f"{field} has {len(getattr(self, field))} values, must be one for each of {len(self.names)} names"
                )

    def stations(self) -> list[GroundStation]:
        """Return the stations in their order."""
        places = zip(self.names, self.latitude_rad, self.longitude_rad, strict=True)
        return [
            GroundStation(name=name, latitude_rad=lat, longitude_rad=lon)
            for name, lat, lon in places
        ]
