"""What a station measures of a satellite: azimuth, elevation, range and range rate, with derivatives and partials.

Geometric: no light time and no refraction, which `corrections` removes from real data beforehand.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.calibration import taylor
from rf_pointing.papers.orbit.earth import EARTH_RATE_RAD_S, Site, to_earth_fixed, to_inertial
from rf_pointing.papers.orbit.motion import Gravity

__all__ = ["KINDS", "Look", "look", "measured", "partials"]

Array = NDArray[np.float64]

KINDS = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")
"""The measured quantities, in the order of `measured` and `partials`."""


@dataclass(frozen=True, eq=False)
class Look:
    """A satellite seen from a station at `t_s`, every array (n,); azimuth is continuous along the samples."""

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
        azimuth_rad=np.unwrap(azimuth[0]),
        elevation_rad=elevation[0],
        azimuth_rate_rad_s=azimuth[1],
        elevation_rate_rad_s=elevation[1],
        azimuth_acceleration_rad_s2=2.0 * azimuth[2],
        elevation_acceleration_rad_s2=2.0 * elevation[2],
        range_m=distance[0],
        range_rate_m_s=distance[1],
    )


def measured(t_s: Array, states: Array, site: Site) -> Array:
    """Return azimuth, elevation, range and range rate (n, 4) of inertial states (n, 6); azimuth in (-pi, pi]."""
    relative, velocity = _relative(t_s, states, site)
    east, north, up = relative.T
    distance = np.linalg.norm(relative, axis=1)
    rate = np.sum(relative * velocity, axis=1) / distance
    return np.stack([np.arctan2(east, north), np.arctan2(up, np.hypot(east, north)), distance, rate], axis=1)


def partials(t_s: Array, states: Array, site: Site) -> Array:
    """Return the partials (n, 4, 6) of `measured` with respect to the inertial state."""
    relative, velocity = _relative(t_s, states, site)
    distance = np.linalg.norm(relative, axis=1)[:, np.newaxis]
    sight = relative / distance
    ground = np.hypot(relative[:, 0], relative[:, 1])[:, np.newaxis]
    rate = np.sum(sight * velocity, axis=1)[:, np.newaxis]
    azimuth = np.stack([relative[:, 1], -relative[:, 0], np.zeros(len(relative))], axis=1) / ground**2
    elevation = (np.array([0.0, 0.0, 1.0]) - sight * sight[:, 2:]) / ground
    by_position = np.stack([azimuth, elevation, sight, (velocity - rate * sight) / distance], axis=1)
    to_axes = _axes_in_inertial(t_s, site)
    # Range rate sees the station's turning: d(rho_dot)/dr is in the inertial frame once v is taken relative there.
    position_part = by_position @ to_axes
    velocity_part = np.zeros_like(position_part)
    velocity_part[:, 3] = np.einsum("ni,nij->nj", sight, to_axes)
    return np.concatenate([position_part, velocity_part], axis=2)


def _relative(t_s: Array, states: Array, site: Site) -> tuple[Array, Array]:
    """Return position and inertial velocity relative to the station, in its east-north-up axes, (n, 3) each."""
    station = to_inertial(np.broadcast_to(site.position_m(), (len(t_s), 3)), t_s)
    moving = EARTH_RATE_RAD_S * np.stack([-station[:, 1], station[:, 0], np.zeros(len(t_s))], axis=1)
    to_axes = _axes_in_inertial(t_s, site)
    relative = np.einsum("nij,nj->ni", to_axes, states[:, :3] - station)
    return relative, np.einsum("nij,nj->ni", to_axes, states[:, 3:] - moving)


def _axes_in_inertial(t_s: Array, site: Site) -> Array:
    """Return the rotations (n, 3, 3) from inertial axes to east, north, up."""
    rows = [to_inertial(np.broadcast_to(axis, (len(t_s), 3)), t_s) for axis in site.axes()]
    return np.stack(rows, axis=1)


def _topocentric_series(t_s: Array, states: Array, site: Site, gravity: Gravity) -> Array:
    """Return east, north, up as Taylor series (3, n, 3) of the motion relative to the turning station."""
    turning = np.array([0.0, 0.0, EARTH_RATE_RAD_S])
    position = to_earth_fixed(states[:, :3], t_s)
    velocity = to_earth_fixed(states[:, 3:], t_s) - np.cross(turning, position)
    acceleration = to_earth_fixed(gravity.acceleration(states[:, :3]), t_s)
    acceleration = acceleration - 2.0 * np.cross(turning, velocity) - np.cross(turning, np.cross(turning, position))
    series = np.stack([position - site.position_m(), velocity, 0.5 * acceleration])
    return series @ site.axes().T
