"""Sun, Moon, radio sources and fixed points as targets, for calibration and to keep off the Sun.

Sun: SOFA epv00 (VSOP2000, better than 0.01 arcsec).  Moon: SOFA moon98 (Meeus, 10 arcsec in
longitude, 3 mdeg).  Both are true positions; the track applies light time, which to first order in
v/c is also the annual aberration.  Radio sources: ICRS places, deflected at the Sun and aberrated
here (SOFA ld, ab), without parallax.  Planets: SOFA plan94 (Simon et al. 1994), whose errors in
longitude are those of `PLANETS`.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import erfa
import numpy as np

from rf_pointing.core import DAY_S, SPEED_OF_LIGHT_M_S, Array, require_between, require_choice
from rf_pointing.ephemeris.celestial_frame import EARTH_RATE_RAD_S, earth_fixed_from_gcrs, tt_parts
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.sites import Site
from rf_pointing.ephemeris.state_vector import OFFSETS, StateVector, Vector, motion_from_positions

_AU_M = 149597870700.0
_AU_DAY_IN_C = _AU_M / DAY_S / SPEED_OF_LIGHT_M_S
_LIGHT_YEAR_M = 9.4607304725808e15
# Long against the rounding of a position, short against the Moon's month.
_STEP_S = 600.0
_NODE_DAYS = 0.125
J2000_S = 946727935.816
JULIAN_YEAR_S = 365.25 * DAY_S
OWN_PLACE, OWN_POINT = "radec", "azel"
_OBLIQUITY_RAD = math.radians(23.4393)


class CelestialTarget:
    """A body whose place in the GCRS is a function of time."""

    rotation_rate_rad_s = EARTH_RATE_RAD_S
    spans_t_s = ((-math.inf, math.inf),)

    def __init__(
        self, name: str, position: Callable[[Any], Any], *, unit_m: float = _AU_M,
        at_infinity: bool = False, orientation: IersEarthOrientation | None = None,
    ) -> None:  # fmt: skip
        self.name, self.at_infinity = name, at_infinity
        self._position, self._unit_m = position, unit_m
        self.orientation = orientation or IersEarthOrientation()

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the inertial motion [m] in Earth-fixed axes at UTC times."""
        positions = [_components(self._position(t_s + ahead_s + k * _STEP_S)) for k in OFFSETS]
        return earth_fixed_from_gcrs(motion_from_positions(positions, _STEP_S, self._unit_m), t_s, self.orientation)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the Earth's orientation at `t_s` less certain."""
        return self.orientation.warnings(t_s)


@lru_cache(maxsize=4096)
def _earth_node(number: int) -> Array:
    """Return position and velocity from the Sun and from the barycentre (2, 2, 3), AU and days."""
    motions = erfa.epv00(erfa.DJ00, number * _NODE_DAYS)
    return np.array([[one["p"] for one in motions], [one["v"] for one in motions]])


def _earth_at(t_s: Any) -> tuple[Any, Any]:
    """Return the Earth's place from the Sun [AU] and its barycentric velocity [AU/day], (..., 3).

    Of many times cubic between nodes, 0.02 m and 1e-5 m/s off: epv00 takes 0.1 ms for each.
    """
    begin, part = tt_parts(t_s)
    if np.ndim(t_s) == 0:
        heliocentric, barycentric = erfa.epv00(begin, part)
        return heliocentric["p"], barycentric["v"]
    steps = ((begin - erfa.DJ00) + part) / _NODE_DAYS
    numbers, which = np.unique(np.floor(steps), return_inverse=True)
    ends = (np.array([_earth_node(int(each) + k) for each in numbers])[which] for k in (0, 1))
    (p0, v0), (p1, v1) = (np.moveaxis(each, -3, 0) for each in ends)
    u = (steps - numbers[which])[..., None, None]
    # Speeds are per node from here on.
    v0, v1 = v0 * _NODE_DAYS, v1 * _NODE_DAYS
    bend, twist = 3.0 * (p1 - p0) - 2.0 * v0 - v1, 2.0 * (p0 - p1) + v0 + v1
    place = p0 + u * (v0 + u * (bend + u * twist))
    speed = (v0 + u * (2.0 * bend + 3.0 * u * twist)) / _NODE_DAYS
    return place[..., 0, :], speed[..., 1, :]


