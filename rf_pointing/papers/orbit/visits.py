"""Passes of a satellite over a station for planning: mean elements carried along by the secular drift of J2.

Good to some kilometres over weeks, which is ample to know which sectors of the sky a pass will fill; the shape of each
pass (rates, accelerations) is integrated numerically and exact.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import require_between
from rf_pointing.core.constants import EARTH_MU_M3_S2, EARTH_RADIUS_M
from rf_pointing.papers.orbit.earth import Site
from rf_pointing.papers.orbit.elements import Elements
from rf_pointing.papers.orbit.measurements import Look, look, measured
from rf_pointing.papers.orbit.motion import Gravity, propagate_together

__all__ = ["secular_states", "visits"]

Array = NDArray[np.float64]

_SEARCH_STEP_S = 30.0
_HALF_WINDOW_S = 900.0
_TURN = 2.0 * math.pi


def secular_states(elements: Elements, elapsed_s: Array, gravity: Gravity) -> Array:
    """Return states (n, 6) of a slowly precessing ellipse after `elapsed_s` (n,)."""
    a, e, i = elements.semi_major_axis_m, elements.eccentricity, elements.inclination_rad
    motion = math.sqrt(EARTH_MU_M3_S2 / a**3)
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
    """Return the passes above `lowest_rad` within `days` of the epoch, sampled every `step_s`, in order of time."""
    require_between("days", days, 0.0, 1000.0)
    coarse = np.arange(0.0, days * 86400.0, _SEARCH_STEP_S)
    elevation = measured(epoch_t_s + coarse, secular_states(elements, coarse, gravity), site)[:, 1]
    peaks = 1 + np.flatnonzero((elevation[1:-1] > elevation[:-2]) & (elevation[1:-1] >= elevation[2:]))
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
