"""Search along the track: strips beside each other, the likeliest first, for an ephemeris that is mostly early or late.

Legs run from rest to rest: out and back along the track, one pitch to the left, back, two to the right, and so on; then
back to the middle and again.  Coordinates are along the track and to its left.
"""

import math
from bisect import bisect_right
from itertools import accumulate, pairwise
from typing import NamedTuple

__all__ = ["StripOffset", "StripSearch"]


class StripOffset(NamedTuple):
    """Offset along the track and to the left of it, and the rates."""

    along_rad: float
    left_rad: float
    along_rate_rad_s: float
    left_rate_rad_s: float


class StripSearch:
    """Covers `half_length_rad` either way along the track and `half_width_rad` beside it, strips `pitch_rad` apart."""

    def __init__(
        self,
        half_length_rad: float,
        half_width_rad: float,
        pitch_rad: float,
        rate_rad_s: float,
        acceleration_rad_s2: float,
    ) -> None:
        self._rate, self._acceleration = rate_rad_s, acceleration_rad_s2
        corners = _corners(half_length_rad, math.ceil(max(half_width_rad / pitch_rad - 0.5, 0.0)), pitch_rad)
        self._legs = list(pairwise(corners))
        self._starts = [0.0, *accumulate(self._leg_time_s(math.dist(*leg)) for leg in self._legs)]

    @property
    def duration_s(self) -> float:
        """Time until everything was passed once and the beam is back in the middle."""
        return self._starts[-1]

    def offset(self, t_since_start_s: float) -> StripOffset:
        """Return the offset from the expected direction and its rates."""
        within_s = max(t_since_start_s, 0.0) % self.duration_s
        leg = min(bisect_right(self._starts, within_s) - 1, len(self._legs) - 1)
        (x0, y0), (x1, y1) = self._legs[leg]
        length = math.hypot(x1 - x0, y1 - y0)
        way, speed = self._way(within_s - self._starts[leg], length)
        cosine, sine = (x1 - x0) / length, (y1 - y0) / length
        return StripOffset(x0 + way * cosine, y0 + way * sine, speed * cosine, speed * sine)

    def _peak_rad_s(self, length: float) -> float:
        return min(self._rate, math.sqrt(self._acceleration * length))

    def _leg_time_s(self, length: float) -> float:
        peak = self._peak_rad_s(length)
        return length / peak + peak / self._acceleration

    def _way(self, t: float, length: float) -> tuple[float, float]:
        """Return how far along a leg of `length` the beam is after `t`, and how fast: a trapezoid of speed."""
        peak = self._peak_rad_s(length)
        ramp_s, total_s = peak / self._acceleration, self._leg_time_s(length)
        if t < ramp_s:
            return 0.5 * self._acceleration * t**2, self._acceleration * t
        if t > total_s - ramp_s:
            left_s = total_s - t
            return length - 0.5 * self._acceleration * left_s**2, self._acceleration * left_s
        return peak * (t - 0.5 * ramp_s), peak


def _corners(half_length: float, strips: int, pitch: float) -> list[tuple[float, float]]:
    """Return the ends of the legs, the first strip through the middle."""
    corners, end = [(0.0, 0.0), (half_length, 0.0), (-half_length, 0.0)], -half_length
    for index in range(1, strips + 1):
        for left in (index * pitch, -index * pitch):
            corners += [(end, left), (-end, left)]
            end = -end
    return [*corners, (0.0, 0.0)]
