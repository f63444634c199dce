"""Measurements of a satellite by a station: angles, range and range rate, with partials.

Geometric, with light time where `light` says so; refraction is removed from real data beforehand.
"""

from dataclasses import dataclass

import numpy as np

from rf_pointing.core import SPEED_OF_LIGHT_M_S, Array
from rf_pointing.orbit.forces import EARTH_RATE_RAD_S

KINDS = ("azimuth_rad", "elevation_rad", "range_m", "range_rate_m_s")
"""The measured quantities, in the order of `measured` and `partials`."""


@dataclass(frozen=True, eq=False)
class StationMotion:
    """Motion of a station in inertial axes at n times: position and velocity (n, 3) [m, m/s].

    `axes` (n, 3, 3) turn inertial components into east, north, up.
    """

    position: Array
    velocity: Array
    axes: Array

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


def measured_from(states: Array, station: StationMotion, light: bool = False) -> Array:
    """Return azimuth, elevation, range and range rate (..., n, 4) of states (..., n, 6)."""
    relative, velocity = station.sight(states, light)
    east, north, up = np.moveaxis(relative, -1, 0)
    distance = np.linalg.norm(relative, axis=-1)
    rate = np.sum(relative * velocity, axis=-1) / distance
    return np.stack(
        [np.arctan2(east, north), np.arctan2(up, np.hypot(east, north)), distance, rate], axis=-1
    )


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
