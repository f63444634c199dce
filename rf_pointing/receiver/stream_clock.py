"""Time and frequency of samples: the count of samples against arrivals, and the Doppler to expect.

The network only delays.  So the smallest of arrival - count / rate over the last seconds is the
time of sample 0, and what arrivals exceed it by is their jitter.  Two windows, one filling and one
full, follow a clock that is 50 ppm off to 0.5 ms.
"""

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S

KEPT, FARTHEST_S = 60, 10.0
WINDOW_S = 5.0
SETTLED_S = 0.25
"""Stretch at the stated rate after which a burst of what had waited counts as over."""
BURST = 1.2
STALL_S = 0.5
WITHIN_S = 0.5
RATE_SHARE = 0.01
"""How far the measured rate may be from the stated one."""
FAR_OFF, JUDGED_S = 0.1, 1.0
"""A rate that is named after a second: so short a window holds one arrival more or less."""


@dataclass
class StreamClock:
    """Maps the index of a sample to its time; None while the stream has not settled."""

    rate_hz: float
    latency_s: float = 0.0
    measured_hz: float = 0.0
    """Samples per second of arrival, over a window; 0 until it is known."""
    spread_s: float = 0.0
    """Largest delay of an arrival beyond the smallest, in the last full window."""
    stalls: int = 0
    _settled: bool = False
    _since: tuple[int, float] | None = None
    _last: tuple[int, float] | None = None
    _window: tuple[int, float] = (0, 0.0)
    _low: float = math.inf
    _low_before: float = math.inf
    _high: float = -math.inf

    def take(self, index_end: int, arrival_s: float) -> None:
        """Note the arrival of the samples before `index_end`."""
        last = self._last
        if last is not None and (index_end < last[0] or not 0.0 <= arrival_s - last[1] < STALL_S):
            self.stalls += 1
            self._settled, self._since = False, None
        self._last = index_end, arrival_s
        if not self._settled:
            self._settle(index_end, arrival_s)
            return
        offset_s = arrival_s - index_end / self.rate_hz
        self._low, self._high = min(self._low, offset_s), max(self._high, offset_s)
        begun, begun_s = self._window
        seconds = arrival_s - begun_s
        far_off = seconds > JUDGED_S and self._is_far_off((index_end - begun) / seconds)
        if far_off or seconds >= WINDOW_S:
            self.measured_hz = (index_end - begun) / seconds
            self.spread_s = self._high - self._low
            self._low_before, self._low, self._high = self._low, math.inf, -math.inf
            self._window = index_end, arrival_s
            if far_off:
                # The count does not tell the time: what it was before is no longer true.
                self._low, self._low_before = offset_s, math.inf

    def time_s(self, index: int) -> float | None:
        """Return the time of a sample at the antenna."""
        low = min(self._low, self._low_before)
        if not (self._settled and math.isfinite(low)):
            return None
        return low + index / self.rate_hz - self.latency_s

    @property
    def wrong_rate(self) -> str:
        """Why the measured rate is not the stated one, "" if it is."""
        last, measured = self._last, self.measured_hz
        if not measured or abs(measured / self.rate_hz - 1.0) <= RATE_SHARE:
            return ""
        # The window under way has lasted: it is not far off.
        if self._is_far_off(measured) and last is not None and last[1] - self._window[1] > JUDGED_S:
            return ""
        return (
            f"{1e-3 * measured:.1f} ksample/s arrive, iq.rate_hz states {1e-3 * self.rate_hz:.1f}"
        )

    def _is_far_off(self, measured_hz: float) -> bool:
        return abs(measured_hz / self.rate_hz - 1.0) > FAR_OFF

    def _settle(self, index_end: int, arrival_s: float) -> None:
        """Wait for the stated rate: what had waited in a queue comes faster."""
        if self._since is None:
            self._since = index_end, arrival_s
            return
        took_s = arrival_s - self._since[1]
        if took_s < SETTLED_S:
            return
        if (
            index_end - self._since[0]
        ) / took_s <= BURST * self.rate_hz or took_s > 8.0 * SETTLED_S:
            self._settled, self._window = True, (index_end, arrival_s)
            self._low = self._high = arrival_s - index_end / self.rate_hz
            self._low_before = math.inf
        self._since = index_end, arrival_s


class SmoothClock:
    """Goes on steadily between the steps of a clock that is received, and may be received late.

    A late step only makes that clock slow.  So what it was ahead of a steady one at most, within
    the last `WITHIN_S`, is what it is ahead by.
    """

    def __init__(
        self, clock_s: Callable[[], float], steady_s: Callable[[], float] = lambda: time.monotonic()
    ) -> None:
        self._clock_s, self._steady_s = clock_s, steady_s
        # Replaced as a whole: the thread of a source and that of its node both look.
        self._ahead: tuple[tuple[float, float], ...] = ()

    def now_s(self) -> float:
        """Return the time of the clock."""
        steady_s, clock_s = self._steady_s(), self._clock_s()
        ahead_s = clock_s - steady_s
        if self._ahead and clock_s < steady_s + self._ahead[0][1] - STALL_S:
            # It stands, or was set back.
            self._ahead = ()
        # Those that are less ahead than a later one never count again.
        kept = [each for each in self._ahead if each[1] > ahead_s and each[0] > steady_s - WITHIN_S]
        self._ahead = (*kept, (steady_s, ahead_s))
        return steady_s + self._ahead[0][1]


class DopplerPrediction:
    """Frequency offset over time: linear between the points, and beyond them for `FARTHEST_S`."""

    def __init__(self, carrier_hz: float) -> None:
        self._carrier_hz = carrier_hz
        self._points: deque[tuple[float, float]] = deque(maxlen=KEPT)

    def take(self, t_s: float, range_rate_m_s: float) -> None:
        """Note a range rate; a step back in time forgets what was known."""
        if self._points and t_s <= self._points[-1][0]:
            if t_s == self._points[-1][0]:
                return
            self._points.clear()
        self._points.append((t_s, -self._carrier_hz * range_rate_m_s / SPEED_OF_LIGHT_M_S))

    def known(self, t_s: float) -> bool:
        """Whether points near `t_s` are known."""
        points = self._points
        return bool(points) and points[0][0] - FARTHEST_S <= t_s <= points[-1][0] + FARTHEST_S

    def offset_hz(self, t_s: float) -> float:
        """Return the Doppler offset at `t_s`; 0 where nothing is known."""
        if not self.known(t_s):
            return 0.0
        points = self._points
        if len(points) == 1:
            return points[0][1]
        # The newest points lead time by seconds: look from their end.
        at = len(points) - 1
        while at > 1 and points[at - 1][0] > t_s:
            at -= 1
        (before_s, before), (after_s, after) = points[at - 1], points[at]
        return before + (after - before) * (t_s - before_s) / (after_s - before_s)
