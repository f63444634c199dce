"""Passes of many objects on one grid: find the maxima, then refine all peaks and crossings together.

A maximum on the grid is kept unless it cannot reach the mask: on a way shorter than the distance the direction turns by
no more than the arc sine of their ratio.  A dip below the mask between two grid points above it separates two passes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rf_pointing.ephemeris.roots import roots_between
from rf_pointing.ephemeris.sampled_sky import MARGIN, SampledSky

__all__ = ["GridPasses", "passes_on_grid"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]

_TOLERANCE_S = 1e-3
_COARSE_S = 60.0
_CLOSE_S = 2.0
"""Golden section ends up to this close to the end of an interval over which the elevation only rises or falls."""


@dataclass(frozen=True, eq=False)
class GridPasses:
    """Passes (n,): object row, times [s], and whether they are cut off at the ends of the searched interval."""

    row: Index
    aos_s: Array
    tca_s: Array
    los_s: Array
    rises_before: Flags
    sets_after: Flags


def passes_on_grid(sky: SampledSky, searched: Flags, duration_s: float, sine_mask: float) -> GridPasses:
    """Return the stays above the mask of the `searched` objects, within `duration_s` of the grid's start."""
    sines = sky.sines
    end_s = sky.start_s + duration_s
    row, tca_s = _turning_points(sky, sines, searched, end_s, sine_mask, 1.0)
    peak = sky.sine(row, tca_s)
    row, tca_s, peak = row[peak > sine_mask], tca_s[peak > sine_mask], peak[peak > sine_mask]
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
    sky: SampledSky, sines: Array, searched: Flags, end_s: float, sine_mask: float, sign: float
) -> tuple[Index, Array]:
    """Return rows and times of the maxima (sign 1) that may reach the mask, or the minima (-1) that may dip below."""
    inside = slice(MARGIN, sines.shape[1] - MARGIN)
    turning = _turning_nodes(sign * sines, ends=sign > 0.0)
    if sign < 0.0:  # a dip to below is one from above; the other minima separate nothing
        turning &= sines[:, inside] > sine_mask
    row, column = np.nonzero(turning & searched[:, None])
    speed_m_s = np.linalg.norm(np.diff(sky.enu_m, axis=1), axis=-1) / sky.step_s
    speed = np.maximum(speed_m_s[row, column + MARGIN - 1], speed_m_s[row, column + MARGIN])
    middle_s = sky.time_s(column + MARGIN)
    low_s, high_s = np.maximum(middle_s - sky.step_s, sky.start_s), np.minimum(middle_s + sky.step_s, end_s)
    for width_s in (sky.step_s, _COARSE_S):
        may = _may_reach(sky, row, middle_s, speed * width_s, sine_mask, sign)
        row, speed, low_s, high_s = row[may], speed[may], low_s[may], high_s[may]
        if width_s > _COARSE_S:
            low_s, high_s = sky.narrowed(row, low_s, high_s, sign, _COARSE_S)
        middle_s = 0.5 * (low_s + high_s)
    return row, _or_end(sky, row, sky.turning_times(row, low_s, high_s, sign), end_s, sign)


def _turning_nodes(values: Array, *, ends: bool) -> Flags:
    """Return which of the searched columns are higher than their neighbours; the `ends` need only one lower."""
    here = values[:, MARGIN : values.shape[1] - MARGIN]
    left, right = values[:, MARGIN - 1 : -MARGIN - 1], values[:, MARGIN + 1 : values.shape[1] - MARGIN + 1]
    turning: Flags = (here >= left) & (here > right)
    if ends:
        turning[:, 0] |= here[:, 0] > right[:, 0]
        turning[:, -1] |= here[:, -1] >= left[:, -1]
    return turning


def _may_reach(sky: SampledSky, row: Index, t_s: Array, moved_m: Array, sine_mask: float, sign: float) -> Flags:
    """Return whether the elevation can pass the mask within a way of `moved_m`: it turns by asin(way / distance)."""
    position = sky.position_m(row, t_s)
    distance = np.sqrt(np.einsum("nc,nc->n", position, position))
    elevation = np.arcsin(position[:, 2] / distance)
    reach = np.arcsin(np.minimum(moved_m / distance, 1.0))
    return np.asarray(sign * (elevation - np.arcsin(sine_mask)) > -reach)


def _or_end(sky: SampledSky, row: Index, t_s: Array, end_s: float, sign: float) -> Array:
    """Return the end of the searched interval instead where it is better than a turning point beside it."""
    for bound_s in (sky.start_s, end_s):
        close = np.flatnonzero(np.abs(t_s - bound_s) <= _CLOSE_S)
        at_end = np.full(len(close), bound_s)
        better = sign * sky.sine(row[close], at_end) > sign * sky.sine(row[close], t_s[close])
        t_s[close[better]] = bound_s
    return t_s


def _bracket_nodes(sky: SampledSky, sines: Array, row: Index, tca_s: Array, sine_mask: float) -> tuple[Array, Array]:
    """Return the nearest grid times below the mask before and after each peak; -inf and inf where there is none."""
    inside = sines[:, MARGIN : sines.shape[1] - MARGIN]
    columns = np.arange(inside.shape[1])
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
) -> tuple[Array, Flags]:
    """Return where each object crosses the mask between a time below it and its peak, or the end it is cut off at."""
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
    """Return one pass per stay, at its highest maximum: an eccentric orbit can have several in one stay."""
    order = np.lexsort((-peak, np.round(passes.aos_s, 1), passes.row))
    row, aos_s = passes.row[order], passes.aos_s[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (row[1:] != row[:-1]) | (np.abs(aos_s[1:] - aos_s[:-1]) > 10.0 * _TOLERANCE_S)
    keep = order[first]
    return GridPasses(
        passes.row[keep],
        passes.aos_s[keep],
        passes.tca_s[keep],
        passes.los_s[keep],
        passes.rises_before[keep],
        passes.sets_after[keep],
    )
