"""The motions that the axes may take through a pass: on one side of the zenith or over the top.

A motion is planned for the beam, in the angles of axes that point it without lags.  The lags of the
mount are then added along the motion that the beam makes.  Where the axes would exceed their limits
with both together, the crossing is planned again with what the lags leave.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rf_pointing.core.types import TURN, Array, Pair
from rf_pointing.planning.crossing import AxisMotionLimits, Crossing, Gain, cross
from rf_pointing.planning.limits import AxisLimits, AxisRates, MachineParams
from rf_pointing.planning.over_the_top import cross_over, plunged, unplunged
from rf_pointing.planning.stops import within_stops

Triple = tuple[Array, Array, Array]
# What axes stand ahead of a beam: position, velocity, acceleration (n, 2) from times (n,), rates
# and accelerations (n, 2).
Lag = Callable[[Array, Array, Array], Triple]
# The lags depend on the motion and the motion on what the lags leave: a fixed point, not always
# reached, so the rounds are bounded.
ROUNDS = 4
ANYWHERE = (-math.inf, math.inf)
SLACK = 0.01
# An elevation above its limit by less than this is the arithmetic's.
ROUNDING_RAD = 1e-6
# An end of travel further below the mount's equator than this bounds a keyhole, and no horizon.
FAR_BELOW_RAD = -0.25 * math.pi
# Lags that leave less of the axes than this are left to the loss.
LEAST_SHARE = 0.5


def no_lag(_t_s: Array, rate: Array, acceleration: Array) -> Triple:
    """Lag of a mount without any."""
    still = np.zeros_like(rate)
    return still, still, np.zeros_like(acceleration)


@dataclass(frozen=True)
class BranchMotion:
    """One motion through a pass: `required` by the target, `axes_rad` (n, 2) as done.

    `plunge` is how the dish is at the rise.
    """

    plunge: bool
    required: Triple
    crossing: Crossing | None
    axes_rad: Array


def branch_motions(
    t_s: Array, sides: dict[bool, Triple], machine: MachineParams, limits: AxisLimits, gain: Gain, lag: Lag
) -> list[BranchMotion]:
    """Return every motion through a pass; `sides`: the beam's, by plunged or not."""
    found = []
    for plunge, motion in sides.items():
        # Over the top the whole pass lies beyond the zenith: an end of travel there rules the
        # branch out and is not a reason for a detour.
        ends_rad = ANYWHERE
        if not plunge:
            low_rad = limits.elevation_min_rad
            ends_rad = (low_rad if low_rad < FAR_BELOW_RAD else -math.inf, limits.elevation_max_rad)
        within = partial(cross, t_s, *motion, gain=gain)
        crossing, axes = _planned(t_s, motion, motion, machine.planned, ends_rad, lag, within)
        found.append(BranchMotion(plunge, motion, crossing, axes))
        for stops_rad in _stops(axes[:, 0], limits):
            stopped = partial(_stopped, t_s, motion, stops_rad, gain)
            crossing, axes = _planned(t_s, motion, motion, machine.planned, ends_rad, lag, stopped)
            if crossing is not None:
                found.append(BranchMotion(plunge, motion, crossing, axes))
    # An axis that ends at 95 or 100 deg cannot finish a pass over the top; the branch is
    # made anyway and shown with that reason.
    leans = len(sides) == 2 and limits.elevation_max_rad > 0.5 * math.pi
    for plunge in sides if leans and any(one.crossing for one in found) else ():
        first, second = sides[plunge], sides[not plunge]
        within = partial(_over, t_s, plunge, first, second, gain)
        crossing, axes = _planned(t_s, first, second, machine.planned, ANYWHERE, lag, within)
        if crossing is not None:
            found.append(BranchMotion(plunge, first, crossing, axes))
    return found


