"""Executable `simulation_clock`: simulation time of one antenna, at a given or at full speed.

While inactive it holds time at the start; while active, time runs.  So every node can be brought up
before the first tick, and a run does not depend on how long that took.

A clock that brings itself up continues from the time at which a killed clock was (`ClockMemory`),
else from the newest time that the nodes of its namespace report on /diagnostics.

Publishes: clock (rosgraph_msgs/Clock), to which the nodes' /clock is remapped.
Subscribes: the topics of `GRAPH` that time waits for, and /diagnostics; it reads their stamps only.
Parameters: start_s, speed (0: as fast as the graph follows), tick_s.
"""

import math
import os
import struct
import time
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock

from rf_pointing.ros.diagnostics import Health
from rf_pointing.ros.graph import ESSENTIAL, TOPICS, Topic
from rf_pointing.ros.main_loop import open_private, run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.pacing import PacedStream, Pacer
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.stamps import seconds_from_raw, seconds_from_stamp, stamp_from_seconds
from rf_pointing.station.parameters import ClockParams

HELD_PERIOD_S = 0.1
"""Wall time between two repetitions of the time while it is held."""
LISTEN_S = 1.5
"""How long a clock that brings itself up waits for the time of a running graph."""
# Every node reports its time once a second.
LONGEST_LISTEN_S = 5.0
"""The same while other nodes are seen, of which none has reported its time yet."""
SETTLE_S = 0.2
"""After the first report: time for the other nodes to report a newer time."""
RESUME_S = 20.0
"""A graph waits no longer than this for a killed clock."""
_RECORD = struct.Struct("<3d")


class ClockMemory:
    """The newest time of one clock, in a file next to the instance lock.

    A killed clock continues from it; `start_s` is where the clock's time begins, `wall_s` a steady
    clock of the machine.  A clock that ends in order leaves no file.
    """

    def __init__(self, path: Path, start_s: float) -> None:
        self._path, self._start_s = path, start_s
        self._file: int | None = None

    def recover(self, wall_s: float) -> float | None:
        """Return where a clock of the same start was killed at most `RESUME_S` ago, else None."""
        try:
            # A file of another start, of another boot, or a torn one is no memory.
            with os.fdopen(os.open(self._path, os.O_RDONLY | os.O_NOFOLLOW), "rb") as file:
                start_s, kept_wall_s, t_s = _RECORD.unpack(file.read(_RECORD.size + 1))
        except (OSError, struct.error):
            return None
        return t_s if start_s == self._start_s and 0.0 <= wall_s - kept_wall_s <= RESUME_S else None

    def keep(self, t_s: float, wall_s: float) -> None:
        """Write the time of a tick, before it is published."""
        if self._file is None:
            self._file = open_private(self._path, os.O_WRONLY)
            os.ftruncate(self._file, 0)
        # Written in place, 24 bytes: the kernel keeps them when the process dies.
        os.pwrite(self._file, _RECORD.pack(self._start_s, wall_s, t_s), 0)

    def forget(self) -> None:
        """Remove the file."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
        self._path.unlink(missing_ok=True)


class SimulationClock(ManagedNode):
    """Publishes time at the pace of the wall clock and of the stamps that come back."""

    def __init__(self) -> None:
        super().__init__("simulation_clock")
        self.parameters.declare("", ClockParams())
        self._pacer: Pacer | None = None
        self._published_wall_s = 0.0
        self._memory: ClockMemory | None = None
        self._resumed = self._reported = False
        self._reported_wall_s = math.inf

    def configure(self) -> None:
        params: ClockParams = self.parameters.value("")
        self._output = self.publisher(Clock, "clock", STREAM)
        streams = {topic.name: self._paced(topic) for topic in TOPICS if topic.allowed_lag_s is not None}
        self._pacer = Pacer(start_s=params.start_s, tick_s=params.tick_s, speed=params.speed, streams=streams)
        if self.brings_itself_up:
            self._memory = ClockMemory(self.lock.path.with_suffix(".time"), params.start_s)
            recovered_s = self._memory.recover(time.monotonic())
            self._resumed = recovered_s is not None
            self._pacer.start_s = params.start_s if recovered_s is None else recovered_s
            self.listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self.diagnostics.add("pacing", self._health)
        self._configured_wall_s = time.perf_counter()

    def _paced(self, topic: Topic) -> PacedStream:
        """Subscribe to a topic that time waits for."""
        assert topic.allowed_lag_s is not None
        stream = PacedStream(allowed_lag_s=topic.allowed_lag_s, essential=topic.name == ESSENTIAL)
        self.listen(
            topic.message_type, topic.name, lambda raw: stream.received(seconds_from_raw(raw)), topic.qos, raw=True
        )
        return stream

    def ready(self) -> bool:
        """Return whether the time of a running graph is known: a new start would set it back."""
        wall_s = time.perf_counter()
        if self._resumed or wall_s - self._reported_wall_s >= SETTLE_S:
            return True
        patience_s = LONGEST_LISTEN_S if self._neighbours() and not self._reported else LISTEN_S
        return wall_s - self._configured_wall_s >= patience_s

    def _neighbours(self) -> bool:
        """Return whether other nodes of the namespace are seen."""
        # Every node of ours publishes on /diagnostics, whatever state it is in.
        seen = self.get_publishers_info_by_topic("/diagnostics")
        return any(each.node_namespace == self.get_namespace() and each.node_name != self.get_name() for each in seen)

    def activate(self) -> None:
        self._pacer.begin(time.perf_counter())

    def deactivate(self) -> None:
        if self._memory is not None:
            self._memory.forget()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Continue from the newest time of the graph."""
        # An older one would be a jump back for all of its nodes.
        whose = message.status[0].hardware_id if message.status else ""
        mine = whose.startswith(self.get_namespace().rstrip("/") + "/") and whose != self.get_fully_qualified_name()
        # Other antennas have other times, and once time runs it cannot be set.
        if not mine or self._pacer.ticks > 0:
            return
        stated_s, self._reported = seconds_from_stamp(message.header.stamp), True
        self._pacer.start_s = max(self._pacer.start_s, stated_s)
        if stated_s > 0.0:
            self._reported_wall_s = min(self._reported_wall_s, time.perf_counter())

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


def main() -> None:
    """Entry point of `ros2 run rf_pointing simulation_clock`."""
    run(SimulationClock)
