"""Crossing the zenith with an azimuth axis that is too slow for it, and what the crossing costs.

An azimuth-elevation mount sees a pass near the zenith turn its azimuth by half a turn faster than
the axis can; any other mount its lower axis, at either end of its pole.  Clipping the rate makes
the beam lag through the whole crossing and far beyond.  The best motion follows the target, leaves
it early at full acceleration and rate, lets it overtake, and comes back onto it at the limits:
follow - bang - follow, the structure that the maximum principle gives for a loss that grows with
the error.  With departure (t_a, az_a, v_a) the return t_b solves

    az_a + V (t_b - t_a) - (V - v_a)^2 / 2A - (V - v_b)^2 / 2A = az(t_b)

so one number, t_a, is left.  It minimises the signal lost, the integral of 1 - g(error).  The
elevation axis helps: for an azimuth error D the nearest elevation to a target at e is
atan2(sin e, cos e cos D).
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.core.pass_outcome import HALF_POWER, SIDELOBE_POWER, pointing_loss_db
from rf_pointing.core.types import Array, BoolArray, Pair
from rf_pointing.planning.forbidden_sky import angle_between

# Power received relative to the beam's peak at angles (n,) from its axis.
Gain = Callable[[Array], Array]

# Share of the largest error from which the beam counts as off the target.
# Relative to the largest error, so that the time off target does not depend on the beam.
OFF_TARGET = 0.05
# Bounds of the search for the departure: four minutes before the limits are reached, COARSE
# starts, then ever finer around the best.
EARLIEST_S = 240.0
COARSE = 32
REFINEMENTS = 4
# Widths of the elevation's smoothing that are tried: the nearest elevation has a corner where the
# target overtakes the beam.
SMOOTHINGS_S = (0.5, 1.0, 2.0, 4.0)
# A crossing begins and ends so long before and after the axes leave the target by more than this.
ON_TARGET_RAD, MARGIN_S = 1e-5, 4.0


@dataclass(frozen=True, slots=True)
class AxisMotionLimits:
    """Largest rates and accelerations (azimuth, elevation) and highest elevation of the axes."""

    rate_rad_s: Pair
    acceleration_rad_s2: Pair
    elevation_max_rad: float
    elevation_min_rad: float = -math.inf
    """Lowest one where it bounds a keyhole, as on an axis that swings to either side."""


@dataclass(frozen=True, slots=True)
class Crossing:
    """Axis motion (n, 2) that replaces the target's in `t_s` (n,); `error_rad` (n,) is left."""

    t_s: Array
    position_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    error_rad: Array
    over_t_s: float | None = None
    """When the dish goes over the top, for a crossing that ends on the other side."""
    turn_rad: float = 0.0
    """Whole turns by which the azimuth is moved at `turn_t_s`."""
    turn_t_s: float | None = None
    at_stop: bool = False
    """Whether an end of the azimuth's travel is crossed, and not the zenith."""

    @property
    def duration_s(self) -> float:
        """Time for which the antenna is not on the target."""
        return float(self.t_s[-1] - self.t_s[0])


