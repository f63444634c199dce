"""Passes of a campaign: when a satellite is seen, with exact rates and accelerations.

Mean Keplerian elements are carried along by the secular drift of J2.  Good to some kilometres over
weeks, enough to know which sectors of the sky a pass fills; the shape of each pass is integrated
numerically and exact.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from rf_pointing.calibration import taylor
from rf_pointing.core import require_between
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.core.target_motion import TargetMotion
from rf_pointing.core.types import TURN, Array
from rf_pointing.orbit.forces import EARTH_RATE_RAD_S
from rf_pointing.orbit.motion import propagate_together
from rf_pointing.papers.satcal_motion import Elements, Gravity, Site, measured, to_earth_fixed

_SEARCH_STEP_S = 30.0
_HALF_WINDOW_S = 900.0


def look(t_s: ArrayLike, states: Array, site: Site, gravity: Gravity) -> TargetMotion:
    """Return the angles with exact rates and accelerations of inertial states (n, 6)."""
    times = np.asarray(t_s, dtype=np.float64)
    east, north, up = np.moveaxis(_topocentric_series(times, states, site, gravity), -1, 0)
    ground = taylor.square_root(taylor.multiply(east, east) + taylor.multiply(north, north))
    distance = taylor.square_root(taylor.multiply(ground, ground) + taylor.multiply(up, up))
    azimuth, elevation = taylor.angle_of(east, north), taylor.angle_of(up, ground)
    return TargetMotion(
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
    return elements.states(np.mod(node, TURN), np.mod(perigee, TURN), np.mod(mean, TURN))


def visits(
    site: Site,
    elements: Elements,
    epoch_t_s: float,
    days: float,
    gravity: Gravity,
    *,
    step_s: float,
    lowest_rad: float,
) -> list[TargetMotion]:
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
    bundle = propagate_together(
        secular_states(elements, culminations, gravity), window, gravity.acceleration
    )
    found = []
    for k, culmination in enumerate(culminations):
        times = epoch_t_s + culmination + window
        up = measured(times, bundle[:, k], site)[:, 1] >= lowest_rad
        if np.any(up):
            found.append(look(times[up], bundle[up, k], site, gravity))
    return found
