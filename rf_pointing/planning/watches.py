"""Watches of the antenna's own sensors, drives and wind: each gives "" or the reason to stop.

Encoders.  The tachometer carries the last trusted angle on.  A sample off that prediction is
bridged by it.  The fourth in a row, or a difference that grows within the window, is a fault.

Drives.  The model is a rate loop of first order with bounded acceleration, held over each tick:

    w' = clip((command - w) b, -a, a)

A sound drive changes its rate by something between nothing and that, plus what the wind gives: the
slow mean of what the model leaves while it is linear, at most `disturbance_rad_s2`.  What a drive
gains beyond is summed, less a slack (CUSUM, Page 1954), and must exceed the limit one sample after
it has begun to grow.  A reading that no drive could reach is bridged.  A drive at full acceleration
is found at the second sample, whatever its rate.  A drive weaker or slower than the model is sound.

Wind.  The 3-s gust and the 10-min mean (WMO No. 8), with hysteresis.  A silent anemometer counts as
high wind.
"""

import math
from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from rf_pointing.core import AXES, Pair, Params, parameter

# A rate that changes by so many times what the drive can give in a tick is a wrong reading.
JUMP = 3.0
# A runaway has gained this share of the limit one sample before it has gained all of it.
BEGUN = 0.2
NO_NUMBER = "encoder reads nan, must be a number"
LATE_TICKS = 2.5
"""Ticks between two samples from which on the comparison of a window begins anew."""
LONGEST_S = 1.0
"""Longest time between two samples for which commands are kept."""
GUST_S = 3.0
MEAN_S = 600.0


@dataclass(frozen=True, kw_only=True)
class AxisWatchParams(Params):
    """Differences between encoder and tachometer from which on an axis is at fault."""

    jump_rad: float = parameter(math.radians(0.03), "encoder off its prediction in one tick", 1e-6, 1.0)
    bridged_samples: int = parameter(3, "samples in a row that are bridged", 0, 50)
    drift_rad: float = parameter(math.radians(0.03), "encoder off the integrated rate within the window", 1e-6, 1.0)
    frozen_rad: float = parameter(
        math.radians(0.008), "motion by the tachometer during which the encoder must change", 1e-7, 1.0
    )
    window_s: float = parameter(0.16, "window of the comparison", 0.02, 2.0)


class _Axis:
    """One axis: trusted angle, and the last window of encoder and integrated rate."""

    def __init__(self, samples: int) -> None:
        self.trusted: float | None = None
        self.raw = math.nan
        self.rate = 0.0
        self.bad = 0
        self.travel = 0.0
        self.frozen_travel = 0.0
        self.window: deque[Pair] = deque(maxlen=samples)
        self.shown: deque[Pair] = deque(maxlen=samples)


