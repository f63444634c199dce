"""The dish over its back: the exact plunge, and crossing the zenith by it.

(az + 180 deg, 180 deg - el) is the same direction with the dish over the top.  Mirroring about
closest approach instead is 30 deg off at loss of signal.

A dish that may lean over its back begins the pass on one side and ends it on the other: the azimuth
hardly moves, the elevation runs on through 90 deg.  The azimuth axis makes only what is left of the
target's half turn.  It leaves the target at t_a, changes to the one rate w that brings it onto the
other side's path at t_b, and changes to that path's rate:

    w (t_b - t_a) + (v_a - w)|v_a - w|/2A + (v_b - w)|v_b - w|/2A = az_b - az_a

The elevation is the nearest one to a target at e, atan2(sin e, cos e cos D) for an azimuth error D;
it goes over the top by itself when D passes 90 deg.  At least the beam's distance from the target
at the zenith is lost; t_a and t_b are those of the least loss.
"""

import math

import numpy as np

from rf_pointing.core.types import TURN, Array
from rf_pointing.planning.crossing import (
    MARGIN_S,
    AxisMotionLimits,
    Crossing,
    Gain,
    nearest_elevation,
    smoothing_kernel,
)
from rf_pointing.planning.forbidden_sky import angle_between

Triple = tuple[Array, Array, Array]
# Bounds the search for departure and return, each from the zenith.
LONGEST_S = 240.0
# On a logarithmic grid: near the zenith seconds count, far from it minutes.
FIRST_TRIES = 20
# Close to the zenith the errors of the mount move its path by hundredths of a degree in tenths of
# a second.
SMOOTHING_S = 0.7
MIRROR = np.array([1.0, -1.0])


