"""Measurements of a satellite by a station, and the passes at which it has them.

Azimuth, elevation, range and range rate, with derivatives and partials.  Geometric: no light time
and no refraction, which `corrections` removes from real data beforehand.

Passes: mean Keplerian elements carried along by the secular drift of J2.  Good to some kilometres
over weeks, enough to know which sectors of the sky a pass fills; the shape of each pass (rates,
accelerations) is integrated numerically and exact.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.calibration import taylor
from rf_pointing.core import Params, as_finite_array, parameter, require_between
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M, SPEED_OF_LIGHT_M_S
from rf_pointing.core.types import Array
from rf_pointing.orbit.forces import EARTH_RATE_RAD_S
from rf_pointing.orbit.motion import Gravity, Site, propagate_together, to_earth_fixed, to_inertial

KINDS = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")
"""The measured quantities, in the order of `measured` and `partials`."""
_KEPLER_TOLERANCE_RAD, _KEPLER_ITERATIONS = 1e-13, 50
_SEARCH_STEP_S = 30.0
_HALF_WINDOW_S = 900.0
_TURN = 2.0 * math.pi


@dataclass(frozen=True, eq=False)
class Look:
    """A satellite seen from a station at `t_s`, every array (n,).

    Azimuth is continuous along the samples.
    """

    t_s: Array
    azimuth_rad: Array
    elevation_rad: Array
    azimuth_rate_rad_s: Array
    elevation_rate_rad_s: Array
    azimuth_acceleration_rad_s2: Array
    elevation_acceleration_rad_s2: Array
    range_m: Array
    range_rate_m_s: Array


def look(t_s: ArrayLike, states: Array, site: Site, gravity: Gravity) -> Look:
    """Return the angles with exact rates and accelerations of inertial states (n, 6)."""
    times = np.asarray(t_s, dtype=np.float64)
    east, north, up = np.moveaxis(_topocentric_series(times, states, site, gravity), -1, 0)
    ground = taylor.square_root(taylor.multiply(east, east) + taylor.multiply(north, north))
    distance = taylor.square_root(taylor.multiply(ground, ground) + taylor.multiply(up, up))
    azimuth, elevation = taylor.angle_of(east, north), taylor.angle_of(up, ground)
    return Look(
        t_s=times,
        # Continuous, as a joint is: fits of rates must not see a jump of a turn.
        azimuth_rad=np.unwrap(azimuth[0]),
        elevation_rad=elevation[0],
        azimuth_rate_rad_s=azimuth[1],
        elevation_rate_rad_s=elevation[1],
        # Taylor coefficients: the second one is half the derivative.
        azimuth_acceleration_rad_s2=2.0 * azimuth[2],
        elevation_acceleration_rad_s2=2.0 * elevation[2],
        range_m=distance[0],
        range_rate_m_s=distance[1],
    )


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


def _topocentric_series(t_s: Array, states: Array, site: Site, gravity: Gravity) -> Array:
    """Return east, north, up as Taylor series (3, n, 3) of the motion relative to the turning
    station.
    """
    turning = np.array([0.0, 0.0, EARTH_RATE_RAD_S])
    position = to_earth_fixed(states[:, :3], t_s)
    velocity = to_earth_fixed(states[:, 3:], t_s) - np.cross(turning, position)
    acceleration = to_earth_fixed(gravity.acceleration(states[:, :3]), t_s)
    # Coriolis and centrifugal part: the station's axes turn with the Earth.
    acceleration = (
        acceleration
        - 2.0 * np.cross(turning, velocity)
        - np.cross(turning, np.cross(turning, position))
    )
    series = np.stack([position - site.position_m(), velocity, 0.5 * acceleration])
    return series @ site.axes().T


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


def secular_states(elements: Elements, elapsed_s: Array, gravity: Gravity) -> Array:
    """Return states (n, 6) of a slowly precessing ellipse after `elapsed_s` (n,)."""
    a, e, i = elements.semi_major_axis_m, elements.eccentricity, elements.inclination_rad
    motion = math.sqrt(EARTH_MU_M3_S2 / a**3)
    # Secular J2 only: the periodic part is some kilometres, which a plan of passes can ignore.
    drift = 0.75 * gravity.j2 * motion * (EARTH_RADIUS_M / (a * (1.0 - e * e))) ** 2
    node = elements.node_rad - 2.0 * drift * math.cos(i) * elapsed_s
    perigee = elements.perigee_rad + drift * (5.0 * math.cos(i) ** 2 - 1.0) * elapsed_s
    mean = (
        elements.mean_anomaly_rad
        + (motion + drift * math.sqrt(1.0 - e * e) * (3.0 * math.cos(i) ** 2 - 1.0)) * elapsed_s
    )
    return elements.states(np.mod(node, _TURN), np.mod(perigee, _TURN), np.mod(mean, _TURN))


def visits(
    site: Site,
    elements: Elements,
    epoch_t_s: float,
    days: float,
    gravity: Gravity,
    *,
    step_s: float,
    lowest_rad: float,
) -> list[Look]:
    """Return the passes above `lowest_rad` within `days` of the epoch, sampled every `step_s`, in
    order of time.
    """
    require_between("days", days, 0.0, 1000.0)
    coarse = np.arange(0.0, days * 86400.0, _SEARCH_STEP_S)
    elevation = measured(epoch_t_s + coarse, secular_states(elements, coarse, gravity), site)[:, 1]
    # Strictly above the left neighbour only, so that a flat top counts once.
    peaks = 1 + np.flatnonzero(
        (elevation[1:-1] > elevation[:-2]) & (elevation[1:-1] >= elevation[2:])
    )
    # Two degrees of reserve: mean elements miss the elevation by less.
    culminations = coarse[peaks[elevation[peaks] > lowest_rad - math.radians(2.0)]]
    if len(culminations) == 0:
        return []
    window = np.arange(-_HALF_WINDOW_S, _HALF_WINDOW_S + step_s, step_s)
    bundle = propagate_together(secular_states(elements, culminations, gravity), window, gravity)
    found = []
    for k, culmination in enumerate(culminations):
        times = epoch_t_s + culmination + window
        up = measured(times, bundle[:, k], site)[:, 1] >= lowest_rad
        if np.any(up):
            found.append(look(times[up], bundle[up, k], site, gravity))
    return found
