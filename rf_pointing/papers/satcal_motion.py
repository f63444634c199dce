"""Motion as SATCAL needs it: zonal harmonics in closed form, stations, Keplerian elements.

    a = -GM r / r^3 + J2, J3, J4 in closed form      (Vallado, Fundamentals of Astrodynamics, 9.7)

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
from rf_pointing.orbit.forces import (
    Disturbances,
    sidereal_angle_rad,
    turned_about_pole,
    turning_velocity,
)
from rf_pointing.orbit.measurements import StationMotion, measured_from, partials_from
from rf_pointing.orbit.motion import propagate_together

_FLATTENING = 1.0 / 298.257223563
# Central differences: the curvature of the orbit cancels, rounding stays below 1e-9 of the
# partials.
_STEP_M, _STEP_M_S = 10.0, 0.01
_KEPLER_TOLERANCE_RAD, _KEPLER_ITERATIONS = 1e-13, 50


def to_earth_fixed(vector: Array, t_s: ArrayLike) -> Array:
    """Return inertial vectors (n, 3) in Earth-fixed axes; `to_inertial` is the inverse."""
    return turned_about_pole(vector, -sidereal_angle_rad(t_s))


def to_inertial(vector: Array, t_s: ArrayLike) -> Array:
    """Return Earth-fixed vectors (n, 3) in inertial axes."""
    return turned_about_pole(vector, sidereal_angle_rad(t_s))


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


def turning_station(t_s: Array, site: Site) -> StationMotion:
    """Return the motion of a site on an Earth that turns by mean sidereal time alone."""
    position = to_inertial(np.broadcast_to(site.position_m(), (len(t_s), 3)), t_s)
    rows = [to_inertial(np.broadcast_to(axis, (len(t_s), 3)), t_s) for axis in site.axes()]
    return StationMotion(position, turning_velocity(position), np.stack(rows, axis=1))


def measured(t_s: Array, states: Array, site: Site) -> Array:
    """Return azimuth, elevation, range and range rate (n, 4) of inertial states (n, 6).

    Azimuth in (-pi, pi].
    """
    return measured_from(states, turning_station(t_s, site))


def partials(t_s: Array, states: Array, site: Site) -> Array:
    """Return the partials (n, 4, 6) of `measured` with respect to the inertial state."""
    return partials_from(states, turning_station(t_s, site))


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
        bundle,
        times - epoch_t_s,
        gravity.acceleration,
        epoch_t_s=epoch_t_s,
        disturbances=disturbances,
    )
    return Trajectory(times, result[:, 0], _differences(result) if with_partials else None)


def _bundle(start: Array) -> Array:
    steps = np.diag([_STEP_M] * 3 + [_STEP_M_S] * 3)
    return np.concatenate([start[np.newaxis], start + steps, start - steps])


def _differences(bundle: Array) -> Array:
    size = np.array([_STEP_M] * 3 + [_STEP_M_S] * 3)
    slopes: Array = (bundle[:, 1:7] - bundle[:, 7:13]) / (2.0 * size[:, np.newaxis])
    return np.swapaxes(slopes, 1, 2)


@dataclass(frozen=True, kw_only=True)
class Elements(Params):
    """Osculating elements in inertial axes."""

    semi_major_axis_m: float = parameter(description="semi-major axis", low=6.4e6, high=1e9)
    eccentricity: float = parameter(description="eccentricity of the ellipse", low=0.0, high=0.99)
    inclination_rad: float = parameter(description="inclination", low=0.0, high=math.pi)
    node_rad: float = parameter(
        description="right ascension of the ascending node", low=-10.0, high=10.0
    )
    perigee_rad: float = parameter(description="argument of perigee", low=-10.0, high=10.0)
    mean_anomaly_rad: float = parameter(description="mean anomaly", low=-10.0, high=10.0)

    def state(self) -> Array:
        """Return position and velocity (6,), m and m/s; `from_state` is the inverse."""
        angles = (
            np.array([value]) for value in (self.node_rad, self.perigee_rad, self.mean_anomaly_rad)
        )
        return np.asarray(self.states(*angles)[0])

    def states(self, node_rad: Array, perigee_rad: Array, mean_anomaly_rad: Array) -> Array:
        """Return states (n, 6) on this ellipse with other nodes, perigees and anomalies (n,)."""
        a, e = self.semi_major_axis_m, self.eccentricity
        anomaly = _eccentric_anomaly(mean_anomaly_rad, e)
        cosine, sine, root = np.cos(anomaly), np.sin(anomaly), math.sqrt(1.0 - e * e)
        speed = math.sqrt(EARTH_MU_M3_S2 * a) / (a * (1.0 - e * cosine))
        toward_perigee, ahead = _orbit_axes(node_rad, self.inclination_rad, perigee_rad)
        position = a * ((cosine - e) * toward_perigee + root * sine * ahead)
        velocity = speed * (root * cosine * ahead - sine * toward_perigee)
        return np.concatenate([position, velocity]).T

    @classmethod
    def from_state(cls, state: ArrayLike) -> "Elements":
        """Return the elements of an elliptic, inclined, not exactly circular orbit."""
        both = as_finite_array("state", state, (6,))
        position, velocity = both[:3], both[3:]
        radius, momentum = float(np.linalg.norm(position)), np.cross(position, velocity)
        a = 1.0 / (2.0 / radius - float(velocity @ velocity) / EARTH_MU_M3_S2)
        # A preliminary orbit from noisy angles may come out hyperbolic.
        if a <= 0.0:
            raise ValueError(
                f"semi_major_axis_m={a:.0f} must be > 0: the state is not a closed orbit"
            )
        inclination = math.atan2(math.hypot(momentum[0], momentum[1]), momentum[2])
        # The node lies across the momentum's horizontal part; atan2 keeps its quadrant.
        node = math.atan2(momentum[0], -momentum[1])
        along_node = np.array([math.cos(node), math.sin(node), 0.0])
        ahead = np.cross(momentum / np.linalg.norm(momentum), along_node)
        latitude = math.atan2(float(position @ ahead), float(position @ along_node))
        # Both components: at small eccentricity the anomaly follows from their ratio, not from a
        # cosine near one.
        e_cos = 1.0 - radius / a
        e_sin = float(position @ velocity) / math.sqrt(EARTH_MU_M3_S2 * a)
        e, anomaly = math.hypot(e_cos, e_sin), math.atan2(e_sin, e_cos)
        true_anomaly = math.atan2(math.sqrt(1.0 - e * e) * math.sin(anomaly), math.cos(anomaly) - e)
        return cls(
            semi_major_axis_m=a,
            eccentricity=e,
            inclination_rad=inclination,
            node_rad=node % (2.0 * math.pi),
            perigee_rad=(latitude - true_anomaly) % (2.0 * math.pi),
            mean_anomaly_rad=(anomaly - e * math.sin(anomaly)) % (2.0 * math.pi),
        )


def _eccentric_anomaly(mean_rad: Array, eccentricity: float) -> Array:
    # First order in the eccentricity: from here Newton needs few steps up to 0.9.
    anomaly = mean_rad + eccentricity * np.sin(mean_rad)
    for _ in range(_KEPLER_ITERATIONS):
        miss = anomaly - eccentricity * np.sin(anomaly) - mean_rad
        step = miss / (1.0 - eccentricity * np.cos(anomaly))
        anomaly = anomaly - step
        if np.max(np.abs(step), initial=0.0) <= _KEPLER_TOLERANCE_RAD:
            return anomaly
    raise ValueError(
        f"eccentricity={eccentricity}: Kepler's equation needs more than {_KEPLER_ITERATIONS} steps"
    )


def _orbit_axes(node: Array, inclination: float, perigee: Array) -> tuple[Array, Array]:
    """Return the unit vectors (3, n) to perigee and a quarter turn ahead of it."""
    sin_o, cos_o, sin_w, cos_w = np.sin(node), np.cos(node), np.sin(perigee), np.cos(perigee)
    sin_i, cos_i = math.sin(inclination), math.cos(inclination)
    toward = np.stack(
        [
            cos_o * cos_w - sin_o * sin_w * cos_i,
            sin_o * cos_w + cos_o * sin_w * cos_i,
            sin_w * sin_i,
        ]
    )
    ahead = np.stack(
        [
            -cos_o * sin_w - sin_o * cos_w * cos_i,
            -sin_o * sin_w + cos_o * cos_w * cos_i,
            cos_w * sin_i,
        ]
    )
    return toward, ahead
