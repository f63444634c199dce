"""Whether a drive does what a control unit relies on: one line per property, pass or fail.

Without motion: connection, period and age of the readings, rest, travel.  With motion, towards the
middle of the travel and back: signs, arrival, rates, latency, stop, stale command, limits.
"""

import math
from collections import Counter
from collections.abc import Callable

import numpy as np

from rf_pointing.core import AXES, Line, Motion, Pair
from rf_pointing.drives.drive import POSITION, Drive, DriveReading
from rf_pointing.drives.params import DriveParams
from rf_pointing.drives.rotator import LONGEST_LATENCY_S, Rotator

WATCH_S = 3.0
STOP_S = 1.5
"""Longest run-out after a stop, with the latency in addition."""
RATE_SHARE = 0.25
"""How far a measured speed may be from the stated one."""
SAME_RAD = 1e-9
Clock = Callable[[float], float]
"""Lets a tick pass and returns the time then; the argument is the longest tick in s."""


class ConformanceCheck:
    """The checks of one drive, in the order of the report; `tick` lets time pass.

    `way_rad` is how far each axis is moved, `flown_rad` the lower and the upper ends of the travel
    that is flown, by default all that the parameters let the device reach.
    """

    def __init__(
        self, drive: Drive, params: DriveParams, tick: Clock, way_rad: float = math.radians(10.0),
        flown_rad: tuple[Pair, Pair] | None = None, axes: tuple[str, str] = AXES,
    ) -> None:  # fmt: skip
        self._drive, self._params, self._tick, self._way_rad = drive, params, tick, way_rad
        self._axes, self._rotator = axes, Rotator(drive, params.rotator)
        self._reach_rad = params.rotator.travel_min_rad, params.rotator.travel_max_rad
        self._flown_rad = flown_rad or self._reach_rad
        self._start_rad = (0.0, 0.0)
        self._t_s = tick(0.0)
        self._before: dict[str, int] = {}
        self._readings: list[tuple[float, DriveReading, Pair]] = []

    @property
    def _here_rad(self) -> Pair:
        return self._rotator.position_rad

    @property
    def _own_axes(self) -> tuple[int, ...]:
        return (0, 1) if self._drive.capabilities.has_elevation else (0,)

    def still(self) -> list[Line]:
        """Return the lines that need no motion; the first one is the connection."""
        begun_s = self._t_s
        self._pass(5.0, lambda: self._rotator.reading is not None)
        if self._rotator.reading is None:
            return [Line("connection", False, self._drive.problem or "no position within 5 s")]
        connection = Line("connection", True, f"first position after {self._t_s - begun_s:.2f} s")
        # A controller's dialect is recognised by its first answers.
        self._before = dict(self._drive.losses)
        self._readings.clear()
        self._pass(WATCH_S)
        found = self._period(), self._age(), self._rest("rest"), self._inside(), self._losses()
        return [connection, *found]

    def moving(self) -> list[Line]:
        """Move both axes and come back; return the lines."""
        self._drive.enable()
        self._start_rad = self._here_rad
        positions = self._drive.capabilities.set_points == POSITION
        one_axis = self._position_axis if positions else self._rate_axis
        lines = [line for axis in self._own_axes for line in one_axis(axis, self._axes[axis])]
        lines.append(self._beyond() if positions else self._stale())
        self._drive.stop()
        self._readings.clear()
        self._pass(WATCH_S)
        return [*lines, self._rest("rest after a stop"), self._losses()]

    # Without motion

    def _period(self) -> Line:
        stated_s, count = self._drive.capabilities.period_s, len(self._readings)
        text = f"{count} readings in {WATCH_S:.0f} s, stated {WATCH_S / stated_s:.0f}"
        return Line("period of readings", count >= 0.7 * WATCH_S / stated_s, text)

    def _age(self) -> Line:
        ages = [reading.age_s(t_s) for t_s, reading, _ in self._readings]
        oldest, middle = max(ages, default=math.inf), float(np.median(ages or [-math.inf]))
        limit_s = self._params.link.lost_s
        # Single ones may be younger than a tick that was held up; a clock that is ahead shifts all.
        text = f"{middle:.2f} s when they come, up to {oldest:.2f} s, must be 0 to {limit_s:.2f} s"
        return Line("age of readings", middle >= -1e-3 and oldest <= limit_s, text)

    def _rest(self, name: str) -> Line:
        late = [position for *_, position in self._readings[len(self._readings) // 2 :]]
        spread = np.ptp(late, axis=0).tolist() if late else [math.inf, math.inf]
        bound = [1.5 * step for step in self._drive.capabilities.resolution_rad]
        good = all(moved <= limit for moved, limit in zip(spread, bound, strict=True))
        return Line(name, good, f"moves by {_degrees(spread)} deg, at most {_degrees(bound)} deg")

    def _inside(self) -> Line:
        can, rotator = self._drive.capabilities, self._params.rotator
        here, (low, high), (first, last) = self._here_rad, self._flown_rad, self._reach_rad
        good = all(first[axis] <= here[axis] <= last[axis] for axis in self._own_axes)
        alone = "; the device has no elevation: mount.fixed_elevation_deg says where it looks"
        text = "" if can.has_elevation else alone
        if can.travel_rad is not None and not can.one_turn:
            device = [np.add(ends, rotator.zero_rad).tolist() for ends in can.travel_rad]
            # A folded azimuth is sent to whatever turn the device takes.
            held = [axis for axis in self._own_axes if axis == 1 or not rotator.takes_one_turn]
            good = good and all(low[axis] >= device[0][axis] - SAME_RAD for axis in held)
            good = good and all(high[axis] <= device[1][axis] + SAME_RAD for axis in held)
            text += f"; the device states {_degrees(device[0])} to {_degrees(device[1])} deg"
        flown = f"flown {_degrees(low)} to {_degrees(high)} deg"
        return Line("travel", good, f"at {_degrees(here)}, {flown}{text}")

    def _losses(self) -> Line:
        new = Counter(self._drive.losses) - Counter(self._before)
        lost = {name: count for name, count in new.items() if name != "late answer"}
        text = ", ".join(f"{name}: {count}" for name, count in lost.items()) or "nothing was lost"
        return Line("losses", not lost, text)

    # With motion

    def _inwards(self, axis: int, size: float, start: float) -> float:
        """Return a size with the sign of the way to the middle of the travel."""
        middle = 0.5 * (self._reach_rad[0][axis] + self._reach_rad[1][axis])
        return math.copysign(size, middle - start)

    def _position_axis(self, axis: int, name: str) -> list[Line]:
        start = self._start_rad
        way = self._inwards(axis, self._way_rad, start[axis])
        goal = [*start]
        goal[axis] += way
        other_before = self._here_rad[1 - axis]
        out = self._go((goal[0], goal[1]))
        moved = self._here_rad[axis] - start[axis]
        crossed = abs(self._here_rad[1 - axis] - other_before)
        limit = self._rotator.smallest_rad[axis] + self._drive.capabilities.resolution_rad[axis]
        off = self._here_rad[axis] - goal[axis]
        lines = [
            Line(f"{name} sign", moved * way > 0.0 and crossed <= limit,
                 f"commanded {math.degrees(way):+.1f}, moved {math.degrees(moved):+.2f} deg, "
                 f"the other axis {math.degrees(crossed):.2f} deg"),
            Line(f"{name} arrival", abs(off) <= limit,
                 f"{math.degrees(off):+.3f} deg off, at most {math.degrees(limit):.3f} deg"),
            self._speed(axis, name, out, way),
            Line(f"{name} latency", self._rotator.latency_s < LONGEST_LATENCY_S,
                 f"{self._rotator.latency_s:.2f} s measured, "
                 f"{self._params.rotator.latency_s:.2f} s stated"),
        ]  # fmt: skip
        self._command(start)
        self._pass(0.5 * abs(way) / self._params.rotator.rate_rad_s[axis] + self._rotator.latency_s)
        lines.append(self._stop(axis, name))
        self._go(start)
        return lines

    def _rate_axis(self, axis: int, name: str) -> list[Line]:
        share = 0.3 * self._drive.capabilities.rate_rad_s[axis]
        rate = self._inwards(axis, share, self._here_rad[axis])
        there, back = ((r, 0.0) if axis == 0 else (0.0, r) for r in (rate, -rate))
        seconds = min(abs(self._way_rad / rate), 20.0)
        self._pass(seconds, turning=there)
        began = self._here_rad[axis]
        self._pass(2.0, turning=there)
        measured = (self._here_rad[axis] - began) / 2.0
        text = f"{math.degrees(measured):+.3f} deg/s, commanded {math.degrees(rate):+.3f} deg/s"
        lines = [
            Line(f"{name} sign", measured * rate > 0.0, text),
            Line(f"{name} rate", abs(measured - rate) <= RATE_SHARE * abs(rate), text),
            self._stop(axis, name),
        ]
        self._drive.enable()
        self._pass(seconds + 2.0, turning=back)
        self._pass(WATCH_S, turning=(0.0, 0.0))
        return lines

    def _speed(self, axis: int, name: str, readings: list[Pair], way: float) -> Line:
        stated = self._params.rotator.rate_rad_s[axis]
        inside = [(t_s, angle) for t_s, angle in readings if 0.15 < angle / way < 0.85]
        if len(inside) < 2:
            return Line(f"{name} rate", True, "the way is too short to measure it")
        (begin_s, first), (end_s, last) = inside[0], inside[-1]
        measured = abs(last - first) / (end_s - begin_s)
        spread = 2.0 * self._drive.capabilities.resolution_rad[axis] / (end_s - begin_s)
        good = abs(measured - stated) <= RATE_SHARE * stated + spread
        text = f"{math.degrees(measured):.2f} deg/s measured, {math.degrees(stated):.2f} stated"
        return Line(f"{name} rate", good, text)

    def _stop(self, axis: int, name: str) -> Line:
        self._rotator.stop()
        began_s, where = self._t_s, self._here_rad[axis]
        self._pass(STOP_S + self._rotator.latency_s)
        ran = math.degrees(abs(self._here_rad[axis] - where))
        still, state = self._still(axis)
        text = f"ran on for {ran:.2f} deg, {state} {self._t_s - began_s:.1f} s later"
        return Line(f"{name} stop", still, text)

    def _stale(self) -> Line:
        """Check that a rate that is not repeated does not go on for ever."""
        rate = 0.1 * self._drive.capabilities.rate_rad_s[0]
        self._pass(1.0, turning=(rate, 0.0))
        self._pass(WATCH_S)
        still, state = self._still(0, 0.1 * rate)
        return Line("stale command", still, f"{state} {WATCH_S:.0f} s after the last rate")

    def _still(self, axis: int, bound: float = 0.0) -> tuple[bool, str]:
        """Return whether an axis rests for a second, to 1.5 steps or a bound, and so in words."""
        at = self._here_rad[axis]
        self._pass(1.0)
        most = max(1.5 * self._drive.capabilities.resolution_rad[axis], bound)
        still = abs(self._here_rad[axis] - at) <= most
        return still, "at rest" if still else "still moving"

    def _beyond(self) -> Line:
        """Check that a set point beyond the travel is cut before it is sent."""
        high, start = self._reach_rad[1], self._here_rad
        motion = Motion(np.array([start[0], high[1] + 1.0]), np.zeros(2), np.zeros(2))
        sent: list[Pair] = []
        keep, self._drive.go_to = self._drive.go_to, sent.append  # type: ignore[method-assign, assignment]
        try:
            self._follow(motion)
        finally:
            self._drive.go_to = keep  # type: ignore[method-assign]
        most = max((each[1] + self._params.rotator.zero_rad[1] for each in sent), default=math.nan)
        # NaN, nothing sent, is not a pass.
        good = start[1] < most <= high[1] + SAME_RAD
        end, cut = math.degrees(high[1]), math.degrees(most)
        return Line("limits", good, f"a set point beyond {end:.1f} deg is cut to {cut:.1f} deg")

    # Time

    def _go(self, goal: Pair) -> list[Pair]:
        """Move to a place; return time and distance moved of the farther axis."""
        start = self._here_rad
        away = np.abs(np.subtract(goal, start))
        axis = int(np.argmax(away))
        self._readings.clear()
        self._command(goal)
        longest = float(np.max(away / self._params.rotator.rate_rad_s))
        self._pass(1.5 * longest + LONGEST_LATENCY_S)
        return [(reading.t_s, place[axis] - start[axis]) for _, reading, place in self._readings]

    def _command(self, goal: Pair) -> None:
        self._follow(Motion(np.array(goal), np.zeros(2), np.zeros(2)))

    def _follow(self, motion: Motion) -> None:
        """Command a place for as long as it may be taken for noise."""
        begun_s = self._t_s
        while self._t_s - begun_s < 2.0 * self._params.rotator.minimum_interval_s + 0.1:
            self._rotator.follow(self._t_s, motion, Motion(*motion))
            self._pass(0.0)

    def _pass(
        self, seconds: float, until: Callable[[], bool] = lambda: False, turning: Pair | None = None
    ) -> None:
        """Let time pass and keep the readings; `turning` is repeated at every tick."""
        begun_s = self._t_s
        while True:
            self._t_s = self._tick(0.02)
            if self._rotator.step(self._t_s) and self._rotator.reading is not None:
                self._readings.append((self._t_s, self._rotator.reading, self._here_rad))
            if turning is not None:
                self._drive.turn(turning)
            if until() or self._t_s - begun_s >= seconds:
                return


def _degrees(angles: "list[float] | tuple[float, ...]") -> str:
    return ", ".join(f"{math.degrees(angle):.2f}" for angle in angles)
