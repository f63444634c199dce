"""Times of samples without time stamps: the count of samples against the times of their arrival.

The network only delays.  So the smallest of arrival - count / rate over the last seconds is the
time of sample 0, and what arrivals exceed it by is their jitter.  Two windows, one filling and one
full, follow a clock that is 50 ppm off to 0.5 ms.
"""

import math
from dataclasses import dataclass

WINDOW_S = 5.0
SETTLED_S = 0.25
"""Stretch at the stated rate after which a burst of what had waited counts as over."""
BURST = 1.2
STALL_S = 0.5
RATE_SHARE = 0.01
"""How far the measured rate may be from the stated one."""


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
        if arrival_s - begun_s >= WINDOW_S:
            self.measured_hz = (index_end - begun) / (arrival_s - begun_s)
            self.spread_s = self._high - self._low
            self._low_before, self._low, self._high = self._low, math.inf, -math.inf
            self._window = index_end, arrival_s

    def time_s(self, index: int) -> float | None:
        """Return the time of a sample at the antenna."""
        low = min(self._low, self._low_before)
        return (
            low + index / self.rate_hz - self.latency_s
            if self._settled and math.isfinite(low)
            else None
        )

    @property
    def wrong_rate(self) -> str:
        """Why the measured rate is not the stated one, "" if it is."""
        last, begun = self._last, self._window
        measured = self.measured_hz
        if self._settled and last is not None and last[1] - begun[1] > 1.0:
            measured = (last[0] - begun[0]) / (last[1] - begun[1])
            # A short window holds one arrival more or less.
            if abs(measured / self.rate_hz - 1.0) < 0.1:
                measured = self.measured_hz
        if not measured or abs(measured / self.rate_hz - 1.0) <= RATE_SHARE:
            return ""
        return (
            f"{1e-3 * measured:.1f} ksample/s arrive, iq.rate_hz states {1e-3 * self.rate_hz:.1f}"
        )

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
