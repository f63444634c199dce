"""A geosynchronous satellite with a nadir-pointing array over its stations: truth of Tripulse.

Circular orbit of one sidereal day, inclined by a few degrees at most, over a spherical Earth.  The
array follows the orbital frame (x along the flight, y against the momentum, z to the Earth's
centre) but for slow attitude errors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.array_sensors.attitude.ground_stations import (
    GroundPlace,
    StationView,
    view_stations,
)
from rf_pointing.array_sensors.attitude.orbits import Orbit, OrbitPoint, circular_frame
from rf_pointing.array_sensors.attitude.quaternion import (
    conjugate,
    quaternion_from_roll_pitch_yaw,
    quaternion_to_matrix,
)
from rf_pointing.core import Params, parameter, require_finite
from rf_pointing.core.types import Array

ORBIT_RADIUS_M = 42164172.0
EARTH_RATE_RAD_S = 7.2921159e-5
# Central difference of the range: over 2 s a geosynchronous orbit is straight to 1e-9 of the rate.
RATE_STEP_S = 1.0


@dataclass(frozen=True, kw_only=True)
class GeostationaryParams(Params):
    """Where the satellite stands."""

    longitude_rad: float = parameter(
        math.radians(19.2), "mean longitude, east", low=-math.pi, high=math.pi
    )
    inclination_rad: float = parameter(
        math.radians(2.0), "inclination of the orbit", low=0.0, high=0.3
    )
    ascending_node_time_s: float = parameter(
        0.0, "UTC seconds since 1970 of one ascending node", low=-1e11, high=1e11
    )

    def point(self, t_s: ArrayLike) -> OrbitPoint:
        """Return place, frame and frame rate at UTC times `t_s` (...)."""
        return geostationary_point(self, t_s)


@dataclass(frozen=True, kw_only=True)
class WobbleParams(Params):
    """Attitude error of the array.

    A constant and a slow oscillation about each axis, a third of a turn apart.
    """

    roll_rad: float = parameter(math.radians(0.03), "constant roll", low=-0.2, high=0.2)
    pitch_rad: float = parameter(math.radians(-0.02), "constant pitch", low=-0.2, high=0.2)
    yaw_rad: float = parameter(math.radians(0.1), "constant yaw", low=-math.pi, high=math.pi)
    amplitude_rad: float = parameter(
        math.radians(0.03), "amplitude about each axis", low=0.0, high=0.2
    )
    period_s: float = parameter(600.0, "period of the oscillation", low=1.0, high=1e6)


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneMoment:
    """Truth at `t_s`: orientation of the array in the orbital frame (x, y, z, w), and the lines of
    sight (N, ...).
    """

    t_s: float
    quaternion: Array
    view: StationView
    range_rate_m_s: Array

    @property
    def rotation(self) -> Array:
        """Rotation (3, 3) from orbital to array components."""
        return quaternion_to_matrix(conjugate(self.quaternion))


def geostationary_point(orbit: GeostationaryParams, t_s: ArrayLike) -> OrbitPoint:
    """Return the satellite's Earth-fixed position (..., 3), orbital frame (..., 3, 3, rows) and
    frame rate (3,) at UTC times `t_s` (...).
    """
    times = np.asarray(t_s, dtype=np.float64)
    require_finite("t_s", times)
    along = EARTH_RATE_RAD_S * (times - orbit.ascending_node_time_s)
    # Earth-fixed axes turn with the Earth: seen from them the node runs back as fast as the
    # satellite runs on.
    node = orbit.longitude_rad - along
    frame = circular_frame(along, node, orbit.inclination_rad)
    rate = np.array([0.0, -EARTH_RATE_RAD_S, 0.0])
    return OrbitPoint(
        position_m=-ORBIT_RADIUS_M * frame[..., 2, :], frame=frame, frame_rate_rad_s=rate
    )


def wobble_quaternion(wobble: WobbleParams, t_s: float) -> Array:
    """Return the orientation (4,) of the array in the orbital frame at `t_s`."""
    # A third of a turn apart, so that no two axes are at zero together.
    phases = 2.0 * math.pi * (t_s / wobble.period_s + np.arange(3) / 3.0)
    constant = np.array([wobble.roll_rad, wobble.pitch_rad, wobble.yaw_rad])
    return quaternion_from_roll_pitch_yaw(constant + wobble.amplitude_rad * np.sin(phases))


def scene_moment(
    orbit: Orbit, wobble: WobbleParams, stations: Sequence[GroundPlace], t_s: float
) -> SceneMoment:
    """Return the truth at `t_s`.

    Attitude, directions to the stations in the orbital frame, elevations, range rates.
    """
    view = view_stations(orbit, stations, t_s)
    before, after = (
        view_stations(orbit, stations, t_s + step_s).range_m
        for step_s in (-RATE_STEP_S, RATE_STEP_S)
    )
    return SceneMoment(
        t_s=t_s,
        quaternion=wobble_quaternion(wobble, t_s),
        view=view,
        range_rate_m_s=(after - before) / (2.0 * RATE_STEP_S),
    )
