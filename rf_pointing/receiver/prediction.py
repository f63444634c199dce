"""The frequency at which a signal is expected, from range rates that are known ahead."""

from collections import deque

from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S

KEPT, FARTHEST_S = 60, 10.0


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
