"""Executable `station_executive`: tracks the passes of a schedule, a night without an operator.

Subscribes: antenna_status, joint_states, tracking_status, passes, target, pass_certificate,
/diagnostics of the nodes of its namespace; schedule and executive_status of its partners.
Publishes: schedule (latched), executive_status (once a second).
Action: run_schedule (rf_pointing_msgs/RunSchedule).
Services: ~/pause, ~/resume, ~/stop (after the present pass), ~/abort (now), std_srvs/Trigger;
~/skip and ~/acknowledge (rf_pointing_msgs/Named); ~/change_schedule
(rf_pointing_msgs/ChangeSchedule).
Parameters: executive.* (files, folder, partners), between.* (what the antenna does between two
passes), alarms.* (thresholds; the station description may set them), hooks.* (where alarms go),
command_key_file (signs the calls of antenna_servo).

Whatever the night is, it is in `executive.state_file` before a directive leaves.  A killed
executive comes back with it, looks at the station, and goes on.
"""

import json
import shutil
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.action import RunSchedule
from rf_pointing_msgs.srv import ChangeSchedule, Named
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing.core import AXES, Params, parameter
from rf_pointing.core.dates import utc_text
from rf_pointing.core.parameters import NodeParameters
from rf_pointing.core.whole_file import KeptState, read_whole
from rf_pointing.operations.alarms import Alarm, AlarmParams
from rf_pointing.operations.dictionary import read_tables
from rf_pointing.operations.night import Night, NightState
from rf_pointing.operations.pass_list import read_passes
from rf_pointing.operations.schedule import BetweenParams, PassState, Schedule
from rf_pointing.planning import AxisLimits, MachineParams
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros.command_key import CommandKeyParams
from rf_pointing.ros.diagnostics import ERROR, LEVELS, OK, WARN, Health
from rf_pointing.ros.directives import DirectiveSender
from rf_pointing.ros.graph import EXECUTIVE_STATUS, SCHEDULE
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import RESULT_TIMEOUT_S, conclude
from rf_pointing.ros.qos import LATCHED, STATUS, WATCHED
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.clients.alarm_hooks import AlarmHooks, HookParams
from rf_pointing.tracking.sensors import SENSOR_CHOICES, load_trackers

STEP_S = 0.2
MOVING_RAD_S = 1e-4
MOST_BYTES = 32 * 1024 * 1024
CLAIMED = (PassState.WAITING, PassState.ACTIVE, PassState.TRACKED)
BUSY = (PassState.ACTIVE, PassState.TRACKED)


@dataclass(frozen=True, kw_only=True)
class ExecutiveParams(Params):
    """What belongs to the executive itself."""

    state_file: str = parameter("", "file that keeps the night over a restart; empty: not kept")
    folder: str = parameter("runs/night", "folder of recordings, journal and morning report")
    directives_file: str = parameter("", "further directives of the station (YAML); empty: the shipped ones")
    procedure_file: str = parameter("", "procedure of a pass (YAML); empty: the shipped one")
    recovery_file: str = parameter("", "recovery table (YAML); empty: the shipped one")
    sensor: str = parameter("", "sensor of passes that name none; empty: the station's")
    record: bool = parameter(True, "whether each pass is recorded and reported on")
    partners: str = parameter("", "namespaces of the antennas that share the schedule, separated by commas")


