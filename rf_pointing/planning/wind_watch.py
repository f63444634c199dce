"""High wind by the 3-s gust and the 10-min mean (WMO No. 8), with hysteresis; an anemometer that is silent is high wind."""

import math
from collections import deque
from dataclasses import dataclass

from rf_pointing.core import Params, parameter

__all__ = ["WindWatch", "WindWatchParams"]

GUST_S = 3.0
MEAN_S = 600.0


@dataclass(frozen=True, kw_only=True)
class WindWatchParams(Params):
    """Speeds at which the antenna is stowed, and how it comes out again."""

    gust_limit_m_s: float = parameter(25.0, "3-s gust from which the antenna is stowed", low=1.0, high=100.0)
    mean_limit_m_s: float = parameter(18.0, "10-min mean from which the antenna is stowed", low=1.0, high=100.0)
    release_share: float = parameter(0.8, "share of both below which it may come out", low=0.1, high=1.0)
    release_s: float = parameter(60.0, "time for which both must stay below", low=0.0, high=7200.0)
    silence_s: float = parameter(5.0, "time without a reading that counts as high wind", low=0.1, high=600.0)


class WindWatch:
    """Takes readings of wind speed and says why the antenna must be stowed."""

    def __init__(self, params: WindWatchParams) -> None:
        self.params = params
        self._second: deque[tuple[float, float]] = deque()
        self._minute: deque[tuple[float, float]] = deque()
        self._sums = [0.0, 0.0]
        self._newest_s = -math.inf
        self._low_since_s: float | None = None
        self.reason = ""

    @property
    def gust_m_s(self) -> float:
        """Mean of the last 3 s."""
        return self._sums[0] / len(self._second) if self._second else 0.0

    @property
    def mean_m_s(self) -> float:
        """Mean of the last 10 min, or of what is known of them."""
        return self._sums[1] / len(self._minute) if self._minute else 0.0

    def take(self, t_s: float, speed_m_s: float) -> None:
        """Note a reading; one that is no finite speed is no reading."""
        if not (math.isfinite(speed_m_s) and 0.0 <= speed_m_s < 150.0):
            return
        if t_s <= self._newest_s:
            self._second.clear()
            self._minute.clear()
            self._sums = [0.0, 0.0]
        self._newest_s = t_s
        for index, (kept, span_s) in enumerate(((self._second, GUST_S), (self._minute, MEAN_S))):
            kept.append((t_s, speed_m_s))
            self._sums[index] += speed_m_s
            while kept[0][0] < t_s - span_s:
                self._sums[index] -= kept.popleft()[1]

    def step(self, t_s: float) -> str:
        """Return why the antenna must be stowed at `t_s`, "" when it may be used."""
        params = self.params
        silent_s = t_s - self._newest_s
        if silent_s > params.silence_s:
            known = "has not been heard" if math.isinf(silent_s) else f"has been silent for {silent_s:.1f} s"
            self.reason, self._low_since_s = f"anemometer {known}: taken for high wind", None
            return self.reason
        highs = ((self.gust_m_s, params.gust_limit_m_s, "gust"), (self.mean_m_s, params.mean_limit_m_s, "10-min mean"))
        for speed, limit, name in highs:
            if speed >= limit:
                self.reason, self._low_since_s = f"{name} {speed:.1f} m/s, limit {limit:.1f} m/s", None
                return self.reason
        if self.reason:
            calm = all(speed < params.release_share * limit for speed, limit, _ in highs)
            if not calm:
                self._low_since_s = None
            elif self._low_since_s is None:
                self._low_since_s = t_s
            elif t_s - self._low_since_s >= params.release_s:
                self.reason = ""
        return self.reason
