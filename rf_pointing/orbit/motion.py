"""Orbital motion by numerical integration, and the turning Earth under it.

    Earth   a = -GM r / r^3 + J2, J3, J4 in closed form
    drag    a = -1/2 rho(h) B |v_r| v_r,   v_r = v - w x r,   rho = rho_0 exp(-(h - h_0) / H)
    tide    a = GM [(s - r) / |s - r|^3 - s / s^3]

Vallado, Fundamentals of Astrodynamics, 8.6 (air of table 8-4, 800 km), 8.7 and 9.7.  Drag and tides
are optional.  Places of Sun and Moon are good to a few minutes of arc, from the leading terms of
their theories (Montenbruck and Gill, Satellite Orbits, 3.3.2): a tide of 1e-6 m/s^2 needs no
better.

Neighbouring trajectories are integrated together with the nominal one, so that partial derivatives
with respect to the starting state are differences of orbits that took the same steps.

Precession, nutation, polar motion and UT1-UTC are left out: inertial axes here are "true equator,
mean equinox of date" to a few arc seconds, the same for simulated and estimated orbits.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Params, as_finite_array, parameter
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.core.types import Array

EARTH_RATE_RAD_S = 7.292115855e-5
"""Sidereal turning rate with respect to the equinox of date (IAU 1982)."""
_FLATTENING = 1.0 / 298.257223563
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
# Central differences: the curvature of the orbit cancels, rounding stays below 1e-9 of the
# partials.
_STEP_M, _STEP_M_S = 10.0, 0.01
# Millimetres after days; looser, and the differences of neighbouring orbits would show the
# integrator.
_RELATIVE_TOLERANCE = 1e-11


def sidereal_angle_rad(t_s: ArrayLike) -> Array:
    """Return Greenwich mean sidereal time at UTC seconds since 1970 (IAU 1982 to first order, UT1 =
    UTC).
    """
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
    latitude_rad: float = parameter(
        description="geodetic latitude", low=-math.pi / 2.0, high=math.pi / 2.0
    )
    longitude_rad: float = parameter(
        description="longitude, east positive", low=-math.pi, high=2.0 * math.pi
    )
    height_m: float = parameter(0.0, "height above the ellipsoid", low=-500.0, high=9000.0)

    def position_m(self) -> Array:
        """Return the Earth-fixed position (3,)."""
        # WGS-84: geodetic latitude, so the station is not on the line to the Earth's centre.
        eccentricity2 = _FLATTENING * (2.0 - _FLATTENING)
        sin_lat, cos_lat = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        normal = EARTH_RADIUS_M / math.sqrt(1.0 - eccentricity2 * sin_lat**2)
        across = (normal + self.height_m) * cos_lat
        up = (normal * (1.0 - eccentricity2) + self.height_m) * sin_lat
        return np.array(
            [across * math.cos(self.longitude_rad), across * math.sin(self.longitude_rad), up]
        )

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


@dataclass(frozen=True, kw_only=True)
class Disturbances(Params):
    """Forces on the satellite besides the Earth's; none by default."""

    ballistic_m2_kg: float = parameter(
        0.0, "drag coefficient times area over mass; 0: no drag", low=0.0, high=10.0
    )
    air_density_kg_m3: float = parameter(
        1.17e-14, "density of the air at the reference height", low=0.0, high=1e-6
    )
    air_height_m: float = parameter(8.0e5, "reference height of the air", low=1e5, high=2e6)
    air_scale_m: float = parameter(
        1.2464e5, "height in which the density falls to 1/e", low=1e3, high=1e6
    )
    sun: bool = parameter(False, "whether the Sun's tide acts")
    moon: bool = parameter(False, "whether the Moon's tide acts")

    def acceleration(self, t_s: float, states: Array) -> Array:
        """Return the acceleration (m, 3) of states (m, 6) at one time, m/s^2."""
        total = np.zeros((len(states), 3))
        if self.ballistic_m2_kg > 0.0:
            total += self._drag(states)
        for acts, place, strength in (
            (self.sun, sun_m, SUN_MU_M3_S2),
            (self.moon, moon_m, MOON_MU_M3_S2),
        ):
            if acts:
                total += _tide(states[:, :3], place(t_s), strength)
        return total

    def _drag(self, states: Array) -> Array:
        position, velocity = states[:, :3], states[:, 3:]
        # The air turns with the Earth: drag acts on the velocity through it.
        turning = EARTH_RATE_RAD_S * np.stack(
            [-position[:, 1], position[:, 0], np.zeros(len(states))], axis=1
        )
        through = velocity - turning
        height = np.linalg.norm(position, axis=1) - EARTH_RADIUS_M
        density = self.air_density_kg_m3 * np.exp(-(height - self.air_height_m) / self.air_scale_m)
        speed = np.linalg.norm(through, axis=1)
        return np.asarray(-0.5 * self.ballistic_m2_kg * (density * speed)[:, np.newaxis] * through)


