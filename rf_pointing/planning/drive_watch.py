"""Watches the drives against a model of them: one that moves as its command does not ask has run away.

The model is a rate loop of first order with bounded acceleration,

    w' = clip((command - w) b, -a, a),

held over each tick.  A sound drive changes its rate by something between nothing and that, plus what the wind gives: the
slow mean of what the model leaves while it is linear, at most `disturbance_rad_s2`.  What a drive gains beyond is summed,
less a slack (CUSUM, Page 1954), and must exceed the limit one sample after it has begun to grow; a reading that
no drive could reach is bridged.  A drive that gives its full acceleration is found at the second sample, whatever rate it
runs to.  A weaker or slower drive than the model's is none that runs away.
"""

import math
from collections import deque
from dataclasses import dataclass

from rf_pointing.core import AXES, Params, parameter

__all__ = ["DriveWatch", "DriveWatchParams"]

Pair = tuple[float, float]
JUMP = 3.0
"""A rate that changes by so many times what the drive can give in a tick is a wrong reading."""
BEGUN = 0.2
"""A runaway has gained this share of the limit one sample before it has gained all of it."""


@dataclass(frozen=True, kw_only=True)
class DriveWatchParams(Params):
    """What is known of both drives, and how far one may differ from it."""

    bandwidth_hz: float = parameter(20.0 / (2.0 * math.pi), "bandwidth of the rate loops", low=0.01, high=100.0)
    acceleration_limit_rad_s2: float = parameter(
        math.radians(2.0), "largest acceleration of the drives", low=1e-6, high=100.0
    )
    rate_limit_rad_s: float = parameter(math.radians(2.0), "largest rate of the drives", low=1e-6, high=10.0)
    delay_s: float = parameter(0.0, "time that a command may take to act", low=0.0, high=1.0)
    margin: float = parameter(1.3, "a drive may follow its command so many times faster", low=1.0, high=10.0)
    disturbance_rad_s2: float = parameter(
        math.radians(1.5), "largest steady acceleration by the wind", low=0.0, high=10.0
    )
    disturbance_time_s: float = parameter(0.3, "time in which it becomes known", low=0.02, high=60.0)
    slack_rad_s2: float = parameter(math.radians(0.3), "unexplained acceleration that is no fault", low=0.0, high=10.0)
    gained_rad_s: float = parameter(
        math.radians(0.02), "rate gained without a command that is a runaway; twice it at first", low=1e-6, high=1.0
    )
    excess_rad_s: float = parameter(
        math.radians(0.5), "rate beyond the commanded one that is a runaway, however it came", low=1e-5, high=1.0
    )
    bridged_samples: int = parameter(3, "impossible readings in a row that are bridged", low=0, high=50)
    overspeed: float = parameter(1.1, "rate over the drives' largest that is a runaway", low=1.0, high=3.0)


class _Drive:
    """One drive: its rate at the last sample, the commands that may act by now, wind, and what it gained either way."""

    def __init__(self, commands: int) -> None:
        self.rate: float | None = None
        self.commands: deque[float] = deque(maxlen=commands)
        self.wind = 0.0
        self.gained = (0.0, 0.0)
        self.fast, self.bridged, self.samples = False, 0, 0


class DriveWatch:
    """Both drives; `step` once a tick, in plain floats."""

    def __init__(self, params: DriveWatchParams, tick_s: float) -> None:
        self.params, self._tick_s = params, tick_s
        self._bandwidth = 2.0 * math.pi * params.bandwidth_hz
        self._jump = JUMP * params.acceleration_limit_rad_s2 * tick_s
        self._linear = params.acceleration_limit_rad_s2 / self._bandwidth
        self._follow = 1.0 - math.exp(-tick_s / params.disturbance_time_s)
        self._unknown = params.disturbance_time_s / tick_s
        self._wind, self._slack = params.disturbance_rad_s2 * tick_s, params.slack_rad_s2 * tick_s
        self.reset()

    def reset(self) -> None:
        """Begin with the drives as they are: none has run away, and no wind is known."""
        commands = 1 + math.ceil(self.params.delay_s / self._tick_s - 1e-9)
        self._drives = (_Drive(commands), _Drive(commands))
        self.reason = ""

    def step(self, rate_rad_s: Pair, command_rad_s: Pair) -> str:
        """Return "" or which drive runs away, after a tick that ended at these rates under these commands."""
        found = []
        for name, drive, rate, command in zip(AXES, self._drives, rate_rad_s, command_rad_s, strict=True):
            if not math.isfinite(rate):
                found.append(f"{name} tachometer gives no number")
            elif self._runs_away(drive, rate, command):
                found.append(
                    f"{name} drive runs at {math.degrees(rate):.2f} deg/s, commanded {math.degrees(command):.2f} deg/s"
                )
        self.reason = "; ".join(found)
        return self.reason

    def _runs_away(self, drive: _Drive, rate: float, command: float) -> bool:
        params, before = self.params, drive.rate
        drive.commands.append(command)
        drive.rate, drive.samples = rate, drive.samples + 1
        if before is None:
            return False
        fast, drive.fast = drive.fast, self._fast(before, rate, command)
        up, down = drive.gained
        if abs(rate - before) < self._jump:
            drive.gained, drive.bridged = self._gained(drive, before, rate), 0
        elif drive.bridged < self.params.bridged_samples:
            drive.rate, drive.bridged = before, drive.bridged + 1
        limit = params.gained_rad_s * (1.0 if drive.samples > self._unknown else 2.0)
        gained = any(now > limit and then > BEGUN * limit for now, then in zip(drive.gained, (up, down), strict=True))
        return gained or (fast and drive.fast)

    def _gained(self, drive: _Drive, before: float, rate: float) -> Pair:
        """Return the rates gained upward and downward so far, and learn the wind from what the model leaves."""
        expected = [self._expected(before, each) for each in drive.commands]
        change = rate - before - drive.wind
        (up, down), margin = drive.gained, self.params.margin
        if max(abs(each - before) for each in drive.commands) < self._linear:
            unexplained = rate - before - 0.5 * (min(expected) + max(expected))
            wind = drive.wind + self._follow * (unexplained - drive.wind)
            drive.wind = min(max(wind, -self._wind), self._wind)
        return (
            max(0.0, up + change - margin * max(0.0, *expected) - self._slack),
            max(0.0, down - change + margin * min(0.0, *expected) - self._slack),
        )

    def _fast(self, before: float, rate: float, command: float) -> bool:
        """Return whether a drive is faster than any may be, or than it is told to be without coming nearer to that."""
        if abs(rate) > self.params.overspeed * self.params.rate_limit_rad_s:
            return True
        beyond = abs(rate - command) > self.params.excess_rad_s and abs(rate) > abs(command)
        return beyond and (rate - before) * (command - rate) <= 0.0

    def _expected(self, rate: float, command: float) -> float:
        """Return by how much the model changes its rate in a tick: at full acceleration, then exponentially."""
        limit, bandwidth = self.params.rate_limit_rad_s, self._bandwidth
        gap = min(max(command, -limit), limit) - rate
        left, hard = abs(gap), self.params.acceleration_limit_rad_s2
        full_s = min(self._tick_s, max(0.0, left / hard - 1.0 / bandwidth))
        left -= hard * full_s
        moved = abs(gap) - left * math.exp(-bandwidth * (self._tick_s - full_s))
        return math.copysign(moved, gap)
