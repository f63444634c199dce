"""Passes of many objects on one grid: find the maxima, then refine all peaks and crossings together.

A maximum on the grid is kept unless it cannot reach the mask: within a step the direction turns by no more than the
way moved over the distance.  A dip below the mask between two grid points above it separates two passes.
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
    values = sign * sines
    here, left, right = (
        values[:, inside],
        values[:, MARGIN - 1 : -MARGIN - 1],
        values[:, MARGIN + 1 : 1 - MARGIN or None],
    )
    turning = (here >= left) & (here > right)
    if sign > 0.0:  # the ends of the interval can be the highest of a stay, never the lowest between two
        turning[:, 0] |= here[:, 0] > right[:, 0]
        turning[:, -1] |= here[:, -1] >= left[:, -1]
    moved = np.linalg.norm(np.diff(sky.enu_m[:, inside], axis=1), axis=-1)
    moved = np.concatenate([moved[:, :1], np.maximum(moved[:, 1:], moved[:, :-1]), moved[:, -1:]], axis=1)
    reach = moved / np.linalg.norm(sky.enu_m[:, inside], axis=-1)
    near = (sines[:, inside] > sine_mask - reach) if sign > 0.0 else (here > -sine_mask - reach) & (here < -sine_mask)
    row, column = np.nonzero(turning & near & searched[:, None])
    middle_s = sky.time_s(column + MARGIN)
    low_s, high_s = np.maximum(middle_s - sky.step_s, sky.start_s), np.minimum(middle_s + sky.step_s, end_s)
    return row, sky.turning_times(row, low_s, high_s, sign)


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
