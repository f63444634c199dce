"""Where the antenna must not look although its axes could: below the horizon mask and near the Sun.

Single directions are plain floats, for a control tick; whole paths are arrays.  Over the top (elevation above 90 deg) the
other side of the horizon counts.
"""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.planning.mask import HorizonMask

__all__ = ["ForbiddenSky"]

Array = NDArray[np.float64]
Pair = tuple[float, float]
ROUNDING_RAD = 1e-9


class ForbiddenSky:
    """A horizon mask, and a circle about the Sun of `sun_radius_rad` (0: none)."""

    def __init__(self, mask: HorizonMask, sun_radius_rad: float) -> None:
        self.mask, self.sun_radius_rad = mask, sun_radius_rad
        self._highest_rad = max(mask.elevation_rad)

    def clear(self, low_rad: float, high_rad: float, sun: Pair | None) -> bool:
        """Return whether nothing is forbidden at any azimuth between these elevations: most of the sky at no cost."""
        if low_rad < self._highest_rad or high_rad > 0.5 * math.pi:
            return False
        return sun is None or low_rad > sun[1] + self.sun_radius_rad or high_rad < sun[1] - self.sun_radius_rad

    def reason(
        self, azimuth: float, elevation: float, present: Pair | None, sun: Pair | None, tolerance_rad: float = 0.0
    ) -> str:
        """Return "" or what is wrong with a direction; from inside a zone all that does not lead further in is right."""
        under = self.under_mask(azimuth, elevation)
        if under > tolerance_rad and (present is None or under > self.under_mask(*present) + ROUNDING_RAD):
            return self._below(azimuth, elevation, under)
        # Two directions are never nearer than their elevations: most are far from the Sun without a sine.
        if sun is None or (abs(elevation - sun[1]) > self.sun_radius_rad and elevation < 0.5 * math.pi):
            return ""
        near = self.sun_distance(azimuth, elevation, sun)
        if near >= self.sun_radius_rad - tolerance_rad:
            return ""
        outward = present is not None and near >= self.sun_distance(*present, sun) - ROUNDING_RAD
        return "" if outward else self._near_sun(near)

    def reason_of_path(self, points: Array, start: Pair, end: Pair, sun: Pair | None, duration_s: float) -> str:
        """Return "" or what is wrong with the worst of `points` (n, 2), reached on the way from `start` to `end`.

        Within the duration the Sun moves on, so the way keeps as much more from it, unless an end is nearer.
        """
        under = self.under_mask_all(points)
        worst = int(np.argmax(under))
        if under[worst] > max(0.0, self.under_mask(*start), self.under_mask(*end)) + ROUNDING_RAD:
            return self._below(float(points[worst, 0]), float(points[worst, 1]), float(under[worst]))
        if sun is None or self.sun_radius_rad == 0.0:
            return ""
        kept = self.sun_radius_rad + EARTH_RATE_RAD_S * duration_s
        ends = min(self.sun_distance(*start, sun), self.sun_distance(*end, sun))
        nearest = float(np.min(self.sun_distance_all(points, np.array(sun))))
        return self._near_sun(nearest) if nearest < min(kept, ends) - ROUNDING_RAD else ""

    def under_mask(self, azimuth: float, elevation: float) -> float:
        """Return how far a direction is below the horizon, negative above it."""
        if elevation > 0.5 * math.pi:
            azimuth, elevation = azimuth + math.pi, math.pi - elevation
        return self.mask.lowest_rad(azimuth) - elevation

    @staticmethod
    def sun_distance(azimuth: float, elevation: float, sun: Pair) -> float:
        """Return the angle between a direction and the Sun."""
        rise, turn = 0.5 * (elevation - sun[1]), 0.5 * (azimuth - sun[0])
        half = math.sin(rise) ** 2 + math.cos(elevation) * math.cos(sun[1]) * math.sin(turn) ** 2
        return 2.0 * math.asin(math.sqrt(min(max(half, 0.0), 1.0)))

    def under_mask_all(self, points: Array) -> Array:
        """Return how far directions (n, 2) are below the horizon (n,), negative above it."""
        azimuth, elevation = points.T
        over = elevation > 0.5 * math.pi
        low = np.where(over, math.pi - elevation, elevation)
        return np.asarray(self.mask.lowest_all(np.where(over, azimuth + math.pi, azimuth)) - low)

    @staticmethod
    def sun_distance_all(points: Array, sun: Array) -> Array:
        """Return the angles (n,) between directions (n, 2) and the Sun, (2,) or (n, 2)."""
        rise, turn = 0.5 * (points - sun).T[::-1]
        half = np.sin(rise) ** 2 + np.cos(points[:, 1]) * np.cos(sun[..., 1]) * np.sin(turn) ** 2
        return np.asarray(2.0 * np.arcsin(np.sqrt(np.clip(half, 0.0, 1.0))))

    @staticmethod
    def _below(azimuth: float, elevation: float, under: float) -> str:
        return (
            f"elevation {math.degrees(elevation):.3f} deg at azimuth {math.degrees(azimuth):.1f} deg is "
            f"{math.degrees(under):.3f} deg below the horizon mask"
        )

    def _near_sun(self, near: float) -> str:
        return f"{math.degrees(near):.3f} deg from the Sun, must be >= {math.degrees(self.sun_radius_rad):.3f} deg"


EARTH_RATE_RAD_S = 2.0 * math.pi / 86400.0
"""How fast the Sun moves over the sky at most."""