def cross(
    t_s: Array, position: Array, velocity: Array, acceleration: Array, limits: AxisMotionLimits, gain: Gain
) -> Crossing | None:
    """Return the crossing of least loss of a path (n, 2) at even times, None when none is needed.

    The path is as the axes would have to move, azimuth continuous.  Where it comes near the pole
    below as well as that above, both crossings are one, on the target in between.
    """
    rate, limit = limits.rate_rad_s[0], limits.acceleration_rad_s2[0]
    # Rate and acceleration count apart: either may exceed its limit where the other does not.
    fast = (np.abs(velocity[:, 0]) > rate) | (np.abs(acceleration[:, 0]) > limit)
    off = fast | (position[:, 1] > limits.elevation_max_rad) | (position[:, 1] < limits.elevation_min_rad)
    rows = np.flatnonzero(off)
    if len(rows) == 0:
        return None
    swaps = np.flatnonzero(np.diff(position[rows, 1] < 0.0))
    cuts = [0, *((rows[swaps] + rows[swaps + 1]) // 2).tolist(), len(t_s)]
    found = []
    for first, end in itertools.pairwise(cuts):
        part = slice(first, end)
        below = bool(position[rows[(rows >= first) & (rows < end)][0], 1] < 0.0)
        # The pole below is that above, seen in a mirror.
        mirror = np.array([1.0, -1.0 if below else 1.0])
        seen = replace(limits, elevation_max_rad=-limits.elevation_min_rad) if below else limits
        path = (position[part] * mirror, velocity[part] * mirror, acceleration[part] * mirror)
        one = _cross_above(t_s[part], *path, fast[part], seen, gain)
        if below:
            one = replace(
                one, position_rad=one.position_rad * mirror, velocity_rad_s=one.velocity_rad_s * mirror,
                acceleration_rad_s2=one.acceleration_rad_s2 * mirror,
            )  # fmt: skip
        found.append(one)
    return found[0] if len(found) == 1 else _joined(t_s, (position, velocity, acceleration), found)


def _joined(t_s: Array, path: tuple[Array, Array, Array], found: list[Crossing]) -> Crossing:
    """Return crossings in order of their times as one, the path itself in between."""
    first, end = (int(np.searchsorted(t_s, at)) for at in (found[0].t_s[0], found[-1].t_s[-1]))
    rows, error = [each.copy() for each in path], np.zeros(len(t_s))
    for each in found:
        begin = int(np.searchsorted(t_s, each.t_s[0]))
        part = slice(begin, begin + len(each.t_s))
        for row, own in zip(rows, (each.position_rad, each.velocity_rad_s, each.acceleration_rad_s2), strict=True):
            row[part] = own
        error[part] = each.error_rad
    whole = slice(first, end + 1)
    return Crossing(t_s[whole], rows[0][whole], rows[1][whole], rows[2][whole], error[whole])


def _cross_above(
    t_s: Array, position: Array, velocity: Array, acceleration: Array, fast: BoolArray, limits: AxisMotionLimits,
    gain: Gain,
) -> Crossing:  # fmt: skip
    """Return the crossing of a path past the pole above; `fast` (n,) is where it exceeds limits."""
    inside = np.flatnonzero(fast | (position[:, 1] > limits.elevation_max_rad))
    first, last = int(inside[0]), int(inside[-1])
    step_s = float(t_s[1] - t_s[0])
    path = _Path(t_s, position, velocity, limits, math.copysign(1.0, position[last, 0] - position[first, 0]))
    # Only the elevation's travel is too short: the azimuth follows the target.
    if not fast.any():
        return _finish(path, position[:, 0], first, last, gain, acceleration)
    earliest = max(0, first - round(EARLIEST_S / step_s))
    best = (math.inf, first, last, position[:, 0])
    candidates = np.unique(np.linspace(earliest, first, COARSE).astype(int))
    # The loss over t_a is smooth but has no derivative at hand: a grid around the best, ever finer.
    for _ in range(REFINEMENTS):
        for start in candidates:
            azimuth, end = path.bang(int(start), last)
            lost = path.lost_s(azimuth, int(start), end, gain)
            if lost < best[0]:
                best = lost, int(start), end, azimuth
        spacing = max(1, int(np.max(np.diff(candidates), initial=1)))
        low, high_index = max(earliest, best[1] - spacing), min(first, best[1] + spacing)
        candidates = np.unique(np.linspace(low, high_index, 9).astype(int))
    _, start, end, azimuth = best
    return _finish(path, azimuth, start, end, gain, acceleration)


class _Path:
    """The path of one pass, with the bang segments that leave it and come back."""

    def __init__(self, t_s: Array, position: Array, velocity: Array, limits: AxisMotionLimits, side: float) -> None:
        self.t_s, self.position, self.velocity = t_s, position, velocity
        self.limits, self.side = limits, side
        self.step_s = float(t_s[1] - t_s[0])

    def bang(self, start: int, last: int) -> tuple[Array, int]:
        """Return the azimuth (n,) that leaves the path at `start`, and the index of its return."""
        rate, limit = self.limits.rate_rad_s[0], self.limits.acceleration_rad_s2[0]
        ahead = self.side * self.position[:, 0]
        # A target that is already too fast is left at the axis's own rate.
        speed = np.minimum(self.side * self.velocity[:, 0], rate)
        lead = (rate - speed[start]) ** 2 / (2.0 * limit)
        tail = (rate - speed) ** 2 / (2.0 * limit)
        elapsed = self.t_s - self.t_s[start]
        reach = ahead[start] + rate * elapsed - lead - tail - ahead
        shortest = (2.0 * rate - speed[start] - speed) / limit
        back = np.flatnonzero((reach >= 0.0) & (elapsed >= shortest) & (np.arange(len(ahead)) > last))
        end = int(back[0]) if len(back) else len(ahead) - 1
        azimuth = self.position[:, 0].copy()
        inside = slice(start, end + 1)
        azimuth[inside] = self.side * self._bang_positions(start, end, ahead, speed, bool(len(back)))
        return azimuth, end

    def _bang_positions(self, start: int, end: int, ahead: Array, speed: Array, returns: bool) -> Array:
        """Accelerate to the limit, run, decelerate to the path's own rate at `end`.

        The exact return lies between two samples; what the run is too far at the later one comes
        off it smoothly.
        """
        rate, limit = self.limits.rate_rad_s[0], self.limits.acceleration_rad_s2[0]
        t: Array = self.t_s[start : end + 1] - self.t_s[start]
        up, down = (rate - speed[start]) / limit, (rate - speed[end]) / limit
        out = ahead[start] + rate * t - 0.5 * limit * (up**2 - np.maximum(up - t, 0.0) ** 2)
        if not returns:
            return np.asarray(out)
        out = out - 0.5 * limit * np.maximum(t - (t[-1] - down), 0.0) ** 2
        share = t / t[-1]
        return np.asarray(out - (out[-1] - ahead[end]) * share**2 * (3.0 - 2.0 * share))

    def error_rad(self, azimuth: Array, elevation: Array, part: slice) -> Array:
        """Return the angle between target and beam at azimuth (n,) and `elevation` in `part`."""
        return angle_between(np.column_stack([azimuth[part], elevation]), self.position[part])

    def lost_s(self, azimuth: Array, start: int, end: int, gain: Gain, elevation: Array | None = None) -> float:
        """Return the integral of 1 - gain, with the nearest elevation unless one is given."""
        part = slice(start, end + 1)
        chosen = self.nearest_elevation(azimuth, part) if elevation is None else elevation[part]
        return float(np.sum(1.0 - gain(self.error_rad(azimuth, chosen, part))) * self.step_s)

    def nearest_elevation(self, azimuth: Array, part: slice) -> Array:
        """Return the elevation within the travel that comes nearest to the target."""
        best = nearest_elevation(azimuth[part] - self.position[part, 0], self.position[part, 1])
        return np.asarray(np.minimum(best, self.limits.elevation_max_rad))


def nearest_elevation(off_rad: Array, elevation_rad: Array) -> Array:
    """Return the elevation at which a beam `off_rad` (n,) in azimuth comes nearest to a target."""
    return np.asarray(np.arctan2(np.sin(elevation_rad), np.cos(elevation_rad) * np.cos(off_rad)))


def smoothing_kernel(width_s: float, step_s: float) -> Array:
    """Return the weights of a Gaussian average, three widths to either side."""
    reach = round(3.0 * width_s / step_s)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step_s / width_s) ** 2)
    return np.asarray(kernel / kernel.sum())