class AxisWatch:
    """Both axes, of these names; `step` once a tick, in plain floats."""

    def __init__(self, params: AxisWatchParams, tick_s: float, names: Sequence[str] = AXES) -> None:
        self.params, self._tick_s, self._names = params, tick_s, names
        # The window holds at least one difference.
        self._samples = max(2, round(params.window_s / tick_s) + 1)
        self.reset()

    def reset(self) -> None:
        """Trust the next encoder samples as they come."""
        self._axes = (_Axis(self._samples), _Axis(self._samples))
        self.reason = ""

    def step(self, encoder_rad: Pair, rate_rad_s: Pair, passed_s: float | None = None) -> tuple[Pair, str]:
        """Return the angles to use, bridged where a sample is not trusted, and "" or the reason.

        `passed_s` is the time since the sample before, None for one tick.
        """
        passed_s = self._tick_s if passed_s is None else passed_s
        first, second = self._axes
        azimuth, reason = self._angle(first, encoder_rad[0], rate_rad_s[0], passed_s)
        elevation, other = self._angle(second, encoder_rad[1], rate_rad_s[1], passed_s)
        self.reason = ""
        if reason or other:
            self.reason = "; ".join(
                f"{name} {text}" for name, text in zip(self._names, (reason, other), strict=True) if text
            )
        return (azimuth, elevation), self.reason

    @property
    def cause(self) -> str:
        """Fault that the last window alone still shows, "" once the sensors agree again."""
        found = []
        for name, axis in zip(self._names, self._axes, strict=True):
            shown = list(axis.shown)
            drift = (shown[-1][0] - shown[0][0]) - (shown[-1][1] - shown[0][1]) if shown else 0.0
            if not all(math.isfinite(encoder) for encoder, _ in shown):
                found.append(f"{name} {NO_NUMBER}")
            elif abs(drift) > self.params.drift_rad:
                found.append(f"{name} {self._drifted(drift)}")
        return "; ".join(found)

    def _angle(self, axis: _Axis, encoder: float, rate: float, passed_s: float) -> tuple[float, str]:
        params, jump_rad = self.params, self.params.jump_rad
        if axis.trusted is None:
            if not math.isfinite(encoder):
                return 0.0, NO_NUMBER
            axis.trusted, axis.raw = encoder, encoder
            return encoder, ""
        # A tachometer without a number leaves the encoder on its own for this tick.
        known = math.isfinite(rate)
        moved = rate * passed_s if known else 0.0
        if passed_s > LATE_TICKS * self._tick_s:
            # The rate may have changed meanwhile: the mean of both ends, and more tolerance.
            moved = 0.5 * (moved + axis.rate * passed_s)
            jump_rad *= passed_s / self._tick_s
            axis.window.clear()
            axis.shown.clear()
        axis.rate = rate if known else axis.rate
        predicted = axis.trusted + moved
        axis.travel += moved
        axis.shown.append((encoder, axis.travel))
        off = encoder - predicted
        # Written so that NaN counts as a jump.
        if not -jump_rad <= off <= jump_rad:
            axis.bad += 1
            axis.trusted = predicted
            text = (
                f"encoder jumped by {math.degrees(off):.3f} deg, at most {math.degrees(jump_rad):.3f} deg"
                if math.isfinite(off)
                else NO_NUMBER
            )
            return predicted, text if axis.bad > params.bridged_samples else ""
        axis.bad = 0
        # An encoder that repeats its value to the last bit while the drive moves has frozen.
        axis.frozen_travel = axis.frozen_travel + moved if encoder == axis.raw else 0.0
        axis.trusted = axis.raw = encoder
        axis.window.append((encoder, axis.travel))
        if not -params.frozen_rad <= axis.frozen_travel <= params.frozen_rad:
            return encoder, (
                f"encoder stands still while the drive moved {math.degrees(axis.frozen_travel):.3f} deg, "
                f"at most {math.degrees(params.frozen_rad):.3f} deg"
            )
        first = axis.window[0]
        drift = (encoder - first[0]) - (axis.travel - first[1])
        if not -params.drift_rad <= drift <= params.drift_rad:
            return encoder, self._drifted(drift)
        return encoder, ""

    def _drifted(self, drift: float) -> str:
        return (
            f"encoder moved {math.degrees(drift):.3f} deg more than the drive, "
            f"at most {math.degrees(self.params.drift_rad):.3f} deg"
        )


@dataclass(frozen=True, kw_only=True)
class DriveWatchParams(Params):
    """Known response of both drives, and how far one may differ from it."""

    bandwidth_hz: float = parameter(20.0 / (2.0 * math.pi), "bandwidth of the rate loops", 0.01, 100.0)
    acceleration_limit_rad_s2: float = parameter(math.radians(2.0), "largest acceleration of the drives", 1e-6, 100.0)
    rate_limit_rad_s: float = parameter(math.radians(2.0), "largest rate of the drives", 1e-6, 10.0)
    delay_s: float = parameter(0.0, "time that a command may take to act", 0.0, 1.0)
    margin: float = parameter(1.3, "a drive may follow its command so many times faster", 1.0, 10.0)
    disturbance_rad_s2: float = parameter(math.radians(1.5), "largest steady acceleration by the wind", 0.0, 10.0)
    disturbance_time_s: float = parameter(0.3, "time in which it becomes known", 0.02, 60.0)
    slack_rad_s2: float = parameter(math.radians(0.3), "unexplained acceleration that is not a fault", 0.0, 10.0)
    gained_rad_s: float = parameter(
        math.radians(0.02), "rate gained without a command that is a runaway; twice it at first", 1e-6, 1.0
    )
    excess_rad_s: float = parameter(
        math.radians(0.5), "rate beyond the commanded one that is a runaway, however it came", 1e-5, 1.0
    )
    bridged_samples: int = parameter(3, "impossible readings in a row that are bridged", 0, 50)
    overspeed: float = parameter(1.1, "rate over the drives' largest that is a runaway", 1.0, 3.0)