class StationExecutive(StationNode):
    """Runs a `Night` on the nodes of its namespace."""

    def __init__(self) -> None:
        super().__init__("station_executive")
        load_trackers()
        self.parameters.declare("executive", ExecutiveParams())
        self.parameters.declare("between", BetweenParams())
        self.parameters.declare("alarms", AlarmParams())
        self.parameters.declare("hooks", HookParams())
        self.parameters.declare("", CommandKeyParams(), group="key")
        self._goal: Any = None
        self._refusal = ""
        self._recorder: Any = None
        self._reports: list[subprocess.Popen[bytes]] = []
        self._action = ActionServer(
            self, RunSchedule, "run_schedule", self._conclude, goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted, cancel_callback=self._on_cancel, result_timeout=RESULT_TIMEOUT_S,
        )  # fmt: skip

    def configure(self) -> None:
        value = self.parameters.value
        own: ExecutiveParams = value("executive")
        if own.sensor and own.sensor not in SENSOR_CHOICES:
            raise ValueError(f"executive.sensor={own.sensor} must be one of {', '.join(SENSOR_CHOICES)}")
        assert self.station is not None
        tables = read_tables(value("alarms"), own.directives_file, own.procedure_file, own.recovery_file)
        controller = NodeParameters("pointing_controller", self.station.parameters("pointing_controller", self.band))
        machine: MachineParams = controller.group("machine", MachineParams())
        antenna = self.get_namespace().strip("/")
        schedule = Schedule(controller.group("limits", AxisLimits()), machine.axes, value("between"), antenna)
        self._hooks = AlarmHooks(value("hooks"), self.station.name)
        self._at_cleanup.callback(self._hooks.close)
        self._sender = DirectiveSender(
            self, tables.directives, {"record": self._record, "end_record": self._end_record, "report": self._report},
            self._responded, self._ended, value("key"),
        )  # fmt: skip
        self._at_cleanup.callback(self._sender.close)
        self._night = Night(
            schedule, tables.procedure, tables.recovery, self._sender.send, quiet_s=value("alarms").quiet_s,
            sensor=own.sensor or self.station.sensor(self.band), least_share=machine.least_share,
            notify=self._notify, save=self._keep,
        )  # fmt: skip
        self._folder = Path(own.folder).expanduser().resolve()
        self._folder.mkdir(parents=True, exist_ok=True)
        self._memory = KeptState(own.state_file)
        self._journal_problem, self._ready_to_keep = "", False
        self._alive_s: dict[str, float] = {}
        self._healths: dict[str, dict[str, Any]] = {}
        self._messages: Counter[str] = Counter()
        self._report_folder = ""
        self._schedules: dict[str, ours.Schedule] = {}
        self._partner_s: dict[str, float] = {}
        self._shown: Any = None
        self._status_wall_s = 0.0
        self._subscribe(own)
        self._schedule_out = self.stream(ours.Schedule, SCHEDULE, LATCHED)
        self._status_out = self.stream(ours.ExecutiveStatus, EXECUTIVE_STATUS, STATUS)
        requests = {"pause": self._night.pause, "resume": self._night.resume, "stop": self._night.stop,
                    "abort": self._night.abort}  # fmt: skip
        for name, act in requests.items():
            self.serve_action(Trigger, f"~/{name}", lambda _r, name=name, act=act: self._request(name, act))
        self.serve_action(Named, "~/skip", lambda r: self._night.skip(r.name, self.now_s()))
        self.serve_action(Named, "~/acknowledge", self._acknowledge)
        self.serve_action(ChangeSchedule, "~/change_schedule", self._change)
        self.diagnostics.add("night", self._health)
        self.diagnostics.add("alarms", self._alarm_health)

    def _subscribe(self, own: ExecutiveParams) -> None:
        self.listen(ours.AntennaStatus, "antenna_status", self._on_antenna, WATCHED)
        self._joints = self.listen_latest(JointState, "joint_states", convert.joints_from_message, WATCHED)
        self.listen(ours.TrackingStatus, "tracking_status", self._on_tracking, WATCHED)
        self.listen(ours.PassList, "passes", self._on_passes, LATCHED)
        self.listen(ours.Target, "target", self._on_target, WATCHED)
        self.listen(ours.PassCertificate, "pass_certificate", self._on_certificate, LATCHED)
        self.listen(DiagnosticArray, "/diagnostics", self._on_diagnostics, WATCHED)
        for name in filter(None, (each.strip().strip("/") for each in own.partners.split(","))):
            self._partner_s[name] = 0.0
            self.listen(ours.Schedule, f"/{name}/{SCHEDULE}", lambda m, name=name: self._on_partner(name, m), LATCHED)
            self.listen(
                ours.ExecutiveStatus, f"/{name}/{EXECUTIVE_STATUS}", lambda _m, name=name: self._alive(name), STATUS
            )

    def activate(self) -> None:
        kept = self._memory.recover()
        if kept and self._night.finished:
            self._night.restore(kept, self.now_s())
            self.get_logger().info(f"the night goes on where it was: {self._night.state_name}")
            self._record_again()
        # Only from here on: a state that was not taken over must not be replaced.
        self._ready_to_keep = True
        self.every(STEP_S, self._step)

    def deactivate(self) -> None:
        self._keep()
        self._end_record()

    def turn(self) -> float:
        if self.active:
            self._sender.poll()
            if time.monotonic() - self._status_wall_s >= 1.0:
                self._publish()
        return 0.05

    # What is known

    def _on_antenna(self, message: ours.AntennaStatus) -> None:
        t_s = seconds_from_stamp(message.header.stamp)
        values = {name: getattr(message, name) for name in ("mode", "fault", "warning", "high_wind")}
        values["moving"] = max(map(abs, message.rate_command)) > MOVING_RAD_S
        self._night.take("antenna", values, t_s)
        reading = self._joints.take()
        if reading is not None:
            azimuth, elevation = map(float, reading.position_rad)
            self._night.take("antenna", {"azimuth": azimuth, "elevation": elevation}, reading.t_s)

    def _on_tracking(self, message: ours.TrackingStatus) -> None:
        names = ("mode", "target", "reason", "held", "seconds_tracked", "seconds_lost", "mean_loss", "carrier_to_noise",
                 "level", "alarm", "on_source")  # fmt: skip
        values = {name: getattr(message, name) for name in names}
        self._night.take("tracking", values, seconds_from_stamp(message.header.stamp))

    def _on_passes(self, message: ours.PassList) -> None:
        windows = [(seconds_from_stamp(each.aos), seconds_from_stamp(each.los), each) for each in message.passes]
        self._night.take_passes(message.target, windows, self.now_s())

    def _on_target(self, message: ours.Target) -> None:
        if message.covariance:
            values = {"age_h": message.element_age / 3600.0, "target": message.target}
            self._night.take("elements", values, seconds_from_stamp(message.header.stamp))

    def _on_certificate(self, message: ours.PassCertificate) -> None:
        values = {"target": message.target, "accepted": message.accepted, "refusal": message.refusal}
        self._night.take("certificate", values, self.now_s())

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        mine = self.get_namespace().rstrip("/") + "/"
        for status in message.status:
            node = status.hardware_id
            if not node.startswith(mine) or node == self.get_fully_qualified_name():
                continue
            name, check = node.removeprefix(mine), status.name.partition(": ")[2]
            self._alive_s[name] = time.monotonic()
            if name == "antenna_servo" and check == "device":
                problem = status.message if status.level == ERROR else ""
                self._healths["drive"] = {"problem": problem}
            if name == "bias_calibrator" and check == "model":
                self._healths["model"] = {"health": status.message, "level": LEVELS.index(status.level)}
            if check == "device":
                values = {pair.key: pair.value for pair in status.values}
                starts = [values[key] for key in (f"{axis}_starts" for axis in AXES) if key in values]
                self._healths["relays"] = {"starts": ", ".join(starts)}

    def _observe(self, now_s: float) -> None:
        """Note what no message carries: silence, disk, recorder."""
        wall_s, night = time.monotonic(), self._night
        for name, seen_s in self._alive_s.items():
            night.take(name, {"silent_s": wall_s - seen_s}, now_s)
        for device, values in self._healths.items():
            night.take(device, values, now_s)
        try:
            night.take("disk", {"free_gb": shutil.disk_usage(self._folder).free / 1e9}, now_s)
        except OSError as error:
            night.take("disk", {"free_gb": 0.0, "problem": str(error)}, now_s)
        state = "idle" if self._recorder is None else "failed" if self._recorder.problem else "recording"
        night.take("recorder", {"state": state}, now_s)
        night.take("executive", {"problem": self._memory.problem or self._journal_problem}, now_s)

    def _on_partner(self, name: str, message: ours.Schedule) -> None:
        self._schedules[name] = message
        self._alive(name)

    def _alive(self, name: str) -> None:
        self._partner_s[name] = time.monotonic()

    def _share(self, now_s: float) -> None:
        """Leave to the partners what they have: all that they plan if they come first by name."""
        taken: set[str] = set()
        mine, silent_s = self._night.schedule.antenna, self.parameters.value("alarms").node_silent_s
        for name, message in self._schedules.items():
            alive = time.monotonic() - self._partner_s[name] <= silent_s
            states = CLAIMED if alive and name < mine else BUSY if alive else (PassState.TRACKED,)
            taken |= {each.id for each in message.passes if each.state in states}
        if taken != self._night.taken:
            self._night.taken = taken
            self._night.change(now_s)

    # Work

    def _step(self, t_s: float) -> None:
        self._sender.poll()
        self._observe(t_s)
        self._share(t_s)
        before = self._night.state_name
        self._night.step(t_s)
        self._write_journal()
        self._publish_if_new()
        if self._night.state_name == NightState.IDLE and before != NightState.IDLE:
            self._finish()
        self._reports = [each for each in self._reports if each.poll() is None]

    def _responded(self, number: int, accepted: bool, text: str) -> None:
        self._night.respond(number, accepted, text, self.now_s())

    def _ended(self, number: int, name: str, succeeded: bool, result: dict[str, Any]) -> None:
        self._night.take(name, {**result, "succeeded": succeeded}, self.now_s())
        if name == "track":
            self._night.take(
                "track",
                {"refused": "" if succeeded or result.get("seconds_tracked") else result["message"]},
                self.now_s(),
            )
        if not succeeded:
            self._night.fail(number, str(result.get("message") or "it has failed"), self.now_s())

    def _notify(self, event: str, alarm: Alarm) -> None:
        # Called while the night is stepped: what an operator receives never waits for a server.
        self._messages[alarm.name] += 1
        text = f"alarm {event}: {alarm.name}: {alarm.message}"
        # Two lines: one line of code that logs at two levels raises.
        if event == "cleared":
            self.get_logger().info(text)
        else:
            self.get_logger().warning(text)
        self._hooks.put(event, alarm.name, alarm.level, alarm.message, alarm.ask, utc_text(self.now_s()))
        self.diagnostics.publish()

    def _keep(self) -> None:
        if self._ready_to_keep:
            self._memory.keep(self._night.state())

    def _write_journal(self) -> None:
        rows, self._night.journal = self._night.journal, []
        if not rows:
            return
        path = self._folder / "journal.jsonl"
        try:
            with path.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps({"utc": utc_text(row.t_s), **asdict(row)}) + "\n" for row in rows)
            self._journal_problem = ""
        except OSError as error:
            self._journal_problem = f"journal {path} cannot be written: {error.strerror}"

    def _finish(self) -> None:
        """Write the morning report and conclude the goal."""
        from rf_pointing.report.night_report import write_night

        self._end_record()
        folder = self._folder / f"report-{utc_text(self.now_s())[:16].replace(':', '')}"
        try:
            write_night(self._morning(), folder)
            self._report_folder = str(folder)
            self.get_logger().info(f"morning report {folder / 'night.html'}")
        except OSError as error:
            self._journal_problem = f"report {folder} cannot be written: {error.strerror}"
        goal, self._goal = self._goal, None
        if goal is not None:
            goal.execute()

    def _morning(self) -> Any:
        from rf_pointing.report.night_report import night_of

        assert self.station is not None
        shown = {name: dict(values) for name, values in self._healths.items()}
        shown["disk"] = {"free_gb": shutil.disk_usage(self._folder).free / 1e9}
        shown["inputs"] = {"lost": sum(self.inputs.lost.values())}
        return night_of(self._night.state(), self.station.name, messages=sum(self._messages.values()), health=shown)

    # Recordings

    def _record(self, name: str) -> str:
        self._end_record()
        if not self.parameters.value("executive").record:
            raise ValueError("executive.record is false")
        needed = self.parameters.value("alarms").disk_free_gb
        free_gb = shutil.disk_usage(self._folder).free / 1e9
        if free_gb < needed:
            raise OSError(f"{free_gb:.3g} GB are free, must be >= {needed:g} GB")
        # Imported when it is needed: an executive that was killed must be back soon.
        from rf_pointing.ros.recorder import Recorder

        stem, number = self._folder / "passes" / name, 1
        while (folder := stem.with_name(f"{stem.name}-{number:02d}")).exists():
            number += 1
        folder.mkdir(parents=True)
        notes = {"station": self.station.name if self.station else "", "band": self.band, "pass": name}
        self._recorder = Recorder(self, self.get_namespace(), folder / "bag", notes=notes)
        return str(folder)

    def _record_again(self) -> None:
        """Go on recording the pass that was tracked when the executive was killed."""
        if not self._night.active_id:
            return
        try:
            self._record(self._night.active_id)
        except (ValueError, OSError) as error:
            self.get_logger().warning(f"the rest of the pass is not recorded: {error}")

    def _end_record(self) -> str:
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return "nothing is recorded"
        result = recorder.close()
        # The report needs seconds of processor time: a process of its own, behind all others.
        self._report(str(result.path.parent))
        return str(result.path)

    def _report(self, name: str) -> str:
        code = "import os; os.nice(19); from rf_pointing.commands.report import main; main()"
        self._reports.append(
            subprocess.Popen(
                [sys.executable, "-c", code, str(Path(name) / "bag")],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
        )
        return name

    # Requests

    def _request(self, name: str, act: Any) -> str:
        act(self.now_s())
        self._publish_if_new()
        return f"{name}: the executive is {self._night.state_name}"

    def _acknowledge(self, request: Named.Request) -> str:
        names = self._night.book.acknowledge(request.name, self.now_s())
        self._keep()
        return f"acknowledged: {', '.join(names) or 'no alarm lasts'}"

    def _change(self, request: ChangeSchedule.Request) -> str:
        added = read_passes(_text_of(request.add), every=False) if request.add else []
        schedule = self._night.schedule
        for each in request.remove:
            schedule.entry(each)
        schedule.remove(request.remove)
        schedule.add(added)
        self._night.change(self.now_s())
        self._publish_if_new()
        return f"{len(added)} passes added, {len(request.remove)} removed; {len(schedule.entries)} in all"

    def _on_goal(self, _request: RunSchedule.Goal) -> GoalResponse:
        if self.active and self._goal is None:
            return GoalResponse.ACCEPT
        self.get_logger().error("goal refused: " + ("a schedule is run" if self.active else "not active"))
        return GoalResponse.REJECT

    def _on_accepted(self, goal: Any) -> None:
        self._refusal = ""
        try:
            self._start(goal.request)
        except (ValueError, OSError) as error:
            self._refusal = str(error)
            self.get_logger().error(f"schedule refused: {error}")
            goal.execute()
            return
        self._goal = goal

    def _start(self, request: RunSchedule.Goal) -> None:
        passes = read_passes(_text_of(request.schedule), every=False) if request.schedule else []
        night = self._night
        if night.state_name == NightState.IDLE:
            if not request.resume:
                night.schedule.entries.clear()
            night.schedule.add(passes)
            if not night.schedule.entries:
                raise ValueError("schedule='' must name passes")
            night.start(self.now_s())
        elif request.resume:
            # The night goes on after a restart; the client takes part again.
            night.schedule.add(passes)
            night.change(self.now_s())
        else:
            raise ValueError(f"the executive is {night.state_name}: resume, or abort first")
        self._publish_if_new()

    def _on_cancel(self, _goal: Any) -> CancelResponse:
        # It may have ended meanwhile.
        with suppress(ValueError):
            self._night.abort(self.now_s())
        return CancelResponse.ACCEPT

    def _conclude(self, goal: Any) -> RunSchedule.Result:
        result = RunSchedule.Result(message=self._refusal)
        if not self._refusal:
            states = Counter(record.state for record in self._night.records)
            result.passes_tracked = states[PassState.TRACKED]
            result.passes_lost = sum(states.values()) - states[PassState.TRACKED]
            result.success, result.report = result.passes_lost == 0, self._report_folder
            result.message = f"{self._night.reason}: {result.passes_tracked} tracked, {result.passes_lost} not"
        return conclude(goal, result)

    # What is published

    def _publish_if_new(self) -> None:
        rows = self._night.schedule.state()
        if rows != self._shown:
            self._shown = rows
            message = ours.Schedule(
                passes=[convert_planning.entry_to_message(each) for each in self._night.schedule.in_order]
            )
            message.header.stamp = stamp_from_seconds(self.now_s())
            self._schedule_out.publish(message)
            self._publish()

    def _publish(self) -> None:
        self._status_wall_s = time.monotonic()
        night, following = self._night, self._night.schedule.next()
        entry = night.schedule.active
        message = ours.ExecutiveStatus(
            state=str(night.state_name), pass_id=night.active_id, target=entry.item.name if entry else "",
            blocks=night.blocks(), reason=night.reason, next_id=following.item.id if following else "",
        )  # fmt: skip
        message.header.stamp = stamp_from_seconds(self.now_s())
        if following is not None:
            message.next_start = stamp_from_seconds(following.item.aos_t_s)
        message.alarms = [
            ours.Alarm(
                name=each.name, level=each.level, message=each.message, raised=stamp_from_seconds(each.raised_t_s),
                acknowledged=each.acknowledged, count=each.count,
            )
            for each in night.book.lasting
        ]  # fmt: skip
        self._status_out.publish(message)
        if self._goal is not None:
            states = Counter(each.state for each in night.schedule.entries.values())
            left = states[PassState.WAITING] + states[PassState.ACTIVE]
            self._goal.publish_feedback(RunSchedule.Feedback(
                state=message.state, target=message.target, step="; ".join(message.blocks),
                passes_done=len(night.records), passes_left=left,
            ))  # fmt: skip

    def _health(self) -> Health:
        night = self._night
        values = {"pass": night.active_id, "passes": len(night.schedule.entries), "records": len(night.records),
                  "alarms_sent": self._hooks.sent, "alarms_not_sent": self._hooks.failed}  # fmt: skip
        problem = self._memory.problem or self._journal_problem or self._hooks.problem
        return Health(WARN if problem else OK, problem or f"{night.state_name}: {night.reason}".rstrip(": "), values)

    def _alarm_health(self) -> Health:
        lasting = self._night.book.lasting
        level = LEVELS[max((each.level for each in lasting if not each.acknowledged), default=0)]
        words = "; ".join(f"{each.name}: {each.message}" for each in lasting)
        return Health(level, words or "none", {each.name: f"raised {utc_text(each.raised_t_s)}" for each in lasting})


def _text_of(given: str) -> str:
    """Return the text of a schedule, which may be that of a file."""
    if len(given) < 4096 and given.startswith("/") and "\n" not in given:
        return read_whole(Path(given), MOST_BYTES)
    return given


def main() -> None:
    """Entry point of `ros2 run rf_pointing station_executive`."""
    run(StationExecutive)
