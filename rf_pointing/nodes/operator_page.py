"""Executable `operator_page`: the station in a browser, and its commands for who has the token.

    ros2 run rf_pointing operator_page --ros-args -r __ns:=/gs1

Subscribes: antenna_status, tracking_status, joint_states, target, passes, pass_profiles,
pass_certificate, schedule, executive_status, station_in_use, /diagnostics of its namespace.
Requests: the services and actions of the other nodes, as every other client; limits, horizon and
offsets by get_parameters of pointing_controller and ephemeris_publisher.
Parameters: page.* (address, port, token, reports), command_key_file (signs the calls of
antenna_servo).

The page moves nothing by itself.  A pass that it has started goes on without it.
"""

import math
import queue
import time
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python
from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import JointState

from rf_pointing.core import leaves, with_leaves
from rf_pointing.core.dates import utc_text
from rf_pointing.core.whole_file import read_whole
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.operations.dictionary import TABLES, DirectiveRow, read_directives
from rf_pointing.planning import HorizonMask
from rf_pointing.ros import convert, convert_planning, station_view
from rf_pointing.ros.command_key import CommandKeyParams
from rf_pointing.ros.diagnostics import LEVELS, OK, WARN, Health
from rf_pointing.ros.directives import DirectiveSender
from rf_pointing.ros.graph import EXECUTIVE, EXECUTIVE_STATUS, OPERATOR_PAGE, SCHEDULE, STATION_IN_USE
from rf_pointing.ros.lifecycle import LifecycleParams
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import IN_USE, LATCHED, STATUS, STREAM
from rf_pointing.ros.station_view import stamp_text
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers
from rf_pointing.web.page_server import Answer, PageParams, PageServer, read_token

SLOW_S = 1.0
"""Wall time between two looks at what changes seldom."""
PARAMETERS_S = 5.0
"""Wall time between two requests for the limits in force: some change while the nodes run."""
REPORTS_S = 10.0
LONGEST_TEXT = 200
MOST_ROWS = 200
"""Of passes, nodes and their checks that are shown."""
EVENTS = 30
FROM_DICTIONARY = (
    "stop_antenna", "stop_pass", "pause_antenna", "release", "park", "stow", "reset_antenna_fault", "select_target", "track",
    "set_along_track", "set_cross_track",
)  # fmt: skip
"""Directives of the shipped dictionary that the page sends."""
OF_EXECUTIVE = {"acknowledge": True, "skip": True, "pause": False, "resume": False, "stop": False, "abort": False}
"""Services of the executive that the page calls as `night_…`, and whether they take a name."""
TAKES = {"track": ("aos_utc", "sensor")}
"""Arguments where they differ: a goal needs a whole pass, a viewer names a shown one."""
FAST = {
    "antenna": ("antenna_status", ours.AntennaStatus, STATUS),
    "tracking": ("tracking_status", ours.TrackingStatus, STREAM),
    "target": ("target", ours.Target, STREAM),
}
LIMITS = ("azimuth_min_deg", "azimuth_max_deg", "elevation_min_deg", "elevation_max_deg")
CONTROLLER, EPHEMERIS = "pointing_controller", "ephemeris_publisher"
OFFSETS = ("source.along_track_offset_s", "source.cross_track_offset_deg")


def command_rows() -> dict[str, DirectiveRow]:
    """Return what the page can send, by name."""
    shipped = read_directives(read_whole(TABLES / "directives.yaml"))
    rows = {name: shipped[name] for name in FROM_DICTIONARY}
    for name, named in OF_EXECUTIVE.items():
        kind, takes = ("rf_pointing_msgs/srv/Named", ("name",)) if named else ("std_srvs/srv/Trigger", ())
        rows[f"night_{name}"] = DirectiveRow(
            name=f"night_{name}", kind="service", address=f"{EXECUTIVE}/{name}", type_name=kind, takes=takes
        )
    return rows


