"""When a device that moves to positions by itself gets which set point, along a motion.

Between two moves the device stands and the target passes.  The mean error is least when it stands
in the middle of what the target passes, so a set point is left when the target, as it will be when
the device can get there, is half a step past it, and the next one is half a step ahead:

    h = max(smallest move, rate * smallest interval) / 2
    p = target(t + latency + h/speed)      left when |p - set point| >= h, next one p + h sign(rate)

The smallest move is never below one step or the dead band, so no relay is closed for a motion that
the device cannot make.  Against the last direction it is the dead band more; what may be the noise
of a tracking loop must last for an interval.

What the device reads is made continuous: joint angle = reading + zero + the turn, which is the one
nearest to the angle before.  The first turn comes from outside.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from operator import add, sub

from rf_pointing.core import TURN, Motion, Pair, nearest_turn_rad
from rf_pointing.drives.drive import Drive, DriveReading
from rf_pointing.drives.params import RotatorParams

RATE_WINDOW_S = 1.0
"""Time over which the rate of a device without tachometers is measured, at least two readings."""
LONGEST_LATENCY_S = 3.0
NEAR_SPEED = 0.7
"""Share of the device's speed from which it must not arrive before its next set point."""
JITTER_S = 0.005
"""How early a tick may come."""
SLOW_SHARE = 0.25
"""Share of the smallest move in an interval below which a motion may be noise."""
SAME_RAD = 1e-9


@dataclass(slots=True)
class MoveCounts:
    """Counts of a relay (azimuth, elevation): set points sent, starts, changes of direction."""

    commands: int = 0
    starts: list[int] = field(default_factory=lambda: [0, 0])
    reversals: list[int] = field(default_factory=lambda: [0, 0])


@dataclass(slots=True)
class _Axis:
    """One axis: its set point, when it was sent, and in which direction it moves."""

    sent: float | None = None
    sent_s: float = -math.inf
    direction: float = 0.0
    timing: tuple[float, float, float] | None = None
    back_since_s: float | None = None


