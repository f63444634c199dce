"""A pass that crosses an end of the azimuth travel: wait there, or unwind a turn in mid-pass.

The axis follows the target, leaves it at one corner and comes back onto it at another: it stands at
the end of its travel until the target is within it again, or runs a whole turn back at its rate.
Corners are rounded by a Gaussian of sigma = dv / (A sqrt(2 pi)), which turns a step of the rate dv
with the acceleration A.  Of all ways the one of the least signal lost is taken.
"""

import math
from collections.abc import Iterator

import numpy as np

from rf_pointing.core.types import TURN, Array, Pair
from rf_pointing.planning.crossing import MARGIN_S, AxisMotionLimits, Crossing, Gain, smoothing_kernel
from rf_pointing.planning.forbidden_sky import angle_between

STARTS = 48
"""Instants at which unwinding may begin that are tried."""
INSIDE_RAD = 1e-3
"""The axis waits so far before the end of its travel."""


def within_stops(
    t_s: Array, position: Array, velocity: Array, acceleration: Array, ends_rad: Pair, gain: Gain,
    limits: AxisMotionLimits, target: Array | None = None,
) -> Crossing | None:  # fmt: skip
    """Return the motion of least loss that keeps an azimuth within `ends_rad`; None without one.

    The path (n, 2) is as the axes would have to move, at even times.  One that crosses the zenith
    off its `target` (n, 2) stays within the ends as well; both crossings are one.
    """
    best: tuple[float, Crossing] | None = None
    aim = position if target is None else target
    off = np.flatnonzero(np.any(position != aim, axis=1))
    for wanted, first, last, turns in _ways(t_s, position[:, 0], ends_rad, limits.rate_rad_s[0]):
        way = wanted, min([first, *off[:1]]), max([last, *off[-1:]]), turns
        found = _rounded(t_s, position, velocity, acceleration, way, limits, aim)
        lost = float(np.sum(1.0 - gain(found.error_rad)))
        inside = ends_rad[0] <= found.position_rad[:, 0].min() and found.position_rad[:, 0].max() <= ends_rad[1]
        if inside and (best is None or lost < best[0]):
            best = lost, found
    return best[1] if best else None


def _ways(t_s: Array, azimuth: Array, ends_rad: Pair, rate: float) -> Iterator[tuple[Array, int, int, int]]:
    """Yield azimuths (n,) with corners, the rows of the first and the last one, and the turns."""
    low, high = ends_rad[0] + INSIDE_RAD, ends_rad[1] - INSIDE_RAD
    past = np.flatnonzero((azimuth < low) | (azimuth > high))
    # A path that only its lags lead beyond an end is clipped nowhere.
    if len(past):
        yield np.clip(azimuth, low, high), int(past[0]), int(past[-1]), 0
    rows = np.arange(len(t_s))
    for turns in (-1, 1):
        other = azimuth + turns * TURN
        for first in np.unique(np.linspace(0, len(t_s) - 2, STARTS).astype(int)).tolist():
            reached = np.abs(other - azimuth[first]) <= rate * (t_s - t_s[first])
            if not (later := np.flatnonzero(reached & (rows > first))).size:
                continue
            last = int(later[0])
            way = np.interp(t_s[first:last], t_s[[first, last]], [azimuth[first], other[last]])
            wanted = np.concatenate([azimuth[:first], way, other[last:]])
            if low <= wanted.min() and wanted.max() <= high:
                yield wanted, first, last, turns


def _rounded(
    t_s: Array, position: Array, velocity: Array, acceleration: Array,
    way: tuple[Array, int, int, int], limits: AxisMotionLimits, target: Array,
) -> Crossing:  # fmt: skip
    wanted, first, last, turns = way
    step_s = float(t_s[1] - t_s[0])
    rates = np.diff(wanted) / step_s
    sudden = float(np.max(np.abs(np.diff(rates)), initial=0.0))
    sigma_s = max(sudden / (limits.acceleration_rad_s2[0] * math.sqrt(TURN)), step_s)
    kernel = smoothing_kernel(sigma_s, step_s)
    reach = min(len(kernel) // 2, len(wanted) - 1)
    kernel = kernel[len(kernel) // 2 - reach : len(kernel) // 2 + reach + 1]
    soft = np.convolve(np.pad(wanted, reach, "reflect", reflect_type="odd"), kernel / kernel.sum(), mode="valid")
    beside = reach + round(MARGIN_S / step_s)
    begin, end = max(0, first - beside), min(len(t_s) - 1, last + beside)
    # Where the path begins or ends within the corner there is nothing to come back onto.
    azimuth, part = position[:, 0].copy(), slice(begin, end + 1)
    azimuth[end:] += turns * TURN
    azimuth[part] = soft[part]
    moved = np.column_stack([azimuth, position[:, 1]])
    rate = np.gradient(moved, step_s, axis=0)
    rate[:, 1] = velocity[:, 1]
    bend = np.gradient(rate, step_s, axis=0)
    for row in {begin, end} - {0, len(t_s) - 1}:
        rate[row], bend[row] = velocity[row], acceleration[row]
    error = angle_between(moved[part], target[part])
    middle_s = float(t_s[(first + last) // 2])
    return Crossing(
        t_s[part], moved[part], rate[part], bend[part], error, turn_rad=turns * TURN, turn_t_s=middle_s, at_stop=True
    )
