"""The graphs of the array sensors, and one of them brought up with each node as a process.

`ARRAY_SYSTEMS` lists nodes, topics and their quality of service; launch files and recorders read
it.  `ArrayGraph` also publishes the clock, because `simulation_clock` waits for an antenna's
streams.  Time goes on once the system's estimates have caught up, so a busy machine makes the run
slower and changes nothing else.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import rclpy
from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import (
    PoseWithCovarianceStamped,
    QuaternionStamped,
    TwistWithCovarianceStamped,
    Vector3Stamped,
)
from rclpy.node import Node
from rf_pointing_msgs import msg as ours
from rosgraph_msgs.msg import Clock

from rf_pointing.core.parameters import read_parameter_files
from rf_pointing.report.bag_writer import BagResult
from rf_pointing.ros.graph import Topic
from rf_pointing.ros.main_loop import make_executor
from rf_pointing.ros.managed_graph import ManagedGraph
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.recorder import Recorder
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.clients.pacing import PacedStream, Pacer

CLOCK = "simulation_clock"
"""Gives the time of a simulated graph where nothing else does."""

_PERIOD = "once a period"
_COMMON = (
    Topic("clock", Clock, STREAM, "every tick", "simulation_clock"),
    Topic("/diagnostics", DiagnosticArray, STREAM, "1 Hz", "every node"),
)


@dataclass(frozen=True)
class ArraySystem:
    """One graph: its name is its usual namespace and that of its parameter file.

    A node of a station is named `station/node`.  Simulation time waits for the stream
    `paced`, whose newest stamp may lag it by `lag_s`: two of its periods.
    """

    name: str
    nodes: tuple[str, ...]
    topics: tuple[Topic, ...]
    paced: str
    lag_s: float


def _tripulse(*stations: str) -> ArraySystem:
    receivers = [f"{station}/tripulse_receiver" for station in stations]
    frames = [
        Topic(f"{station}/tripulse_frame", ours.TripulseFrame, STREAM, _PERIOD, "tripulse_source")
        for station in stations
    ]
    lines = [
        Topic(
            f"{station}/tripulse_measurement", ours.TripulseMeasurement, STREAM, _PERIOD, receiver
        )
        for station, receiver in zip(stations, receivers, strict=True)
    ]
    attitude = Topic("attitude", ours.Attitude, STREAM, _PERIOD, "tripulse_attitude")
    truth = Topic("sim/attitude", QuaternionStamped, STREAM, _PERIOD, "tripulse_source")
    return ArraySystem(
        name="tripulse",
        nodes=("tripulse_source", *receivers, "tripulse_attitude"),
        topics=(*frames, *lines, attitude, truth, *_COMMON),
        paced="attitude",
        lag_s=2.5,
    )


_DOA = ArraySystem(
    name="doa",
    nodes=("doa_source", "doa_attitude"),
    topics=(
        Topic(
            "array_snapshots",
            ours.ArraySnapshots,
            STREAM,
            "once a period while a station is received",
            "doa_source",
        ),
        Topic("known_torque", ours.KnownTorque, STREAM, _PERIOD, "doa_source"),
        Topic("attitude", ours.Attitude, STREAM, "once a block", "doa_attitude"),
        Topic(
            "attitude_rate",
            TwistWithCovarianceStamped,
            STREAM,
            "once a valid attitude",
            "doa_attitude",
        ),
        Topic("sim/attitude", QuaternionStamped, STREAM, _PERIOD, "doa_source"),
        Topic("sim/attitude_rate", Vector3Stamped, STREAM, _PERIOD, "doa_source"),
        *_COMMON,
    ),
    paced="attitude",
    lag_s=1.5,
)

_INTERFEROMETER = ArraySystem(
    name="interferometer",
    nodes=("interferometer_source", "interferometer_tracker"),
    topics=(
        Topic(
            "interferometer_measurement",
            ours.InterferometerMeasurement,
            STREAM,
            _PERIOD,
            "interferometer_source",
        ),
        Topic(
            "relative_pose",
            PoseWithCovarianceStamped,
            STREAM,
            "while there is a pose",
            "interferometer_tracker",
        ),
        Topic(
            "relative_twist",
            TwistWithCovarianceStamped,
            STREAM,
            "while there is a pose",
            "interferometer_tracker",
        ),
        Topic(
            "relative_pose_status",
            ours.RelativePoseStatus,
            STREAM,
            _PERIOD,
            "interferometer_tracker",
        ),
        Topic(
            "sim/relative_pose", PoseWithCovarianceStamped, STREAM, _PERIOD, "interferometer_source"
        ),
        Topic(
            "sim/relative_twist",
            TwistWithCovarianceStamped,
            STREAM,
            _PERIOD,
            "interferometer_source",
        ),
        *_COMMON,
    ),
    paced="relative_pose_status",
    lag_s=4.5,
)

ARRAY_SYSTEMS = {
    system.name: system
    for system in (_tripulse("usingen", "hartebeesthoek"), _DOA, _INTERFEROMETER)
}
"""The graphs that config/, launch/ and the example know, by name."""

# The period of doa_source: a larger step would make it skip blocks.
TICK_S = 0.25
# Before the run the same time is published again: nodes need a clock message to configure timers.
HELD_PERIOD_S = 0.1
PATIENCE_S = 5.0
"""How long time waits for estimates that do not come: a satellite may receive no station."""


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
        folder = Path(get_package_share_directory("rf_pointing")) / "config" / "array_sensors"
        share = folder / f"{system.name}.yaml"
        start_s = float(read_parameter_files([share])[CLOCK]["start_s"])
        self.namespace = f"/{system.name}"
        self._node, self._system, self._spin_once = node, system, spin
        files = [share, *parameter_files]
        self._nodes = ManagedGraph(
            node, self.namespace, files, logs, self.spin, patience_s=patience_s
        )
        self._clock = node.create_publisher(Clock, f"{self.namespace}/clock", STREAM)
        # Time may run ahead of the estimates by the lag, and expects one of them within two lags.
        estimates = PacedStream(allowed_lag_s=system.lag_s, spacing_s=2.0 * system.lag_s)
        streams = {system.paced: estimates}
        self._pacer = Pacer(
            start_s=start_s, tick_s=TICK_S, speed=speed, streams=streams, patience_s=PATIENCE_S
        )
        (paced,) = (topic for topic in system.topics if topic.name == system.paced)
        node.create_subscription(
            paced.message_type,
            f"{self.namespace}/{paced.name}",
            lambda message: estimates.received(seconds_from_stamp(message.header.stamp)),
            STREAM,
        )
        self._running, self._held_wall_s = False, 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
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
        topics = [
            t.name if t.name.startswith("/") else f"{self.namespace}/{t.name}"
            for t in self._system.topics
        ]
        # A topic without its publisher yet would lose the first messages of the run.
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
        self._nodes.waiting.until(condition, f"{self.namespace}: {what} not seen")

    def check(self) -> None:
        """NotStartedError if a process has ended."""
        self._nodes.check()

    def _publish(self, t_s: float) -> None:
        self._clock.publish(Clock(clock=stamp_from_seconds(t_s)))


SPEEDS = {"tripulse": 20.0, "doa": 10.0, "interferometer": 20.0}
"""Factor of real time at which two cores simulate each system."""


def record_system(name: str, seconds: float, folder: Path) -> BagResult:
    """Run one system for `seconds` of wall time, and record all its topics below `folder`.

    rclpy must have been initialised.  Returns path, count of messages and problem of the bag.
    """
    node = rclpy.create_node(f"{name}_recording")
    executor = make_executor()
    executor.add_node(node)
    system = ARRAY_SYSTEMS[name]

    def spin(timeout_s: float) -> None:
        executor.spin_once(timeout_sec=timeout_s)

    recorder = Recorder(node, f"/{name}", folder / f"{name}_bag", system.topics, simulated=True)
    try:
        with ArrayGraph(system, node, spin, folder / "logs" / name, speed=SPEEDS[name]) as graph:
            graph.bring_up()
            graph.run_time()
            end_s = graph.now_s + seconds * SPEEDS[name]
            while graph.now_s < end_s:
                graph.check()
                graph.spin(0.05)
    finally:
        recorded = recorder.close()
        executor.shutdown()
        node.destroy_node()
    return recorded
