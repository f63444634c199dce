"""Where the antenna must not look although its axes could: below the horizon mask and near the Sun.

Directions are angles of the mount's axes, the Sun's too; the horizon is that of the sky.  Over the
top (elevation above 90 deg) the other side of the horizon counts.  Single directions are plain
floats, for a control tick; whole paths are arrays.
"""

import math

import numpy as np

from rf_pointing.core import LEVEL, TURN, Array, Kinematics, Pair
from rf_pointing.planning.horizon import HorizonMask

# How fast the Sun moves over the sky at most.
EARTH_RATE_RAD_S = 2.0 * math.pi / 86400.0
# Finer than a zone about the Sun.
STEP_RAD = math.radians(0.25)
# A motion along the edge of a zone must not be stopped by the last bits of its own position.
ROUNDING_RAD = 1e-9


def angle_between(points: Array, others: Array) -> Array:
    """Return the angles (...) between directions (..., 2) and others, (2,) or (..., 2)."""
    # Not the arc cosine of the scalar product: it loses half the digits of a small angle.
    apart = 0.5 * (points - others)
    across = np.cos(points[..., 1]) * np.cos(others[..., 1]) * np.sin(apart[..., 0]) ** 2
    return np.asarray(2.0 * np.arcsin(np.sqrt(np.clip(np.sin(apart[..., 1]) ** 2 + across, 0.0, 1.0))))


def _refined(lines: Array, azimuths: Array, step_rad: float) -> Array:
    """Return chords (k, n, 2) with points where one crosses an azimuth, and `step_rad` apart."""
    if lines.shape[1] < 2:
        return lines
    begin, end = lines[:, :-1], lines[:, 1:]
    # A peak between two points of the path would be missed; on a chord the horizon bends only here.
    passed = (begin[..., 0, None] < azimuths) != (end[..., 0, None] < azimuths)
    line, segment, which = np.nonzero(passed)
    share = (azimuths[which] - begin[line, segment, 0]) / (end[line, segment, 0] - begin[line, segment, 0])
    longest = np.max(np.abs(end - begin), axis=(0, 2))
    pieces = np.maximum(np.ceil(longest / step_rad), 1.0).astype(np.int64)
    first = np.repeat(np.cumsum(pieces) - pieces, pieces)
    even = np.repeat(np.arange(len(pieces)), pieces) + (np.arange(len(first)) - first) / np.repeat(pieces, pieces)
    at = np.sort(np.concatenate([even, segment + share, [len(pieces)]]))
    index = np.minimum(at.astype(np.int64), len(pieces) - 1)
    rest = (at - index)[:, None]
    return np.asarray(begin[:, index] + rest * (end[:, index] - begin[:, index]))


