"""The scene of DOA section 6: 800-km orbit, eight stations, 5000 s in steps of 250 ms.

The orbit is Sun-synchronous.  The satellite holds nadir exactly: q = identity, w = w_o, with the
torque that Euler's equations require, known to the filter.  The station in use is the one with the
highest elevation; one is always above 10 deg.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.array_sensors.attitude.ground_stations import stations_along_track, view_stations
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams, orbit_point
from rf_pointing.array_sensors.attitude.rigid_body import (
    RigidInertia,
    SatelliteParams,
    gravity_gradient_n_m,
    rigid_inertia,
)
from rf_pointing.core import require_between
from rf_pointing.core.types import Array

STEP_S = 0.25
ELEVATION_MIN_RAD = math.radians(10.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """Times (n,), reference directions and true directions (n, 3), station numbers (n,), frame
    rates, torques (n, 3).
    """

    t_s: Array
    reference: Array
    station: NDArray[np.intp]
    frame_rate: Array
    control_n_m: Array
    inertia: RigidInertia


def nadir_scene(duration_s: float = 5000.0, start_s: float = 0.0) -> Scene:
    """Return the scene from `start_s` after the ascending node.

    Raises
    ------
    ValueError
        If at some time no station is above 10 deg: the paper assumes one always is.
    """
    require_between("duration_s", duration_s, 1.0, 5000.0)
    orbit, inertia = SunSynchronousOrbitParams(), rigid_inertia(SatelliteParams())
    t_s = np.asarray(start_s + STEP_S * np.arange(round(duration_s / STEP_S)), dtype=np.float64)
    view = view_stations(orbit, stations_along_track(orbit, 0.0), t_s)
    # The highest one: DOA uses one station at a time and does not state how it is chosen.
    station = np.argmax(view.elevation_rad, axis=-1)
    lowest = float(np.min(np.max(view.elevation_rad, axis=-1)))
    require_between("elevation_rad", lowest, ELEVATION_MIN_RAD, None)
    rate = orbit_point(orbit, t_s).frame_rate_rad_s
    slope = (orbit_point(orbit, t_s + STEP_S).frame_rate_rad_s - rate) / STEP_S
    momentum = rate @ inertia.matrix
    torque = slope @ inertia.matrix + np.cross(rate, momentum)
    # What is left for the control is Euler's torque less that of gravity.
    torque -= gravity_gradient_n_m(inertia, np.broadcast_to(np.eye(3), (len(t_s), 3, 3)), rate)
    return Scene(
        t_s=t_s,
        reference=view.reference[np.arange(len(t_s)), station],
        station=station,
        frame_rate=rate,
        control_n_m=torque,
        inertia=inertia,
    )
