"""Stays above a mask, of one object or of many at once.

The motion from the site is a polynomial between even nodes.  Elevation is cut at its turning
points; between two of them it is monotonic, so each crossing of the mask is bracketed and none is
missed that the step of the search resolves.  A horizon that depends on the azimuth cuts the stays
above its lowest point again, at even steps of time: every stay above it counts.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rf_pointing.core import Array, BoolArray, IntArray, RadioRefraction, require_between
from rf_pointing.core.roots import roots_between

# Lowest elevation (n,) at azimuths (n,) on any turn.
Horizon = Callable[[Array], Array]
Pairs = tuple[Array, Array]

_TIME_TOLERANCE_S = 1e-4
# Steps to a turning point or a crossing, and what the last one may be.
_NEWTON, _SETTLED_S = 5, 0.1
_HORIZON_POINTS, _HORIZON_MARGIN_RAD = 3601, 0.01
_MOST_STEPS = 5000
# Ten points lead through a step: so many before its start, and from its end on.
LEAN = 4, 5
_NODES = np.arange(-4.0, 6.0)


def _through_one(node: float) -> Array:
    """Return the powers (10,) of what is 1 at a node and 0 at the others."""
    others = np.setdiff1d(_NODES, node)
    # Whole numbers over a whole number: nothing to round but the quotient.
    return np.asarray(np.poly(others)[::-1] / np.prod(node - others))


_LAGRANGE = np.array([_through_one(node) for node in _NODES]).T


@dataclass(frozen=True, eq=False)
class SkyMotion:
    """Motion from the site between even nodes, east-north-up, metres.

    `coefficients` (powers, 3, objects * count) are those of polynomials in the part of the way from
    node to node.  Objects follow one another on one line of time, a node apart: the time of object
    k is its own plus k times `period_s`.
    """

    start_t_s: float
    step_s: float
    coefficients: Array
    objects: int = 1

    @classmethod
    def through(cls, enu_m: Array, start_t_s: float, step_s: float) -> "SkyMotion":
        """Return the motion through positions (objects, times, 3), each step by ten around it."""
        windows = sliding_window_view(enu_m.transpose(2, 0, 1), len(_NODES), axis=2)
        powers = np.tensordot(_LAGRANGE, windows, axes=(1, 3))
        return cls(start_t_s, step_s, powers.reshape(len(_NODES), 3, -1), len(enu_m))

    @property
    def count(self) -> int:
        """Steps from node to node of each object."""
        return int(self.coefficients.shape[2]) // self.objects

    @property
    def period_s(self) -> float:
        """Time from the start of one object to that of the next."""
        return self.step_s * (self.count + 1)

    def objects_at(self, t_s: Array) -> IntArray:
        """Return which object a time belongs to."""
        return self._owners((t_s - self.start_t_s) / self.step_s)

    def _owners(self, place: Array) -> IntArray:
        # Half a node off: rounding must not take an object's first time for the one before.
        return ((place + 0.5) / (self.count + 1)).astype(np.int64)

    def at(self, t_s: Array, orders: int) -> list[Array]:
        """Return position (3, n) and its first derivatives, `orders` in all."""
        place = (t_s - self.start_t_s) / self.step_s
        row = self._owners(place)
        place = place - row * (self.count + 1)
        # Rounding may put a first time before its step, and a last one behind it.
        node = np.minimum(np.maximum(place, 0.0).astype(np.int64), self.count - 1)
        here = self.coefficients[:, :, row * self.count + node]
        return list(np.einsum("okn,kcn->ocn", self._bases(place - node, orders), here))

    def grid(self, step_s: float) -> tuple[Array, Array, Array]:
        """Return even times (objects, n) <= `step_s` apart, with nodes, and `height` there."""
        parts = math.ceil(self.step_s / step_s)
        bases = self._bases(np.arange(parts + 1) / parts, 2).swapaxes(1, 2)
        even = bases @ self.coefficients.reshape(len(self.coefficients), -1)
        motion = even.reshape(2, parts + 1, 3, -1).swapaxes(1, 2).reshape(2, 3, -1)
        # Each node is the end of one part and the start of the next: the last end alone counts.
        height, rate = (
            np.c_[one[:-1].transpose(1, 2, 0).reshape(self.objects, -1), one[-1, :, -1:]]
            for one in np.reshape(height_of(*motion), (2, parts + 1, self.objects, self.count))
        )
        line = np.arange(self.objects)[:, np.newaxis] * ((self.count + 1) * parts)
        number = np.arange(self.count * parts + 1) + line
        return np.asarray(self.start_t_s + self.step_s / parts * number), height, rate

    def _bases(self, s: Array, orders: int) -> Array:
        """Return the powers (orders, powers, n) of `s` and their derivatives by time."""
        powers = len(self.coefficients)
        bases = np.zeros((orders, powers, len(s)))
        bases[0, 0] = 1.0
        for k in range(1, powers):
            np.multiply(bases[0, k - 1], s, out=bases[0, k])
        exponents = np.arange(1.0, powers)[:, np.newaxis]
        for order in range(1, orders):
            bases[order, 1:] = bases[order - 1, :-1] * (exponents / self.step_s)
        return bases

    def height(self, t_s: Array, orders: int) -> list[Array]:
        """Return the sine of the true elevation and its rates, `orders` in all (2 or 3)."""
        return height_of(*self.at(t_s, orders))


def height_of(position: Array, velocity: Array, *bend: Array) -> list[Array]:
    """Return the sine of the elevation, its rate, and with the acceleration the second one."""
    square = np.einsum("cn,cn->n", position, position)
    away = np.einsum("cn,cn->n", position, velocity)
    length = np.sqrt(square)
    height, rate = position[2] / length, (velocity[2] - position[2] * away / square) / length
    if not bend:
        return [height, rate]
    speed = np.einsum("cn,cn->n", velocity, velocity) + np.einsum("cn,cn->n", position, bend[0])
    longer = (speed - away * away / square) / length
    return [height, rate, (bend[0][2] - 2.0 * rate * away / length - height * longer) / length]


class Stays(NamedTuple):
    """Stays (n,) in time order, and times that the search has met on its way."""

    rise: Array
    fall: Array
    peaks: Array
    """Where the elevation is highest around."""
    ends: Array
    """First and last time of each object."""

    @property
    def cut_off(self) -> tuple[BoolArray, BoolArray]:
        """Which stays begin before the search, and which last beyond it."""
        rise, fall = (np.any(one[:, np.newaxis] == self.ends, axis=1) for one in self[:2])
        return rise, fall

    def inside(self) -> tuple[Array, IntArray]:
        """Return the peaks inside of stays, and which stay each belongs to."""
        row = np.searchsorted(self.rise, self.peaks) - 1
        within = (row >= 0) & (self.peaks < self.fall[row]) if len(self.rise) else row >= 0
        return self.peaks[within], row[within]

    def highest(self, motion: SkyMotion) -> tuple[Array, BoolArray]:
        """Return where each stay is highest, and whether it turns there (an end otherwise)."""
        count = len(self.rise)
        peaks, owner = self.inside()
        place = np.concatenate([self.rise, self.fall, peaks])
        row = np.concatenate([np.arange(count), np.arange(count), owner])
        best = np.lexsort((motion.height(place, 2)[0], row))[np.cumsum(np.bincount(row)) - 1]
        return place[best], best >= 2 * count


def mask_of(
    min_elevation_rad: float | Horizon, air: RadioRefraction | None
) -> tuple[Horizon | None, float]:  # fmt: skip
    """Return the horizon, if it is one, and a sine of true elevations that all stays are above."""
    horizon = min_elevation_rad if callable(min_elevation_rad) else None
    if callable(min_elevation_rad):
        # Below all of it, so that every crossing of it is found.
        around = min_elevation_rad(np.linspace(0.0, 2.0 * np.pi, _HORIZON_POINTS))
        min_elevation_rad = float(np.min(around)) - _HORIZON_MARGIN_RAD
    require_between("min_elevation_rad", min_elevation_rad, -0.2 if horizon else -0.01, np.pi / 2)
    return horizon, math.sin(air.remove(min_elevation_rad) if air else min_elevation_rad)


def stays_above(motion: SkyMotion, sine: float, step_s: float) -> Stays:
    """Return the stays whose true elevation has a sine above `sine`, searched at a step."""

    def over_mask(t_s: Array) -> list[Array]:
        height, rate = motion.height(t_s, 2)
        return [height - sine, rate]

    times, heights, rates = motion.grid(step_s)
    grid, height, rate = times.ravel(), heights.ravel(), rates.ravel()
    edge = np.zeros(times.shape, dtype=np.int8)
    edge[:, 0], edge[:, -1] = 1, 2
    # From an object's last point to the next one's first there is no motion.
    moves = edge.ravel()[1:] != 1
    # A turning point that the tangents keep on one side of the mask cuts nothing.
    wide_s = grid[1] - grid[0]
    turns = np.flatnonzero(((rate[1:] > 0.0) != (rate[:-1] > 0.0)) & moves)
    reach = height[turns] + rate[turns] * wide_s, height[turns + 1] - rate[turns + 1] * wide_s
    turns = turns[np.where(rate[turns] > 0.0, np.maximum(*reach) > sine, np.minimum(*reach) < sine)]
    around = (grid[turns], grid[turns + 1]), (rate[turns], rate[turns + 1])
    turning = _root(lambda t_s: motion.height(t_s, 3)[1:], *around)
    turned = motion.height(turning, 2)[0]
    peaks = turning[rate[turns] > 0.0]
    # Grid and turning points in time order: between two of them the height is monotonic.
    knots, over = np.empty((2, len(grid) + len(turns)))
    new = np.zeros(len(knots), dtype=bool)
    new[turns + 1 + np.arange(len(turns))] = True
    knots[new], over[new] = turning, turned - sine
    knots[~new], over[~new] = grid, height - sine
    bounds = np.zeros(len(knots), dtype=np.int8)
    bounds[~new] = edge.ravel()
    above = over > 0.0
    change = np.flatnonzero((above[1:] != above[:-1]) & (bounds[1:] != 1))
    around = (knots[change], knots[change + 1]), (over[change], over[change + 1])
    crossings = _root(over_mask, *around)
    rise = np.sort(np.concatenate([knots[above & (bounds == 1)], crossings[above[change + 1]]]))
    fall = np.sort(np.concatenate([crossings[above[change]], knots[above & (bounds == 2)]]))
    lasts = fall > rise
    return Stays(rise[lasts], fall[lasts], peaks, times[:, [0, -1]].ravel())


def _root(function: Callable[[Array], list[Array]], ends: Pairs, values: Pairs) -> Array:
    """Return where a function (value, slope) crosses 0 between `ends` (n,), by `values`."""
    low, high = ends
    at = low + (high - low) * values[0] / (values[0] - values[1])
    for _ in range(_NEWTON):
        value, slope = function(at)
        late_s = value / np.where(slope == 0.0, 1e-30, slope)
        at = np.minimum(np.maximum(at - late_s, low), high)
        astray = np.abs(late_s) >= _SETTLED_S
        if not np.any(astray):
            return at
    # Newton's steps went astray near a peak at the mask.
    around = low[astray], high[astray]
    at[astray] = roots_between(lambda t_s: function(t_s)[0], *around, _TIME_TOLERANCE_S)
    return at


def parts_above(stays: Stays, clearance: Callable[[Array], Array], step_s: float) -> Stays:
    """Return the parts of stays with a positive `clearance` (n,) over a horizon, at times (n,)."""
    if not len(stays.rise):
        return stays
    counts = np.clip(np.ceil((stays.fall - stays.rise) / step_s) + 1, 2, _MOST_STEPS)
    even = map(np.linspace, stays.rise, stays.fall, counts.astype(int).tolist())
    # With the turning points, so that a short peak above a hill is not stepped over.
    times = np.unique(np.concatenate([*even, stays.inside()[0]]))
    first, last = np.searchsorted(times, stays.rise), np.searchsorted(times, stays.fall)
    above = clearance(times) > 0.0
    changes = above[1:] != above[:-1]
    # Where one stay ends as the next begins, each has its own.
    changes[last[:-1][last[:-1] < first[1:]]] = False
    change = np.flatnonzero(changes)
    edges = roots_between(clearance, times[change], times[change + 1], _TIME_TOLERANCE_S)
    # Between two edges the target is above or below throughout; they alternate.
    up = above[change + 1]
    rise = np.sort(np.concatenate([stays.rise[above[first]], edges[up]]))
    fall = np.sort(np.concatenate([edges[~up], stays.fall[above[last]]]))
    lasts = fall > rise
    return stays._replace(rise=rise[lasts], fall=fall[lasts])
