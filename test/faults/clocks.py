"""The clock of nodes under test, told by hand."""

import time
from collections.abc import Callable
from types import SimpleNamespace

from rosgraph_msgs.msg import Clock

from rf_pointing.nodes.qos import STREAM


class ManualClock:
    """Publishes the time of the nodes of a live test."""

    def __init__(self, live: SimpleNamespace, start_s: float) -> None:
        self.live, self.t_s = live, start_s
        self.publisher = live.node.create_publisher(Clock, "clock", STREAM)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time go on in real time; return whether `until` came true."""
        end_s = self.t_s + seconds
        while self.t_s < end_s:
            due_s = time.monotonic() + 0.02
            self.t_s = round(self.t_s + 0.02, 6)
            message = Clock()
            message.clock.sec, message.clock.nanosec = int(self.t_s), round((self.t_s % 1.0) * 1e9)
            self.publisher.publish(message)
            while time.monotonic() < due_s:
                self.live.executor.spin_once(timeout_sec=0.005)
            if until():
                return True
        return False
