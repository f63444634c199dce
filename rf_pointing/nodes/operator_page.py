"""Executable `operator_page`: the station in a browser, and its commands for who has the token.

    ros2 run rf_pointing operator_page --ros-args -r __ns:=/gs1

Subscribes: antenna_status, tracking_status, joint_states, target, passes, pass_profiles,
pass_certificate, schedule, executive_status, station_in_use, /diagnostics of its namespace.
Requests: services, actions and parameters of the other nodes, as every other client.
Parameters: page.* (address, port, token, reports), command_key_file (signs the calls).

The page moves nothing by itself.  A pass that it has started goes on without it.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState

from rf_pointing.core.secret_files import read_token
from rf_pointing.ros import convert, station_view
from rf_pointing.ros.command_key import CommandKeyParams
from rf_pointing.ros.convert_planning import profile_from_message
from rf_pointing.ros.diagnostics import LEVELS
from rf_pointing.ros.directives import DirectiveSender
from rf_pointing.ros.graph import EXECUTIVE_STATUS, OPERATOR_PAGE, SCHEDULE, STATION_IN_USE
from rf_pointing.ros.lifecycle import LifecycleParams
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import IN_USE, LATCHED, STATUS, STREAM
from rf_pointing.ros.repeated_call import ParametersOf
from rf_pointing.station.clients.board import JOG, LONGEST_TEXT, READ, Board, PageParams
from rf_pointing.tracking.sensors import load_trackers
from rf_pointing.web.metrics import board_metrics
from rf_pointing.web.page_server import PageServer, report

PARAMETERS_S = 5.0  # Wall time between two requests for the limits in force.
STREAMS = {
    "antenna": (ours.AntennaStatus, "antenna_status", STATUS), "tracking": (ours.TrackingStatus, "tracking_status", STREAM),
    "target": (ours.Target, "target", STREAM),
}  # fmt: skip
SECTIONS = {
    "passes": (ours.PassList, "passes", station_view.passes_values, LATCHED),
    "schedule": (ours.Schedule, SCHEDULE, station_view.schedule_values, LATCHED),
    "certificate": (ours.PassCertificate, "pass_certificate", station_view.certificate_values, LATCHED),
    "executive": (ours.ExecutiveStatus, EXECUTIVE_STATUS, station_view.executive_values, STATUS),
    "station": (ours.StationInUse, STATION_IN_USE, lambda m: {"name": m.station, "band": m.band}, IN_USE),
}
"""Sections of the page by name: the message, its topic, and its values."""


class OperatorPage(ManagedNode):
    """Shows what is published, and sends what an operator requests."""

    LIFECYCLE = LifecycleParams(autostart=True)

    def __init__(self) -> None:
        super().__init__(OPERATOR_PAGE)
        load_trackers()
        self.parameters.declare("page", PageParams())
        self.parameters.declare("", CommandKeyParams(), group="key")
        self._server: PageServer | None = None
        # Nobody would look at /diagnostics for why there is no page.
        if self.parameters.reasons:
            raise ValueError("; ".join(self.parameters.reasons))

    def configure(self) -> None:
        params: PageParams = self.parameters.value("page")
        self._board = board = Board(params.rate_hz, self.get_namespace(), self._send)
        key = self.parameters.value("key")
        self._sender = DirectiveSender(self, board.rows, {}, board.responded, board.ended, key)
        self._readers = {node: ParametersOf(self, node, names, PARAMETERS_S) for node, names in READ.items()}
        for part in (self._sender, *self._readers.values()):
            self._at_cleanup.callback(part.close)
        self._newest: dict[str, Any] = {}
        self._streams = {
            name: self.listen_latest(kind, topic, lambda m: m, qos, required=True)
            for name, (kind, topic, qos) in STREAMS.items()
        }
        joints = convert.joints_from_message
        self._streams["joints"] = self.listen_latest(JointState, "joint_states", joints, STREAM, required=True)
        for name, (kind, topic, values, qos) in SECTIONS.items():
            self.listen(kind, topic, partial(self._keep, name, values), qos)
        profiles = lambda m: board.take_profiles([profile_from_message(each) for each in m.profiles])  # noqa: E731
        self.listen(ours.PassProfileList, "pass_profiles", profiles, LATCHED)
        self.listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        token, path = read_token("token_file", params.token_file, self.lock.path.with_suffix(".token"))
        self._server = PageServer(params, token)
        self._at_cleanup.callback(setattr, self, "_server", None)
        self._at_cleanup.callback(self._server.close)
        self.diagnostics.add_report("page", lambda: report(self._server))
        self.get_logger().info(f"operator's page at {self._server.address}; the token of commands is in {path}")

    def turn(self) -> float:
        if self._server is None:
            return super().turn()
        due = self._board.turn(time.monotonic(), time.time(), self._server.app.viewers)
        while not self._server.requests.empty():
            each = self._server.requests.get()
            try:
                if each.name != JOG:
                    self.get_logger().info(f"{each.name[:LONGEST_TEXT]!r} {each.arguments} requested by {each.who}")
                self._board.request(each.name, each.arguments, each.reply)
            except Exception as error:
                self.survived("a command", error)
                each.reply(False, f"{type(error).__name__}: {error}")
        self._sender.poll()
        if due:
            try:
                self._show(self._server)
            except Exception as error:
                # What cannot be shown must not take the commands with it.
                self.survived("what is shown", error)
        return self._board.wait_s

    def _keep(self, name: str, values: Callable[[Any], Any], message: Any) -> None:
        # A message without values leaves the one before it, on the board and here.
        self._board.keep(name, values(message))
        self._newest[name] = message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            level = LEVELS.index(status.level) if status.level in LEVELS else 2
            self._board.note_check(status.hardware_id, status.name.partition(": ")[2], level, status.message)

    def _show(self, server: PageServer) -> None:
        for name, stream in self._streams.items():
            if (message := stream.take()) is not None:
                self._newest[name] = message
                self._board.seen(name)
        board, live = self._board, station_view.live_values(self._newest)
        server.app.measured = time.monotonic(), board_metrics(live, board.age_s, board.kept, board.nodes)
        if not server.app.viewers:
            return
        for node, reader in self._readers.items():
            if refused := board.take_parameters(node, reader.take()):
                self.inputs.note_refusal("get_parameters", refused)
        server.put(board.sections(live))

    def _send(self, number: int, name: str, arguments: Mapping[str, Any]) -> None:
        if name == "track":
            arguments = {**arguments, "target_pass": self._newest["passes"].passes[arguments["target_pass"]]}
        self._sender.send(number, name, arguments)


def main() -> None:
    """Entry point of `ros2 run rf_pointing operator_page`."""
    run(OperatorPage)
