"""Executable `antenna_servo`: the simulated antenna and its control unit; a station's own driver takes its place.

Subscribes: joint_trajectory.  Publishes: joint_states (50 Hz), antenna_status (10 Hz), sim/boresight (50 Hz, truth).
While identifying: manual_rate (50 Hz).
Action: identify (rf_pointing_msgs/Identify).  Services: ~/stop, ~/reset_fault (std_srvs/Trigger).
Parameters: antenna.*, loops.* (retunable while running), and as truth plant.* (changeable too), wind.*, mount.*.
Activation releases the brakes and holds; deactivation sets them.
"""

import time
from collections.abc import Mapping
from typing import Any

from rf_pointing_msgs.msg import AntennaStatus, Boresight
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.geometry import AXES
from rf_pointing.nodes import convert
from rf_pointing.nodes.diagnostics import ERROR, OK, WARN, Health
from rf_pointing.nodes.identification_server import IdentificationServer
from rf_pointing.nodes.managed import ManagedNode, run
from rf_pointing.nodes.qos import COMMAND_INPUT, SAMPLES, STREAM
from rf_pointing.servo import WindParams, dss13_plant
from rf_pointing.station.antenna import AntennaParams, LoopParams, SimulatedAntenna
from rf_pointing.station.mount import MountParams

STATUS_PERIOD_S = 0.1


class AntennaServo(ManagedNode):
    """Steps the simulated antenna once a tick of node time; ticks missed by up to half a second are made up."""

    def __init__(self) -> None:
        super().__init__("antenna_servo")
        groups = {"antenna": AntennaParams(), "plant": dss13_plant(), "loops": LoopParams(), "wind": WindParams()}
        for prefix, defaults in {**groups, "mount": MountParams()}.items():
            self.parameters.declare(prefix, defaults)
        self.parameters.check_with(self._check)
        self.parameters.on_change(self._retune)
        self._antenna: SimulatedAntenna | None = None
        self._status_every = 1
        self._identification = IdentificationServer(self)
        self._tick_wall_s: float | None = None
        self._lateness_s = 0.0

    def configure(self) -> None:
        value = self.parameters.value
        self._antenna = SimulatedAntenna(
            value("antenna"), value("plant"), value("loops"), value("wind"), value("mount").model()
        )
        self._status_every = max(1, round(STATUS_PERIOD_S / self._antenna.params.tick_s))
        self._joints = self.publisher(JointState, "joint_states", STREAM)
        self._boresight = self.stream(Boresight, "sim/boresight", SAMPLES)
        self._status = self.stream(AntennaStatus, "antenna_status", STREAM)
        self._identification.configure(self._antenna)
        self.listen(JointTrajectory, "joint_trajectory", self._on_trajectory, COMMAND_INPUT)
        self.serve(Trigger, "~/stop", self._on_stop)
        self.serve(Trigger, "~/reset_fault", self._on_reset)
        self.diagnostics.add("drive", self._health)
        self.diagnostics.add("oscillation", self._oscillation_health)

    def activate(self) -> None:
        self._antenna.enable()
        self._tick_wall_s = None
        self._joints.publish(convert.joints_to_message(self._antenna.reading(self.now_s())))
        self._schedule = self.every(self._antenna.params.tick_s, self._tick)

    def deactivate(self) -> None:
        self._antenna.disable()
        self._identification.end()

    def _tick(self, t_s: float) -> None:
        if self._schedule.jumped_s:
            self._antenna.stop(f"the clock jumped by {self._schedule.jumped_s:+.2f} s")
        self._measure_lateness(self._antenna.params.tick_s)
        reading, boresight = self._antenna.step(t_s)
        self._joints.publish(convert.joints_to_message(reading))
        self._boresight.publish(convert.boresight_to_message(boresight))
        self._identification.tick(t_s)
        if round(t_s / self._antenna.params.tick_s) % self._status_every == 0:
            message = convert.antenna_status_to_message(self._antenna.status(t_s))
            message.tick_lateness = self._lateness_s
            self._status.publish(message)

    def _measure_lateness(self, tick_s: float) -> None:
        """Compare the wall time between two ticks with the period; at another speed than 1 it shows that speed."""
        wall_s = time.perf_counter()
        if self._tick_wall_s is not None:
            self._lateness_s = wall_s - self._tick_wall_s - tick_s
        self._tick_wall_s = wall_s

    def _on_trajectory(self, message: JointTrajectory) -> None:
        try:
            refused = self._antenna.accept(convert.trajectory_from_message(message), self.now_s())
        except ValueError as error:
            refused = self._antenna.reject(str(error))
        if refused:
            self.get_logger().warning(f"command rejected: {refused}", throttle_duration_sec=1.0)

    def _on_stop(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._antenna.stop("stop was requested")
        response.success, response.message = True, "stopping; reset_fault allows motion again"
        return response

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        refused = self._antenna.reset_fault()
        response.success, response.message = not refused, refused or "fault cleared"
        return response

    def _check(self, sets: Mapping[str, Any]) -> None:
        if self._antenna is not None:
            self._antenna.check(sets["plant"], sets["loops"])

    def _retune(self) -> None:
        if self._antenna is not None:
            self._antenna.retune(self.parameters.value("plant"), self.parameters.value("loops"))

    def _health(self) -> Health:
        status = self._antenna.status(self.now_s())
        level = ERROR if status.fault else WARN if any(status.at_limit) else OK
        rejected = {"commands_rejected": status.commands_rejected, "last_rejection": status.last_rejection}
        return Health(level, status.fault or status.mode, {"commands_accepted": status.commands_accepted, **rejected})

    def _oscillation_health(self) -> Health:
        watch = dict(zip(AXES, self._antenna.oscillation_watch, strict=True))
        found = "; ".join(f"{axis}: {seen.reason}" for axis, seen in watch.items() if seen.oscillating)
        swings = {f"{axis} swings in a row": len(seen.state.row) for axis, seen in watch.items()}
        return Health(ERROR if found else OK, found or "none", swings)


def main() -> None:
    """Entry point of `ros2 run rf_pointing antenna_servo`."""
    run(AntennaServo)
