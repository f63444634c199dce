"""Sun, Moon and radio sources as targets, for calibration and for keeping the beam off the Sun.

Sun: SOFA epv00 (VSOP2000, better than 0.01 arcsec).  Moon: SOFA moon98 (Meeus, 10 arcsec in
longitude, 3 mdeg).  Both are true positions; the track applies light time, which to first order in
v/c is also the annual aberration.  Radio sources: ICRS places, deflected at the Sun and aberrated
here (SOFA ld, ab), without parallax.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import erfa
import numpy as np

from rf_pointing.core import require_between, require_choice
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.dates import DAY_S
from rf_pointing.ephemeris.celestial_frame import EARTH_RATE_RAD_S, earth_fixed_from_gcrs, tt_parts
from rf_pointing.ephemeris.earth_orientation import EarthOrientationSource, IersEarthOrientation
from rf_pointing.ephemeris.state_vector import OFFSETS, StateVector, Vector, motion_from_positions

_AU_M = 149597870700.0
_AU_DAY_IN_C = _AU_M / DAY_S / SPEED_OF_LIGHT_M_S
_LIGHT_YEAR_M = 9.4607304725808e15
# Long against the rounding of a position, short against the Moon's month.
_STEP_S = 600.0


class CelestialTarget:
    """A body whose place in the GCRS is a function of time."""

    rotation_rate_rad_s = EARTH_RATE_RAD_S
    spans_t_s = ((-math.inf, math.inf),)

    def __init__(
        self,
        name: str,
        position: Callable[[Any], Vector],
        *,
        unit_m: float,
        at_infinity: bool,
        orientation: EarthOrientationSource | None,
    ) -> None:
        self.name = name
        self.at_infinity = at_infinity
        self._position = position
        self._unit_m = unit_m
        self.orientation: EarthOrientationSource = orientation or IersEarthOrientation()

    def motion_at(self, t_s: Any, ahead_s: float = 0.0) -> StateVector:
        """Return the inertial motion [m] in Earth-fixed axes at UTC times."""
        positions = [self._position(t_s + ahead_s + k * _STEP_S) for k in OFFSETS]
        return earth_fixed_from_gcrs(motion_from_positions(positions, _STEP_S, self._unit_m), t_s, self.orientation)

    def warnings(self, t_s: float) -> tuple[str, ...]:
        """Return what makes the Earth's orientation at `t_s` less certain."""
        return self.orientation.warnings(t_s)


def sun(orientation: EarthOrientationSource | None = None) -> CelestialTarget:
    """Return the centre of the Sun."""

    def position(t_s: Any) -> Vector:
        heliocentric, _ = erfa.epv00(*tt_parts(t_s))
        return _components(-heliocentric["p"])

    return CelestialTarget("Sun", position, unit_m=_AU_M, at_infinity=False, orientation=orientation)


def moon(orientation: EarthOrientationSource | None = None) -> CelestialTarget:
    """Return the centre of the Moon."""

    def position(t_s: Any) -> Vector:
        return _components(erfa.moon98(*tt_parts(t_s))["p"])

    return CelestialTarget("Moon", position, unit_m=_AU_M, at_infinity=False, orientation=orientation)


@dataclass(frozen=True)
class RadioSource:
    """A place on the sky without proper motion: right ascension and declination in the ICRS."""

    name: str
    right_ascension_rad: float
    declination_rad: float

    def __post_init__(self) -> None:
        require_between("right_ascension_rad", self.right_ascension_rad, 0.0, 2.0 * math.pi)
        require_between("declination_rad", self.declination_rad, -0.5 * math.pi, 0.5 * math.pi)

    def target(self, orientation: EarthOrientationSource | None = None) -> CelestialTarget:
        """Return the source as a target; its range is set to one light year and means nothing."""
        catalogue = erfa.s2c(self.right_ascension_rad, self.declination_rad)

        def direction(t_s: Any) -> Vector:
            heliocentric, barycentric = erfa.epv00(*tt_parts(t_s))
            # Deflection at the Sun depends on the observer's distance from it.
            distance_au = np.linalg.norm(heliocentric["p"], axis=-1)
            deflected = erfa.ldsun(catalogue, heliocentric["p"] / distance_au[..., None], distance_au)
            velocity = barycentric["v"] * _AU_DAY_IN_C
            # SOFA's ab wants the reciprocal of the Lorentz factor.
            inverse_lorentz = np.sqrt(1.0 - np.sum(velocity**2, axis=-1))
            return _components(erfa.ab(deflected, velocity, distance_au, inverse_lorentz))

        return CelestialTarget(self.name, direction, unit_m=_LIGHT_YEAR_M, at_infinity=True, orientation=orientation)


def _source(name: str, hours: tuple[int, int, float], degrees: tuple[int, int, float]) -> RadioSource:
    right_ascension = (hours[0] + hours[1] / 60.0 + hours[2] / 3600.0) * 15.0
    # The sign belongs to all three parts: -5 deg 23' is not -5 deg + 23'.
    declination = math.copysign(abs(degrees[0]) + degrees[1] / 60.0 + degrees[2] / 3600.0, degrees[0])
    return RadioSource(name, math.radians(right_ascension), math.radians(declination))


# Strong sources used to calibrate antennas; places from the NASA/IPAC Extragalactic Database and
# SIMBAD, ICRS.
RADIO_SOURCES = {
    source.name: source
    for source in (
        _source("Cassiopeia A", (23, 23, 24.0), (58, 48, 54.0)),
        _source("Cygnus A", (19, 59, 28.357), (40, 44, 2.10)),
        _source("Taurus A", (5, 34, 31.94), (22, 0, 52.2)),
        _source("Virgo A", (12, 30, 49.423), (12, 23, 28.04)),
        _source("Orion A", (5, 35, 17.3), (-5, 23, 28.0)),
        _source("3C 84", (3, 19, 48.160), (41, 30, 42.11)),
        _source("3C 273", (12, 29, 6.700), (2, 3, 8.60)),
        _source("3C 286", (13, 31, 8.288), (30, 30, 32.96)),
    )
}


def radio_source(name: str, orientation: EarthOrientationSource | None = None) -> CelestialTarget:
    """Return the catalogued source of that name as a target; ValueError lists the names."""
    require_choice("radio_source", name, RADIO_SOURCES)
    return RADIO_SOURCES[name].target(orientation)


def _components(vectors: Any) -> Vector:
    """Return x, y, z of (..., 3): plain floats for a single vector."""
    if vectors.ndim == 1:
        x, y, z = vectors.tolist()
        return x, y, z
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]
