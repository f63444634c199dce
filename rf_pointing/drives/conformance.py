"""Whether a drive does what a control unit relies on: one line per property, pass or fail.

Without motion: connection, period and age of the readings, rest, travel.  With motion, towards the
middle of the travel and back: signs, arrival, rates, latency, stop, stale command, limits.
"""

import math
from collections.abc import Callable

import numpy as np

from rf_pointing.core import AXES, Motion
from rf_pointing.core.checks import Line
from rf_pointing.core.types import Pair
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
        self._axes = axes
        self._flown_rad = flown_rad or (
            params.rotator.travel_min_rad,
            params.rotator.travel_max_rad,
        )
        self._rotator = Rotator(drive, params.rotator)
        self._t_s = tick(0.0)
        self._before: dict[str, int] = {}
        self._readings: list[tuple[float, DriveReading, Pair]] = []

    def still(self) -> list[Line]:
        """Return the lines that need no motion; the first one is the connection."""
        begun_s = self._t_s
        self._pass(5.0, lambda: self._rotator.reading is not None)
        if self._rotator.reading is None:
            return [Line("connection", False, self._drive.problem or "no position within 5 s")]
        lines = [Line("connection", True, f"first position after {self._t_s - begun_s:.2f} s")]
        # A controller's dialect is recognised by its first answers.
        self._before = dict(self._drive.losses)
        self._readings.clear()
        self._pass(WATCH_S)
        return [
            *lines,
            self._period(),
            self._age(),
            self._rest("rest"),
            self._inside(),
            self._losses(),
        ]

    def moving(self) -> list[Line]:
        """Move both axes and come back; return the lines."""
        self._drive.enable()
        positions = self._drive.capabilities.set_points == POSITION
        start = self._rotator.position_rad
        lines: list[Line] = []
        for axis, name in enumerate(self._axes):
            if axis == 0 or self._drive.capabilities.has_elevation:
                lines += (
                    self._position_axis(axis, name, start)
                    if positions
                    else self._rate_axis(axis, name)
                )
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
        late = self._readings[len(self._readings) // 2 :]
        spread = [
            max(p[axis] for *_, p in late) - min(p[axis] for *_, p in late) if late else math.inf
            for axis in (0, 1)
        ]
        bound = [1.5 * step for step in self._drive.capabilities.resolution_rad]
        good = all(moved <= limit for moved, limit in zip(spread, bound, strict=True))
        return Line(name, good, f"moves by {_degrees(spread)} deg, at most {_degrees(bound)} deg")

    def _inside(self) -> Line:
        can, rotator = self._drive.capabilities, self._params.rotator
        here, (low, high) = self._rotator.position_rad, self._flown_rad
        axes = [axis for axis in (0, 1) if axis == 0 or can.has_elevation]
        reach = rotator.travel_min_rad, rotator.travel_max_rad
        good = all(reach[0][axis] <= here[axis] <= reach[1][axis] for axis in axes)
        text = (
            ""
            if can.has_elevation
            else "; the device has no elevation: mount.fixed_elevation_deg says where it looks"
        )
        if can.travel_rad is not None and not can.one_turn:
            device = [
                [angle + z for angle, z in zip(ends, rotator.zero_rad, strict=True)]
                for ends in can.travel_rad
            ]
            # A folded azimuth is sent to whatever turn the device takes.
            held = [axis for axis in axes if axis == 1 or not rotator.takes_one_turn]
            good = good and all(low[axis] >= device[0][axis] - SAME_RAD for axis in held)
            good = good and all(high[axis] <= device[1][axis] + SAME_RAD for axis in held)
            text += f"; the device states {_degrees(device[0])} to {_degrees(device[1])} deg"
        return Line(
            "travel",
            good,
            f"at {_degrees(here)}, flown {_degrees(low)} to {_degrees(high)} deg{text}",
        )

    def _losses(self) -> Line:
        new = {
            name: count - self._before.get(name, 0) for name, count in self._drive.losses.items()
        }
        lost = {name: count for name, count in new.items() if count and name != "late answer"}
        text = ", ".join(f"{name}: {count}" for name, count in lost.items()) or "nothing was lost"
        return Line("losses", not lost, text)

    # With motion

    def _position_axis(self, axis: int, name: str, start: Pair) -> list[Line]:
        middle = 0.5 * (
            self._params.rotator.travel_min_rad[axis] + self._params.rotator.travel_max_rad[axis]
        )
        way = math.copysign(self._way_rad, middle - start[axis])
        goal = [*start]
        goal[axis] += way
        other_before = self._rotator.position_rad[1 - axis]
        out = self._go((goal[0], goal[1]))
        moved = self._rotator.position_rad[axis] - start[axis]
        crossed = abs(self._rotator.position_rad[1 - axis] - other_before)
        limit = self._rotator.smallest_rad[axis] + self._drive.capabilities.resolution_rad[axis]
        off = self._rotator.position_rad[axis] - goal[axis]
        lines = [
            Line(f"{name} sign", moved * way > 0.0 and crossed <= limit,
                 f"commanded {math.degrees(way):+.1f}, moved {math.degrees(moved):+.2f} deg, the other axis "
                 f"{math.degrees(crossed):.2f} deg"),
            Line(f"{name} arrival", abs(off) <= limit,
                 f"{math.degrees(off):+.3f} deg off, at most {math.degrees(limit):.3f} deg"),
            self._speed(axis, name, out, way),
            Line(f"{name} latency", self._rotator.latency_s < LONGEST_LATENCY_S,
                 f"{self._rotator.latency_s:.2f} s measured, {self._params.rotator.latency_s:.2f} s stated"),
        ]  # fmt: skip
        self._command(start)
        self._pass(0.5 * abs(way) / self._params.rotator.rate_rad_s[axis] + self._rotator.latency_s)
        lines.append(self._stop(axis, name))
        self._go(start)
        return lines

    def _rate_axis(self, axis: int, name: str) -> list[Line]:
        rotator, start = self._rotator, self._rotator.position_rad[axis]
        middle = 0.5 * (
            self._params.rotator.travel_min_rad[axis] + self._params.rotator.travel_max_rad[axis]
        )
        rate = math.copysign(0.3 * self._drive.capabilities.rate_rad_s[axis], middle - start)
        rates = [0.0, 0.0]
        rates[axis] = rate
        seconds = min(abs(self._way_rad / rate), 20.0)
        self._pass(seconds, turning=(rates[0], rates[1]))
        began = rotator.position_rad[axis]
        self._pass(2.0, turning=(rates[0], rates[1]))
        measured = (rotator.position_rad[axis] - began) / 2.0
        text = f"{math.degrees(measured):+.3f} deg/s, commanded {math.degrees(rate):+.3f} deg/s"
        lines = [
            Line(f"{name} sign", measured * rate > 0.0, text),
            Line(f"{name} rate", abs(measured - rate) <= RATE_SHARE * abs(rate), text),
            self._stop(axis, name),
        ]
        self._drive.enable()
        self._pass(seconds + 2.0, turning=(-rates[0], -rates[1]))
        self._pass(WATCH_S, turning=(0.0, 0.0))
        return lines

    def _speed(self, axis: int, name: str, readings: list[tuple[float, float]], way: float) -> Line:
        stated = self._params.rotator.rate_rad_s[axis]
        inside = [(t_s, angle) for t_s, angle in readings if 0.15 < angle / way < 0.85]
        if len(inside) < 2:
            return Line(f"{name} rate", True, "the way is too short to measure it")
        (begin_s, first), (end_s, last) = inside[0], inside[-1]
        measured = abs(last - first) / (end_s - begin_s)
        spread = 2.0 * self._drive.capabilities.resolution_rad[axis] / (end_s - begin_s)
        good = abs(measured - stated) <= RATE_SHARE * stated + spread
        return Line(
            f"{name} rate",
            good,
            f"{math.degrees(measured):.2f} deg/s measured, {math.degrees(stated):.2f} stated",
        )

    def _stop(self, axis: int, name: str) -> Line:
        self._rotator.stop()
        began_s, where = self._t_s, self._rotator.position_rad[axis]
        self._pass(STOP_S + self._rotator.latency_s)
        at = self._rotator.position_rad[axis]
        self._pass(1.0)
        still = (
            abs(self._rotator.position_rad[axis] - at)
            <= 1.5 * self._drive.capabilities.resolution_rad[axis]
        )
        ran = math.degrees(abs(at - where))
        return Line(f"{name} stop", still, f"ran on for {ran:.2f} deg, {'at rest' if still else 'still moving'} "
                    f"{self._t_s - began_s:.1f} s later")  # fmt: skip

    def _stale(self) -> Line:
        """Check that a rate that is not repeated does not go on for ever."""
        rate = 0.1 * self._drive.capabilities.rate_rad_s[0]
        self._pass(1.0, turning=(rate, 0.0))
        self._pass(WATCH_S)
        at = self._rotator.position_rad[0]
        self._pass(1.0)
        moved = abs(self._rotator.position_rad[0] - at)
        still = moved <= max(1.5 * self._drive.capabilities.resolution_rad[0], 0.1 * rate)
        return Line(
            "stale command",
            still,
            f"{'at rest' if still else 'still moving'} {WATCH_S:.0f} s after the last rate",
        )

    def _beyond(self) -> Line:
        """Check that a set point beyond the travel is cut before it is sent."""
        high = self._params.rotator.travel_max_rad
        start = self._rotator.position_rad
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
        text = f"a set point beyond {math.degrees(high[1]):.1f} deg is cut to {math.degrees(most):.1f} deg"
        return Line("limits", good, text)

    # Time

    def _go(self, goal: Pair) -> list[tuple[float, float]]:
        """Move to a place; return time and distance moved of the farther axis."""
        start = self._rotator.position_rad
        axis = int(np.argmax(np.abs(np.subtract(goal, start))))
        self._readings.clear()
        self._command(goal)
        longest = max(
            abs(b - a) / rate
            for a, b, rate in zip(start, goal, self._params.rotator.rate_rad_s, strict=True)
        )
        self._pass(1.5 * longest + LONGEST_LATENCY_S)
        return [
            (reading.t_s, position[axis] - start[axis]) for _, reading, position in self._readings
        ]

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
                self._readings.append(
                    (self._t_s, self._rotator.reading, self._rotator.position_rad)
                )
            if turning is not None:
                self._drive.turn(turning)
            if until() or self._t_s - begun_s >= seconds:
                return


def _degrees(angles: "list[float] | tuple[float, ...]") -> str:
    return ", ".join(f"{math.degrees(angle):.2f}" for angle in angles)
