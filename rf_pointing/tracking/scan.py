"""The circle that conscan adds to the command: angle and rate at a time since the start.

x = r cos(w t), y = r sin(w t), w = 2 pi / period; the radius grows smoothly over `ramp_s`, so the command never jumps.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from rf_pointing.core import MDEG, Params, parameter

__all__ = ["Offset", "ScanParams", "circle_offset"]


class Offset(NamedTuple):
    """An offset to add to the command, on the sky, with its rates."""

    cross_elevation_rad: float
    elevation_rad: float
    cross_elevation_rate_rad_s: float
    elevation_rate_rad_s: float


@dataclass(frozen=True, kw_only=True)
class ScanParams(Params):
    """Radius and period of the conical scan."""

    radius_rad: float = parameter(5.93 * MDEG, "scan radius; 0.0912 beamwidths cost 0.1 dB", low=1e-8, high=0.1)
    period_s: float = parameter(32.0, "time of one turn", low=0.1, high=3600.0)
    ramp_s: float = parameter(4.0, "time over which the radius grows from zero", low=0.0, high=600.0)


def circle_offset(params: ScanParams, t_since_start_s: float) -> Offset:
    """Return the scan offset `t_since_start_s` after the start; zero before it."""
    if t_since_start_s <= 0.0:
        return Offset(0.0, 0.0, 0.0, 0.0)
    radius, radius_rate = _ramp(params, t_since_start_s)
    rate = 2.0 * math.pi / params.period_s
    cosine, sine = math.cos(rate * t_since_start_s), math.sin(rate * t_since_start_s)
    return Offset(
        radius * cosine,
        radius * sine,
        radius_rate * cosine - radius * rate * sine,
        radius_rate * sine + radius * rate * cosine,
    )


def _ramp(params: ScanParams, t_s: float) -> tuple[float, float]:
    """Radius and its rate: the quintic 10 s^3 - 15 s^4 + 6 s^5, at rest at both ends."""
    if t_s >= params.ramp_s:
        return params.radius_rad, 0.0
    s = t_s / params.ramp_s
    shape = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return params.radius_rad * shape, params.radius_rad * 30.0 * s**2 * (1.0 - s) ** 2 / params.ramp_s
