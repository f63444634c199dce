"""Circular orbits and the orbital frame, in Earth-fixed axes (DOA section 2).

Orbital frame F_o: x along the flight, y against the orbit's momentum, z to the centre of the Earth.
The Earth is a sphere here, as in DOA's 62 deg nadir angle.

Sun-synchronous orbit: the node turns once a year with the mean Sun, so its Earth-fixed longitude
follows from the time of day alone, lambda_node = 2 pi (local time of the ascending node - UTC day
fraction).  The inclination is the one whose J2 precession does this:

    cos i = -2/3 (2 pi / year) a^(7/2) / (J2 R^2 sqrt(mu)).
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude.rotations import cross_product
from rf_pointing.core import Params, parameter
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.core.types import Array

# Only the precession of the node needs it; the motion along the orbit is Keplerian.
EARTH_J2 = 1.08262668e-3
YEAR_S = 365.24219 * 86400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class OrbitPoint:
    """Earth-fixed position (..., 3), axes of F_o as rows (..., 3, 3), and inertial rate of F_o in
    F_o (..., 3).
    """

    position_m: Array
    frame: Array
    frame_rate_rad_s: Array


class Orbit(Protocol):
    """The orbit of a satellite: where it is, and how its orbital frame stands and turns."""

    def point(self, t_s: ArrayLike) -> OrbitPoint:
        """Return place, frame and frame rate at UTC times `t_s` (...)."""


def circular_frame(along_rad: ArrayLike, node_rad: ArrayLike, inclination_rad: float) -> Array:
    """Return F_o (..., 3, 3) at `along_rad` past the ascending node of Earth-fixed longitude
    `node_rad`.
    """
    along = np.asarray(along_rad, dtype=np.float64)
    outward = _turned(np.cos(along), np.sin(along), node_rad, inclination_rad)
    forward = _turned(-np.sin(along), np.cos(along), node_rad, inclination_rad)
    # y against the momentum, z down: (forward, -normal, -outward) is right-handed as (x, y, z).
    return np.stack([forward, -cross_product(outward, forward), -outward], axis=-2)


def _turned(in_plane_x: Array, in_plane_y: Array, node_rad: ArrayLike, tilt: float) -> Array:
    x, y = in_plane_x, in_plane_y * np.cos(tilt)
    return np.stack(
        [
            x * np.cos(node_rad) - y * np.sin(node_rad),
            x * np.sin(node_rad) + y * np.cos(node_rad),
            in_plane_y * np.sin(tilt),
        ],
        axis=-1,
    )


@dataclass(frozen=True, kw_only=True)
class SunSynchronousOrbitParams(Params):
    """DOA section 4.1: 800 km, descending node at 08:00 local mean solar time."""

    altitude_m: float = parameter(800e3, "height above the spherical Earth", low=200e3, high=5000e3)
    descending_node_local_time_h: float = parameter(
        8.0, "local mean solar time, hours", low=0.0, high=24.0
    )
    ascending_node_time_s: float = parameter(
        0.0, "UTC seconds since 1970 of one ascending node", low=-1e11, high=1e11
    )

    def point(self, t_s: ArrayLike) -> OrbitPoint:
        """Return place, frame and frame rate at UTC times `t_s` (...)."""
        return orbit_point(self, t_s)


def mean_motion_rad_s(orbit: SunSynchronousOrbitParams) -> float:
    """Return the Keplerian mean motion."""
    return math.sqrt(EARTH_MU_M3_S2 / (EARTH_RADIUS_M + orbit.altitude_m) ** 3)


def period_s(orbit: SunSynchronousOrbitParams) -> float:
    """Return the orbital period (6052 s at 800 km)."""
    return 2.0 * math.pi / mean_motion_rad_s(orbit)


def inclination_rad(orbit: SunSynchronousOrbitParams) -> float:
    """Return the Sun-synchronous inclination (98.6 deg at 800 km)."""
    axis_m = EARTH_RADIUS_M + orbit.altitude_m
    cosine = (
        -2.0
        / 3.0
        * (2.0 * math.pi / YEAR_S)
        * axis_m**3.5
        / (EARTH_J2 * EARTH_RADIUS_M**2 * EARTH_MU_M3_S2**0.5)
    )
    return math.acos(cosine)


def orbit_point(orbit: SunSynchronousOrbitParams, t_s: ArrayLike) -> OrbitPoint:
    """Return place, frame and frame rate at UTC times `t_s` (...)."""
    time = np.asarray(t_s, dtype=np.float64)
    along = mean_motion_rad_s(orbit) * (time - orbit.ascending_node_time_s)
    node = 2.0 * np.pi * ((orbit.descending_node_local_time_h + 12.0) / 24.0 - time / 86400.0)
    frame = circular_frame(along, node, inclination_rad(orbit))
    # The node's turn is about the Earth's axis: its components in F_o are the third column of the
    # frame.
    precession = 2.0 * np.pi / YEAR_S * frame[..., :, 2]
    rate = precession + np.array([0.0, -mean_motion_rad_s(orbit), 0.0])
    return OrbitPoint(
        position_m=-(EARTH_RADIUS_M + orbit.altitude_m) * frame[..., 2, :],
        frame=frame,
        frame_rate_rad_s=rate,
    )
