"""The operator's client of a running station: what it shows, and its requests.

A request says what the station answers and returns whether it was granted.  What moves or resets
the antenna is signed with its key, if this user can read it.
"""

import json
import math
import os
import select
import shutil
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.parameter import Parameter, parameter_value_to_python
from rf_pointing_msgs.action import RunSchedule, TrackPass
from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus, PassList, Schedule, TrackingStatus
from rf_pointing_msgs.srv import ChangeSchedule, GoTo, Jog, Named, PermitSun, SelectTarget
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.core import JOURNAL_BYTES, Kinematics, leaves, read_whole, utc_text
from rf_pointing.core.kinematics import mount_of_joints
from rf_pointing.ephemeris.target_offsets import TargetOffsets
from rf_pointing.operations.pass_list import read_passes
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.convert_planning import scheduled_to_message
from rf_pointing.ros.diagnostics import LEVELS
from rf_pointing.ros.graph import ALARMS, EXECUTIVE, EXECUTIVE_STATUS, SCHEDULE
from rf_pointing.ros.leased_services import LEASED, OWNER, Caller
from rf_pointing.ros.live_pass import LiveLine, LivePass, outcome_line
from rf_pointing.ros.managed_graph import TAKEN_UP_S, NotStartedError
from rf_pointing.ros.qos import LATCHED, STATUS, WATCHED
from rf_pointing.ros.recorder import Recorder
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.station_run import FOLLOW_S, GraphRun
from rf_pointing.ros.station_view import entry_values, pass_line, stamp_text, status_text, status_values, window_values
from rf_pointing.station.clients.alarm_hooks import NO_WAY

PATIENCE_S = 10.0
"""Wall time to find the station, or to get an answer."""
RESULT_S = 5.0
"""After the end of a night until its result must have arrived."""
LOOK_S = 1.5
"""Wall time in which a part that is there is seen."""
WATCH_S = 1.0
TESTED_S = 3.0
"""Wall time in which every node that has alarms shows them on /diagnostics."""
SENT_S = 60.0
"""Wall time until it is known what came of a message: three tries of 10 s, and what waits."""
NIGHT = {each: each for each in ("pause", "resume", "stop", "abort", "skip", "run")} | {"ack": "acknowledge"}
"""Services of the executive by the words that request them."""
JOG = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "up": (0.0, 1.0), "down": (0.0, -1.0)}
"""Directions of a jog, azimuth and elevation."""
ARROWS = {"\x1b[A": "up", "\x1b[B": "down", "\x1b[C": "right", "\x1b[D": "left"}
JOG_PAUSE_S = 0.1
FAST, SLOW, SLOW_BEAMS = 0.5, 0.1, 0.25
"""Rates of a jog: shares of the largest rate, and half-power beamwidths a second."""
ABOUT_ONE = ("skip", "run", "ack")
"""Requests that name a pass, a procedure or an alarm."""
LOST = ("lost", "missed", "weather")
"""States of the passes of a night that were not tracked."""
TARGET_CHECK = "ephemeris_publisher: target"
"""Check on /diagnostics with the numbers behind the target."""
ALARM_CHECK = "station_alarms: alarms"
"""Check with the alarms of a station without an executive."""
TOPICS = {
    SCHEDULE: (Schedule, LATCHED),
    EXECUTIVE_STATUS: (ExecutiveStatus, STATUS),
    "passes": (PassList, LATCHED),
    "antenna_status": (AntennaStatus, STATUS),
    # Volatile publishers do not match a request for kept messages.
    "tracking_status": (TrackingStatus, 10),
    "joint_states": (JointState, WATCHED),
}


