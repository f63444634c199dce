"""Executable `station`: the operator's client of a running station, real or simulated.

    station passes                          the schedule, or the coming passes of the present target
    station track SATELLITE                 track its next pass: live line, recording, report
    station queue night.csv --start         hand a schedule over, and let the executive run it
    station status --watch                  what it does, and the alarms
    station go 120 45                       turn the axes to azimuth and elevation, deg
    station park | stow | pause | release | disable | stop | reset
    station offset --along 0.3 --cross 0.01
    station night pause | resume | stop | abort | skip [ID] | ack [ALARM]
    station log -n 50                       the journal of the executive

What moves or resets the antenna is signed with its key, if this user can read it: then it is served
in somebody's pass too.

Exit code 0: done, or all well; 1: the pass was not tracked, a request was refused, or an error
lasts; 2: the station could not be reached, or the command line is wrong.
"""

import argparse
import json
import math
import os
import shutil
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.parameter import Parameter, parameter_value_to_python
from rf_pointing_msgs.action import RunSchedule, TrackPass
from rf_pointing_msgs.msg import AntennaStatus, ExecutiveStatus, PassList, Schedule, TrackingStatus
from rf_pointing_msgs.srv import ChangeSchedule, GoTo, Named
from std_srvs.srv import Trigger

from rf_pointing.commands.live_pass import LivePass, outcome_line
from rf_pointing.commands.options import add_namespace_option, between, say
from rf_pointing.commands.station_run import EVENT_S, FOLLOW_S, GraphRun, run_to_end
from rf_pointing.core.dates import parse_utc, utc_text
from rf_pointing.operations.pass_list import read_passes
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.graph import EXECUTIVE, EXECUTIVE_STATUS, SCHEDULE
from rf_pointing.ros.leased_services import LEASED, OWNER, Caller
from rf_pointing.ros.managed_graph import NotStartedError
from rf_pointing.ros.qos import LATCHED, STATUS
from rf_pointing.ros.recorder import Recorder
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.station_view import entry_values, stamp_text, status_values, window_values
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers

PATIENCE_S = 10.0
"""Wall time to find the station, or to get an answer."""
RESULT_S = 5.0
"""After the end of a night until its result must have arrived."""
LOOK_S = 1.5
"""Wall time in which a part that is there is seen."""
ANTENNA = {"park": "park", "stow": "stow", "pause": "pause", "release": "resume", "disable": "disable",
           "reset": "reset_fault"}  # fmt: skip