class _Drive:
    """One drive: its last rate, the commands that may act by now, wind, and what it gained."""

    def __init__(self, commands: int) -> None:
        self.rate: float | None = None
        self.commands: deque[float] = deque(maxlen=commands)
        self.wind = 0.0
        self.gained = (0.0, 0.0)
        self.fast, self.bridged, self.samples = "", 0, 0


class DriveWatch:
    """Both drives, of axes of these names; `step` once a tick, in plain floats."""

    def __init__(self, params: DriveWatchParams, tick_s: float, names: Sequence[str] = AXES) -> None:
        self.params, self._tick_s, self._names = params, tick_s, names
        self._bandwidth = 2.0 * math.pi * params.bandwidth_hz
        self._jump = JUMP * params.acceleration_limit_rad_s2 * tick_s
        self._linear = params.acceleration_limit_rad_s2 / self._bandwidth
        self._delay = math.ceil(params.delay_s / tick_s - 1e-9)
        self._unknown = params.disturbance_time_s / tick_s
        self._wind, self._slack = params.disturbance_rad_s2 * tick_s, params.slack_rad_s2 * tick_s
        # What a tick leaves of a gap of rates, and of a difference of winds: computed once.
        self._left, self._follow = self._over(tick_s)
        self.reset()

    def _over(self, passed_s: float) -> Pair:
        return (math.exp(-self._bandwidth * passed_s), 1.0 - math.exp(-passed_s / self.params.disturbance_time_s))

    def reset(self) -> None:
        """Begin with the drives as they are: none has run away, and no wind is known."""
        commands = self._delay + math.ceil(LONGEST_S / self._tick_s)
        self._drives = (_Drive(commands), _Drive(commands))
        self.reason = ""

    def step(self, rate_rad_s: Pair, command_rad_s: Pair, passed_s: float | None = None) -> str:
        """Return "" or which drive runs away, after a tick that ended at these rates.

        `passed_s` is the time since the sample before: None for one tick, 0 where there is no new
        sample, so that only the commands are noted.
        """
        found, passed_s = [], self._tick_s if passed_s is None else passed_s
        for name, drive, rate, command in zip(self._names, self._drives, rate_rad_s, command_rad_s, strict=True):
            drive.commands.append(command)
            if not math.isfinite(rate):
                found.append(f"{name} tachometer reads {rate}, must be a number")
            elif passed_s > 0.0 and (reason := self._runaway(drive, rate, passed_s)):
                found.append(f"{name} drive runs at {math.degrees(rate):.2f} deg/s, {reason}")
        self.reason = "; ".join(found) if found else ""
        return self.reason

    def _runaway(self, drive: _Drive, rate: float, passed_s: float) -> str:
        """Return how a drive runs away, with the bound that it exceeds, "" if it does not."""
        params, before = self.params, drive.rate
        ticks = passed_s / self._tick_s
        count = self._delay + (1 if ticks == 1.0 else max(1, round(ticks)))
        acting = [drive.commands[-1]] if count == 1 else list(drive.commands)[-count:]
        drive.rate, drive.samples = rate, drive.samples + 1
        if before is None:
            return ""
        # Twice in a row: one wrong reading of the tachometer is not a runaway.
        was_fast, drive.fast = drive.fast, self._fast(before, rate, acting)
        up, down = drive.gained
        if abs(rate - before) < self._jump * ticks:
            drive.gained, drive.bridged = self._gained(drive, before, rate, acting, passed_s), 0
        # A change that no drive can make is a fault of the tachometer, for a few samples.
        elif drive.bridged < self.params.bridged_samples:
            drive.rate, drive.bridged = before, drive.bridged + 1
        # Until the wind is known it counts as gained, so the limit is twice as wide.
        limit = params.gained_rad_s * (1.0 if drive.samples > self._unknown else 2.0)
        for now, then in ((drive.gained[0], up), (drive.gained[1], down)):
            if now > limit and then > BEGUN * limit:
                return (
                    f"commanded {math.degrees(acting[-1]):.2f} deg/s: gained {math.degrees(now):.3f} deg/s "
                    f"without a command, at most {math.degrees(limit):.3f} deg/s"
                )
        return drive.fast if was_fast else ""

    def _gained(self, drive: _Drive, before: float, rate: float, acting: Sequence[float], passed_s: float) -> Pair:
        """Return the rates gained up and down so far; learn the wind from what the model leaves."""
        ticks = passed_s / self._tick_s
        left, follow = (self._left, self._follow) if ticks == 1.0 else self._over(passed_s)
        least = most = self._expected(before, acting[0], passed_s, left)
        linear = abs(acting[0] - before) < self._linear
        for each in acting[1:]:
            change = self._expected(before, each, passed_s, left)
            least, most = min(least, change), max(most, change)
            linear = linear and abs(each - before) < self._linear
        moved = rate - before
        change = moved - drive.wind * ticks
        (up, down), margin, slack = drive.gained, self.params.margin, self._slack * ticks
        # Only a linear loop tells wind from saturation.
        if linear:
            # Which of the commands acts is not known: what any of them explains is not wind.
            explained = least if moved < least else most if moved > most else moved
            wind = drive.wind + follow * ((moved - explained) / ticks - drive.wind)
            drive.wind = -self._wind if wind < -self._wind else wind if wind < self._wind else self._wind
        up = up + change - margin * (most if most > 0.0 else 0.0) - slack
        down = down - change + margin * (least if least < 0.0 else 0.0) - slack
        return up if up > 0.0 else 0.0, down if down > 0.0 else 0.0

    def _fast(self, before: float, rate: float, acting: Sequence[float]) -> str:
        """Return which bound a drive exceeds: its largest rate, or that about its command."""
        largest, excess = self.params.overspeed * self.params.rate_limit_rad_s, self.params.excess_rad_s
        if abs(rate) > largest:
            return f"must be <= {math.degrees(largest):.2f} deg/s"
        for each in acting:
            if -excess <= rate - each <= excess:
                return ""
        command = min(acting, key=lambda each: abs(rate - each))
        if abs(rate) <= max(map(abs, acting)) or (rate - before) * (command - rate) > 0.0:
            return ""
        return f"commanded {math.degrees(command):.2f} deg/s, must be within {math.degrees(excess):.2f} deg/s of it"

    def _expected(self, rate: float, command: float, passed_s: float, left: float) -> float:
        """Return the model's change of rate: full acceleration, then exponential.

        `left` is the share of a gap that an exponential of the whole time leaves.
        """
        limit, bandwidth = self.params.rate_limit_rad_s, self._bandwidth
        gap = (-limit if command < -limit else command if command < limit else limit) - rate
        size, hard = abs(gap), self.params.acceleration_limit_rad_s2
        full_s = size / hard - 1.0 / bandwidth
        if full_s <= 0.0:
            moved = size - size * left
        else:
            full_s = min(passed_s, full_s)
            moved = size - (size - hard * full_s) * math.exp(-bandwidth * (passed_s - full_s))
        return moved if gap >= 0.0 else -moved


