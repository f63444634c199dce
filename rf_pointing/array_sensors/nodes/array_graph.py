"""Bring up the simulated graph of one array sensor, each node as a process, and let its time run.

This module publishes the clock: `simulation_clock` waits for an antenna's streams.  Time goes on
once the system's estimates have caught up, so a busy machine makes the run slower and changes
nothing else.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from rf_pointing.array_sensors.nodes.array_systems import CLOCK, ArraySystem
from rf_pointing.commands.managed_graph import ManagedGraph
from rf_pointing.core.parameter_files import read_parameter_files
from rf_pointing.nodes.pacing import PacedStream, Pacer
from rf_pointing.nodes.qos import STREAM
from rf_pointing.nodes.stamps import seconds_from_stamp, stamp_from_seconds

__all__ = ["ArrayGraph"]

TICK_S = 0.25
HELD_PERIOD_S = 0.1
PATIENCE_S = 5.0
"""How long time waits for estimates that do not come, such as those of a satellite that hears no
station."""


class ArrayGraph:
    """Context manager around the processes of `system` in the namespace of its name.

    `spin(timeout_s)` must run the executor of `node` once; `speed` is simulated seconds per second.
    """

    def __init__(
        self,
        system: ArraySystem,
        node: Node,
        spin: Callable[[float], None],
        logs: Path,
        *,
        speed: float,
        parameter_files: Sequence[Path] = (),
        patience_s: float = 60.0,
    ) -> None:
        share = Path(get_package_share_directory("rf_pointing")) / "config" / f"{system.name}.yaml"
        start_s = float(read_parameter_files([share])[CLOCK].values["start_s"])
        self.namespace = f"/{system.name}"
        self._node, self._system, self._spin_once = node, system, spin
        files = [share, *parameter_files]
        self._nodes = ManagedGraph(node, self.namespace, files, logs, self.spin, patience_s=patience_s)
        self._clock = node.create_publisher(Clock, f"{self.namespace}/clock", STREAM)
        estimates = PacedStream(allowed_lag_s=system.lag_s, spacing_s=2.0 * system.lag_s)
        streams = {system.paced: estimates}
        self._pacer = Pacer(start_s=start_s, tick_s=TICK_S, speed=speed, streams=streams, patience_s=PATIENCE_S)
        (paced,) = (topic for topic in system.topics if topic.name == system.paced)
        node.create_subscription(
            paced.message_type,
            f"{self.namespace}/{paced.name}",
            lambda message: estimates.heard(seconds_from_stamp(message.header.stamp)),
            STREAM,
        )
        self._running, self._held_wall_s = False, 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._nodes.stop()

    @property
    def now_s(self) -> float:
        """Simulation time."""
        return self._pacer.now_s

    def bring_up(self) -> None:
        """Start, configure and activate every node, while time stands still."""
        names = self._system.nodes
        self._nodes.start(names)
        self._nodes.configure(names)
        self._nodes.activate(names)
        topics = [t.name if t.name.startswith("/") else f"{self.namespace}/{t.name}" for t in self._system.topics]
        self.wait_until(lambda: all(self._node.count_publishers(t) for t in topics), "every topic")

    def run_time(self) -> None:
        """Let simulation time run from now on."""
        self._pacer.begin(time.perf_counter())
        self._running = True

    def spin(self, timeout_s: float) -> None:
        """Publish the time that is due, then handle one event or wait for one."""
        wall_s = time.perf_counter()
        if self._running:
            wait_s = self._pacer.wait_s(wall_s)
            if wait_s <= 0.0:
                self._publish(self._pacer.advance(wall_s))
            timeout_s = min(timeout_s, wait_s)
        elif wall_s - self._held_wall_s >= HELD_PERIOD_S:
            self._held_wall_s = wall_s
            self._publish(self._pacer.now_s)
        self._spin_once(timeout_s)

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        """Spin until `condition`; TimeoutError naming `what` after the patience of the graph."""
        self._nodes.wait_until(condition, f"{self.namespace}: {what}")

    def check(self) -> None:
        """NotStartedError if a process has ended."""
        self._nodes.check()

    def _publish(self, t_s: float) -> None:
        self._clock.publish(Clock(clock=stamp_from_seconds(t_s)))