class StationClient(GraphRun):
    """A client node in the namespace of one antenna; `newest` are its messages by topic.

    `key` is the file of the antenna's key, None for the one that antenna_servo names.
    """

    def __init__(self, namespace: str, key: Path | None = None) -> None:
        # A name of its own: several operators may look at one station.
        super().__init__("station", namespace, name=f"station_{os.getpid()}", patience_s=PATIENCE_S)
        self._given_key, self.newest = key, dict[str, Any]()
        for name, (kind, qos) in TOPICS.items():
            self.node.create_subscription(kind, name, lambda m, name=name: self.newest.__setitem__(name, m), qos)

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Wait for `condition`; TimeoutError says what was not seen, and where."""
        try:
            super().until(condition, what)
        except TimeoutError as error:
            raise TimeoutError(f"{error} in {self.place}") from error

    @property
    def mount(self) -> Kinematics:
        """A mount with the joints of the antenna."""
        return mount_of_joints(self.newest["joint_states"].name if "joint_states" in self.newest else ())

    # What it shows

    def show_passes(self, *, as_json: bool = False) -> bool:
        """Print the schedule, or without one the coming passes of the present target."""
        self._look(SCHEDULE)
        rows = [entry_values(each) for each in self.newest[SCHEDULE].passes] if SCHEDULE in self.newest else []
        if not rows:
            self.until(lambda: "passes" in self.newest, "passes")
            found = self.newest["passes"]
            rows = [window_values(each) | {"target": found.target} for each in found.passes]
        for text in [json.dumps(rows, indent=1)] if as_json else map(pass_line, rows):
            print(text)
        return True

    def show_status(self, *, watch: bool = False, as_json: bool = False, forget: bool = False) -> bool:
        """Print what the station does, with `watch` once a second; return whether all is well.

        With `forget` drop what passes taught of the target instead.
        """
        if forget:
            return self.ask("ephemeris_publisher/forget_learned")
        self._hear_of_target()
        # A line a second and a script wait for no diagnostics.
        more = () if watch or as_json else (TARGET_CHECK,)
        self._look("antenna_status", "tracking_status", EXECUTIVE_STATUS, "joint_states", *more)
        if "antenna_status" not in self.newest:
            raise TimeoutError(f"no antenna in {self.place}")
        while True:
            tracking = self.newest.get("tracking_status", TrackingStatus())
            executive = self.newest.get(EXECUTIVE_STATUS, ExecutiveStatus(state="none"))
            values = status_values(self.newest["antenna_status"], tracking, executive)
            if not self.mount.level:
                values["axes"] = self.mount.axes
            values["learned"] = self.newest.get(TARGET_CHECK, {}).get("learned", "")
            if executive.state == "none" and (own := self.newest.get(ALARM_CHECK)):
                values["alarms"] = [{"name": "station_alarms", **own, "acknowledged": False}]
            print(json.dumps(values) if as_json else status_text(values), flush=True)
            if not watch or self.stopping:
                return not values["fault"] and all(each["level"] != 2 for each in values["alarms"])
            with suppress(TimeoutError):
                self.waiting.until(lambda: self.stopping, "", WATCH_S)

    def show_journal(self, *, count: int = 30) -> bool:
        """Print the last lines of the executive's journal; NotStartedError if it is elsewhere."""
        folder = Path(str(self.parameter(EXECUTIVE, "executive.folder"))).expanduser()
        if not (path := folder / "journal.jsonl").is_file():
            raise NotStartedError(f"no journal at {path} on this computer")
        for line in read_whole(path, JOURNAL_BYTES).splitlines()[-count:]:
            row = json.loads(line)
            where = ".".join(filter(None, (row["block"], row["directive"])))
            print(f"{row['utc']} {row['event']:<16} {where:<28} {row['detail']}")
        return True

    def _look(self, *names: str) -> None:
        """Receive for a moment what is published; end early when all of `names` are there."""
        with suppress(TimeoutError):
            self.waiting.until(lambda: set(names) <= self.newest.keys(), "", LOOK_S)

    # Requests

    def ask(self, name: str) -> bool:
        """Call a service of the station that takes no argument, as `antenna_servo/park`."""
        return self._ask(Trigger, name, Trigger.Request())

    def night(self, request: str, name: str = "") -> bool:
        """Request one of `NIGHT` of the executive; "" names the present pass, or all alarms."""
        service = f"{EXECUTIVE}/{NIGHT[request]}"
        return self._ask(Named, service, Named.Request(name=name)) if request in ABOUT_ONE else self.ask(service)

    def test_alarms(self) -> bool:
        """Send a message by every way out of the station, and say what came of it."""
        found = dict[str, dict[str, str]]()

        def note(message: DiagnosticArray) -> None:
            for status in message.status:
                if status.name.endswith(": hooks"):
                    found[status.hardware_id] = {pair.key: pair.value for pair in status.values}

        self.node.create_subscription(DiagnosticArray, "/diagnostics", note, 100)
        nodes = {f"{self.namespace.rstrip('/')}/{name}": name for name in (EXECUTIVE, ALARMS)}
        with suppress(TimeoutError):
            self.waiting.until(lambda: nodes.keys() <= found.keys(), "", TESTED_S)
        tested = [full_name for full_name in nodes if full_name in found]
        if not tested:
            raise TimeoutError(f"neither {EXECUTIVE} nor {ALARMS} is in {self.place}")
        came = [self._test_alarms(nodes[full_name], found, full_name) for full_name in tested]
        return all(came)

    def _test_alarms(
        self, name: str, found: Mapping[str, Mapping[str, str]], full_name: str
    ) -> bool:  # fmt: skip
        answer = self._call(Trigger, f"{name}/test_alarms", Trigger.Request())
        utc, _, named = answer.message.partition(" ")
        if named == NO_WAY:
            self.say(f"{name}: {named}")
            return False
        ways = named.split(", ")
        with suppress(TimeoutError):
            tried = lambda: all(utc in found[full_name].get(way, "") for way in ways)  # noqa: E731
            self.waiting.until(tried, "", SENT_S)
        last = {way: found[full_name].get(way, "") for way in ways}
        late = f"not sent within {SENT_S:g} s"
        came = {way: text if utc in text else late for way, text in last.items()}
        for way, text in came.items():
            self.say(f"{name}: {way}: {text}")
        return all(text.startswith("sent") for text in came.values())

    def go(self, azimuth_rad: float, elevation_rad: float) -> bool:
        """Turn the axes to a position; the turn of the cables counts."""
        return self._ask(GoTo, f"{OWNER}/go_to", GoTo.Request(azimuth=azimuth_rad, elevation=elevation_rad))

    def jog(self, direction: str | None, seconds: float, *, fast: bool) -> bool:
        """Jog in a direction for a time, or while an arrow key of the terminal is held.

        The antenna stops half a second after the last call, whatever has become of this client.
        """
        self.until(lambda: "antenna_status" in self.newest, "antenna_status")
        if direction is not None:
            ends_s = time.monotonic() + seconds
            wanted = iter(lambda: direction if time.monotonic() < ends_s else None, None)
            return self._jog(wanted, fast=fast)
        self.say("arrow keys move the antenna while they are held, f: fast or slow, q: end")
        with arrow_keys(sys.stdin.fileno()) as keys:
            return self._jog(keys, fast=fast)

    def _jog(self, wanted: Iterable[str], *, fast: bool) -> bool:
        name = f"{OWNER}/jog"
        caller = Caller(self.node, CommandKey(CommandKeyParams(command_key_file=self.key())))
        client = caller.client(Jog, name)
        self.until(client.service_is_ready, name)
        for word in wanted:
            if self.stopping or word == "q":
                break
            fast ^= word == "f"
            if word not in JOG:
                self.spin(JOG_PAUSE_S)
                continue
            rates = self._jog_rates(fast=fast)
            azimuth, elevation = (sign * rate for sign, rate in zip(JOG[word], rates, strict=True))
            request = Jog.Request(azimuth=azimuth, elevation=elevation)
            future = client.call_async(caller.request(name, request))
            self.until(future.done, f"an answer of {name}")
            if not future.result().success:
                self.say(future.result().message)
                return False
            self.spin(JOG_PAUSE_S)
        return True

    def _jog_rates(self, *, fast: bool) -> list[float]:
        limits = map(float, self.newest["antenna_status"].rate_limit)
        beam_rad = self.newest.get("tracking_status", TrackingStatus()).beamwidth or math.inf
        return [FAST * each if fast else min(SLOW * each, SLOW_BEAMS * beam_rad) for each in limits]

    def permit_sun(self, until: float | None, by: str, band: str) -> bool:
        """Let the beam of a band look into the Sun until a time (UTC s), None: no longer."""
        request = PermitSun.Request(by="" if until is None else by, band=band)
        request.until = stamp_from_seconds(until or 0.0)
        return self._ask(PermitSun, f"{OWNER}/permit_sun", request)

    def queue(self, text: str | None, remove: Sequence[str] = (), *, start: bool = False) -> bool:
        """Give the passes of a file of plan_passes to the executive, and take others away.

        With `start` the executive runs the schedule ("": the kept one), and is followed to its end.
        """
        passes = read_passes(text, every=False) if text else []
        messages = [scheduled_to_message(each) for each in passes]
        if start:
            return self._run_schedule(RunSchedule.Goal(passes=messages, resume=not text))
        request = ChangeSchedule.Request(add=messages, remove=list(remove))
        granted = self._ask(ChangeSchedule, f"{EXECUTIVE}/change_schedule", request)
        if granted and passes:
            self.say(f"{len(passes)} passes from {utc_text(passes[0].aos_t_s)}")
        return granted

    def offsets(self, request: tuple[str, str] | None = None, **wanted: float | None) -> bool:
        """Set offsets of the target in one step, by the names of their parameters.

        Or do a `request`: clear, or keep, recall or forget the set of a name; without anything show
        the offsets and the sets.
        """
        given = {name: value for name, value in wanted.items() if value is not None}
        if request is not None:
            word, name = request
            service = f"ephemeris_publisher/{word}_offsets"
            if word == "clear":
                return self.ask(service)
            return self._ask(Named, service, Named.Request(name=name))
        if not given:
            return self._show_offsets()
        rows = [
            ParameterMessage(name=f"source.{name}", value=Parameter("", value=value).get_parameter_value())
            for name, value in given.items()
        ]
        name = "ephemeris_publisher/set_parameters_atomically"
        answer = self._call(SetParametersAtomically, name, SetParametersAtomically.Request(parameters=rows)).result
        self.say(answer.reason or ", ".join(f"{name}={value}" for name, value in given.items()))
        return bool(answer.successful)

    def _show_offsets(self) -> bool:
        self._hear_of_target()
        self.until(lambda: TARGET_CHECK in self.newest, "ephemeris_publisher on /diagnostics")
        for name in (*leaves(TargetOffsets()), "offset_sets"):
            print(f"{name}: {self.newest[TARGET_CHECK].get(name, '')}")
        return True

    def _hear_of_target(self) -> None:
        """Keep the newest values of the publisher's check of its target, and of the alarms."""

        def note(message: DiagnosticArray) -> None:
            for status in message.status:
                if status.name.endswith(TARGET_CHECK):
                    self.newest[TARGET_CHECK] = {pair.key: pair.value for pair in status.values}
                elif status.name.endswith(ALARM_CHECK):
                    level = LEVELS.index(status.level)
                    self.newest[ALARM_CHECK] = {"level": level, "message": status.message} if level else {}

        self.node.create_subscription(DiagnosticArray, "/diagnostics", note, 100)

    def track(
        self, satellite: str, sensor: str = "auto", min_peak_rad: float = 0.0,
        near_s: float | None = None, output: Path | None = None, *, band: str = "",
        record: bool = True,
    ) -> bool:  # fmt: skip
        """Track the pass at or nearest to `near_s` (None: the next), with recording and report.

        Return whether it was tracked.
        """
        self._look(EXECUTIVE_STATUS)
        if EXECUTIVE_STATUS in self.newest and self.newest[EXECUTIVE_STATUS].state == "running":
            raise NotStartedError("the executive runs a schedule: use queue, or night pause first")
        stem = f"{satellite.replace('/', '_')}-{datetime.now(UTC):%Y%m%dT%H%M%S}"
        folder = output or Path("runs") / stem
        if (folder / "bag").exists():
            raise NotStartedError(f"output={folder} holds a bag already")
        goal = TrackPass.Goal(satellite=satellite, sensor=sensor, band=band)
        goal.minimum_peak_elevation = min_peak_rad
        if near_s is not None:
            goal.near = stamp_from_seconds(near_s)
        live = LivePass(self)
        self.until(live.client.server_is_ready, "track_pass")
        given = self.node, self.namespace, folder / "bag"
        simulated = self.node.count_publishers(f"{self.namespace}/clock") > 0
        recorder = Recorder(*given, simulated=simulated) if record else None
        try:
            result = live.result(live.begin(goal))
        finally:
            closed = recorder.close() if recorder is not None else None
        window = result.target_pass
        if not window.target:
            # There was no pass to record.
            shutil.rmtree(folder / "bag", ignore_errors=True)
            raise NotStartedError(result.message)
        self.say(f"{window.target}: AOS {stamp_text(window.aos)}, LOS {stamp_text(window.los)}, "
                 f"peak {math.degrees(window.peak_elevation):.1f} deg")  # fmt: skip
        if closed is not None:
            if closed.problem:
                self.say(f"recording stopped: {closed.problem}")
            # Imported late: its libraries take time that the pass may not have.
            from rf_pointing.report import write_report

            write_report(closed.path, folder)
            self.say(f"report {folder / 'report.html'}")
        self.say(outcome_line(result))
        return bool(result.success)

    def _run_schedule(self, goal: RunSchedule.Goal) -> bool:
        client, line = ActionClient(self.node, RunSchedule, "run_schedule"), LiveLine(1.0)
        self.until(client.server_is_ready, "run_schedule")
        handle = self.send(client, goal, EXECUTIVE, lambda m: line.show(lambda: _night_line(m.feedback)))
        result = self._end_of_night(handle)
        if result is None:
            states = [each.state for each in self.newest[SCHEDULE].passes]
            lost = sum(state in LOST for state in states)
            self.say(
                f"the night has ended: {states.count('tracked')} tracked, {lost} not; the executive was started again "
                "in it"
            )
            return not lost
        self.say(result.message)
        if result.report:
            self.say(f"morning report {result.report}/night.html")
        return bool(result.success)

    def _end_of_night(self, handle: Any) -> RunSchedule.Result | None:
        """Return the result; None if an executive that was started again has ended the night."""
        ended, begun, idle_s = handle.get_result_async(), False, math.inf
        while not ended.done():
            self.spin(FOLLOW_S)
            if self.stopping:
                # The night goes on without its client; `station night stop` ends it.
                raise NotStartedError("no longer followed; the night goes on")
            state = self.newest[EXECUTIVE_STATUS].state if EXECUTIVE_STATUS in self.newest else "idle"
            begun = begun or state != "idle"
            idle_s = min(idle_s, time.monotonic()) if begun and state == "idle" else math.inf
            if time.monotonic() - idle_s > RESULT_S:
                return None
        found: RunSchedule.Result = ended.result().result
        return found

    def _ask(self, kind: Any, name: str, request: Any) -> bool:
        answer = self._call(kind, name, request)
        self.say(answer.message)
        return bool(answer.success)

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        caller = Caller(self.node, CommandKey(CommandKeyParams(command_key_file=self.key() if name in LEASED else "")))
        client = caller.client(kind, name)
        self.waiting.pause(TAKEN_UP_S)
        self.until(client.service_is_ready, name)
        future = client.call_async(caller.request(name, request))
        self.until(future.done, f"an answer of {name}")
        return future.result()

    def parameter(self, node: str, name: str) -> Any:
        """Return the value of a parameter of a node of the station, None where it has none."""
        found = self._call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=[name]))
        return parameter_value_to_python(found.values[0]) if found.values else None

    def select(self, target: str) -> None:
        """Make a target that of the ephemeris, so that its receivers know what to expect."""
        answer = self._call(SelectTarget, "ephemeris_publisher/select_target", SelectTarget.Request(target=target))
        if not answer.success:
            raise ValueError(answer.message)

    def key(self) -> str:
        """Return the file of the antenna's key, "" where this user or computer has none."""
        if self._given_key is not None:
            return str(self._given_key)
        path = self.parameter(OWNER, "command_key_file")
        return path if path and Path(path).is_file() and Path(path).stat().st_uid == os.getuid() else ""


@contextmanager
def arrow_keys(terminal: int) -> Iterator[Iterator[str]]:
    """Yield the keys of a terminal as words, "" while none is held."""
    before = termios.tcgetattr(terminal)
    # A held key repeats itself: no word for its release is needed.
    tty.setcbreak(terminal)

    def words() -> Iterator[str]:
        while True:
            ready = select.select([terminal], [], [], 0.0)[0]
            # Only the newest of what a slow link has left behind.
            text = os.read(terminal, 1000).decode(errors="replace") if ready else ""
            yield ARROWS.get(text[-3:], text[-1:])

    try:
        yield words()
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _night_line(feedback: RunSchedule.Feedback) -> str:
    doing = f"{feedback.target}: {feedback.step}" if feedback.target else "between passes"
    return f"{feedback.state}, {feedback.passes_done} done, {feedback.passes_left} left, {doing}"
