"""Measurements of a satellite by a station: angles, range and range rate, with partials.

Geometric, with light time where `light` says so; refraction is removed from real data beforehand.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.core import Params, as_finite_array, parameter
from rf_pointing.core.constants import EARTH_MU_M3_S2, SPEED_OF_LIGHT_M_S
from rf_pointing.core.types import Array
from rf_pointing.orbit.forces import EARTH_RATE_RAD_S
from rf_pointing.orbit.motion import Site, to_inertial

KINDS = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")
"""The measured quantities, in the order of `measured` and `partials`."""
_KEPLER_TOLERANCE_RAD, _KEPLER_ITERATIONS = 1e-13, 50


@dataclass(frozen=True, eq=False)
class StationMotion:
    """Motion of a station in inertial axes at n times: position and velocity (n, 3) [m, m/s].

    `axes` (n, 3, 3) turn inertial components into east, north, up.
    """

    position: Array
    velocity: Array
    axes: Array

    @classmethod
    def turning(cls, t_s: Array, site: Site) -> Self:
        """Return the motion of a site on an Earth that turns by mean sidereal time alone."""
        position = to_inertial(np.broadcast_to(site.position_m(), (len(t_s), 3)), t_s)
        rows = [to_inertial(np.broadcast_to(axis, (len(t_s), 3)), t_s) for axis in site.axes()]
        return cls(position, turning_velocity(position), np.stack(rows, axis=1))

    def sight(self, states: Array, light: bool = False) -> tuple[Array, Array]:
        """Return position and inertial velocity (..., n, 3) of states (..., n, 6) from here, ENU.

        With `light` both are moved back by the time that light takes, as an antenna sees them.
        """
        relative, velocity = states[..., :3] - self.position, states[..., 3:] - self.velocity
        if light:
            taken_s = np.linalg.norm(relative, axis=-1, keepdims=True) / SPEED_OF_LIGHT_M_S
            relative = relative - taken_s * velocity
        return tuple(
            np.einsum("nij,...nj->...ni", self.axes, each) for each in (relative, velocity)
        )

    def angle_rates(self, states: Array) -> tuple[Array, Array]:
        """Return the rates (..., n) of azimuth and elevation, rad/s."""
        relative, velocity = self.sight(states)
        # The axes turn under the satellite: the Earth's rate has a north and an up component.
        pole = self.axes @ np.array([0.0, 0.0, EARTH_RATE_RAD_S])
        east, north, up = np.moveaxis(relative, -1, 0)
        v_east, v_north, v_up = np.moveaxis(velocity - np.cross(pole, relative), -1, 0)
        ground = np.hypot(east, north)
        outward = (east * v_east + north * v_north) / ground
        azimuth = (north * v_east - east * v_north) / ground**2
        return azimuth, (ground * v_up - up * outward) / (ground**2 + up**2)


def turning_velocity(position: Array) -> Array:
    """Return the velocity (..., 3) of what turns with the Earth at inertial positions (..., 3)."""
    x, y, _ = np.moveaxis(position, -1, 0)
    return EARTH_RATE_RAD_S * np.stack([-y, x, np.zeros_like(x)], axis=-1)


def measured(t_s: Array, states: Array, site: Site) -> Array:
    """Return azimuth, elevation, range and range rate (n, 4) of inertial states (n, 6).

    Azimuth in (-pi, pi].
    """
    return measured_from(states, StationMotion.turning(t_s, site))


def measured_from(states: Array, station: StationMotion, light: bool = False) -> Array:
    """Return azimuth, elevation, range and range rate (..., n, 4) of states (..., n, 6)."""
    relative, velocity = station.sight(states, light)
    east, north, up = np.moveaxis(relative, -1, 0)
    distance = np.linalg.norm(relative, axis=-1)
    rate = np.sum(relative * velocity, axis=-1) / distance
    return np.stack(
        [np.arctan2(east, north), np.arctan2(up, np.hypot(east, north)), distance, rate], axis=-1
    )


def partials(t_s: Array, states: Array, site: Site) -> Array:
    """Return the partials (n, 4, 6) of `measured` with respect to the inertial state."""
    return partials_from(states, StationMotion.turning(t_s, site))


def partials_from(states: Array, station: StationMotion) -> Array:
    """Return the partials (..., n, 4, 6) of `measured_from` with respect to the inertial state."""
    relative, velocity = station.sight(states)
    distance = np.linalg.norm(relative, axis=-1)[..., np.newaxis]
    sight = relative / distance
    ground = np.hypot(relative[..., 0], relative[..., 1])[..., np.newaxis]
    rate = np.sum(sight * velocity, axis=-1)[..., np.newaxis]
    azimuth = (
        np.stack([relative[..., 1], -relative[..., 0], np.zeros(relative.shape[:-1])], axis=-1)
        / ground**2
    )
    elevation = (np.array([0.0, 0.0, 1.0]) - sight * sight[..., 2:]) / ground
    by_position = np.stack(
        [azimuth, elevation, sight, (velocity - rate * sight) / distance], axis=-2
    )
    # Range rate sees the station's turning: d(rho_dot)/dr is in the inertial frame once v is taken
    # relative there.
    position_part = by_position @ station.axes
    velocity_part = np.zeros_like(position_part)
    velocity_part[..., 3, :] = np.einsum("...ni,nij->...nj", sight, station.axes)
    return np.concatenate([position_part, velocity_part], axis=-1)


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