@dataclass(frozen=True, kw_only=True)
class WindWatchParams(Params):
    """Speeds at which the antenna is stowed, and how it comes out again."""

    gust_limit_m_s: float = parameter(25.0, "3-s gust from which the antenna is stowed", 1.0, 100.0)
    mean_limit_m_s: float = parameter(18.0, "10-min mean from which the antenna is stowed", 1.0, 100.0)
    watched: bool = parameter(True, "whether there is an anemometer; without one the wind is not watched")
    stows: bool = parameter(True, "whether high wind stows the antenna; false: it is only warned of")
    release_share: float = parameter(0.8, "share of both below which it may come out", 0.1, 1.0)
    release_s: float = parameter(60.0, "time for which both must stay below", 0.0, 7200.0)
    silence_s: float = parameter(5.0, "time without a reading that counts as high wind", 0.1, 600.0)


class WindWatch:
    """Takes readings of wind speed and says why the antenna must be stowed."""

    def __init__(self, params: WindWatchParams) -> None:
        self.params = params
        # Time and speed in turns: a tuple of each reading would take 0.6 MB more in 10 min.
        self._seconds, self._minutes = array("d"), array("d")
        self._sums = [0.0, 0.0]
        self._newest_s, self._begun_s = -math.inf, math.inf
        self._low_since_s: float | None = None
        self.reason = ""

    def clock_stepped(self, by_s: float) -> None:
        """Go on with a clock that was stepped: readings and silence stay as old as they were."""
        self._newest_s, self._begun_s = self._newest_s + by_s, self._begun_s + by_s
        if self._low_since_s is not None:
            self._low_since_s += by_s
        for kept in (self._seconds, self._minutes):
            kept[0::2] = array("d", (t_s + by_s for t_s in kept[0::2]))

    @property
    def gust_m_s(self) -> float:
        """Mean of the last 3 s."""
        return self._sums[0] / (len(self._seconds) // 2) if self._seconds else 0.0

    @property
    def mean_m_s(self) -> float:
        """Mean of the last 10 min, or of what is known of them."""
        return self._sums[1] / (len(self._minutes) // 2) if self._minutes else 0.0

    def take(self, t_s: float, speed_m_s: float) -> None:
        """Note a reading; one that is not a finite speed is not a reading."""
        if not (math.isfinite(speed_m_s) and 0.0 <= speed_m_s < 150.0):
            return
        # Time went back: a simulation began again, and its old readings mean nothing.
        if t_s <= self._newest_s:
            self._seconds, self._minutes = array("d"), array("d")
            self._sums = [0.0, 0.0]
        self._newest_s = t_s
        for index, (kept, span_s) in enumerate(((self._seconds, GUST_S), (self._minutes, MEAN_S))):
            kept.extend((t_s, speed_m_s))
            self._sums[index] += speed_m_s
            while kept[0] < t_s - span_s:
                self._sums[index] -= kept[1]
                del kept[:2]

    def step(self, t_s: float) -> str:
        """Return why the antenna must be stowed at `t_s`, "" when it may be used."""
        params = self.params
        if not params.watched:
            return ""
        self._begun_s = min(self._begun_s, t_s)
        # An instrument behind a topic may need a moment before its first reading.
        silent_s = t_s - max(self._newest_s, self._begun_s)
        if silent_s > params.silence_s:
            never = math.isinf(self._newest_s)
            known = "has not been received" if never else f"has been silent for {silent_s:.1f} s"
            self.reason, self._low_since_s = f"anemometer {known}: taken for high wind", None
            return self.reason
        highs = ((self.gust_m_s, params.gust_limit_m_s, "gust"), (self.mean_m_s, params.mean_limit_m_s, "10-min mean"))
        for speed, limit, name in highs:
            if speed >= limit:
                self.reason, self._low_since_s = f"{name} {speed:.1f} m/s, limit {limit:.1f} m/s", None
                return self.reason
        # Out of high wind only after `release_s` well below both limits: a gust must not move the
        # antenna in and out of stow.
        if self.reason:
            calm = all(speed < params.release_share * limit for speed, limit, _ in highs)
            if not calm:
                self._low_since_s = None
            elif self._low_since_s is None:
                self._low_since_s = t_s
            elif t_s - self._low_since_s >= params.release_s:
                self.reason = ""
        return self.reason
