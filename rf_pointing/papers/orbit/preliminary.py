"""Preliminary orbit from one station: 100 to 200 s of range and angles right after injection (SATCAL 4.1, Table 2).

First a start: measured positions are fitted by r0 + v0 t + the twice-integrated attraction along the path, which is the
f and g series summed by iteration.  Then batch least squares on the measurements with their own weights.
"""

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import as_finite_array, require_between, unit_vector_from_azel
from rf_pointing.papers.orbit.batch import Arc, OrbitResult, fit_orbit
from rf_pointing.papers.orbit.earth import Site, to_inertial
from rf_pointing.papers.orbit.motion import Gravity

__all__ = ["preliminary_orbit", "starting_state"]

Array = NDArray[np.float64]

_FEWEST, _SWEEPS, _DEGREE = 10, 4, 3


def preliminary_orbit(
    site: Site,
    t_s: Array,
    range_m: Array,
    azimuth_rad: Array,
    elevation_rad: Array,
    *,
    sigma_range_m: float,
    sigma_angle_rad: float,
    gravity: Gravity,
) -> OrbitResult:
    """Return the orbit at the middle of the data; all arrays (n,), n >= 10, from one pass of one station.

    `sigma_angle_rad` is on the sky; in azimuth it counts as sigma / cos El.
    """
    epoch, guess = starting_state(site, t_s, range_m, azimuth_rad, elevation_rad, gravity)
    arcs = (
        Arc(site, "range_m", t_s, range_m, np.full(len(t_s), sigma_range_m)),
        Arc(site, "azimuth_rad", t_s, azimuth_rad, sigma_angle_rad / np.cos(elevation_rad)),
        Arc(site, "elevation_rad", t_s, elevation_rad, np.full(len(t_s), sigma_angle_rad)),
    )
    return fit_orbit(epoch, guess, arcs, gravity)


def starting_state(
    site: Site, t_s: Array, range_m: Array, azimuth_rad: Array, elevation_rad: Array, gravity: Gravity
) -> tuple[float, Array]:
    """Return the middle time and a state (6,) there, good to the accuracy of the measured positions."""
    times = as_finite_array("t_s", t_s, (None,))
    require_between("samples", len(times), _FEWEST, None)
    positions = _positions(site, times, range_m, azimuth_rad, elevation_rad)
    epoch = float(0.5 * (times[0] + times[-1]))
    elapsed = times - epoch
    half = max(abs(float(elapsed[0])), 1.0)
    path = positions
    for _ in range(_SWEEPS):
        fallen = _twice_integrated(elapsed / half, gravity.acceleration(path)) * half**2
        line = np.polynomial.polynomial.polyfit(elapsed / half, positions - fallen, 1)
        path = line[0] + np.outer(elapsed / half, line[1]) + fallen
    return epoch, np.concatenate([line[0], line[1] / half])


def _positions(site: Site, t_s: Array, range_m: Array, azimuth_rad: Array, elevation_rad: Array) -> Array:
    sight = as_finite_array("range_m", range_m, (len(t_s),))[:, np.newaxis] * unit_vector_from_azel(
        azimuth_rad, elevation_rad
    )
    return to_inertial(site.position_m() + sight @ site.axes(), t_s)


def _twice_integrated(x: Array, acceleration: Array) -> Array:
    """Return the double integral from x = 0 of a cubic through the acceleration (n, 3)."""
    cubic = np.polynomial.polynomial.polyfit(x, acceleration, _DEGREE)
    power = np.arange(_DEGREE + 1)
    weights = cubic / ((power + 1) * (power + 2))[:, np.newaxis]
    return np.asarray(x[:, np.newaxis] ** 2 * np.polynomial.polynomial.polyval(x, weights).T)