def checked_arguments(row: DirectiveRow, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a command; ValueError for one that it does not take, or no number."""
    takes = TAKES.get(row.name, row.takes)
    for name, value in arguments.items():
        if name not in takes:
            raise ValueError(
                f"{row.name} has no argument {name[:LONGEST_TEXT]!r}; it takes {', '.join(takes) or 'none'}"
            )
        if isinstance(value, str) and len(value) > LONGEST_TEXT:
            raise ValueError(f"{name} has {len(value)} characters, must be <= {LONGEST_TEXT}")
        if row.kind == "parameter" and (isinstance(value, bool) or not isinstance(value, (int, float))):
            raise ValueError(f"{row.name}: {name}={value!r} must be a number")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{row.name}: {name}={value} must be finite")
    found = dict(arguments)
    if row.kind == "parameter" and "value" in found:
        found["value"] = float(found["value"])
    return found


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
        self._rows = command_rows()
        self._requests: queue.SimpleQueue[tuple[str, Mapping[str, Any], str, Future[Answer]]] = queue.SimpleQueue()
        self._answers: dict[int, tuple[str, Future[Answer]]] = {}
        self._number = 0
        self._sent: deque[dict[str, Any]] = deque(maxlen=EVENTS)
        key = self.parameters.value("key")
        self._sender = DirectiveSender(self, self._rows, {}, self._responded, self._ended, key)
        self._at_cleanup.callback(self._sender.close)
        self._newest: dict[str, Any] = {}
        self._seen_s: dict[str, float] = {}
        self._nodes: dict[str, dict[str, Any]] = {}
        self._profiles: list[ours.PassProfile] = []
        self._sections: dict[str, Any] = {}
        self._sun: SolarDirection | None = None
        self._waiting: dict[str, Any] = {}
        self._next_s = self._slow_s = self._parameters_s = self._reports_s = 0.0
        self._watched = False
        self._subscribe()
        token, path = read_token(params.token_file, self.lock.path.with_suffix(".token"))
        self._server = PageServer(params, token, self._request)
        self._at_cleanup.callback(self._close)
        self.diagnostics.add("page", self._health)
        self.get_logger().info(f"operator's page at {self._server.address}; the token of commands is in {path}")

    def _subscribe(self) -> None:
        self._fast = {
            name: self.listen_latest(kind, topic, lambda message: message, qos)
            for name, (topic, kind, qos) in FAST.items()
        }
        self._fast["joints"] = self.listen_latest(JointState, "joint_states", convert.joints_from_message, STREAM)
        self.listen(ours.PassList, "passes", lambda m: self._keep("passes", m), LATCHED)
        self.listen(ours.PassProfileList, "pass_profiles", self._on_profiles, LATCHED)
        self.listen(ours.PassCertificate, "pass_certificate", self._on_certificate, LATCHED)
        self.listen(ours.Schedule, SCHEDULE, lambda m: self._keep("schedule", m), LATCHED)
        self.listen(ours.ExecutiveStatus, EXECUTIVE_STATUS, lambda m: self._keep("executive", m), STATUS)
        self.listen(ours.StationInUse, STATION_IN_USE, lambda m: self._keep("station", m), IN_USE)
        self.listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, STREAM)
        self._readers = {
            name: self.create_client(GetParameters, f"{name}/get_parameters") for name in (CONTROLLER, EPHEMERIS)
        }
        for client in self._readers.values():
            self._at_cleanup.callback(self.destroy_client, client)

    def _close(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            server.close()

    def turn(self) -> float:
        if self._server is None:
            return super().turn()
        self._act()
        self._sender.poll()
        now_s, watched = time.monotonic(), self._server.app.viewers > 0
        if watched and not self._watched:
            # The first viewer has nothing yet.
            self._next_s = self._slow_s = self._reports_s = 0.0
            self._sections.clear()
        self._watched = watched
        if now_s >= self._next_s:
            period_s = 1.0 / self.parameters.value("page").rate_hz if watched else SLOW_S
            self._next_s = max(self._next_s + period_s, now_s + 0.5 * period_s)
            try:
                self._show(now_s)
            except Exception as error:
                # What cannot be shown must not take the commands with it.
                self.survived("what is shown", error)
        return min(0.05, max(0.001, self._next_s - now_s))

    # What is known

    def _keep(self, name: str, message: Any) -> None:
        self._newest[name], self._seen_s[name] = message, time.monotonic()

    def _on_profiles(self, message: ours.PassProfileList) -> None:
        self._profiles = list(message.profiles)

    def _on_certificate(self, message: ours.PassCertificate) -> None:
        self._newest["certificate"] = station_view.certificate_section(message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        mine = self.get_namespace().rstrip("/") + "/"
        for status in message.status:
            name = status.hardware_id.removeprefix(mine)
            known = name in self._nodes or len(self._nodes) < MOST_ROWS
            if not status.hardware_id.startswith(mine) or not known:
                continue
            row = self._nodes.setdefault(name, {"checks": {}})
            row["seen_s"] = time.monotonic()
            check = status.name.partition(": ")[2]
            if check in row["checks"] or len(row["checks"]) < MOST_ROWS:
                row["checks"][check] = (LEVELS.index(status.level) if status.level in LEVELS else 2, status.message)

    def _read_parameters(self, now_s: float) -> None:
        """Request what is in force, and take what has arrived."""
        for name, future in list(self._waiting.items()):
            if future.done():
                del self._waiting[name]
                self._take_parameters(name, future.result())
        if now_s < self._parameters_s:
            return
        self._parameters_s = now_s + PARAMETERS_S
        for name, client in self._readers.items():
            if name in self._waiting:
                # Lost with its node.
                client.remove_pending_request(self._waiting.pop(name))
            if client.service_is_ready():
                self._waiting[name] = client.call_async(GetParameters.Request(names=self._names(name)))

    @staticmethod
    def _names(node: str) -> list[str]:
        if node == EPHEMERIS:
            return list(OFFSETS)
        sets = {"mask": HorizonMask(), "sun": SunParams()}
        return [
            *(f"limits.{name}" for name in LIMITS), "machine.sun_radius_deg",
            *(f"{prefix}.{edge}" for prefix, defaults in sets.items() for edge in leaves(defaults)),
        ]  # fmt: skip

    def _take_parameters(self, node: str, answer: Any) -> None:
        if answer is None or len(answer.values) != len(self._names(node)):
            return
        values = {
            name: tuple(value) if not isinstance(value, (bool, int, float, str)) else value
            for name, value in zip(self._names(node), map(parameter_value_to_python, answer.values), strict=True)
            if value is not None
        }
        if node == EPHEMERIS:
            self._newest["offsets"] = dict(zip(("along_s", "cross_deg"), map(values.get, OFFSETS), strict=True))
            return
        try:
            mask = with_leaves(HorizonMask(), _below("mask", values))
            sun = with_leaves(SunParams(), _below("sun", values))
        except ValueError as error:
            self.inputs.note_refusal("get_parameters", str(error))
            return
        self._newest["sky"] = {
            "limits_deg": [values.get(f"limits.{name}") for name in LIMITS],
            "mask_deg": station_view.mask_values(mask), "sun_radius_deg": values.get("machine.sun_radius_deg"),
        }  # fmt: skip
        if self._sun is None or self._sun.site != sun.site:
            self._sun = SolarDirection(sun)

    # What is shown

    def _show(self, now_s: float) -> None:
        assert self._server is not None
        for name, latest in self._fast.items():
            message = latest.take()
            if message is not None:
                self._keep(name, message)
        if not self._watched:
            return
        sections = {"live": self._live(now_s)}
        if now_s >= self._slow_s:
            self._slow_s = now_s + SLOW_S
            self._read_parameters(now_s)
            sections |= self._slow(now_s)
        self._server.put(sections)

    def _live(self, now_s: float) -> dict[str, Any]:
        newest = self._newest
        names = ("antenna", "tracking", "target", "executive")
        values: dict[str, Any] = {
            "age_s": {name: round(max(0.0, now_s - self._seen_s[name]), 1) for name in names if name in self._seen_s},
            "viewers": self._server.app.viewers if self._server else 0,
        }
        antenna, tracking = newest.get("antenna"), newest.get("tracking")
        if antenna is not None:
            shown = station_view.status_values(
                antenna, tracking or ours.TrackingStatus(), newest.get("executive", ours.ExecutiveStatus(state="none"))
            )
            # The executive has a section of its own.
            values |= {name: value for name, value in shown.items() if name not in ("alarms", "blocks")}
            values |= station_view.moving_values(antenna, tracking or ours.TrackingStatus())
        if "joints" in newest:
            values["encoder_deg"] = station_view.degrees(newest["joints"].position_rad)
        if "target" in newest:
            values["sky_target"] = station_view.target_values(newest["target"])
        return values

    def _slow(self, now_s: float) -> dict[str, Any]:
        newest, found = self._newest, dict[str, Any]()
        t_s = station_view.seconds_from_stamp(newest["antenna"].header.stamp) if "antenna" in newest else time.time()
        used = newest.get("station")
        found["station"] = {
            "name": used.station if used else "", "band": used.band if used else "", "namespace": self.get_namespace(),
            "sensors": list(SENSOR_CHOICES), "offsets": newest.get("offsets"), **newest.get("sky", {}),
        }  # fmt: skip
        sun = self._sun.at(t_s) if self._sun else None
        found["sun"] = station_view.degrees(sun, 2) if sun else None
        if "passes" in newest:
            rows = [station_view.window_values(each) for each in newest["passes"].passes[:MOST_ROWS]]
            found["passes"] = {"target": newest["passes"].target, "rows": rows}
        found["path"] = self._path(t_s)
        found["certificate"] = newest.get("certificate")
        if "executive" in newest:
            found["executive"] = station_view.executive_values(newest["executive"])
        if "schedule" in newest:
            found["schedule"] = [station_view.entry_values(each) for each in newest["schedule"].passes[:MOST_ROWS]]
        found["nodes"] = [
            {"name": name, "silent_s": round(silent_s) if (silent_s := now_s - row["seen_s"]) > 3.0 else 0,
             "checks": [[check, *state] for check, state in row["checks"].items()]}
            for name, row in sorted(self._nodes.items())
        ]  # fmt: skip
        if now_s >= self._reports_s:
            self._reports_s = now_s + REPORTS_S
            self._server.find_reports()
        found["events"] = list(self._sent)
        return found

    def _path(self, t_s: float) -> dict[str, Any] | None:
        """Return the pass that lasts or comes next, of the selected target."""
        for profile in self._profiles:
            if profile.time and station_view.seconds_from_stamp(profile.aos) + profile.time[-1] > t_s:
                key = f"{profile.target} {stamp_text(profile.aos)}"
                if self._sections.get("path", ("",))[0] != key:
                    try:
                        values = station_view.path_values(convert_planning.profile_from_message(profile))
                    except ValueError as error:
                        self.inputs.note_refusal("pass_profiles", str(error))
                        return None
                    self._sections["path"] = key, values
                return dict(self._sections["path"][1])
        return None

    # Commands

    def _request(self, name: str, arguments: Mapping[str, Any], who: str) -> "Future[Answer]":
        """Take a command of the server's thread; this node's own thread sends it."""
        future: Future[Answer] = Future()
        self._requests.put((name, arguments, who, future))
        return future

    def _act(self) -> None:
        while not self._requests.empty():
            name, arguments, who, future = self._requests.get_nowait()
            self._number += 1
            self._answers[self._number] = name, future
            self.get_logger().info(f"{name[:LONGEST_TEXT]} {dict(arguments)} requested by {who}")
            try:
                self._send(self._number, name, arguments)
            except (ValueError, TypeError) as error:
                self._responded(self._number, False, str(error))

    def _send(self, number: int, name: str, arguments: Mapping[str, Any]) -> None:
        row = self._rows.get(name)
        if row is None:
            raise ValueError(f"command {name[:LONGEST_TEXT]!r} must be one of {', '.join(self._rows)}")
        found = checked_arguments(row, arguments)
        if name == "track":
            found = {"target_pass": self._pass(found.get("aos_utc", "")), "sensor": found.get("sensor", "auto")}
        self._sender.send(number, name, found)

    def _pass(self, aos_utc: str) -> ours.Pass:
        executive = self._newest.get("executive")
        if executive is not None and executive.state == "running" and self._age_s("executive") < PARAMETERS_S:
            raise ValueError("the executive runs a schedule: pause the night first")
        passes = self._newest["passes"].passes if "passes" in self._newest else []
        for window in passes:
            if stamp_text(window.aos) == aos_utc:
                return window
        raise ValueError(f"aos_utc={aos_utc!r} is none of the {len(passes)} coming passes: select the target first")

    def _age_s(self, name: str) -> float:
        return time.monotonic() - self._seen_s.get(name, -math.inf)

    def _responded(self, number: int, accepted: bool, text: str) -> None:
        name, future = self._answers.pop(number, ("", None))
        if future is None:
            return
        words = text or ("accepted" if accepted else "refused")
        self._note(accepted, f"{name}: {words}")
        if not future.done():
            future.set_result((accepted, words))

    def _ended(self, _number: int, name: str, succeeded: bool, result: dict[str, Any]) -> None:
        self._note(succeeded, f"{name} ended: {result.get('message') or 'no message'}")

    def _note(self, accepted: bool, text: str) -> None:
        self._sent.appendleft({"utc": utc_text(time.time())[:19], "accepted": accepted, "text": text})
        self._slow_s = 0.0

    def _health(self) -> Health:
        if self._server is None:
            return Health(WARN, "not served")
        app = self._server.app
        values = {"viewers": app.viewers, "slow_viewers_dropped": app.dropped, "commands": app.commands,
                  "requests_refused": app.refused}  # fmt: skip
        return Health(OK, f"{self._server.address}, {app.viewers} viewers", values)


def _below(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    start = f"{prefix}."
    return {name.removeprefix(start): value for name, value in values.items() if name.startswith(start)}


def main() -> None:
    """Entry point of `ros2 run rf_pointing operator_page`."""
    run(OperatorPage)