NIGHT = ("pause", "resume", "stop", "abort", "skip", "ack")


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Return the parsed command line."""
    load_trackers()
    parser = argparse.ArgumentParser(prog="station", description="Operate a running station.")
    add_namespace_option(parser)
    parser.add_argument("--key", metavar="FILE", help="key of the commands (default: that of antenna_servo)")
    every = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, text: str) -> argparse.ArgumentParser:
        return every.add_parser(name, help=text, description=text)

    add("passes", "show the schedule, or the coming passes of the present target").add_argument(
        "--json", action="store_true", help="print JSON"
    )
    track = add("track", "track the next pass of a satellite, record it and report on it")
    track.add_argument("satellite", help="catalogue number or name")
    track.add_argument("--sensor", choices=tuple(SENSOR_CHOICES), default="auto", help="(default: auto)")
    track.add_argument(
        "--min-peak", type=between(0.0, 90.0), default=0.0, help="least peak elevation in deg (default: 0)"
    )
    track.add_argument(
        "--near", type=parse_utc, metavar="UTC", help="the pass at or nearest to this time (default: the next)"
    )
    track.add_argument("--output", metavar="DIR", help="folder of recording and report (default: runs/SATELLITE-TIME)")
    track.add_argument("--no-record", action="store_true", help="neither recording nor report")
    queue = add("queue", "hand passes over to the executive: JSON, CSV or ICS of plan_passes")
    queue.add_argument("file", nargs="?", type=Path, help="file of the passes")
    queue.add_argument("--remove", nargs="+", default=[], metavar="ID", help="take passes out")
    queue.add_argument("--start", action="store_true", help="run the schedule, and follow it to its end")
    status = add("status", "show what the station does, and the alarms")
    status.add_argument("--watch", action="store_true", help="until Ctrl-C, a line a second")
    status.add_argument("--json", action="store_true", help="print JSON")
    go = add("go", "turn the axes to a position and hold there")
    go.add_argument("azimuth", type=between(-1000.0, 1000.0), help="deg, the turn of the cables counts")
    go.add_argument("elevation", type=between(-20.0, 200.0), help="deg")
    for name, text in (("park", "go to the park position"), ("stow", "go to the stow position"),
                       ("pause", "stop, and keep the commands that come"), ("disable", "stop, and set the brakes"),
                       ("release", "leave a pause or a rest"), ("reset", "clear a latched fault")):  # fmt: skip
        add(name, text)
    add("stop", "end the pass under control").add_argument(
        "--antenna", action="store_true", help="stop the antenna itself: latches a fault"
    )
    offset = add("offset", "set the target off its elements")
    offset.add_argument("--along", type=between(-60.0, 60.0), metavar="S", help="ahead of its elements")
    offset.add_argument("--cross", type=between(-5.7, 5.7), metavar="DEG", help="right of its elements")
    night = add("night", "request something of the executive")
    night.add_argument("request", choices=NIGHT)
    night.add_argument(
        "name", nargs="?", default="", help="id of the pass, or the alarm (default: the present one, all)"
    )
    add("log", "show the journal of the executive").add_argument(
        "-n", type=int, default=30, help="last lines (default: 30)"
    )
    options = parser.parse_args(argv)
    if options.command == "offset" and options.along is None and options.cross is None:
        parser.error("offset needs --along or --cross")
    if options.command == "queue" and not (options.file or options.remove or options.start):
        parser.error("queue needs a file, --remove or --start")
    return options


class StationClient(GraphRun):
    """A client node in the namespace of one antenna."""

    def __init__(self, options: argparse.Namespace) -> None:
        # A name of its own: several operators may look at one station.
        super().__init__(f"station_{os.getpid()}", options.namespace)
        self._program, self.options, self.newest = "station", options, {}
        kinds = {SCHEDULE: (Schedule, LATCHED), EXECUTIVE_STATUS: (ExecutiveStatus, STATUS), "passes": (PassList, LATCHED),
                 "antenna_status": (AntennaStatus, STATUS), "tracking_status": (TrackingStatus, STATUS)}  # fmt: skip
        for name, (kind, qos) in kinds.items():
            # Volatile publishers do not match a request for kept messages.
            qos = 10 if name == "tracking_status" else qos
            self.node.create_subscription(kind, name, lambda m, name=name: self.newest.__setitem__(name, m), qos)

    def work(self) -> int:
        """Do what the command line says; return the exit code."""
        command = self.options.command
        if command in ANTENNA:
            return self._ask(Trigger, f"antenna_servo/{ANTENNA[command]}", Trigger.Request())
        return int(getattr(self, f"_{command}")())

    # Waiting

    def _until(self, condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> None:
        deadline_s = time.monotonic() + patience_s
        while not condition():
            if self.stopping:
                raise NotStartedError("interrupted")
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"{what} not seen within {patience_s:.0f} s in {self.options.namespace}")
            self.spin(EVENT_S)

    def _call(self, kind: Any, name: str, request: Any) -> Any:
        caller = Caller(self.node, CommandKey(CommandKeyParams(command_key_file=self._key() if name in LEASED else "")))
        client = caller.client(kind, name)
        self._until(client.service_is_ready, name)
        future = client.call_async(caller.request(name, request))
        self._until(future.done, f"an answer of {name}")
        return future.result()

    def _key(self) -> str:
        """Return the file of the antenna's key, "" where this user or computer has none."""
        path = self.options.key
        if path is None:
            found = self._call(
                GetParameters, f"{OWNER}/get_parameters", GetParameters.Request(names=["command_key_file"])
            )
            path = parameter_value_to_python(found.values[0]) if found.values else None
            if not path or not Path(path).is_file() or Path(path).stat().st_uid != os.getuid():
                path = ""
        elif not Path(path).is_file():
            raise ValueError(f"--key {path}: no such file")
        return str(path)

    def _ask(self, kind: Any, name: str, request: Any) -> int:
        answer = self._call(kind, name, request)
        self.say(answer.message)
        return 0 if answer.success else 1

    def _look(self, *names: str) -> None:
        """Receive for a moment what is published; end early when all of `names` are there."""
        deadline_s = time.monotonic() + LOOK_S
        while time.monotonic() < deadline_s and not set(names) <= self.newest.keys():
            self.spin(EVENT_S)

    # Commands

    def _passes(self) -> int:
        self._look(SCHEDULE)
        rows = [entry_values(each) for each in self.newest[SCHEDULE].passes] if SCHEDULE in self.newest else []
        if not rows:
            self._until(lambda: "passes" in self.newest, "passes")
            found = self.newest["passes"]
            rows = [window_values(each) | {"target": found.target} for each in found.passes]
        if self.options.json:
            print(json.dumps(rows, indent=1))
            return 0
        for row in rows:
            more = f"  {row['priority']:>4} {row['state']:<8} {row['id']}: {row['reason']}" if "id" in row else ""
            print(
                f"{row['aos_utc'][:19]} {row['los_utc'][11:19]} {row['peak_deg']:6.2f} deg  {row['target']:<24}{more}"
            )
        return 0

    def _track(self) -> int:
        options = self.options
        self._look(EXECUTIVE_STATUS)
        if EXECUTIVE_STATUS in self.newest and self.newest[EXECUTIVE_STATUS].state == "running":
            raise NotStartedError("the executive runs a schedule: use queue, or night pause first")
        stem = f"{options.satellite.replace('/', '_')}-{datetime.now(UTC):%Y%m%dT%H%M%S}"
        folder = Path(options.output or Path("runs") / stem)
        if (folder / "bag").exists():
            raise NotStartedError(f"output={folder} holds a bag already")
        live = LivePass(self)
        self._until(live.client.server_is_ready, "track_pass")
        recorder = None if options.no_record else Recorder(self.node, options.namespace, folder / "bag")
        goal = TrackPass.Goal(
            satellite=options.satellite, sensor=options.sensor, minimum_peak_elevation=math.radians(options.min_peak)
        )
        if options.near is not None:
            goal.near = stamp_from_seconds(options.near)
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
        return 0 if result.success else 1

    def _queue(self) -> int:
        options = self.options
        text = options.file.read_text() if options.file else ""
        # Refused here, with its row, rather than by a node.
        passes = read_passes(text, every=False) if text else []
        if options.start:
            return self._run_schedule(text)
        request = ChangeSchedule.Request(add=text, remove=options.remove)
        code = self._ask(ChangeSchedule, f"{EXECUTIVE}/change_schedule", request)
        if not code and passes:
            self.say(f"{len(passes)} passes from {utc_text(passes[0].aos_t_s)}")
        return code

    def _run_schedule(self, text: str) -> int:
        client = ActionClient(self.node, RunSchedule, "run_schedule")
        self._until(client.server_is_ready, "run_schedule")
        goal = RunSchedule.Goal(schedule=text, resume=not text)
        handle = self.send(client, goal, EXECUTIVE, self._feedback)
        result = self._end_of_night(handle)
        if result is None:
            states = [each.state for each in self.newest[SCHEDULE].passes]
            lost = sum(state in ("lost", "missed", "weather") for state in states)
            self.say(
                f"the night has ended: {states.count('tracked')} tracked, {lost} not; the executive was started again in it"
            )
            return 1 if lost else 0
        self.say(result.message)
        if result.report:
            self.say(f"morning report {result.report}/night.html")
        return 0 if result.success else 1

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

    def _feedback(self, message: Any) -> None:
        feedback = message.feedback
        if time.monotonic() >= getattr(self, "_next_s", 0.0):
            self._next_s = time.monotonic() + (1.0 if sys.stderr.isatty() else 10.0)
            doing = f"{feedback.target}: {feedback.step}" if feedback.target else "between passes"
            line = f"{feedback.state}, {feedback.passes_done} done, {feedback.passes_left} left, {doing}"
            sys.stderr.write(f"\r\x1b[2K{line}" if sys.stderr.isatty() else f"{line}\n")
            sys.stderr.flush()

    def _status(self) -> int:
        self._look("antenna_status", "tracking_status", EXECUTIVE_STATUS)
        if "antenna_status" not in self.newest:
            raise TimeoutError(f"no antenna in {self.options.namespace}")
        while True:
            values = self._status_values()
            print(json.dumps(values) if self.options.json else _status_line(values), flush=True)
            if not self.options.watch or self.stopping:
                return 1 if values["fault"] or any(each["level"] == 2 for each in values["alarms"]) else 0
            deadline_s = time.monotonic() + 1.0
            while time.monotonic() < deadline_s and not self.stopping:
                self.spin(EVENT_S)

    def _status_values(self) -> dict[str, Any]:
        antenna, tracking = self.newest["antenna_status"], self.newest.get("tracking_status", TrackingStatus())
        return status_values(antenna, tracking, self.newest.get(EXECUTIVE_STATUS, ExecutiveStatus(state="none")))

    def _go(self) -> int:
        azimuth, elevation = math.radians(self.options.azimuth), math.radians(self.options.elevation)
        return self._ask(GoTo, "antenna_servo/go_to", GoTo.Request(azimuth=azimuth, elevation=elevation))

    def _stop(self) -> int:
        name = "antenna_servo/stop" if self.options.antenna else "pointing_controller/stop"
        return self._ask(Trigger, name, Trigger.Request())

    def _offset(self) -> int:
        wanted = {"along_track_offset_s": self.options.along, "cross_track_offset_deg": self.options.cross}
        rows = [
            ParameterMessage(name=f"source.{name}", value=Parameter("", value=value).get_parameter_value())
            for name, value in wanted.items() if value is not None
        ]  # fmt: skip
        answer = self._call(
            SetParametersAtomically, "ephemeris_publisher/set_parameters_atomically",
            SetParametersAtomically.Request(parameters=rows),
        )  # fmt: skip
        self.say(
            answer.result.reason or ", ".join(f"{name}={value}" for name, value in wanted.items() if value is not None)
        )
        return 0 if answer.result.successful else 1

    def _night(self) -> int:
        request, name = self.options.request, self.options.name
        if request in ("skip", "ack"):
            service = "skip" if request == "skip" else "acknowledge"
            return self._ask(Named, f"{EXECUTIVE}/{service}", Named.Request(name=name))
        return self._ask(Trigger, f"{EXECUTIVE}/{request}", Trigger.Request())

    def _log(self) -> int:
        answer = self._call(
            GetParameters, f"{EXECUTIVE}/get_parameters", GetParameters.Request(names=["executive.folder"])
        )
        folder = Path(str(parameter_value_to_python(answer.values[0]))).expanduser()
        path = folder / "journal.jsonl"
        if not path.is_file():
            raise NotStartedError(f"no journal at {path} on this computer")
        for line in path.read_text(encoding="utf-8").splitlines()[-self.options.n :]:
            row = json.loads(line)
            where = ".".join(filter(None, (row["block"], row["directive"])))
            print(f"{row['utc']} {row['event']:<16} {where:<28} {row['detail']}")
        return 0


def _status_line(values: dict[str, Any]) -> str:
    doing = f"{values['pass']} {'; '.join(values['blocks'])}" if values["pass"] else values["doing"] or "nothing"
    lines = [
        f"{values['utc'][:19]}  antenna {values['antenna']} az {values['azimuth_deg']:.2f} el {values['elevation_deg']:.2f} deg"
        f"  {values['tracking'] or 'no controller'} {values['target']}  executive {values['executive']}: {doing}"
    ]
    lines += [f"  fault: {values['fault']}"] * bool(values["fault"])
    lines += [
        f"  {('', 'warning', 'ERROR')[each['level']]} {each['name']}: {each['message']}"
        + (" (acknowledged)" if each["acknowledged"] else "")
        for each in values["alarms"]
    ]
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> None:
    """Entry point of `ros2 run rf_pointing station`."""
    options = arguments(argv)
    if options.command == "queue" and options.file and not options.file.is_file():
        say("station", f"no such file: {options.file}")
        sys.exit(2)

    def work(client: StationClient) -> int:
        try:
            return client.work()
        except ValueError as error:
            client.say(str(error))
            return 2

    sys.exit(run_to_end("station", lambda: StationClient(options), work))