def sun_m(t_s: float) -> Array:
    """Return the geocentric place of the Sun (3,), mean equator and equinox of J2000."""
    centuries = (t_s - _J2000_T_S) / _CENTURY_S
    anomaly = np.radians(357.5256 + 35999.049 * centuries)
    longitude = (
        np.radians(282.9400)
        + anomaly
        + _ARC * (6892.0 * np.sin(anomaly) + 72.0 * np.sin(2.0 * anomaly))
    )
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
    latitude = _ARC * (
        18520.0 * np.sin(node + unequal + up) + _sum(_MOON_LATITUDE, np.sin, arguments)
    )
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
    # The Earth falls towards the body too: only the difference is a tide.
    return np.asarray(strength * (pull - body_m / np.linalg.norm(body_m) ** 3))


@dataclass(frozen=True, kw_only=True)
class Gravity(Params):
    """Zonal harmonics of the attraction (JGM-3); zero switches one off."""

    j2: float = parameter(1.08262668e-3, "second zonal harmonic", low=0.0, high=0.01)
    j3: float = parameter(-2.53265649e-6, "third zonal harmonic", low=-1e-4, high=1e-4)
    j4: float = parameter(-1.61962159e-6, "fourth zonal harmonic", low=-1e-4, high=1e-4)

    def acceleration(self, position_m: Array) -> Array:
        """Return the acceleration (..., 3) at positions (..., 3), m/s^2."""
        # With u = 1/r^2, s = z^2 u and a, b, d the three harmonics; few operations, for the arrays
        # are small.
        z = position_m[..., 2]
        u = 1.0 / np.einsum("...i,...i->...", position_m, position_m)
        s = z * z * u
        a = (1.5 * self.j2 * EARTH_RADIUS_M**2) * u
        w = u * u
        d = (0.625 * self.j4 * EARTH_RADIUS_M**4) * w
        c = (2.5 * self.j3 * EARTH_RADIUS_M**3) * u
        b = c * u * z
        rest = a + 3.0 * b
        scale = (-EARTH_MU_M3_S2) * u * np.sqrt(u)
        across = 1.0 + rest - 3.0 * d + s * (d * (42.0 - 63.0 * s) - 5.0 * a - 7.0 * b)
        result: Array = position_m * (scale * across)[..., np.newaxis]
        result[..., 2] += scale * (z * (rest + a + d * (28.0 * s - 12.0)) - 0.6 * c)
        return result


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States (n, 6) at `t_s` (n,); partials (n, 6, 6) by the first state, if requested."""

    t_s: Array
    states: Array
    partials: Array | None


def propagate(
    epoch_t_s: float,
    state: ArrayLike,
    t_s: ArrayLike,
    gravity: Gravity,
    *,
    with_partials: bool = False,
    disturbances: Disturbances | None = None,
) -> Trajectory:
    """Integrate `state` (6,) at `epoch_t_s` to the times `t_s` (n,), sorted, on either side of the
    epoch.

    Raises ValueError for unsorted times and when the integrator gives up.
    """
    start, times = as_finite_array("state", state, (6,)), as_finite_array("t_s", t_s, (None,))
    if np.any(np.diff(times) < 0.0):
        raise ValueError("t_s must not decrease")
    bundle = _bundle(start) if with_partials else start[np.newaxis]
    result = propagate_together(
        bundle, times - epoch_t_s, gravity, epoch_t_s=epoch_t_s, disturbances=disturbances
    )
    return Trajectory(times, result[:, 0], _differences(result) if with_partials else None)


def propagate_together(
    states: ArrayLike,
    elapsed_s: ArrayLike,
    gravity: Gravity,
    *,
    epoch_t_s: float = 0.0,
    disturbances: Disturbances | None = None,
) -> Array:
    """Integrate many starting states (m, 6) over the same elapsed times (n,), sorted.

    The result is (n, m, 6).  `epoch_t_s` matters only to `disturbances`.
    """
    bundle, times = (
        as_finite_array("states", states, (None, 6)),
        as_finite_array("elapsed_s", elapsed_s, (None,)),
    )
    if np.any(np.diff(times) < 0.0):
        raise ValueError("elapsed_s must not decrease")
    result = np.empty((len(times), *bundle.shape))
    # The integrator runs in one direction: once back and once ahead from the epoch.
    for side in (times < 0.0, times >= 0.0):
        if np.any(side):
            result[side] = _integrate(bundle, times[side], gravity, epoch_t_s, disturbances)
    return result


def _bundle(start: Array) -> Array:
    steps = np.diag([_STEP_M] * 3 + [_STEP_M_S] * 3)
    return np.concatenate([start[np.newaxis], start + steps, start - steps])


def _differences(bundle: Array) -> Array:
    size = np.array([_STEP_M] * 3 + [_STEP_M_S] * 3)
    slopes: Array = (bundle[:, 1:7] - bundle[:, 7:13]) / (2.0 * size[:, np.newaxis])
    return np.swapaxes(slopes, 1, 2)


def _integrate(
    bundle: Array,
    elapsed_s: Array,
    gravity: Gravity,
    epoch_t_s: float,
    disturbances: Disturbances | None,
) -> Array:
    from scipy.integrate import solve_ivp

    shape = bundle.shape

    def slope(elapsed: float, flat: Array) -> Array:
        states = flat.reshape(shape)
        acceleration = gravity.acceleration(states[:, :3])
        if disturbances is not None:
            acceleration += disturbances.acceleration(epoch_t_s + elapsed, states)
        return np.concatenate([states[:, 3:], acceleration], axis=1).ravel()

    order = np.argsort(np.abs(elapsed_s), kind="stable")
    # t_eval must be strictly monotonic; several measurements share a time.
    wanted, place = np.unique(elapsed_s[order], return_inverse=True)
    wanted = wanted if elapsed_s[order][-1] >= 0.0 else wanted[::-1]
    end = float(wanted[-1])
    if end == 0.0:
        return np.broadcast_to(bundle, (len(elapsed_s), *shape))
    # Metres and metres per second: one absolute tolerance would suit neither.
    scale = np.tile([1e-5] * 3 + [1e-8] * 3, shape[0])
    solution = solve_ivp(
        slope,
        (0.0, end),
        bundle.ravel(),
        method="DOP853",
        t_eval=wanted,
        rtol=_RELATIVE_TOLERANCE,
        atol=scale,
    )
    if not solution.success:
        raise ValueError(f"orbit integration to {end:.0f} s failed: {solution.message}")
    found = solution.y.T.reshape(-1, *shape)
    if end < 0.0:
        place = len(wanted) - 1 - place
    result = np.empty((len(elapsed_s), *shape))
    result[order] = found[place]
    return result