def _stops(azimuth: Array, limits: AxisLimits) -> list[Pair]:
    """Return the ends of the travel on each turn that a part of a pass fits, none if all does."""
    low, high = float(azimuth.min()), float(azimuth.max())
    least, most = limits.azimuth_min_rad, limits.azimuth_max_rad
    if math.ceil((least - low) / TURN) <= math.floor((most - high) / TURN):
        return []
    turns = range(math.ceil((least - high) / TURN), math.floor((most - low) / TURN) + 1)
    return [(least - each * TURN, most - each * TURN) for each in turns]


def _stopped(t_s: Array, motion: Triple, stops_rad: Pair, gain: Gain, limits: AxisMotionLimits) -> Crossing | None:
    """Return the way of least loss within the ends of the travel, past the zenith if need be."""
    over = cross(t_s, *motion, limits, gain)
    path = motion if over is None else _joined(t_s, motion, over, motion)
    return within_stops(t_s, *path, stops_rad, gain, limits, motion[0])


def _over(
    t_s: Array, plunge: bool, first: Triple, second: Triple, gain: Gain, limits: AxisMotionLimits
) -> Crossing | None:
    """Return the crossing over the top; one that begins plunged is it with the dish turned."""
    if not plunge:
        return cross_over(t_s, first, second, limits, gain)
    found = cross_over(t_s, unplunged(*first), unplunged(*second), limits, gain)
    if found is None:
        return None
    turned = plunged(found.position_rad, found.velocity_rad_s, found.acceleration_rad_s2)
    position, velocity, acceleration = turned
    return replace(found, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration)


def _planned(
    t_s: Array, first: Triple, second: Triple, most: AxisRates, ends_rad: Pair, lag: Lag,
    crossing_within: Callable[[AxisMotionLimits], Crossing | None],
) -> tuple[Crossing | None, Array]:  # fmt: skip
    """Plan a crossing within what the lags of the mount leave of the axes' rates `most`.

    `ends_rad` are the ends of the upper axis's travel that bound keyholes.

    Return it, and the positions (n, 2) of the axes through the whole pass.
    """
    left, kept_rad = np.ones((2, 2)), ends_rad[1]
    for _ in range(ROUNDS):
        rate, acceleration = (np.array(most) * left).tolist()
        crossing = crossing_within(
            AxisMotionLimits((rate[0], rate[1]), (acceleration[0], acceleration[1]), kept_rad, ends_rad[0])
        )
        beam = first if crossing is None else _joined(t_s, first, crossing, second)
        axes = [part + more for part, more in zip(beam, lag(t_s, beam[1], beam[2]), strict=True)]
        if crossing is None:
            break
        inside = (t_s >= crossing.t_s[0]) & (t_s <= crossing.t_s[-1])
        needed, alone = (np.array([np.abs(part[inside]).max(axis=0) for part in motion[1:]]) for motion in (axes, beam))
        dragged = (needed > (1.0 + SLACK) * np.array(most)) & (needed > (1.0 + SLACK) * alone)
        high_rad = float(axes[0][inside, 1].max()) - ends_rad[1]
        if not (dragged.any() or high_rad > ROUNDING_RAD) or float(left.min()) < LEAST_SHARE:
            break
        # Only axes that the lags drag over their limits get less; the others keep theirs.
        left = np.where(dragged, left * alone / needed, left)
        kept_rad -= max(high_rad, 0.0)
    return crossing, axes[0]


def _joined(t_s: Array, before: Triple, crossing: Crossing, after: Triple) -> Triple:
    """Return the beam's motion through a whole pass with its crossing."""
    first = int(np.searchsorted(t_s, crossing.t_s[0]))
    last = first + len(crossing.t_s)
    inside = (crossing.position_rad, crossing.velocity_rad_s, crossing.acceleration_rad_s2)
    turned = (after[0] + np.array([crossing.turn_rad, 0.0]), after[1], after[2])
    rows = zip(before, inside, turned, strict=True)
    position, velocity, acceleration = (np.concatenate([a[:first], b, c[last:]]) for a, b, c in rows)
    return position, velocity, acceleration
