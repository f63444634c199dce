"""Earth-fixed motion from a motion in the celestial frame (GCRS), IAU 2006/2000A with the CIO.

    r_ITRS = W(x_p, y_p) R3(ERA(UT1)) Q(TT) r_GCRS         (IERS Conventions 2010, equation 5.1)

Q moves by 50 arcsec a year.  It is computed on a grid of one hour and interpolated linearly, which
is good to 5e-11 rad, and its own rate, 8e-12 rad/s, is left out of the derivatives.
"""

import math
from functools import lru_cache
from typing import Any

import erfa
import numpy as np

from rf_pointing.core import DAY_S, Array
from rf_pointing.ephemeris.earth_orientation import IersEarthOrientation
from rf_pointing.ephemeris.state_vector import StateVector, Vector, dot, turned_about_z
from rf_pointing.ephemeris.time_scales import POSIX_EPOCH_JD, TT_MINUS_TAI_S, leap_seconds

# Rate of the Earth rotation angle per second of UT1 (IERS Conventions 2010, equation 5.15).
EARTH_RATE_RAD_S = 1.00273781191135448 * 2.0 * math.pi / DAY_S
# The full series takes far longer than a control period may; one matrix an hour serves them all.
_GRID_S = 3600.0


def tt_parts(t_s: Any) -> tuple[Any, Any]:
    """Return the Julian date in TT of UTC times as whole and fraction."""
    days = t_s // DAY_S
    seconds = t_s - days * DAY_S + leap_seconds().tai_minus_utc_s(t_s) + TT_MINUS_TAI_S
    return POSIX_EPOCH_JD + days, seconds / DAY_S


def earth_fixed_from_gcrs(motion: StateVector, t_s: Any, orientation: IersEarthOrientation) -> StateVector:
    """Return the inertial motion in Earth-fixed axes at UTC times, from components in the GCRS."""
    rows = _intermediate_axes(t_s)
    intermediate = StateVector(*((dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)) for v in motion.derivatives()))
    earth = orientation.at(t_s)
    days = t_s // DAY_S
    angle = erfa.era00(POSIX_EPOCH_JD + days, (t_s - days * DAY_S + earth.ut1_minus_utc_s) / DAY_S)
    return turned_about_z(intermediate, angle, earth.pole_x_rad, earth.pole_y_rad)


def _intermediate_axes(t_s: Any) -> tuple[Vector, Vector, Vector]:
    """Return the rows of Q; components are floats for a float time, arrays for an array."""
    if isinstance(t_s, float):
        step = int(t_s // _GRID_S)
        part = t_s / _GRID_S - step
        a, b = _matrix(step), _matrix(step + 1)
        q = ((1.0 - part) * a + part * b).tolist()
        return tuple(q[0]), tuple(q[1]), tuple(q[2])
    steps = t_s // _GRID_S
    first, last = (int(steps.min()), int(steps.max())) if steps.size else (0, -2)
    grid = np.array([_matrix(step) for step in range(first, last + 2)]).reshape(-1, 3, 3)
    index = steps.astype(int) - first
    part = (t_s / _GRID_S - steps)[:, None, None]
    rows = np.moveaxis((1.0 - part) * grid[index] + part * grid[index + 1], 0, -1)
    return tuple(rows[0]), tuple(rows[1]), tuple(rows[2])


@lru_cache(maxsize=512)
def _matrix(step: int) -> Array:
    matrix: Array = erfa.c2i06a(*tt_parts(step * _GRID_S))
    return matrix