def plunged(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Return the same motion with the dish over the top, (..., 2) each; `unplunged` undoes it."""
    return position * MIRROR + np.pi, velocity * MIRROR, acceleration * MIRROR


def unplunged(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """Undo `plunged`."""
    return (position - np.pi) * MIRROR, velocity * MIRROR, acceleration * MIRROR


def cross_over(t_s: Array, first: Triple, second: Triple, limits: AxisMotionLimits, gain: Gain) -> Crossing | None:
    """Return the crossing of least loss from one side to the other, None when none is possible.

    Parameters
    ----------
    t_s : even times (n,).
    first, second : position, velocity, acceleration (n, 2) of the axes before and after, azimuths
        continuous, the second over the top: about (az + 180 deg, 180 deg - el) of the first, on any
        turn.
    limits : rates and accelerations; the elevation's travel is left to the caller.
    """
    sides = _Sides(t_s, first, second, limits, gain)
    middle = int(np.argmax(sides.target[:, 1]))
    most = min(round(LONGEST_S / sides.step_s), middle - 2, len(t_s) - 3 - middle)
    if most < 1:
        return None
    before = after = np.unique(np.geomspace(1, most, FIRST_TRIES).astype(int))
    best = (math.inf, 0, 0)
    for _ in range(3):
        best = min([best, *((sides.lost_s(middle - a, middle + b), int(a), int(b)) for a in before for b in after)])
        if not math.isfinite(best[0]):
            return None
        # The two times are refined together, each by a quarter to either side.
        before, after = (np.unique(np.clip(np.geomspace(0.8 * x, 1.25 * x, 7), 1, most).astype(int)) for x in best[1:])
    return sides.crossing(middle - best[1], middle + best[2])


class _Sides:
    """The paths on both sides, and the ways from one to the other."""

    def __init__(self, t_s: Array, first: Triple, second: Triple, limits: AxisMotionLimits, gain: Gain) -> None:
        self.t_s, self.first, self.limits, self.gain = t_s, first, limits, gain
        self.step_s = float(t_s[1] - t_s[0])
        azimuth = first[0][:, 0]
        self.half_turn_rad = math.copysign(math.pi, float(azimuth[-1] - azimuth[0]))
        # The other side's azimuth may be given on any turn: the one that joins this side's counts.
        self.turn_rad = TURN * round(float(azimuth[-1] - self.half_turn_rad - second[0][-1, 0]) / TURN)
        self.second: Triple = (second[0] + np.array([self.turn_rad, 0.0]), second[1], second[2])
        self.target = _between(first[0], self.second[0])
        over = np.column_stack([self.target[:, 0] - self.half_turn_rad, math.pi - self.target[:, 1]])
        self.before, self.after = first[0] - self.target, self.second[0] - over
        """Offsets (n, 2) of the axes from the target by the errors of the mount, on either side."""
        self._kernel = smoothing_kernel(SMOOTHING_S, self.step_s)

    def lost_s(self, start: int, end: int) -> float:
        """Return the signal lost by changing sides between two rows, infinite when impossible."""
        moved = self._moved(start, end)
        if moved is None:
            return math.inf
        before, after = self.first[0][start - 1 : start, 1], self.second[0][end + 1 : end + 2, 1]
        rates = np.diff(np.concatenate([before, moved[0][:, 1], after])) / self.step_s
        rate, limit = self.limits.rate_rad_s[1], self.limits.acceleration_rad_s2[1]
        # The azimuth keeps its limits by construction; the elevation is what is left to check.
        if np.abs(rates).max() > rate or np.abs(np.diff(rates)).max() > limit * self.step_s:
            return math.inf
        return float(np.sum(1.0 - self.gain(moved[1])) * self.step_s)

    def crossing(self, start: int, end: int) -> Crossing:
        """Return the motion that changes sides between two rows, on the target at its ends."""
        moved = self._moved(start, end)
        assert moved is not None
        margin = round(MARGIN_S / self.step_s)
        first, last = max(0, start - margin), min(len(self.t_s) - 1, end + margin)
        part = slice(first, last + 1)
        position = np.concatenate([self.first[0][:start], moved[0], self.second[0][end + 1 :]])
        velocity = np.gradient(position, self.step_s, axis=0)
        velocity[:first], velocity[last + 1 :] = self.first[1][:first], self.second[1][last + 1 :]
        bend = np.gradient(velocity, self.step_s, axis=0)
        for row, side in ((first, self.first), (last, self.second)):
            velocity[row], bend[row] = side[1][row], side[2][row]
        error = np.zeros(last + 1 - first)
        error[start - first : end + 1 - first] = moved[1]
        top = start + int(np.argmax(moved[0][:, 1] >= 0.5 * math.pi))
        return Crossing(
            self.t_s[part], position[part], velocity[part], bend[part], error, over_t_s=float(self.t_s[top]),
            turn_rad=self.turn_rad, turn_t_s=float(self.t_s[top]),
        )  # fmt: skip

    def _moved(self, start: int, end: int) -> tuple[Array, Array] | None:
        """Return the axes' positions (m, 2) between two rows, and the beam's error (m,) on the way.

        None when the azimuth axis is too slow.  The errors of the mount on the other side are
        blended in smoothly.
        """
        azimuth = self._azimuth(start, end)
        if azimuth is None:
            return None
        part, x = slice(start, end + 1), np.linspace(0.0, 1.0, end - start + 1)[:, None]
        share, t = x**3 * (10.0 + x * (6.0 * x - 15.0)), self.t_s[part]
        # At the zenith the errors of the mount change too fast to be followed: straight lines from
        # beyond it.
        before = _line(self.before[start - 1 : start + 1], self.step_s, t - t[0], 1)
        after = _line(self.after[end : end + 2], self.step_s, t - t[-1], 0)
        beside, target = (1.0 - share) * before + share * after, self.target[part]
        off = azimuth - beside[:, 0] - target[:, 0]
        elevation = nearest_elevation(off, target[:, 1]) + beside[:, 1]
        # Smoothed most in the middle, not at all at the ends, where both sides must be met.
        elevation = elevation + 16.0 * (x[:, 0] * (1.0 - x[:, 0])) ** 2 * (
            self._soft(elevation, start, end) - elevation
        )
        error = angle_between(np.column_stack([target[:, 0] + off, elevation - beside[:, 1]]), target)
        return np.column_stack([azimuth, elevation]), error

    def _soft(self, elevation: Array, start: int, end: int) -> Array:
        """Return the elevation (m,) between two rows, smoothed with what lies beyond them."""
        reach = len(self._kernel) // 2
        before, after = self.first[0][max(start - reach, 0) : start, 1], self.second[0][end + 1 : end + 1 + reach, 1]
        padded = np.pad(np.concatenate([before, elevation, after]), (reach - len(before), reach - len(after)), "edge")
        return np.convolve(padded, self._kernel, mode="valid")

    def _azimuth(self, start: int, end: int) -> Array | None:
        limit, most = self.limits.acceleration_rad_s2[0], self.limits.rate_rad_s[0]
        t = self.t_s[start : end + 1] - self.t_s[start]
        way = float(self.second[0][end, 0] - self.first[0][start, 0])
        leaving, joining = float(self.first[1][start, 0]), float(self.second[1][end, 0])
        rate = _rate_between(way, float(t[-1]), leaving, joining, limit)
        if rate is None or max(abs(rate), abs(leaving), abs(joining)) > most:
            return None
        up, down = abs(leaving - rate) / limit, abs(joining - rate) / limit
        run = rate * t + (leaving - rate) * (np.minimum(t, up) - 0.5 * np.minimum(t, up) ** 2 / max(up, 1e-9))
        left = np.maximum(t - (t[-1] - down), 0.0)
        return np.asarray(self.first[0][start, 0] + run + (joining - rate) * 0.5 * left**2 / max(down, 1e-9))


def _between(one: Array, other: Array) -> Array:
    """Return the direction (n, 2) half-way between two, azimuth continuous from the first."""
    both = np.stack([one, other])
    level = np.cos(both[..., 1])
    rows = np.stack([np.sin(both[..., 0]) * level, np.cos(both[..., 0]) * level, np.sin(both[..., 1])])
    vectors = rows.sum(axis=1)
    azimuth = np.unwrap(np.arctan2(vectors[0], vectors[1]))
    azimuth += TURN * round(float(one[0, 0] - azimuth[0]) / TURN)
    return np.column_stack([azimuth, np.arctan2(vectors[2], np.hypot(vectors[0], vectors[1]))])


def _line(two: Array, step_s: float, since_s: Array, known: int) -> Array:
    """Return the line (m, 2) through two rows a step apart, `since_s` (m,) after row `known`."""
    return np.asarray(two[known] + since_s[:, None] * (two[1] - two[0]) / step_s)


def _rate_between(way: float, duration_s: float, leaving: float, joining: float, limit: float) -> float | None:
    """Return the one rate between two others at a given acceleration, None when time is short."""
    rate = way / duration_s
    # Newton; quadratic, with a slope that is the time at the rate w itself.
    for _ in range(20):
        bent = ((leaving - rate) * abs(leaving - rate) + (joining - rate) * abs(joining - rate)) / (2.0 * limit)
        slope = duration_s - (abs(leaving - rate) + abs(joining - rate)) / limit
        if slope <= 0.0:
            return None
        change = (way - rate * duration_s - bent) / slope
        rate += change
        if abs(change) < 1e-12:
            break
    return rate
