"""Executable `simulation_clock`: simulation time of one antenna, at a given or at full speed.

While inactive it holds time at the start; while active, time runs.  So every node can be brought up
before the first tick, and a run does not depend on how long that took.

A clock that brings itself up continues from the time at which a killed clock was, else from the
newest time that the nodes of its namespace report on /diagnostics.

Publishes: clock (rosgraph_msgs/Clock), to which the nodes' /clock is remapped.
Subscribes: the topics of `GRAPH` that time waits for, and /diagnostics; it reads their stamps only.
Parameters: start_s, speed (0: as fast as the graph follows), tick_s.
"""

import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

from rf_pointing.core.whole_file import open_private
from rf_pointing.ros.diagnostics import Health
from rf_pointing.ros.graph import ERRORS, ESSENTIAL, TOPICS, Topic
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.stamps import seconds_from_raw, seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.clients.pacing import ClockMemory, ClockParams, ClockStart, PacedStream, Pacer

HELD_PERIOD_S = 0.1
"""Wall time between two repetitions of the time while it is held."""


class SimulationClock(ManagedNode):
    """Publishes time at the pace of the wall clock and of the stamps that come back."""

    def __init__(self) -> None:
        super().__init__("simulation_clock")
        # It makes the time that the other nodes of its process take.
        self.set_parameters([Parameter("use_sim_time", value=False)])
        self.parameters.declare("", ClockParams())
        self._pacer: Pacer | None = None
        self._published_wall_s = 0.0
        self._memory: ClockMemory | None = None

    def configure(self) -> None:
        params: ClockParams = self.parameters.value("")
        self._output = self.publisher(Clock, "clock", STREAM)
        # What a real receiver measures comes late by nature: time that waited would stand.
        late = () if params.errors_in_time else (ERRORS,)
        paced = [topic for topic in TOPICS if topic.allowed_lag_s is not None and topic.name not in late]
        streams = {topic.name: self._paced(topic) for topic in paced}
        start_s = params.start_s or time.time()
        self._pacer = Pacer(start_s=start_s, tick_s=params.tick_s, speed=params.speed, streams=streams)
        resumed_s = None
        if self.brings_itself_up:
            # Next to the instance lock.
            self._memory = ClockMemory(self.lock.path.with_suffix(".time"), params.start_s, open_private)
            resumed_s = self._memory.recover(time.monotonic())
            self.listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self._start = ClockStart(self._pacer, resumed_s, time.perf_counter())
        self.diagnostics.add("pacing", self._health)

    def _paced(self, topic: Topic) -> PacedStream:
        """Subscribe to a topic that time waits for."""
        assert topic.allowed_lag_s is not None
        stream = PacedStream(allowed_lag_s=topic.allowed_lag_s, essential=topic.name == ESSENTIAL)

        def take(raw: bytes) -> None:
            stream.received(seconds_from_raw(raw))

        self.listen(topic.message_type, topic.name, take, topic.qos, raw=True)
        return stream

    def ready(self) -> bool:
        """Return whether the time of a running graph is known."""
        # Every node of ours publishes on /diagnostics, whatever state it is in.
        seen = self.get_publishers_info_by_topic("/diagnostics")
        mine, name = self.get_namespace(), self.get_name()
        neighbours = any(each.node_namespace == mine and each.node_name != name for each in seen)
        return self._start.known(time.perf_counter(), neighbours)

    def activate(self) -> None:
        self._pacer.begin(time.perf_counter())

    def deactivate(self) -> None:
        if self._memory is not None:
            self._memory.forget()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        whose = message.status[0].hardware_id if message.status else ""
        # Other antennas have other times.
        if whose.startswith(self.get_namespace().rstrip("/") + "/") and whose != self.get_fully_qualified_name():
            self._start.report(seconds_from_stamp(message.header.stamp), time.perf_counter())

    def turn(self) -> float:
        """Publish what is due; return how long to wait for the next event."""
        wall_s = time.perf_counter()
        if self._pacer is None:
            return 0.1
        if not self.active:
            # Silently while the time of a running graph is not known: a first message could be a
            # jump back.
            if not self.brings_itself_up:
                self._repeat(wall_s)
            return HELD_PERIOD_S
        wait_s = self._pacer.wait_s(wall_s)
        if wait_s > 0.0:
            self._repeat(wall_s)
            return min(wait_s, HELD_PERIOD_S)
        self._publish(self._pacer.advance(wall_s))
        return 0.0

    def _repeat(self, wall_s: float) -> None:
        """Repeat the time for nodes that start late."""
        # One that missed it would keep the clock waiting for its work.
        if wall_s - self._published_wall_s >= HELD_PERIOD_S:
            self._publish(self._pacer.now_s)

    def _publish(self, t_s: float) -> None:
        self._published_wall_s = time.perf_counter()
        if self._memory is not None:
            # Before publishing: a resumed clock must not be behind what the nodes have received.
            self._memory.keep(t_s, time.monotonic())
        self._output.publish(Clock(clock=stamp_from_seconds(t_s)))

    def _health(self) -> Health:
        pacer = self._pacer
        values: dict[str, object] = {"time_s": pacer.now_s}
        values |= {f"waited {name}": stream.waits for name, stream in pacer.streams.items()}
        values |= {f"abandoned {name}": stream.abandoned for name, stream in pacer.streams.items()}
        return Health(message="running" if self.active else "held", values=values)


main = SimulationClock.main
