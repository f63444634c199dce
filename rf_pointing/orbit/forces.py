"""Forces on a satellite besides the Earth's point mass, and the places of Sun and Moon.

    field      harmonics of EGM96 from degree 2 to `degree` (`geopotential`)
    drag       a = -1/2 rho(h) B |v_r| v_r,   v_r = v - w x r,   rho = rho_0 exp(-(h - h_0) / H)
    tide       a = GM [(s - r) / |s - r|^3 - s / s^3]
    radiation  a = -P (AU / d)^2 C_r A / m  nu  d^,   nu the lit share of the Sun's disc
    panel      a = a_panel d^, the thermal radiation of a panel that faces the Sun (`panel`)

with d from the satellite to the Sun.  Vallado, Fundamentals of Astrodynamics, 8.6 (air of table
8-4) and 8.7; Montenbruck and Gill, Satellite Orbits, 3.4 (pressure, shadow with penumbra).  Places
of Sun and Moon are good to a few minutes of arc, from the leading terms of their theories (the
same, 3.3.2): a tide of 1e-6 m/s^2 needs no better.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import EARTH_RADIUS_M, Array, Params, parameter
from rf_pointing.orbit.geopotential import MOST_DEGREES, attraction

EARTH_RATE_RAD_S = 7.292115855e-5
"""Sidereal turning rate with respect to the equinox of date (IAU 1982)."""
NOMINAL_SCALES = (1.0, 1.0, 0.0)
"""Factors of each satellite: of drag, of radiation, and of the field beyond `degree`."""
AU_M, SUN_RADIUS_M = 1.495_978_707e11, 6.957e8
SUN_PRESSURE_N_M2 = 4.56e-6
"""At one astronomical unit, of light that is absorbed."""
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
_AIR = np.array([
    (1.0e5, 5.297e-7, 5877.0), (1.1e5, 9.661e-8, 7263.0), (1.2e5, 2.438e-8, 9473.0),
    (1.3e5, 8.484e-9, 12636.0), (1.4e5, 3.845e-9, 16149.0), (1.5e5, 2.070e-9, 22523.0),
    (1.8e5, 5.464e-10, 29740.0), (2.0e5, 2.789e-10, 37105.0), (2.5e5, 7.248e-11, 45546.0),
    (3.0e5, 2.418e-11, 53628.0), (3.5e5, 9.518e-12, 53298.0), (4.0e5, 3.725e-12, 58515.0),
    (4.5e5, 1.585e-12, 60828.0), (5.0e5, 6.967e-13, 63822.0), (6.0e5, 1.454e-13, 71835.0),
    (7.0e5, 3.614e-14, 88667.0), (8.0e5, 1.170e-14, 124640.0), (9.0e5, 5.245e-15, 181050.0),
    (1.0e6, 3.019e-15, 268000.0),
])  # fmt: skip
"""Base height (m), density (kg/m^3) and scale height (m) of the mean atmosphere, 100 to 1000 km."""


@dataclass(frozen=True, kw_only=True)
class Disturbances(Params):
    """Forces on the satellite besides the Earth's; none by default."""

    ballistic_m2_kg: float = parameter(
        0.0, "drag coefficient times area over mass; 0: no drag", 0.0, 10.0
    )
    air_density_kg_m3: float = parameter(
        1.17e-14, "density of the air at the reference height", 0.0, 1e-6
    )
    air_height_m: float = parameter(8.0e5, "reference height of the air", 1e5, 2e6)
    air_scale_m: float = parameter(1.2464e5, "height in which the density falls to 1/e", 1e3, 1e6)
    degree: int = parameter(0, "last degree of the Earth's field; 0: none of it", 0, MOST_DEGREES)
    radiation_m2_kg: float = parameter(
        0.0, "radiation coefficient times area over mass; 0: no radiation", 0.0, 100.0
    )
    panel_m_s2: float = parameter(0.0, "acceleration by a warm panel, towards the Sun", -1e-6, 1e-6)
    sun: bool = parameter(False, "whether the Sun's tide acts")
    moon: bool = parameter(False, "whether the Moon's tide acts")

    @staticmethod
    def air_at(height_m: float) -> dict[str, float]:
        """Return density and scale of the mean atmosphere about a height, as parameters."""
        row = _AIR[max(int(np.searchsorted(_AIR[:, 0], height_m, side="right")) - 1, 0)]
        return dict(zip(("air_height_m", "air_density_kg_m3", "air_scale_m"), row, strict=True))

    def acceleration(self, t_s: ArrayLike, states: Array, scales: Array | None = None) -> Array:
        """Return the acceleration (..., m, 3) of states (..., m, 6) at times (...), m/s^2.

        `scales` (m, 3) are the factors as in `NOMINAL_SCALES`; None: these.
        """
        # One bundle holds orbits of several forces: their differences are partials.
        factors = np.asarray([NOMINAL_SCALES]) if scales is None else scales
        position, total = states[..., :3], np.zeros((*states.shape[:-1], 3))
        if self.ballistic_m2_kg > 0.0:
            total += factors[:, :1] * self._drag(states)
        if self.degree >= 2:
            total += self._field(t_s, position, factors[:, 2:])
        sun = sun_m(t_s)[..., np.newaxis, :]
        if self.sun:
            total += _tide(position, sun, SUN_MU_M3_S2)
        if self.moon:
            total += _tide(position, moon_m(t_s)[..., np.newaxis, :], MOON_MU_M3_S2)
        if self.radiation_m2_kg > 0.0 or self.panel_m_s2 != 0.0:
            total += self._by_light(position, sun, factors[:, 1:2])
        return total

    def _field(self, t_s: ArrayLike, position: Array, beyond: Array) -> Array:
        # The Earth's axes turn; one rotation there and back costs less than one for each degree.
        angle = sidereal_angle_rad(t_s)[..., np.newaxis]
        fixed = turned_about_pole(position, -angle)
        if self.degree == MOST_DEGREES or not np.any(beyond):
            return turned_about_pole(attraction(fixed, (2, self.degree))[0], angle)
        known, rest = attraction(fixed, (2, self.degree), (self.degree + 1, MOST_DEGREES))
        return turned_about_pole(known + beyond * rest, angle)

    def _by_light(self, position: Array, sun: Array, factor: Array) -> Array:
        toward = sun - position
        distance = np.linalg.norm(toward, axis=-1, keepdims=True)
        pressure = SUN_PRESSURE_N_M2 * self.radiation_m2_kg * (AU_M / distance) ** 2
        push = factor * pressure * lit_share(position, sun)[..., np.newaxis]
        # A panel stays warm for longer than the shadow lasts: its radiation is not switched.
        return np.asarray((self.panel_m_s2 - push) * toward / distance)

    def _drag(self, states: Array) -> Array:
        height = np.linalg.norm(states[..., :3], axis=-1, keepdims=True) - EARTH_RADIUS_M
        density = self.air_density_kg_m3 * np.exp(-(height - self.air_height_m) / self.air_scale_m)
        # The air turns with the Earth: drag acts on the velocity through it.
        through = states[..., 3:] - turning_velocity(states[..., :3])
        speed = np.linalg.norm(through, axis=-1, keepdims=True)
        return np.asarray(-0.5 * self.ballistic_m2_kg * density * speed * through)


