"""Executable `station_executive`: tracks the passes of a schedule, a night without an operator.

Subscribes: antenna_status, joint_states, tracking_status, passes, target, pass_certificate,
/diagnostics of the nodes of its namespace; schedule and executive_status of its partners.
Publishes: schedule (latched), executive_status (once a second), alarms (each message of an alarm,
diagnostic_msgs/DiagnosticArray).
Action: run_schedule (rf_pointing_msgs/RunSchedule).
Services: ~/pause, ~/resume, ~/stop (after the present pass), ~/abort (now), std_srvs/Trigger;
~/test_alarms (a message by every way out); ~/skip, ~/acknowledge and ~/run (a procedure between
two passes; rf_pointing_msgs/Named);
~/change_schedule (rf_pointing_msgs/ChangeSchedule).
Parameters: executive.* (files, folder, partners), between.* (what the antenna does between two
passes), alarms.* (thresholds; the station description may set them), hooks.* (where alarms go),
command_key_file (signs the calls of antenna_servo).
"""

import platform
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rf_pointing_msgs import msg as ours
from rf_pointing_msgs.action import RunSchedule
from rf_pointing_msgs.srv import ChangeSchedule, Named
from std_srvs.srv import Trigger

from rf_pointing import __version__
from rf_pointing.ros import night_messages as messages
from rf_pointing.ros.convert_planning import scheduled_from_messages
from rf_pointing.ros.directives import DirectiveSender
from rf_pointing.ros.graph import EXECUTIVE_STATUS, SCHEDULE
from rf_pointing.ros.one_goal import OneGoal
from rf_pointing.ros.qos import LATCHED, STATUS
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.clients.night_watch import NightWatch
from rf_pointing.tracking.sensors import load_trackers

SETS = ("executive", "between", "alarms", "hooks")
STEP_S = 0.2


class StationExecutive(StationNode):
    """Runs a night on the nodes of its namespace."""

    def __init__(self) -> None:
        load_trackers()
        super().__init__("station_executive")
        result = lambda reason: RunSchedule.Result(**self.watch.result(reason))  # noqa: E731
        cancel = lambda: self.watch.cancel(self.now_s())  # noqa: E731
        self._goal = OneGoal(self, RunSchedule, "run_schedule", self._begin, result, cancel)

    def configure(self) -> None:
        values = map(self.parameters.value, SETS)
        self.watch = watch = NightWatch(
            *values, self.station, self.band, self.get_namespace().strip("/"), connect=self._connect,
            record=self._record, report=self._report, tell=self._tell, publish=messages.AlarmTopic(self).publish,
        )  # fmt: skip
        messages.serve_alarms(self, watch.alarms)
        messages.hear_outages(self, watch)
        self._at_cleanup.callback(watch.alarms.hooks.close)
        self._at_cleanup.callback(watch.sender.close)
        self._key = messages.hear_night(self, watch, self.parameters.value("executive"))
        self._schedule = self.stream(ours.Schedule, SCHEDULE, LATCHED)
        self._status = self.stream(ours.ExecutiveStatus, EXECUTIVE_STATUS, STATUS)
        for name in ("pause", "resume", "stop", "abort"):
            self.serve_action(Trigger, f"~/{name}", lambda _, name=name: self._shown(watch.request(name, self.now_s())))
        self.serve_action(Named, "~/skip", lambda r: watch.night.skip(r.name, self.now_s()))
        self.serve_action(Named, "~/run", lambda r: watch.run(r.name, self.now_s()))
        self.serve_action(Named, "~/acknowledge", lambda r: watch.acknowledge(r.name, self.now_s()))
        passes = scheduled_from_messages
        change = lambda r: self._shown(watch.change(passes(r.add), r.remove, self.now_s()))  # noqa: E731
        self.serve_action(ChangeSchedule, "~/change_schedule", change)
        self.diagnostics.add_report("night", watch.health)

    def activate(self) -> None:
        self.watch.begin(self.now_s())
        self.every(STEP_S, self._step)

    def deactivate(self) -> None:
        self.watch.end()
        self._publish(ended=True)

    def turn(self) -> float:
        """Take responses, and publish the status as often as it is due."""
        if self.active:
            self.watch.poll(self.now_s())
            if self.watch.status_due(time.monotonic()):
                self._publish()
        return 0.05

    def _step(self, t_s: float) -> None:
        over = self.watch.step(t_s, time.monotonic())
        self._shown()
        if over:
            self._goal.finish()

    def _connect(self, *given: Any) -> DirectiveSender:
        return DirectiveSender(self, *given, self.parameters.value("key"), answered=given[2])

    def _record(self, bag: Path, notes: Mapping[str, str]) -> Any:
        # Imported when it is needed: an executive that was killed must be back soon.
        from rf_pointing.ros.recorder import Recorder

        simulated = self.get_parameter("use_sim_time").value
        return Recorder(self, self.get_namespace(), bag, notes=notes, simulated=simulated)

    def _report(self, folder: Path, health: Mapping[str, Mapping[str, Any]]) -> None:
        from rf_pointing.report.night_report import night_of, write_night

        software = {
            "rf_pointing": __version__,
            "Python": platform.python_version(),
            "description": self.station.digest[:12],
        }
        shown = {**health, "inputs": {"lost": sum(self.inputs.lost.values())}, "software": software}
        write_night(night_of(self.watch.night.state(), self.station.name, health=shown), folder)

    def _tell(self, text: str, good: bool) -> None:
        messages.log(self, text, good=good)

    def _begin(self, request: RunSchedule.Goal) -> None:
        self.watch.start(scheduled_from_messages(request.passes), request.resume, self.now_s())
        self._shown()

    def _shown(self, answer: str = "") -> str:
        """Publish schedule and status if the schedule has changed; return the answer."""
        if (entries := self.watch.news()) is not None:
            self._send(self._schedule, messages.schedule_to_message(entries, self.now_s()), SCHEDULE)
            self._publish()
        return answer

    def _send(self, publisher: Any, message: Any, topic: str) -> None:
        self._key.sign_claim(message, topic, self.get_namespace().strip("/"))
        publisher.publish(message)

    def _publish(self, *, ended: bool = False) -> None:
        status = messages.executive_status_to_message(self.watch, self.now_s(), ended=ended)
        self._send(self._status, status, EXECUTIVE_STATUS)
        if self._goal.lasts:
            self._goal.report(RunSchedule.Feedback(**self.watch.progress()))


main = StationExecutive.main
