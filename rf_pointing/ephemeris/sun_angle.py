"""How close a target comes to the Sun on the sky: solar noise in the beam, and heat in the focus."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.ephemeris.celestial import sun
from rf_pointing.ephemeris.passes import Pass
from rf_pointing.ephemeris.state_vector import Vector, cross, dot, norm
from rf_pointing.ephemeris.track import TopocentricTrack

__all__ = ["smallest_sun_angle_rad", "sun_angle_rad"]

_STEP_S = 5.0


def sun_angle_rad(track: TopocentricTrack, t_s: ArrayLike) -> NDArray[np.float64]:
    """Return the angle between the target and the centre of the Sun, both as the antenna sees them, shape (n,)."""
    times = np.asarray(t_s, dtype=np.float64)
    other = TopocentricTrack(sun(), track.site, refraction=track.refraction)
    target, solar = _direction(track, times), _direction(other, times)
    return np.asarray(np.arctan2(norm(cross(target, solar)), dot(target, solar)))


def smallest_sun_angle_rad(track: TopocentricTrack, found: Pass) -> float:
    """Return the smallest angle to the Sun during a pass, sampled every 5 s (0.25 deg of the fastest low orbit)."""
    count = max(int(np.ceil(found.duration_s / _STEP_S)) + 1, 2)
    return float(sun_angle_rad(track, np.linspace(found.aos_t_s, found.los_t_s, count)).min())


def _direction(track: TopocentricTrack, t_s: NDArray[np.float64]) -> Vector:
    looks: Any = track.sample(t_s)
    horizontal = np.cos(looks.elevation_rad)
    return horizontal * np.sin(looks.azimuth_rad), horizontal * np.cos(looks.azimuth_rad), np.sin(looks.elevation_rad)