def _finish(path: _Path, azimuth: Array, start: int, end: int, gain: Gain, acceleration: Array) -> Crossing:
    """Choose the elevation that the axis can do and that loses least; return the crossing."""
    margin = round(4.0 * max(SMOOTHINGS_S) / path.step_s)
    first, last = max(0, start - margin), min(len(path.t_s) - 1, end + margin)
    part = slice(first, last + 1)
    best: tuple[float, Array] | None = None
    for elevation in _elevations(path, azimuth):
        rate = np.gradient(elevation, path.step_s)
        bent = np.abs(np.gradient(rate, path.step_s))[part]
        possible = (
            np.abs(rate[part]).max() <= path.limits.rate_rad_s[1]
            and bent.max() <= path.limits.acceleration_rad_s2[1]
            and elevation[part].max() <= path.limits.elevation_max_rad + 1e-9
        )
        lost = path.lost_s(azimuth, first, last, gain, elevation) if possible else math.inf
        if best is None or lost < best[0]:
            best = lost, elevation
    # The target's own elevation is always a candidate, so there is one.
    assert best is not None
    moved = np.column_stack([azimuth, best[1]])
    off = first + np.flatnonzero(np.max(np.abs(moved - path.position)[part], axis=1) > ON_TARGET_RAD)
    start, end = (int(off[0]), int(off[-1])) if len(off) else (start, end)
    beside = round(MARGIN_S / path.step_s)
    first, last = max(first, start - beside), min(last, end + beside)
    part = slice(first, last + 1)
    velocity = np.gradient(moved, path.step_s, axis=0)
    # Outside the window the motion is the target's own, not its difference quotient.
    velocity[:first], velocity[last + 1 :] = path.velocity[:first], path.velocity[last + 1 :]
    bend = np.gradient(velocity, path.step_s, axis=0)
    error = path.error_rad(azimuth, best[1][part], part)
    velocity[[first, last]], bend[[first, last]] = path.velocity[[first, last]], acceleration[[first, last]]
    return Crossing(path.t_s[part], moved[part], velocity[part], bend[part], error)


