"""Executable `radio_control`: the radio of the antenna, by `radio` of the description.

Tunes receiver and transmitter behind rigctld after the Doppler shift of the target, as rigctld of
its own answers programs that ask (port 4534), and lets the transmitter send or not: `set_ptt` is
refused, a transmitter that sends is unkeyed, and a line of the hardware goes low
(`station/radio/`).

Subscribes: target, joint_states, antenna_status, tracking_status, executive_status.
Publishes: radio/inhibit (10 Hz and at every change: why the transmitter may not send, "" while
it may).
Parameters: server.* (address, port, who may connect), inhibit.* (largest pointing error, silence).
"""

import math
import time
from collections import deque
from pathlib import Path
from queue import SimpleQueue

from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from rf_pointing.core.secret_files import read_token
from rf_pointing.drives.line_server import Inquiry, LineServer
from rf_pointing.drives.rigctld import RadioView, RigWords
from rf_pointing.ephemeris.solar import SolarDirection
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.ros import convert
from rf_pointing.ros.graph import EXECUTIVE_STATUS, INHIBIT, RADIO
from rf_pointing.ros.qos import STATUS, STREAM
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.radio.control import PERIOD_S, RadioControl
from rf_pointing.station.radio.inhibit import TransmitRules

PUBLISHED_S = 0.1
CHECKS = ("receiver", "transmitter", "transmit", "clients")


class RadioControlNode(StationNode):
    """The topics, the port and the clock of the radio's brain."""

    def __init__(self) -> None:
        super().__init__(RADIO)
        self._server: LineServer | None = None
        self._inbox: SimpleQueue[Inquiry] = SimpleQueue()
        self._refused: deque[str] = deque(maxlen=100)
        self._published, self._published_s = "", -math.inf

    def configure(self) -> None:
        value = self.parameters.value
        assert self.station is not None
        radio = self.station.content.radio
        if radio is None:
            raise ValueError(f"{self.station.path} has no section radio (docs/own_radio.md)")
        sky = ForbiddenSky(value("mask"), value("gate").sun_radius_rad)
        view = RadioView(f"rf_pointing {self.station.name}")
        rules = TransmitRules(value("inhibit"), radio, sky, kinematics_of(self.station.content))
        self._radio = RadioControl(radio, rules, view, self.get_logger().info)
        self._at_cleanup.callback(self._radio.close)
        self._sun = SolarDirection(value("sun"))
        self._inhibits = self.publisher(String, INHIBIT.name, INHIBIT.qos)
        joints = convert.joints_from_message
        self._joints = self.listen_latest(JointState, "joint_states", joints, STREAM, required=True)
        self.listen(ours.Target, "target", self._on_target, STREAM, required=True)
        self.listen(ours.AntennaStatus, "antenna_status", self._on_antenna, STATUS, required=True)
        self.listen(ours.TrackingStatus, "tracking_status", self._on_tracking, STREAM, required=True)
        self.listen(ours.ExecutiveStatus, EXECUTIVE_STATUS, self._on_executive, STATUS)
        for name in CHECKS:
            self.diagnostics.add_report(name, lambda name=name: self._radio.reports(self._server)[name])

    def activate(self) -> None:
        params = self.parameters.value("server")
        file = params.password_file
        password = read_token("server.password_file", file, Path(file))[0] if file else ""
        words = RigWords(self._radio.view)
        self._server = LineServer(params, words, self._inbox.put, self._refused.append, password)
        self._at_deactivation.callback(setattr, self, "_server", None)
        self._at_deactivation.callback(self._server.close)
        self.get_logger().info(f"rigctld clients are served at {params.host}:{self._server.port}")
        # A rig gets one tuning for all instants that a late timer missed.
        self.every(PERIOD_S, self._step, catches_up=False)

    def deactivate(self) -> None:
        self._radio.rest(time.monotonic())
        self._publish(time.monotonic())

    def turn(self) -> float:
        """Carry out what clients have requested since the last turn."""
        if self._server is None:
            return super().turn()
        while not self._inbox.empty():
            self._radio.order(self._inbox.get(), self.now_s())
        while self._refused:
            self.log_once("line refused", self._refused.popleft())
        self._radio.follow(self.now_s(), time.monotonic())
        return self._radio.wait_s(time.monotonic())

    def _step(self, t_s: float) -> None:
        wall_s = time.monotonic()
        reading = self._joints.take()
        if reading is not None:
            axes_rad = reading.position_rad.tolist()
            self._radio.note("joint_states", wall_s, axes_rad=tuple(axes_rad))
        self._radio.step(t_s, wall_s, self._sun.at(t_s))
        self._publish(wall_s)

    def _publish(self, wall_s: float) -> None:
        # Numbers in the words change all the time; a change that matters is published at once.
        reason = self._radio.reason
        if bool(reason) != bool(self._published) or wall_s - self._published_s >= PUBLISHED_S:
            self._published, self._published_s = reason, wall_s
            self._inhibits.publish(String(data=reason))

    def _on_target(self, message: ours.Target) -> None:
        self._radio.note_target(convert.target_from_message(message))

    def _on_antenna(self, m: ours.AntennaStatus) -> None:
        said = {"inhibit": m.transmit_inhibit, "fault": m.fault}
        self._radio.note("antenna_status", time.monotonic(), **said)

    def _on_executive(self, m: ours.ExecutiveStatus) -> None:
        said = {"shares": m.shares, "executive_inhibit": m.partner_inhibit}
        self._radio.note("executive_status", time.monotonic(), **said)

    def _on_tracking(self, m: ours.TrackingStatus) -> None:
        error_rad = max(math.hypot(m.cross_elevation_error, m.elevation_error), m.axis_distance)
        said = {"mode": m.mode, "target": m.target, "error_rad": error_rad}
        self._radio.note("tracking_status", time.monotonic(), **said, beamwidth_rad=m.beamwidth)


main = RadioControlNode.main