def lit_share(position_m: Array, sun: Array) -> Array:
    """Return the lit share (...) of the Sun's disc at positions (..., 3); 0 in the umbra."""
    toward = sun - position_m
    distance, radius = np.linalg.norm(toward, axis=-1), np.linalg.norm(position_m, axis=-1)
    own, earth = np.arcsin(SUN_RADIUS_M / distance), np.arcsin(EARTH_RADIUS_M / radius)
    cosine = -np.einsum("...i,...i", position_m, toward) / (radius * distance)
    # Straight under the Sun rounding leaves the range of a cosine.
    apart = np.maximum(np.arccos(np.clip(cosine, -1.0, 1.0)), 1e-9)
    # Two overlapping discs; the clip makes contact from inside and outside the limits.
    x = np.clip((apart**2 + own**2 - earth**2) / (2.0 * apart), -own, own)
    y = np.sqrt(np.maximum(own**2 - x**2, 0.0))
    hidden = own**2 * np.arccos(x / own) + earth**2 * np.arcsin(y / earth) - apart * y
    covered = np.where(apart < earth - own, np.pi * own**2, hidden)
    return np.asarray(np.where(apart >= own + earth, 1.0, 1.0 - covered / (np.pi * own**2)))


def sidereal_angle_rad(t_s: ArrayLike) -> Array:
    """Return Greenwich mean sidereal time at UTC seconds since 1970 (IAU 1982 to first order, UT1 =
    UTC).
    """
    days = (np.asarray(t_s, dtype=np.float64) - _J2000_T_S) / 86400.0
    return np.mod(np.radians(280.46061837 + 360.98564736629 * days), 2.0 * np.pi)


