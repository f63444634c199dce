"""Passes of many objects over one site, found on an even grid and refined together.

Positions are interpolated through ten grid points.  With a step of 0.45 rad of circular motion the
error is 0.00024 (0.45)^10 r: 0.6 m in a low orbit, 0.1 ms of its motion.  A maximum on the grid is
kept unless it cannot reach the mask: on a path shorter than the distance the direction turns by no
more than the arc sine of their ratio.  A dip below the mask between two grid points above it
separates two passes.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core.roots import roots_between
from rf_pointing.core.types import Array, BoolArray

Index = NDArray[np.int64]

_TOLERANCE_S = 1e-3
_COARSE_S = 60.0
# Golden section ends up to this close to the end of an interval over which the elevation only
# rises or falls.
_CLOSE_S = 2.0
# Grid points before the first and after the last searched instant, for the interpolation to lean
# on.
MARGIN = 5

_NODES = np.arange(-4.0, 6.0)
_DENOMINATORS = np.array([np.prod([a - b for b in _NODES if b != a]) for a in _NODES])
_NARROW_S = 1.0
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True, eq=False)
class SampledSky:
    """East-north-up positions `enu_m` (objects, times, 3); column MARGIN is at `start_s`."""

    enu_m: Array
    start_s: float
    step_s: float

    @property
    def sines(self) -> Array:
        """Sine of the true elevation at the grid points, (objects, times)."""
        squares: Array = np.einsum("otc,otc->ot", self.enu_m, self.enu_m)
        distance: Array = np.sqrt(squares)
        return self.enu_m[..., 2] / distance

    def time_s(self, column: Index) -> Array:
        """Return the times of grid columns."""
        return self.start_s + self.step_s * (column - MARGIN).astype(np.float64)

    def column(self, t_s: Array) -> Index:
        """Return the last column at or before each time."""
        last = self.enu_m.shape[1] - MARGIN - 1
        found = np.floor((t_s - self.start_s) / self.step_s).astype(np.int64) + MARGIN
        return np.clip(found, MARGIN - 1, last)

    def position_m(self, row: Index, t_s: Array) -> Array:
        """Return the position (n, 3) of object `row[i]` at `t_s[i]`."""
        column = self.column(t_s)
        u = (t_s - self.time_s(column)) / self.step_s
        apart = u[:, None] - _NODES
        ones = np.ones((len(u), 1))
        # Products of all differences but one, from running products of both ends: no division.
        before = np.concatenate([ones, np.cumprod(apart[:, :-1], axis=1)], axis=1)
        after = np.concatenate([ones, np.cumprod(apart[:, :0:-1], axis=1)], axis=1)[:, ::-1]
        weights = before * after / _DENOMINATORS
        # Ten nodes around each time, five on either side.
        nodes = self.enu_m[row[:, None], column[:, None] + np.arange(-4, 6)]
        return np.asarray(np.einsum("nj,njc->nc", weights, nodes))

    def sine(self, row: Index, t_s: Array) -> Array:
        """Return the sine of the true elevation of object `row[i]` at `t_s[i]`."""
        position = self.position_m(row, t_s)
        return np.asarray(position[:, 2] / np.sqrt(np.einsum("nc,nc->n", position, position)))

    def narrowed(self, row: Index, low_s: Array, high_s: Array, sign: float, width_s: float) -> tuple[Array, Array]:
        """Return intervals of `width_s` or less around the highest (1) or lowest (-1) elevation."""
        a, b = low_s, high_s
        c, d = b - _GOLDEN * (b - a), a + _GOLDEN * (b - a)
        fc, fd = sign * self.sine(row, c), sign * self.sine(row, d)
        widest = float(np.max(b - a, initial=width_s))
        # The count follows from the width: all objects in one array, no test of convergence.
        for _ in range(int(np.ceil(np.log(width_s / widest) / np.log(_GOLDEN)))):
            left = fc > fd
            a, b = np.where(left, a, c), np.where(left, d, b)
            x = np.where(left, b - _GOLDEN * (b - a), a + _GOLDEN * (b - a))
            fx = sign * self.sine(row, x)
            c, d = np.where(left, x, d), np.where(left, c, x)
            fc, fd = np.where(left, fx, fd), np.where(left, fc, fx)
        return a, b

    def turning_times(self, row: Index, low_s: Array, high_s: Array, sign: float) -> Array:
        """Return where the elevation is highest (sign = 1) or lowest (-1) inside each interval.

        Golden section to a second, then the vertex of a parabola: good to 10 ms where the elevation
        peaks sharply.
        """
        a, b = self.narrowed(row, low_s, high_s, sign, _NARROW_S)
        middle_s = 0.5 * (a + b)
        before, here, after = (self.sine(row, middle_s + k * _NARROW_S) for k in (-1.0, 0.0, 1.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            # A flat top divides by zero; it has no vertex, and the middle serves.
            shift = 0.5 * (before - after) / (before - 2.0 * here + after)
        return np.clip(middle_s + np.where(np.abs(shift) < 1.0, shift, 0.0) * _NARROW_S, low_s, high_s)


class GridPasses(NamedTuple):
    """Passes (n,): object row, times [s], and whether they are cut off at the ends."""

    row: Index
    aos_s: Array
    tca_s: Array
    los_s: Array
    rises_before: BoolArray
    sets_after: BoolArray


def passes_on_grid(sky: SampledSky, searched: BoolArray, duration_s: float, sine_mask: float) -> GridPasses:
    """Return the stays above the mask of the `searched` objects in `duration_s` from the start."""
    sines = sky.sines
    end_s = sky.start_s + duration_s
    row, tca_s = _turning_points(sky, sines, searched, end_s, sine_mask, 1.0)
    peak = sky.sine(row, tca_s)
    row, tca_s, peak = row[peak > sine_mask], tca_s[peak > sine_mask], peak[peak > sine_mask]
    # The dips cut the stays: two peaks with a dip below the mask between them are two passes.
    dip_row, dip_s = _turning_points(sky, sines, searched, end_s, sine_mask, -1.0)
    deep = sky.sine(dip_row, dip_s) < sine_mask
    before, after = _bracket_nodes(sky, sines, row, tca_s, sine_mask)
    for one_row, one_s in zip(dip_row[deep], dip_s[deep], strict=True):
        same = row == one_row
        before = np.where(same & (one_s < tca_s), np.maximum(before, one_s), before)
        after = np.where(same & (one_s > tca_s), np.minimum(after, one_s), after)
    aos_s, rises_before = _crossings(sky, row, before, tca_s, sine_mask, sky.start_s)
    los_s, sets_after = _crossings(sky, row, after, tca_s, sine_mask, end_s)
    return _highest_of_each(GridPasses(row, aos_s, tca_s, los_s, rises_before, sets_after), peak)


def _turning_points(
    sky: SampledSky, sines: Array, searched: BoolArray, end_s: float, sine_mask: float, sign: float
) -> tuple[Index, Array]:
    """Return rows and times of maxima (sign 1) or minima (-1) that may cross the mask."""
    inside = slice(MARGIN, sines.shape[1] - MARGIN)
    turning = _turning_nodes(sign * sines, ends=sign > 0.0)
    if sign < 0.0:  # a dip to below is one from above; the other minima separate nothing
        turning &= sines[:, inside] > sine_mask
    row, column = np.nonzero(turning & searched[:, None])
    speed_m_s = np.linalg.norm(np.diff(sky.enu_m, axis=1), axis=-1) / sky.step_s
    speed = np.maximum(speed_m_s[row, column + MARGIN - 1], speed_m_s[row, column + MARGIN])
    middle_s = sky.time_s(column + MARGIN)
    low_s, high_s = np.maximum(middle_s - sky.step_s, sky.start_s), np.minimum(middle_s + sky.step_s, end_s)
    # Twice: first over the whole step, then, narrowed, with a far smaller reach.
    for width_s in (sky.step_s, _COARSE_S):
        may = _may_reach(sky, row, middle_s, speed * width_s, sine_mask, sign)
        row, speed, low_s, high_s = row[may], speed[may], low_s[may], high_s[may]
        if width_s > _COARSE_S:
            low_s, high_s = sky.narrowed(row, low_s, high_s, sign, _COARSE_S)
        middle_s = 0.5 * (low_s + high_s)
    return row, _or_end(sky, row, sky.turning_times(row, low_s, high_s, sign), end_s, sign)


def _turning_nodes(values: Array, *, ends: bool) -> BoolArray:
    """Return which columns are higher than their neighbours; the `ends` need only one lower."""
    here = values[:, MARGIN : values.shape[1] - MARGIN]
    left, right = values[:, MARGIN - 1 : -MARGIN - 1], values[:, MARGIN + 1 : values.shape[1] - MARGIN + 1]
    turning: BoolArray = (here >= left) & (here > right)
    if ends:
        turning[:, 0] |= here[:, 0] > right[:, 0]
        turning[:, -1] |= here[:, -1] >= left[:, -1]
    return turning


def _may_reach(sky: SampledSky, row: Index, t_s: Array, moved_m: Array, sine_mask: float, sign: float) -> BoolArray:
    """Return whether the elevation can cross the mask within `moved_m` of motion."""
    position = sky.position_m(row, t_s)
    distance = np.sqrt(np.einsum("nc,nc->n", position, position))
    elevation = np.arcsin(position[:, 2] / distance)
    reach = np.arcsin(np.minimum(moved_m / distance, 1.0))
    return np.asarray(sign * (elevation - np.arcsin(sine_mask)) > -reach)


def _or_end(sky: SampledSky, row: Index, t_s: Array, end_s: float, sign: float) -> Array:
    """Return the end of the searched interval where it is better than a turning point close by."""
    for bound_s in (sky.start_s, end_s):
        # Golden section ends short of an end over which the elevation only rises or falls.
        close = np.flatnonzero(np.abs(t_s - bound_s) <= _CLOSE_S)
        at_end = np.full(len(close), bound_s)
        better = sign * sky.sine(row[close], at_end) > sign * sky.sine(row[close], t_s[close])
        t_s[close[better]] = bound_s
    return t_s


def _bracket_nodes(sky: SampledSky, sines: Array, row: Index, tca_s: Array, sine_mask: float) -> tuple[Array, Array]:
    """Return the nearest grid times below the mask around each peak; -inf and inf for none."""
    inside = sines[:, MARGIN : sines.shape[1] - MARGIN]
    columns = np.arange(inside.shape[1])
    # Running extremes give the nearest column below the mask on either side without a loop.
    below = inside <= sine_mask
    last = np.maximum.accumulate(np.where(below, columns, -1), axis=1)
    none = inside.shape[1]
    following = np.minimum.accumulate(np.where(below, columns, none)[:, ::-1], axis=1)[:, ::-1]
    column = sky.column(tca_s) - MARGIN
    before, after = last[row, column], following[row, np.minimum(column + 1, none - 1)]
    return (
        np.where(before < 0, -np.inf, sky.time_s(before + MARGIN)),
        np.where(after == none, np.inf, sky.time_s(after + MARGIN)),
    )


def _crossings(
    sky: SampledSky, row: Index, outside_s: Array, tca_s: Array, sine_mask: float, end_s: float
) -> tuple[Array, BoolArray]:
    """Return where each object crosses the mask on the way to its peak, or where it is cut off."""
    cut = ~np.isfinite(outside_s)
    crossing = np.full(len(row), end_s)
    moving, rows = ~cut, row[~cut]
    # Between the last point below and the first above; a peak inside that step bounds it instead.
    towards = np.sign(tca_s - outside_s)[moving]
    inner = outside_s[moving] + towards * np.minimum(sky.step_s, np.abs(tca_s - outside_s)[moving])
    crossing[moving] = roots_between(
        lambda t_s: sky.sine(rows, t_s) - sine_mask, outside_s[moving], inner, _TOLERANCE_S
    )
    return crossing, cut


def _highest_of_each(passes: GridPasses, peak: Array) -> GridPasses:
    """Return one pass per stay, at its highest maximum: an eccentric orbit can have several."""
    # Sorted by object, rise and peak, the highest of each stay comes first.
    order = np.lexsort((-peak, np.round(passes.aos_s, 1), passes.row))
    row, aos_s = passes.row[order], passes.aos_s[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (row[1:] != row[:-1]) | (np.abs(aos_s[1:] - aos_s[:-1]) > 10.0 * _TOLERANCE_S)
    return GridPasses._make(column[order[first]] for column in passes)