def _elevations(path: _Path, azimuth: Array) -> list[Array]:
    """Return elevations to choose from: the target's own, and the nearest one, smoothed."""
    own = np.minimum(path.position[:, 1], path.limits.elevation_max_rad)
    wanted = path.nearest_elevation(azimuth, slice(None)) - path.position[:, 1]
    choices = [own]
    for width_s in SMOOTHINGS_S:
        kernel = smoothing_kernel(width_s, path.step_s)
        reach = len(kernel) // 2
        soft = np.convolve(np.pad(wanted, reach, mode="edge"), kernel, mode="valid")
        choices += [path.position[:, 1] + share * soft for share in (0.5, 1.0)]
        choices.append(np.convolve(np.pad(own, reach, mode="edge"), kernel, mode="valid"))
    return choices


@dataclass(frozen=True, slots=True)
class CrossingLoss:
    """Loss of a pass by a crossing from `begin_s` on, by `core.pass_outcome`.

    Seconds off the target, seconds below half power, seconds of signal lost (the integral of
    1 - g), and the deepest loss in dB.
    """

    keyhole_s: float = 0.0
    lost_s: float = 0.0
    lost_signal_s: float = 0.0
    peak_loss_db: float = 0.0

    @classmethod
    def of(cls, crossing: Crossing | None, gain: Gain, begin_s: float = -math.inf) -> "CrossingLoss":
        """Return the cost of what lies after `begin_s`; nothing without a crossing."""
        if crossing is None or begin_s > crossing.t_s[-1]:
            return cls()
        step_s, ahead = float(crossing.t_s[1] - crossing.t_s[0]), crossing.t_s >= begin_s
        off = crossing.error_rad[ahead] > OFF_TARGET * np.max(crossing.error_rad)
        seconds = float(np.sum(off) * step_s)
        return cls(keyhole_s=seconds, **cls.of_errors(crossing.error_rad[ahead], gain, step_s))

    @staticmethod
    def of_errors(error_rad: Array, gain: Gain, step_s: float) -> dict[str, float]:
        """Return the cost of angles (n,) off the beam axis, `step_s` apart, without `keyhole_s`."""
        received = np.maximum(gain(error_rad), SIDELOBE_POWER)
        return {
            "lost_s": float(np.sum(received < HALF_POWER) * step_s),
            "lost_signal_s": float(np.sum(1.0 - received) * step_s),
            "peak_loss_db": float(pointing_loss_db(received.min())),
        }
