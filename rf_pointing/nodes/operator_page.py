"""Executable `operator_page`: one antenna or a network in a browser, and commands with a token.

    ros2 run rf_pointing operator_page --ros-args -r __ns:=/gs1
    ros2 run rf_pointing operator_page --ros-args -r __ns:=/network -p page.antennas:=/gs1,/gs2

Subscribes, in the namespace of each antenna: antenna_status, tracking_status, joint_states, target,
passes, pass_profiles, pass_certificate, schedule, executive_status, station_in_use; /diagnostics.
Requests: services, actions and parameters of the other nodes, as every other client.
Parameters: page.* (address, port, token, reports), command_key_file (signs the calls).

The page moves nothing by itself.  A pass that it has started goes on without it.
"""

import time
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from rf_pointing.core.dates import utc_text
from rf_pointing.core.secret_files import read_token
from rf_pointing.ros.antenna_view import GRAPH_S, AntennaView, antennas_in_graph
from rf_pointing.ros.command_key import CommandKeyParams
from rf_pointing.ros.diagnostics import LEVELS
from rf_pointing.ros.graph import OPERATOR_PAGE
from rf_pointing.ros.lifecycle import LifecycleParams
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM
from rf_pointing.station.clients import network
from rf_pointing.station.clients.board import ALL, JOG, LONGEST_TEXT, MOST_ANTENNAS, SLOW_S, PageParams, namespaces_of
from rf_pointing.tracking.sensors import load_trackers
from rf_pointing.web.metrics import board_metrics, labelled
from rf_pointing.web.page_server import PageServer, report

NETWORK_S = 0.5
"""Wall time between two views of a network; after 1.5 s a page reports a lost connection."""


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
        self._params: PageParams = self.parameters.value("page")
        self._views: dict[str, AntennaView] = {}
        self._lines: dict[str, dict[str, Any]] = {}
        self._metrics: dict[str, Any] = {}
        self._looked_s = self._shown_s = 0.0
        token, path = read_token("token_file", self._params.token_file, self.lock.path.with_suffix(".token"))
        self._server = PageServer(self._params, token)
        self._at_cleanup.callback(setattr, self, "_server", None)
        self._at_cleanup.callback(self._server.close)
        if self._params.antennas != ALL:
            for each in namespaces_of(self._params.antennas) or [""]:
                self._add(each, self._server)
        self.listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self.diagnostics.add_report("page", lambda: report(self._server))
        self.get_logger().info(f"operator's page at {self._server.address}; the token of commands is in {path}")

    def _add(self, namespace: str, server: PageServer) -> None:
        view = AntennaView(self, namespace, self._params.rate_hz, self.parameters.value("key"))
        self._views[view.path] = view
        self._at_cleanup.callback(view.close)
        if view.path:
            server.app.add(view.path)

    def turn(self) -> float:
        server = self._server
        if server is None:
            return super().turn()
        now_s, utc_s = time.monotonic(), time.time()
        if self._params.antennas == ALL and now_s >= self._looked_s + GRAPH_S:
            self._looked_s = now_s
            self._find(server)
        views, watching = list(self._views.values()), server.app.watching
        due = [each for each in views if each.board.turn(now_s, utc_s, watching(each.path))]
        while not server.requests.empty():
            each = server.requests.get()
            try:
                if each.name != JOG:
                    wanted = f"{each.name[:LONGEST_TEXT]!r} {each.arguments} requested by"
                    self.get_logger().info(f"{wanted} {each.who} {each.antenna}".rstrip())
                if each.antenna not in self._views:
                    raise ValueError("a command goes to one antenna: open its page")
                self._views[each.antenna].board.request(each.name, each.arguments, each.reply)
            except Exception as error:
                self.survived("a command", error)
                each.reply(False, f"{type(error).__name__}: {error}")
        for view in views:
            view.poll()
        shows = [partial(self._show, view, server) for view in due]
        if self._params.antennas and now_s >= self._shown_s + NETWORK_S:
            self._shown_s = now_s
            shows.append(partial(self._show_network, server, utc_s))
        for show in shows:
            try:
                show()
            except Exception as error:
                # What cannot be shown takes neither the commands nor another antenna with it.
                self.survived("what is shown", error)
        return min((each.board.wait_s for each in views), default=SLOW_S)

    def _find(self, server: PageServer) -> None:
        """Add the antennas that have appeared in the graph; those that leave it stay, as silent."""
        for namespace in antennas_in_graph(self):
            if namespace.lstrip("/") not in self._views and len(self._views) < MOST_ANTENNAS:
                self._add(namespace, server)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            level = LEVELS.index(status.level) if status.level in LEVELS else 2
            for view in self._views.values():
                check = status.name.partition(": ")[2]
                view.board.note_check(status.hardware_id, check, level, status.message)

    def _show(self, view: AntennaView, server: PageServer) -> None:
        live, board = view.take(), view.board
        families = board_metrics(live, board.age_s, board.kept, board.nodes, board.axes)
        if view.path:
            self._metrics[view.namespace] = families
            self._lines[view.namespace] = view.line(live)
        else:
            server.app.measured = time.monotonic(), families
        if server.app.watching(view.path):
            server.put(view.sections(live), view.path)

    def _show_network(self, server: PageServer, utc_s: float) -> None:
        server.app.measured = time.monotonic(), labelled(self._metrics)
        if server.app.watching(""):
            views = self._views.values()
            alarms = network.merged_alarms({each.namespace: network.alarms_of(each.board) for each in views})
            lines = network.worst_first(network.with_same_names(list(self._lines.values())))
            server.put({"lines": lines, "alarms": alarms, "utc": utc_text(utc_s)})


main = OperatorPage.main