def _sun_at(t_s: Any) -> Any:
    return -_earth_at(t_s)[0]


def _moon_at(t_s: Any) -> Any:
    return erfa.moon98(*tt_parts(t_s))["p"]


def _planet_at(number: int, t_s: Any) -> Any:
    return erfa.plan94(*tt_parts(t_s), number)["p"] + _sun_at(t_s)


def sun(orientation: IersEarthOrientation | None = None) -> CelestialTarget:
    """Return the centre of the Sun."""
    return CelestialTarget("Sun", _sun_at, orientation=orientation)


def moon(orientation: IersEarthOrientation | None = None) -> CelestialTarget:
    """Return the centre of the Moon."""
    return CelestialTarget("Moon", _moon_at, orientation=orientation)


def moon_phase_rad(t_s: float) -> float:
    """Return the Moon's ecliptic longitude off that opposite to the Sun: 0 at full, then > 0."""
    cosine, sine = math.cos(_OBLIQUITY_RAD), math.sin(_OBLIQUITY_RAD)
    places = _sun_at(t_s), _moon_at(t_s)
    longitudes = [math.atan2(cosine * y + sine * z, x) for x, y, z in places]
    return math.remainder(longitudes[1] - longitudes[0] - math.pi, math.tau)


# Largest error in arcsec from 1800 to 2050, in the order of plan94's numbers; the third is Earth.
PLANETS = {
    "Mercury": 4.0, "Venus": 5.0, "": 6.0, "Mars": 17.0, "Jupiter": 71.0, "Saturn": 81.0,
    "Uranus": 86.0, "Neptune": 11.0,
}  # fmt: skip


def planet(name: str, orientation: IersEarthOrientation | None = None) -> CelestialTarget:
    """Return the centre of a planet of `PLANETS`, good to the error given there."""
    number = list(PLANETS).index(name) + 1
    return CelestialTarget(name, partial(_planet_at, number), orientation=orientation)


@dataclass(frozen=True)
class RadioSource:
    """A place on the sky: right ascension and declination in the ICRS at an epoch (Julian year).

    Proper motions are in rad a year, that in right ascension with the cosine of the declination.
    """

    name: str
    right_ascension_rad: float
    declination_rad: float
    motion_east_rad_year: float = 0.0
    motion_north_rad_year: float = 0.0
    epoch_year: float = 2000.0

    def __post_init__(self) -> None:
        require_between("right_ascension_rad", self.right_ascension_rad, 0.0, 2.0 * math.pi)
        require_between("declination_rad", self.declination_rad, -0.5 * math.pi, 0.5 * math.pi)

    def target(self, orientation: IersEarthOrientation | None = None) -> CelestialTarget:
        """Return the source as a target; its range is set to one light year and means nothing."""
        place = erfa.s2c(self.right_ascension_rad, self.declination_rad)
        sine, cosine = math.sin(self.right_ascension_rad), math.cos(self.right_ascension_rad)
        east = np.array([-sine, cosine, 0.0])
        motion = self.motion_east_rad_year * east
        motion = motion + self.motion_north_rad_year * np.cross(place, east)

        def direction(t_s: Any) -> Any:
            # On a straight line in space, as long as the motion is small against a radian.
            years = (np.asarray(t_s) - J2000_S) / JULIAN_YEAR_S - (self.epoch_year - 2000.0)
            moved = place + years[..., None] * motion
            catalogue = moved / np.linalg.norm(moved, axis=-1)[..., None]
            earth, velocity = _earth_at(t_s)
            # Deflection at the Sun depends on the observer's distance from it.
            distance_au = np.linalg.norm(earth, axis=-1)
            deflected = erfa.ldsun(catalogue, earth / distance_au[..., None], distance_au)
            velocity = velocity * _AU_DAY_IN_C
            # SOFA's ab wants the reciprocal of the Lorentz factor.
            inverse_lorentz = np.sqrt(1.0 - np.sum(velocity**2, axis=-1))
            return erfa.ab(deflected, velocity, distance_au, inverse_lorentz)

        return CelestialTarget(self.name, direction, unit_m=_LIGHT_YEAR_M, at_infinity=True, orientation=orientation)