class ForbiddenSky:
    """A horizon mask, and a circle about the Sun of `sun_radius_rad` (0: none)."""

    def __init__(self, mask: HorizonMask, sun_radius_rad: float, mount: Kinematics = LEVEL) -> None:
        self.mask, self.sun_radius_rad, self.mount = mask, sun_radius_rad, mount
        self._highest_rad = max(mask.elevation_rad)

    def clear(self, low_rad: float, high_rad: float, sun: Pair | None, margin_rad: float = 0.0) -> bool:
        """Return whether nothing is forbidden between these elevations, whatever the azimuth."""
        # Most of the sky costs a tick 9 us this way instead of 33.
        if low_rad < self._highest_rad or high_rad > 0.5 * math.pi or not self.mount.level:
            return False
        radius = self.sun_radius_rad + margin_rad
        return sun is None or low_rad > sun[1] + radius or high_rad < sun[1] - radius

    def reason(
        self, azimuth: float, elevation: float, present: Pair | None, sun: Pair | None, tolerance_rad: float = 0.0
    ) -> str:
        """Return "" or why a direction is forbidden; a motion out of a zone is always allowed."""
        under = self.under_mask(azimuth, elevation)
        if under > tolerance_rad and (present is None or under > self.under_mask(*present) + ROUNDING_RAD):
            if not self.mount.level:
                azimuth, elevation = self.mount.sky_at(azimuth, elevation)
            return self._below(azimuth, elevation, under)
        # Two directions are never nearer than their elevations: this spares most ticks a sine.
        if sun is None or (abs(elevation - sun[1]) > self.sun_radius_rad and elevation < 0.5 * math.pi):
            return ""
        near = self.sun_distance(azimuth, elevation, sun)
        if near >= self.sun_radius_rad - tolerance_rad:
            return ""
        outward = present is not None and near >= self.sun_distance(*present, sun) - ROUNDING_RAD
        return "" if outward else self._near_sun(near)

    def near_sun(self, azimuth: float, elevation: float, sun: Pair | None) -> str:
        """Return "" or how near the Sun is to a direction in its zone."""
        near = math.inf if sun is None else self.sun_distance(azimuth, elevation, sun)
        return self._near_sun(near) if near < self.sun_radius_rad else ""

    def reason_of_path(self, lines: Array, sun: Pair | None, margin_rad: float = 0.0, *, arrives: bool = True) -> str:
        """Return "" or why the worst point of a path is forbidden.

        `lines` (k, n, 2) are chords: the path first, then where the axes would come by when stopped
        at each of its points.  A path that begins in a zone may leave it, on the way out all the
        time.  From the Sun it keeps `margin_rad` more than the zone; it `arrives` when the end is
        its goal, which may be nearer.
        """
        low, high = float(lines[..., 1].min()), float(lines[..., 1].max())
        if self.clear(low, high, sun, margin_rad):
            return ""
        kept = self.sun_radius_rad + margin_rad
        if high < 0.5 * math.pi and sun is not None and not low - kept < sun[1] < high + kept:
            sun = None
        if self.mount.level:
            seen = lines = _refined(lines, self._azimuths_of(lines), math.inf if sun is None else STEP_RAD)
        else:
            lines = _refined(lines, np.empty(0), STEP_RAD)
            # On the sky the short chords are nearly straight too, and the horizon bends there.
            seen = self.mount.skies(lines)
            seen[..., 0] = np.unwrap(seen[..., 0], axis=1)
            seen = _refined(seen, self._azimuths_of(seen), math.inf)
        under = self._under_horizon(seen)
        past = under - np.maximum(np.minimum.accumulate(under[0]), 0.0)
        worst = np.unravel_index(int(np.argmax(past)), past.shape)
        if past[worst] > ROUNDING_RAD:
            azimuth, elevation = seen[worst].tolist()
            return self._below(azimuth, elevation, float(under[worst]))
        if sun is None or self.sun_radius_rad == 0.0:
            return ""
        near = angle_between(lines, np.array(sun))
        least = np.minimum(kept, np.maximum.accumulate(near[0]))
        if arrives:
            coming = np.minimum(kept, np.maximum.accumulate(near[0][::-1])[::-1])
            least = np.minimum(least, np.maximum(coming, self.sun_radius_rad))
        short = least - near
        worst = np.unravel_index(int(np.argmax(short)), short.shape)
        return self._near_sun(float(near[worst])) if short[worst] > ROUNDING_RAD else ""

    def mask_azimuths(self, west_rad: float, east_rad: float, *, over: bool) -> Array:
        """Return the azimuths (n,) of the horizon's points on all turns between two azimuths.

        `over`: those of the other side too, which count over the top.
        """
        points = np.add.outer((0.0, math.pi) if over else (0.0,), self.mask.azimuth_rad).ravel() % TURN
        turns = np.arange(math.floor(west_rad / TURN), math.ceil(east_rad / TURN))
        every = (points[:, None] + TURN * turns).ravel()
        return np.asarray(every[(every > west_rad) & (every < east_rad)])

    def _azimuths_of(self, lines: Array) -> Array:
        azimuths, over = lines[..., 0], bool(np.max(lines[..., 1]) > 0.5 * math.pi)
        return self.mask_azimuths(float(azimuths.min()), float(azimuths.max()), over=over)

    def under_mask(self, azimuth: float, elevation: float) -> float:
        """Return how far a direction is below the horizon, negative above it."""
        if not self.mount.level:
            azimuth, elevation = self.mount.sky_at(azimuth, elevation)
        elif elevation > 0.5 * math.pi:
            azimuth, elevation = azimuth + math.pi, math.pi - elevation
        return self.mask.lowest_rad(azimuth) - elevation

    @staticmethod
    def sun_distance(azimuth: float, elevation: float, sun: Pair) -> float:
        """Return the angle between a direction and the Sun."""
        rise, turn = 0.5 * (elevation - sun[1]), 0.5 * (azimuth - sun[0])
        half = math.sin(rise) ** 2 + math.cos(elevation) * math.cos(sun[1]) * math.sin(turn) ** 2
        return 2.0 * math.asin(math.sqrt(min(max(half, 0.0), 1.0)))

    def under_mask_all(self, points: Array) -> Array:
        """Return how far directions (..., 2) are below the horizon (...), negative above it."""
        return self._under_horizon(points if self.mount.level else self.mount.skies(points))

    def free_heights(self, azimuths: Array, low_rad: float, high_rad: float) -> Array:
        """Return the horizon at azimuths (n,) of the axes on both sides, the other over the top.

        The rows (2, n) are the lowest free elevation, and the highest one short of 180 deg.
        """
        if self.mount.level:
            return self.mask.lowest_all(np.stack([azimuths, azimuths + math.pi]))
        # The longest free piece of each circle about the lower axis: with a horizon that is nearly
        # flat there is only one.
        heights = np.linspace(low_rad, high_rad, max(2, math.ceil((high_rad - low_rad) / STEP_RAD) + 1))
        grid = np.stack(np.broadcast_arrays(azimuths[:, None], heights), axis=-1)
        barred = np.pad(self.under_mask_all(grid) > 0.0, ((0, 0), (1, 1)), constant_values=True)
        found = np.full((2, len(azimuths)), math.pi)
        for row, column in enumerate(barred):
            ends = np.flatnonzero(np.diff(column.astype(np.int8)))
            if len(ends):
                longest = int(np.argmax(ends[1::2] - ends[::2]))
                found[:, row] = heights[ends[2 * longest]], math.pi - heights[ends[2 * longest + 1] - 1]
        return found

    def _under_horizon(self, points: Array) -> Array:
        azimuth, elevation = points[..., 0], points[..., 1]
        over = elevation > 0.5 * math.pi
        low = np.where(over, math.pi - elevation, elevation)
        return np.asarray(self.mask.lowest_all(np.where(over, azimuth + math.pi, azimuth)) - low)

    @staticmethod
    def _below(azimuth: float, elevation: float, under: float) -> str:
        return (
            f"elevation {math.degrees(elevation):.3f} deg at azimuth {math.degrees(azimuth):.1f} deg is "
            f"{math.degrees(under):.3f} deg below the horizon mask"
        )

    def _near_sun(self, near: float) -> str:
        return f"{math.degrees(near):.3f} deg from the Sun, must be >= {math.degrees(self.sun_radius_rad):.3f} deg"