class Rotator:
    """A drive of positions in continuous joint angles; `latency_s` is measured, at first stated."""

    def __init__(self, drive: Drive, params: RotatorParams) -> None:
        self.drive, self.params = drive, params
        self.latency_s = params.latency_s
        self.reading: DriveReading | None = None
        self.position_rad: Pair = (0.0, 0.0)
        self._axes = (_Axis(), _Axis())
        self._history: deque[tuple[float, Pair]] = deque()
        self._sent_s = self._t_s = -math.inf
        self.counts = MoveCounts()

    # What the device reads

    def clock_stepped(self, by_s: float) -> None:
        """Go on with a clock that was set ahead by so much, or back: every wait stays as it was."""
        self._t_s += by_s
        self._sent_s += by_s
        self._history.clear()
        for axis in self._axes:
            axis.timing = axis.back_since_s = None
            axis.sent_s += by_s
        self.drive.clock_stepped(by_s)

    def step(self, t_s: float) -> bool:
        """Let the drive work; return whether there is a new reading."""
        if t_s < self._t_s:
            self.clock_stepped(t_s - self._t_s)
        self._t_s = t_s
        reading = self.drive.step(t_s)
        if reading is None or reading is self.reading:
            return False
        first, self.reading = self.reading is None, reading
        self._take(reading, first)
        return True

    def place(self, azimuth_rad: float) -> None:
        """Take the turn of the azimuth from outside: the one nearest to `azimuth_rad`."""
        if self.drive.capabilities.one_turn:
            here, elevation = self.position_rad
            self.position_rad = nearest_turn_rad(here, azimuth_rad), elevation
            self._history.clear()

    def _take(self, reading: DriveReading, first: bool) -> None:
        azimuth, elevation = map(add, reading.position_rad, self.params.zero_rad)
        if self.drive.capabilities.one_turn and not first:
            azimuth = nearest_turn_rad(azimuth, self.position_rad[0])
        if not self.drive.capabilities.has_elevation:
            # An elevation that the device does not have is where it is set.
            elevation = self._kept(1)
        self.position_rad = azimuth, elevation
        window_s = max(RATE_WINDOW_S, 2.0 * self.drive.capabilities.period_s)
        # After a gap the motion before it says nothing.
        if self._history and not 0.0 <= reading.t_s - self._history[-1][0] <= window_s:
            self._history.clear()
        self._history.append((reading.t_s, self.position_rad))
        while len(self._history) > 2 and self._history[1][0] <= reading.t_s - window_s:
            self._history.popleft()
        self._measure(reading.t_s)

    def correct(self, position_rad: Pair) -> None:
        """Take these angles in place of the newest reading, which is not trusted."""
        self.position_rad = position_rad
        self._history[-1] = self._history[-1][0], position_rad

    @property
    def rate_rad_s(self) -> Pair:
        """Rates over the last second; changes of a single step are not motion."""
        if self.reading is not None and self.reading.rate_rad_s is not None:
            return self.reading.rate_rad_s
        if len(self._history) < 2:
            return 0.0, 0.0
        (begin_s, before), (end_s, after) = self._history[0], self._history[-1]
        steps = zip(before, after, self.drive.capabilities.resolution_rad, strict=True)
        moved = [b - a if abs(b - a) > 1.01 * step else 0.0 for a, b, step in steps]
        elapsed = end_s - begin_s
        return (moved[0] / elapsed, moved[1] / elapsed) if elapsed > 0.0 else (0.0, 0.0)

    def _measure(self, t_s: float) -> None:
        """Move the latency into what the first reading of a motion from rest leaves open."""
        if len(self._history) < 2:
            return
        steps = self.drive.capabilities.resolution_rad
        for axis, step, speed in zip((0, 1), steps, self.params.rate_rad_s, strict=True):
            each, rounding_s = self._axes[axis], 0.5 * step / speed
            if each.timing is None:
                continue
            sent_s, from_rad, goal_rad = each.timing
            moved = abs(self.position_rad[axis] - from_rad)
            if each.sent is None or t_s - sent_s > LONGEST_LATENCY_S:
                each.timing = None
            elif moved >= 0.99 * step:
                each.timing = None
                began_s = t_s - moved / speed
                # A device that has arrived may have begun at any time since the reading before.
                arrived = abs(goal_rad - from_rad) - moved <= 0.5 * step
                low_s = self._history[-2][0] if arrived else began_s
                low_s, high_s = low_s - rounding_s - sent_s, began_s + rounding_s - sent_s
                self.latency_s = max(0.0, min(max(self.latency_s, low_s), high_s))

    def estimate(self, t_s: float) -> Pair:
        """Return where the device is at `t_s`: its reading, moved on towards its set point."""
        if self.reading is None:
            return self.position_rad
        moved = []
        rows = zip(self._axes, self.position_rad, self.params.rate_rad_s, strict=True)
        for axis, here, speed in rows:
            if axis.sent is None:
                moved.append(here)
                continue
            away = axis.sent - here
            reach = speed * max(0.0, t_s - max(self.reading.t_s, axis.sent_s + self.latency_s))
            # Within a step of the set point the reading says no more than the set point.
            moved.append(axis.sent if abs(away) <= reach else here + math.copysign(reach, away))
        return moved[0], moved[1]

    # What the device gets

    @property
    def smallest_rad(self) -> Pair:
        """Smallest moves that are commanded."""
        steps, params = self.drive.capabilities.resolution_rad, self.params
        first, second = map(max, params.minimum_move_rad, steps, params.dead_band_rad)
        return first, second

    @property
    def set_point_rad(self) -> tuple[float | None, float | None]:
        """The set points in force, None where the device was stopped."""
        return self._axes[0].sent, self._axes[1].sent

    def follow(self, t_s: float, motion: Motion, goal: Motion) -> None:
        """Follow `motion`, which chases `goal` (itself for a stop); no set point passes it."""
        if self.reading is None:
            return
        # Also while nothing may be sent: how long a motion has lasted does not wait for it.
        wanted = [self._wanted(axis, t_s, motion, goal, 0.0) for axis in (0, 1)]
        if wanted == [None, None] or t_s - self._sent_s < self.params.minimum_interval_s - JITTER_S:
            return
        # What is sent now blocks the other axis for an interval: it goes along if its turn comes
        # in the first half of it.
        early_s = 0.5 * self.params.minimum_interval_s
        for axis in (0, 1):
            if wanted[axis] is None:
                wanted[axis] = self._wanted(axis, t_s, motion, goal, early_s)
        first, second = wanted
        azimuth = self._kept(0) if first is None else first
        self._send(t_s, (azimuth, self._kept(1) if second is None else second))

    def stop(self) -> None:
        """Stop the device where it is."""
        for axis in self._axes:
            axis.sent, axis.timing, axis.direction = None, None, 0.0
        self._sent_s = -math.inf
        self.drive.stop()

    def count_anew(self) -> None:
        """Begin the counts of a pass."""
        self.counts = MoveCounts()
        for axis in self._axes:
            axis.direction = 0.0

    def _kept(self, axis: int) -> float:
        sent = self._axes[axis].sent
        return sent if sent is not None else self.position_rad[axis]

    def _wanted(
        self, axis: int, t_s: float, motion: Motion, goal: Motion, early_s: float
    ) -> float | None:
        """Return the next set point of an axis, None while the one in force is the best.

        `early_s` before its time it is given up already.
        """
        state, smallest = self._axes[axis], self.smallest_rad[axis]
        step = self.drive.capabilities.resolution_rad[axis]
        rate, speed = float(motion.velocity[axis]), self.params.rate_rad_s[axis]
        share = min(abs(rate) / speed, 1.0)
        interval_s = self.params.minimum_interval_s
        half = 0.5 * max(smallest, abs(rate) * interval_s)
        # A device that barely keeps up must not arrive and stop before its next set point.
        spare_s = interval_s * max(0.0, (share - NEAR_SPEED) / (1.0 - NEAR_SPEED))
        lead_s = self.latency_s + half / speed
        at = _ahead(motion, axis, lead_s)
        here = self._kept(axis)
        off = at - here
        # Where the interval decides, neither the rounding of a set point nor an early tick
        # may cost another tick.
        fast = max(0.0, abs(rate) * interval_s - smallest)
        early = half - abs(rate) * (early_s + JITTER_S) - 0.5 * min(step, fast)
        enough = early if rate != 0.0 else smallest
        back, slow = state.direction * off < 0.0, abs(rate) * interval_s < SLOW_SHARE * smallest
        ahead = rate * state.direction > 0.0 and abs(off) <= half + abs(rate) * spare_s + smallest
        if back and (motion is goal or ahead):
            # A stop ends ahead of where it was commanded, not with a way back; and a set point
            # that is ahead was meant to be.
            return None
        if back:
            enough = half + self.params.dead_band_rad[axis]
        if slow and (back or state.direction == 0.0):
            # The noise of a tracking loop is not motion: a motion lasts.
            if abs(off) < half - SAME_RAD:
                state.back_since_s = None
                return None
            state.back_since_s = t_s if state.back_since_s is None else state.back_since_s
            if t_s - state.back_since_s < interval_s:
                return None
        else:
            state.back_since_s = None
        if abs(off) < enough - SAME_RAD:
            return None
        # Towards a target that comes back there is nothing to be gained by going further.
        wanted = at + math.copysign(half, rate) + rate * spare_s if rate * off > 0.0 else at
        # By the goal's own rate: a chase is faster, and half a step of it would lead past the goal.
        own, end = float(goal.velocity[axis]), _ahead(goal, axis, lead_s)
        if own != 0.0:
            end += math.copysign(0.5 * max(smallest, abs(own) * interval_s), own)
        # Beyond the goal the device would only come back.
        if rate > 0.0:
            wanted = min(wanted, max(end, at))
        elif rate < 0.0:
            wanted = max(wanted, min(end, at))
        low, high = self.params.travel_min_rad[axis], self.params.travel_max_rad[axis]
        zero = self.params.zero_rad[axis]
        wanted = min(max(round((wanted - zero) / step) * step + zero, low), high)
        return wanted if abs(wanted - here) > 0.5 * step else None

    def _send(self, t_s: float, target: Pair) -> None:
        here_rad = self.estimate(t_s)
        for index, axis in enumerate(self._axes):
            new, here = target[index], here_rad[index]
            if axis.sent is not None and abs(new - axis.sent) < SAME_RAD:
                continue
            away = new - here
            standing = axis.sent is None or abs(axis.sent - here) < SAME_RAD
            direction = math.copysign(1.0, away) if away else axis.direction
            self.counts.starts[index] += standing or direction != axis.direction
            self.counts.reversals[index] += direction == -axis.direction and axis.direction != 0.0
            # Measured are moves of a device that had come to rest at its last set point.
            shown = self.position_rad[index]
            rests = len(self._history) > 1 and abs(self._history[-2][1][index] - shown) < SAME_RAD
            step = self.drive.capabilities.resolution_rad[index]
            arrived = axis.sent is None or abs(shown - axis.sent) < 0.51 * step
            if axis.timing is None and rests and arrived:
                axis.timing = t_s, shown, new
            axis.sent, axis.sent_s, axis.direction = new, t_s, direction
        self._sent_s = t_s
        self.counts.commands += 1
        azimuth, elevation = map(sub, target, self.params.zero_rad)
        if self.params.takes_one_turn:
            azimuth %= TURN
        self.drive.go_to((azimuth, elevation))


def _ahead(motion: Motion, axis: int, lead_s: float) -> float:
    """Return where a motion will be; one that slows down ends where it comes to rest."""
    position, rate, acceleration = (float(part[axis]) for part in motion)
    if rate * acceleration < 0.0:
        lead_s = min(lead_s, -rate / acceleration)
    return position + rate * lead_s + 0.5 * acceleration * lead_s * lead_s
