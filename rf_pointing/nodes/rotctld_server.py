"""Executable `rotctld_server`: the antenna as a rotator of Hamlib, for Gpredict, SatNOGS, SatDump.

Serves rotctld's protocol (`drives/rotctld.py`) on TCP port 4533 of this computer.  Points of a
satellite of the ephemeris publisher's elements become its pass, tracked by `track_pass`; others are
followed, through the safety gate of the antenna like any commander (`station/clients/`).

Subscribes: joint_states, antenna_status, tracking_status, executive_status, pointing_model.
Publishes: joint_trajectory and command_signature (10 Hz, while it follows points itself).
Uses: antenna_servo/go_to, park, resume; pointing_controller/stop;
ephemeris_publisher/select_target and its parameter source.elements; track_pass.
Parameters: server.* (address, port, who may connect), follow.* and match.* (what points mean),
sensor, identify, command_key_file (the key that signs commands and calls).
"""

import math
import time
from collections import deque
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState

from rf_pointing.core.secret_files import read_token
from rf_pointing.drives.line_server import IO_ERROR, REJECTED, Inquiry, LineServer
from rf_pointing.drives.rotctld import RotatorWords, StationView
from rf_pointing.ros import convert, convert_calibration
from rf_pointing.ros.directives import DirectiveSender
from rf_pointing.ros.graph import EXECUTIVE_STATUS
from rf_pointing.ros.qos import LATCHED, STATUS, STREAM
from rf_pointing.ros.repeated_call import ParametersOf
from rf_pointing.ros.signed_commands import CommandSender
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.clients.points import Follower, KnownSatellites
from rf_pointing.station.clients.steering import PERIOD_S, Answer, Steering, steering_rows
from rf_pointing.station.parameters import controller_params
from rf_pointing.tracking.sensors import load_trackers

RELOAD_S = 600.0


class RotctldServerNode(StationNode):
    """The port of the clients, and the topics and services that their steering needs."""

    def __init__(self) -> None:
        load_trackers()
        super().__init__("rotctld_server")
        self._server: LineServer | None = None
        self._inbox: SimpleQueue[Inquiry] = SimpleQueue()
        self._refused: deque[str] = deque(maxlen=100)

    def configure(self) -> None:
        value = self.parameters.value
        assert self.station is not None
        self._known = KnownSatellites(self.station.site)
        self._follower = Follower(controller_params(self.station, self.band), value("follow"))
        self._steering = steering = Steering(
            value(""), value("match"), self._follower, self._known, StationView(f"rf_pointing {self.station.name}"),
            node=self.get_fully_qualified_name(), send=lambda *directive: self._sender.send(*directive),
            heard_s=lambda client: self._server.heard_s(client) if self._server else -math.inf,
            inform=self.get_logger().info, warn=self.log_once,
        )  # fmt: skip
        self._sender = DirectiveSender(
            self, steering_rows(), {}, self._responded, self._ended, value("key"), self._answered
        )
        self._elements = ParametersOf(self, "ephemeris_publisher", ["source.elements"], RELOAD_S)
        for part in (self._sender, self._elements, self._known):
            self._at_cleanup.callback(part.close)
        self._commands = CommandSender(self, value("key"), self.publisher)
        axes = self._axes = self._follower.mount.axes
        joints = partial(convert.joints_from_message, axes=axes)
        self._latest = self.listen_latest(JointState, "joint_states", joints, STREAM, required=True)
        self.listen(ours.AntennaStatus, "antenna_status", self._on_antenna, STATUS, required=True)
        self.listen(ours.TrackingStatus, "tracking_status", self._on_tracking, STREAM, required=True)
        self.listen(ours.ExecutiveStatus, EXECUTIVE_STATUS, lambda m: steering.note_executive(m.state), STATUS)
        self.listen(ours.PointingModel, "pointing_model", self._on_model, LATCHED)
        self.diagnostics.add_report("clients", lambda: steering.report(self._server))

    def activate(self) -> None:
        params = self.parameters.value("server")
        file = params.password_file
        password = read_token("server.password_file", file, Path(file))[0] if file else ""
        self._server = LineServer(
            params, RotatorWords(self._steering.view), self._inbox.put, self._refused.append, password
        )
        self._at_deactivation.callback(setattr, self, "_server", None)
        self._at_deactivation.callback(self._server.close)
        self.get_logger().info(f"rotctld clients are served at {params.host}:{self._server.port}")
        self.every(PERIOD_S, self._step)

    def deactivate(self) -> None:
        self._steering.rest()

    def turn(self) -> float:
        """Carry out what clients have requested since the last turn."""
        if self._server is None:
            return super().turn()
        self._steering.turn(self.now_s(), time.monotonic())
        while not self._inbox.empty():
            self._steering.order(self._inbox.get())
        while self._refused:
            self.log_once("line refused", self._refused.popleft())
        self._sender.poll()
        # An order waits this long at most; its time is that of its arrival.
        return 0.01 if self._server.counts.connected else 0.1

    def _step(self, t_s: float) -> None:
        reading = self._latest.take()
        if reading is not None:
            self._steering.note_axes(reading)
        self._known.look()
        wanted = self.parameters.value("").identify and not self._steering.in_pass
        if wanted and (values := self._elements.take()):
            self._known.load(values["source.elements"], t_s)
        trajectory = self._steering.step(t_s, time.monotonic())
        if trajectory is not None:
            self._commands.send(convert.trajectory_to_message(trajectory, t_s, self._axes))

    def _on_antenna(self, m: ours.AntennaStatus) -> None:
        self._steering.note_antenna(m.mode, m.fault, m.commander, m.commands_rejected, m.last_rejection)

    def _on_tracking(self, message: ours.TrackingStatus) -> None:
        self._steering.note_tracking(message.target, message.commands_sent)

    def _on_model(self, message: ours.PointingModel) -> None:
        self._follower.model = convert_calibration.model_from_message(message).on(self._follower.mount)

    def _responded(self, number: int, accepted: bool, text: str) -> None:
        self._steering.answered(number, Answer(0 if accepted else IO_ERROR, text))

    def _answered(self, number: int, accepted: bool, text: str, answer: Any) -> None:
        passes = getattr(answer, "passes", ())
        windows = tuple((seconds_from_stamp(each.aos), seconds_from_stamp(each.los), each) for each in passes)
        self._steering.answered(number, Answer(0 if accepted else REJECTED, text, windows))

    def _ended(self, number: int, _name: str, _succeeded: bool, result: dict[str, Any]) -> None:
        self._steering.ended(number, result["message"], result["seconds_tracked"])


main = RotctldServerNode.main
