"""Executable `simulation_clock`: simulation time for one antenna's graph, at a given speed or as fast as the graph follows.

Inactive, it holds time at the start; active, time runs.  So every node can be brought up before the first tick, and a run
does not depend on how long that took.  One that brings itself up goes on where a killed one stood (`clock_memory.py`), else
from the time that the nodes of its namespace state.
Publishes: clock (rosgraph_msgs/Clock), to which the nodes' /clock is remapped.
Subscribes: antenna_status, sim/pointing_error, pointing_error, tracking_status, target, /diagnostics (their stamps only).
Parameters: start_s, speed (0: as fast as the graph follows), tick_s.
"""

import math
import time
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from rf_pointing_msgs.msg import AntennaStatus, PointingError, Target, TrackingStatus
from rosgraph_msgs.msg import Clock

from rf_pointing.core import Params, parameter
from rf_pointing.nodes.clock_memory import ClockMemory
from rf_pointing.nodes.diagnostics import Health
from rf_pointing.nodes.main_loop import run
from rf_pointing.nodes.managed import ManagedNode
from rf_pointing.nodes.pacing import PacedStream, Pacer
from rf_pointing.nodes.qos import STATUS, STREAM
from rf_pointing.nodes.stamps import seconds_from_raw, seconds_from_stamp, stamp_from_seconds

PACED = {
    "antenna_status": (AntennaStatus, STATUS, 0.19),
    "sim/pointing_error": (PointingError, STREAM, 0.19),
    "pointing_error": (PointingError, STREAM, 0.23),
    "tracking_status": (TrackingStatus, STREAM, 0.19),
    "target": (Target, STREAM, -1.0),
}
"""Stream, its type, its quality of service, and by how much its newest stamp may lag the next tick.

The antenna reports every 0.1 s; the receiver, the tracker and the controller work every 0.1 s on what is older than
their own instant.  A lag of one period less a tick lets time reach the next such instant only when the previous one's
work has arrived, so a run gives the same result at any speed; the errors of monopulse are stamped in the middle of their
cluster, 0.04 s before its end.  Of each node it is the stream that the node writes last in a period: when it is heard
here, what the node wrote before (the command, the samples) has reached those who need it, and the tick cannot overtake it.
"""

ESSENTIAL = "antenna_status"
HELD_PERIOD_S = 0.1
LISTEN_S, LONGEST_LISTEN_S, SETTLE_S = 1.5, 5.0, 0.2
"""How long a clock that brings itself up holds: every node states its time once a second, and is waited for if it is seen.
Once a time is heard the others have a moment to state a newer one."""


@dataclass(frozen=True, kw_only=True)
class ClockParams(Params):
    """Simulation time."""

    start_s: float = parameter(0.0, "UTC seconds since 1970 at which time starts", low=0.0, high=4.0e9)
    speed: float = parameter(1.0, "simulated seconds per second; 0: as fast as the graph follows", low=0.0, high=1e4)
    tick_s: float = parameter(0.02, "step of simulation time", low=0.001, high=1.0)


class SimulationClock(ManagedNode):
    """Publishes time; paced by the wall clock and by the stamps that come back."""

    def __init__(self) -> None:
        super().__init__("simulation_clock")
        self.parameters.declare("", ClockParams())
        self._pacer: Pacer | None = None
        self._running = False
        self._told_wall_s = 0.0
        self._memory: ClockMemory | None = None
        self._resumed = self._spoken = False
        self._heard_wall_s = math.inf

    def configure(self) -> None:
        params: ClockParams = self.parameters.value("")
        streams = {
            topic: PacedStream(allowed_lag_s=lag_s, essential=topic == ESSENTIAL)
            for topic, (_, _, lag_s) in PACED.items()
        }
        self._pacer = Pacer(start_s=params.start_s, tick_s=params.tick_s, speed=params.speed, streams=streams)
        self._output = self.publisher(Clock, "clock", STREAM)
        for topic, (message_type, qos, _) in PACED.items():
            self.listen(
                message_type,
                topic,
                lambda raw, stream=streams[topic]: stream.heard(seconds_from_raw(raw)),
                qos,
                raw=True,
            )
        if self.brings_itself_up:
            self._memory = ClockMemory(self.lock.path.with_suffix(".time"), params.start_s)
            stood_s = self._memory.recover(time.monotonic())
            self._resumed = stood_s is not None
            self._pacer.start_s = stood_s if stood_s is not None else params.start_s
            self.listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self.diagnostics.add("pacing", self._health)
        self._configured_wall_s = time.perf_counter()

    def ready(self) -> bool:
        """Hold until the time of a graph that is already there is known: to begin anew would take it back."""
        wall_s = time.perf_counter()
        if self._resumed or wall_s - self._heard_wall_s >= SETTLE_S:
            return True
        patience_s = LONGEST_LISTEN_S if self._neighbours() and not self._spoken else LISTEN_S
        return wall_s - self._configured_wall_s >= patience_s

    def _neighbours(self) -> bool:
        """Return whether other nodes of the namespace are seen."""
        seen = self.get_publishers_info_by_topic("/diagnostics")
        return any(each.node_namespace == self.get_namespace() and each.node_name != self.get_name() for each in seen)

    def activate(self) -> None:
        self._pacer.begin(time.perf_counter())
        self._running = True

    def deactivate(self) -> None:
        self._running = False
        if self._memory is not None:
            self._memory.forget()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Go on from the newest time of the graph: going back would be a jump to all of its nodes."""
        whose = message.status[0].hardware_id if message.status else ""
        mine = whose.startswith(self.get_namespace().rstrip("/") + "/") and whose != self.get_fully_qualified_name()
        if not mine or self._pacer.ticks > 0:
            return
        stated_s, self._spoken = seconds_from_stamp(message.header.stamp), True
        self._pacer.start_s = max(self._pacer.start_s, stated_s)
        if stated_s > 0.0:
            self._heard_wall_s = min(self._heard_wall_s, time.perf_counter())

    def turn(self) -> float:
        """Publish what is due; return how long to wait for the next event."""
        wall_s = time.perf_counter()
        if self._pacer is None:
            return 0.1
        if not self._running:
            return self._hold(wall_s)
        wait_s = self._pacer.wait_s(wall_s)
        if wait_s > 0.0:
            self._repeat(wall_s)
            return min(wait_s, HELD_PERIOD_S)
        self._publish(self._pacer.advance(wall_s))
        return 0.0

    def _hold(self, wall_s: float) -> float:
        """Hold time; while it is still being learned, the first of it could be a jump back."""
        if not self.brings_itself_up:
            self._repeat(wall_s)
        return HELD_PERIOD_S

    def _repeat(self, wall_s: float) -> None:
        """Repeat the time for those who come: one that missed it would keep the clock waiting for its work."""
        if wall_s - self._told_wall_s >= HELD_PERIOD_S:
            self._publish(self._pacer.now_s)

    def _publish(self, t_s: float) -> None:
        self._told_wall_s = time.perf_counter()
        if self._memory is not None:
            self._memory.keep(t_s, time.monotonic())
        self._output.publish(Clock(clock=stamp_from_seconds(t_s)))

    def _health(self) -> Health:
        pacer = self._pacer
        values: dict[str, object] = {"time_s": pacer.now_s}
        values |= {f"waits for {name}": stream.waits for name, stream in pacer.streams.items()}
        values |= {f"abandoned waits for {name}": stream.abandoned for name, stream in pacer.streams.items()}
        return Health(message="running" if self._running else "held", values=values)


def main() -> None:
    """Entry point of `ros2 run rf_pointing simulation_clock`."""
    run(SimulationClock)
