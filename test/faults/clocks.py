"""The clock of nodes under test, told by hand."""

import time
from collections.abc import Callable
from types import SimpleNamespace

from rosgraph_msgs.msg import Clock

from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.stamps import stamp_from_seconds

TICK_S = 0.02
PATIENCE_S = 0.5


class WallClock:
    """The time of nodes that use no simulated time."""

    ticked: Callable[[], None]

    def __init__(self, live: SimpleNamespace) -> None:
        self.live = live

    @property
    def t_s(self) -> float:
        return time.time()

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time go on; return whether `until` came true."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.live.executor.spin_once(timeout_sec=0.005)
            if until():
                return True
        return False


class ManualClock:
    """Publishes the time of the nodes of a live test: in real time, or as fast as a node follows.

    `followed_s` tells for which tick the followed node has worked last; until it has begun time runs in real time.
    """

    def __init__(self, live: SimpleNamespace, start_s: float, followed_s: Callable[[], float] | None = None) -> None:
        self.live, self.t_s, self._followed_s = live, start_s, followed_s
        self.publisher = live.node.create_publisher(Clock, "clock", STREAM)
        self.ticked: Callable[[], None] = lambda: None
        """Called after every tick."""

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time go on; return whether `until` came true."""
        end_s = self.t_s + seconds
        while self.t_s < end_s:
            self._tick()
            if until():
                return True
        return False

    def _tick(self) -> None:
        begun = self._followed_s is not None and self._followed_s() > 0.0
        due_s = time.monotonic() + (PATIENCE_S if begun else TICK_S)
        self.t_s = round(self.t_s + TICK_S, 6)
        self.publisher.publish(Clock(clock=stamp_from_seconds(self.t_s)))
        self.ticked()
        while time.monotonic() < due_s and not (begun and abs(self._followed_s() - self.t_s) < 1e-6):
            self.live.executor.spin_once(timeout_sec=0.005)