def turned_about_pole(vector: Array, angle_rad: ArrayLike) -> Array:
    """Return vectors (..., 3) turned about the Earth's axis by an angle."""
    sine, cosine = np.sin(angle_rad), np.cos(angle_rad)
    x, y, z = np.moveaxis(vector, -1, 0)
    return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)


def turning_velocity(position: Array) -> Array:
    """Return the velocity (..., 3) of what turns with the Earth at inertial positions (..., 3)."""
    x, y, _ = np.moveaxis(position, -1, 0)
    return EARTH_RATE_RAD_S * np.stack([-y, x, np.zeros_like(x)], axis=-1)


def sun_m(t_s: ArrayLike) -> Array:
    """Return the geocentric places of the Sun (..., 3), mean equator and equinox of J2000."""
    centuries = (np.asarray(t_s) - _J2000_T_S) / _CENTURY_S
    anomaly = np.radians(357.5256 + 35999.049 * centuries)
    longitude = (
        np.radians(282.9400)
        + anomaly
        + _ARC * (6892.0 * np.sin(anomaly) + 72.0 * np.sin(2.0 * anomaly))
    )
    distance = 1e9 * (149.619 - 2.499 * np.cos(anomaly) - 0.021 * np.cos(2.0 * anomaly))
    return _equatorial(longitude, 0.0, distance)


def moon_m(t_s: ArrayLike) -> Array:
    """Return the geocentric places of the Moon (..., 3), mean equator and equinox of J2000."""
    centuries = (np.asarray(t_s) - _J2000_T_S) / _CENTURY_S
    mean = np.radians(218.31617 + 481267.88088 * centuries - 1.3972 * centuries)
    arguments = np.radians(
        np.array([134.96292, 357.52543, 93.27283, 297.85027])
        + np.multiply.outer(centuries, [477198.86753, 35999.04944, 483202.01873, 445267.11135])
    ).T
    _, suns, node, _ = arguments
    unequal = _ARC * _sum(_MOON_LONGITUDE, np.sin, arguments)
    up = _ARC * (412.0 * np.sin(2.0 * node) + 541.0 * np.sin(suns))
    latitude = _ARC * (
        18520.0 * np.sin(node + unequal + up) + _sum(_MOON_LATITUDE, np.sin, arguments)
    )
    distance = 1e3 * (385000.0 + _sum(_MOON_DISTANCE_KM, np.cos, arguments))
    return _equatorial(mean + unequal, latitude, distance)


def _sum(series: Array, wave: np.ufunc, arguments: Array) -> Array:
    return np.asarray(series[:, 0] @ wave(series[:, 1:] @ arguments))


def _equatorial(longitude: Array, latitude: ArrayLike, distance_m: Array) -> Array:
    across, up = np.cos(latitude), np.sin(latitude)
    x, y, z = across * np.cos(longitude), across * np.sin(longitude), up
    cos_e, sin_e = np.cos(OBLIQUITY_RAD), np.sin(OBLIQUITY_RAD)
    turned = [x, cos_e * y - sin_e * z, sin_e * y + cos_e * z]
    return np.asarray(distance_m[..., np.newaxis] * np.stack(turned, axis=-1))


def _tide(position: Array, body_m: Array, strength: float) -> Array:
    toward = body_m - position
    # The Earth falls towards the body too: only the difference is a tide.
    pull, fall = (
        each / np.linalg.norm(each, axis=-1, keepdims=True) ** 3 for each in (toward, body_m)
    )
    return np.asarray(strength * (pull - fall))
