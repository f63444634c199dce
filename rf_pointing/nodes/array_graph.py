"""Bring up the simulated graph of one array sensor, each node as its own process, and let its time run.

Time comes from here and not from `simulation_clock`, which waits for an antenna's streams: it goes on once the system's
estimates have caught up, so that a busy machine makes the run slower and changes nothing else.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from rf_pointing.nodes.array_systems import CLOCK, ArraySystem
from rf_pointing.nodes.lifecycle_client import LifecycleClient
from rf_pointing.nodes.pacing import PacedStream, Pacer
from rf_pointing.nodes.processes import NodeProcesses
from rf_pointing.nodes.qos import STREAM
from rf_pointing.nodes.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.configuration import read_parameter_files

__all__ = ["ArrayGraph", "NotStartedError"]

TICK_S = 0.25
HELD_PERIOD_S = 0.1
PATIENCE_S = 5.0
"""How long time waits for estimates that do not come, such as those of a satellite that hears no station."""
_ACTIVATION_TRIES = 50


class NotStartedError(Exception):
    """Why the graph could not be brought up, or what ended."""


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
        self._node, self._system, self._spin_once, self._patience_s = node, system, spin, patience_s
        self._processes = NodeProcesses(self.namespace, [share, *parameter_files], logs)
        self._lifecycle = LifecycleClient(node, self.namespace, self.spin, self.check)
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
        self._processes.stop()

    @property
    def now_s(self) -> float:
        """Simulation time."""
        return self._pacer.now_s

    def bring_up(self) -> None:
        """Start, configure and activate every node, while time stands still."""
        names = self._system.nodes
        self._processes.start(names)
        self._lifecycle.wait_for(names, self._patience_s)
        self._change(names, "configure")
        self._activate(names)
        topics = [t.name if t.name.startswith("/") else f"{self.namespace}/{t.name}" for t in self._system.topics]
        self.wait_until(lambda: all(self._node.count_publishers(t) for t in topics), "every topic", self._patience_s)

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

    def wait_until(self, condition: Callable[[], bool], what: str, timeout_s: float) -> None:
        """Spin until `condition`; TimeoutError naming `what` after `timeout_s` of wall time."""
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            self.check()
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"{self.namespace}: {what} not seen within {timeout_s:.0f} s")
            self.spin(0.05)

    def check(self) -> None:
        """Raise NotStartedError if a process has ended."""
        ended = self._processes.ended()
        if ended:
            raise NotStartedError("; ".join(f"{name} ended: {self._processes.complaint(name)}" for name in ended))

    def _publish(self, t_s: float) -> None:
        self._clock.publish(Clock(clock=stamp_from_seconds(t_s)))

    def _activate(self, names: Sequence[str]) -> None:
        """Activate; a refusal is tried again for a moment, since the held time reaches the nodes one by one."""
        for _ in range(_ACTIVATION_TRIES):
            names = self._lifecycle.change(names, "activate", self._patience_s)
            if not names:
                return
            held_s = time.monotonic() + HELD_PERIOD_S
            while time.monotonic() < held_s:
                self.spin(0.02)
        self._change(names, "activate")

    def _change(self, names: Sequence[str], transition: str) -> None:
        refused = self._lifecycle.change(names, transition, self._patience_s)
        if refused:
            reasons = "; ".join(f"{name}: {self._processes.complaint(name)}" for name in refused)
            raise NotStartedError(f"could not {transition} {reasons}")