def _source(name: str, hours: tuple[int, int, float], degrees: tuple[int, int, float]) -> RadioSource:
    right_ascension = (hours[0] + hours[1] / 60.0 + hours[2] / 3600.0) * 15.0
    # The sign belongs to all three parts: -5 deg 23' is not -5 deg + 23'.
    declination = math.copysign(abs(degrees[0]) + degrees[1] / 60.0 + degrees[2] / 3600.0, degrees[0])
    return RadioSource(name, math.radians(right_ascension), math.radians(declination))


# Strong sources used to calibrate antennas; places from the NASA/IPAC Extragalactic Database and
# SIMBAD, ICRS.
_PLACES = {
    "Cassiopeia A": ((23, 23, 24.0), (58, 48, 54.0)),
    "Cygnus A": ((19, 59, 28.357), (40, 44, 2.10)), "Taurus A": ((5, 34, 31.94), (22, 0, 52.2)),
    "Virgo A": ((12, 30, 49.423), (12, 23, 28.04)), "Orion A": ((5, 35, 17.3), (-5, 23, 28.0)),
    "3C 84": ((3, 19, 48.160), (41, 30, 42.11)), "3C 273": ((12, 29, 6.700), (2, 3, 8.60)),
    "3C 286": ((13, 31, 8.288), (30, 30, 32.96)),
}  # fmt: skip
RADIO_SOURCES = {name: _source(name, *place) for name, place in _PLACES.items()}


def radio_source(name: str, orientation: IersEarthOrientation | None = None) -> CelestialTarget:
    """Return the catalogued source of that name as a target; ValueError lists the names."""
    require_choice("radio_source", name, RADIO_SOURCES)
    return RADIO_SOURCES[name].target(orientation)


def own_place(text: str) -> RadioSource:
    """Return the place of `radec RA DEC [EAST NORTH EPOCH]`: deg, mas a year, Julian year.

    ValueError for another number of words, and for one that is not a number or outside its range.
    """
    values = _numbers(text, f"{OWN_PLACE} RA DEC [EAST NORTH EPOCH] in deg, mas/year, year", (2, 5))
    right, up, east, north, epoch = [*values, 0.0, 0.0, 2000.0][:5]
    mas = math.radians(1.0 / 3.6e6)
    return RadioSource(text, math.radians(right), math.radians(up), east * mas, north * mas, epoch)


class FixedPoint:
    """The true direction `azel AZ EL` in deg: a beacon on a mast, or the empty sky.

    A `TargetSource` in Earth-fixed axes that do not turn; `seen_from` a site it is above that
    site's horizon, and refraction lifts it.  ValueError as for `own_place`.
    """

    rotation_rate_rad_s, at_infinity, orientation = 0.0, True, None
    spans_t_s = ((-math.inf, math.inf),)

    def __init__(self, text: str) -> None:
        azimuth, elevation = map(math.radians, _numbers(text, f"{OWN_POINT} AZ EL in deg", (2,)))
        require_between("azimuth_rad", azimuth, -2.0 * math.pi, 2.0 * math.pi)
        require_between("elevation_rad", elevation, -0.5 * math.pi, 0.5 * math.pi)
        self.name = text
        self._position = erfa.s2c(0.5 * math.pi - azimuth, elevation) * _LIGHT_YEAR_M

    def seen_from(self, site: Site) -> "FixedPoint":
        """Return the point of the sky over a site."""
        point = FixedPoint(self.name)
        point._position = self._position @ np.array(site.axes)
        return point

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the place [m] at UTC times, and that it never moves."""
        still = 0.0 * (t_s + ahead_s)
        x, y, z = self._position.tolist()
        return StateVector((still + x, still + y, still + z), *3 * ((still, still, still),))

    def warnings(self, _t_s: float) -> tuple[str, ...]:
        """Return nothing: the Earth's orientation does not matter."""
        return ()


def _numbers(text: str, form: str, counts: tuple[int, ...]) -> list[float]:
    """Return the numbers after the first word of a target."""
    words = text.split()[1:]
    if len(words) not in counts:
        raise ValueError(f"satellite={text!r} must be {form}")
    for word in words:
        if not re.fullmatch(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,2})?", word):
            raise ValueError(f"satellite={text!r}: {word!r} must be a number")
    return [*map(float, words)]


def _components(vectors: Any) -> Vector:
    """Return x, y, z of (..., 3): plain floats for a single vector."""
    if vectors.ndim == 1:
        x, y, z = vectors.tolist()
        return x, y, z
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]
