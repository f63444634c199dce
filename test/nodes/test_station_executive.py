"""What the executive sends, by name and type; two executives that share a list; a dead one is noticed."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.action import CancelResponse, GoalResponse
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rf_pointing_msgs.action import RunSchedule, TrackPass
from rf_pointing_msgs.msg import (
    AntennaStatus,
    ExecutiveStatus,
    Pass,
    PassCertificate,
    PassList,
    Schedule,
    ScheduledPass,
    Target,
    TrackingStatus,
)
from rf_pointing_msgs.srv import ChangeSchedule, GoTo, Named, SelectTarget

from rf_pointing.core import JointReading
from rf_pointing.core.dates import utc_text
from rf_pointing.nodes import station_executive
from rf_pointing.nodes.station_executive import StationExecutive
from rf_pointing.operations import AlarmParams
from rf_pointing.operations.dictionary import read_directives, read_tables
from rf_pointing.operations.schedule import PassState
from rf_pointing.ros import recorder, station_node
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.directives import DirectiveSender, filled, plain_fields, type_of
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_node import ExecutiveWatch
from test.nodes.goal_handle import GoalHandle


def test_every_shipped_directive_has_an_installed_type_with_its_arguments() -> None:
    for row in read_tables(AlarmParams()).directives.values():
        if row.kind in ("service", "action"):
            kind = type_of(row.type_name)
            blank = kind.Request() if row.kind == "service" else kind.Goal()
            assert not [name for name in row.takes if not hasattr(blank, name)], row


def test_messages_are_filled_from_plain_values() -> None:
    request = filled(SelectTarget.Request(), {"target": "25544", "start": 12.25, "minimum_peak_elevation": 1})
    assert (request.target, request.start.sec, request.start.nanosec) == ("25544", 12, 250_000_000)
    assert request.minimum_peak_elevation == 1.0
    goal = filled(TrackPass.Goal(), {"target_pass": {"target": "x", "aos": 3.0}, "sensor": "auto"})
    assert (goal.target_pass.target, goal.target_pass.aos.sec, goal.sensor) == ("x", 3, "auto")
    window = Pass(target="y")
    assert filled(TrackPass.Goal(), {"target_pass": window}).target_pass.target == "y"


@pytest.mark.parametrize(
    ("values", "message"),
    [({"speed": 1.0}, "has no field speed"), ({"azimuth": "north"}, "azimuth='north' is no float")],
)
def test_what_does_not_fit_a_message_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        filled(GoTo.Request(), values)


def test_results_give_their_plain_fields() -> None:
    found = plain_fields(TrackPass.Result(success=True, message="loss of signal", seconds_tracked=3.0))
    assert (found["success"], found["message"], found["seconds_tracked"]) == (True, "loss of signal", 3.0)


class Clients:
    """A node whose services are ready or not, and answer when they are set to."""

    def __init__(self, ready: bool) -> None:
        self.ready, self.futures = ready, []

    def create_client(self, kind: Any, name: str) -> Any:
        self.made = kind, name
        return SimpleNamespace(service_is_ready=lambda: self.ready, call_async=self._call)

    def _call(self, request: Any) -> Any:
        self.futures.append(
            SimpleNamespace(done=lambda: hasattr(self, "answer"), result=lambda: self.answer, request=request)
        )
        return self.futures[-1]


ROWS = """
version: 1
directives:
  go: {service: antenna_servo/go_to, type: rf_pointing_msgs/srv/GoTo, takes: [azimuth, elevation]}
  set: {parameter: ephemeris_publisher/source.along_track_offset_s, takes: [value]}
  record: {own: record, takes: [name]}
"""


def sender(clients: Clients, own: Any = None, key: str = "") -> tuple[DirectiveSender, list[Any]]:
    answers: list[Any] = []
    made = DirectiveSender(
        clients, read_directives(ROWS), {"record": own or (lambda name: f"recording {name}")},
        lambda *answer: answers.append(answer), lambda *_: None, CommandKeyParams(command_key_file=key),
    )  # fmt: skip
    return made, answers


def test_a_service_that_is_not_offered_is_a_refusal_at_once() -> None:
    made, answers = sender(Clients(ready=False))
    made.send(1, "go", {"azimuth": 0.1, "elevation": 0.2})
    assert answers == [(1, False, "service antenna_servo/go_to is not offered")]


def test_a_response_comes_back_with_its_number_when_it_is_polled() -> None:
    clients = Clients(ready=True)
    made, answers = sender(clients)
    made.send(7, "go", {"azimuth": 0.1, "elevation": 0.2})
    made.poll()
    assert (answers, clients.futures[0].request.azimuth) == ([], 0.1)
    clients.answer = GoTo.Response(success=False, message="the antenna is parked")
    made.poll()
    made.poll()
    assert answers == [(7, False, "the antenna is parked")]


@pytest.mark.usefixtures("ros_domain")
def test_what_has_a_lease_is_called_signed_with_the_key_of_the_antenna(tmp_path: Path) -> None:
    path = tmp_path / "command.key"
    servo, clients = CommandKey(CommandKeyParams(command_key_file=str(path))), Clients(ready=True)
    clients.resolve_service_name = lambda name: f"/gs1/{name}"
    clients.get_fully_qualified_name = lambda: "/gs1/station_executive"
    made, _ = sender(clients, key=str(path))
    made.send(7, "go", {"azimuth": 0.1, "elevation": 0.2})
    call = clients.futures[0].request
    assert (call.service, call.caller) == ("/gs1/antenna_servo/go_to", "/gs1/station_executive")
    servo.check_call(call)
    assert deserialize_message(bytes(call.request), GoTo.Request).azimuth == 0.1


def test_a_parameter_is_set_by_node_and_name_and_its_refusal_is_the_response() -> None:
    clients = Clients(ready=True)
    made, answers = sender(clients)
    made.send(2, "set", {"value": 0.3})
    (parameter,) = clients.futures[0].request.parameters
    assert (parameter.name, parameter.value.double_value) == ("source.along_track_offset_s", 0.3)
    clients.answer = SimpleNamespace(result=SimpleNamespace(successful=False, reason="must be <= 60"))
    made.poll()
    assert answers == [(2, False, "must be <= 60")]


def test_what_the_executive_does_itself_fails_with_its_reason() -> None:
    def full(name: str) -> str:
        raise OSError("0.1 GB are free")

    made, answers = sender(Clients(ready=True), full)
    made.send(3, "record", {"name": "p1"})
    assert answers == [(3, False, "0.1 GB are free")]


def test_two_executives_share_a_list_and_the_living_one_takes_over() -> None:
    rows = {"a": "waiting", "b": "active", "c": "tracked", "d": "yields"}
    message = Schedule(passes=[ScheduledPass(id=name, state=state) for name, state in rows.items()])

    def taken(mine: str, other: str, silent_s: float) -> set[str]:
        node = StationExecutive.__new__(StationExecutive)
        changes: list[float] = []
        node._night = SimpleNamespace(schedule=SimpleNamespace(antenna=mine), taken=set(), change=changes.append)
        node.parameters = SimpleNamespace(value=lambda _name: AlarmParams())
        node._schedules, node._partner_s = {other: message}, {other: time.monotonic() - silent_s}
        node._share(5.0)
        assert changes == [5.0]
        return node._night.taken

    # The first by name leaves only what has begun; the second leaves all that the first plans.
    assert taken("gs1", "gs2", 0.0) == {"b", "c"}
    assert taken("gs2", "gs1", 0.0) == {"a", "b", "c"}
    assert taken("gs2", "gs1", 60.0) == {"c"}


def test_a_silent_executive_is_an_error_unless_it_was_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    checks: dict[str, Any] = {}
    node = SimpleNamespace(listen=lambda *_: None, diagnostics=SimpleNamespace(add=checks.__setitem__))
    watch, now_s = ExecutiveWatch(node), 100.0
    monkeypatch.setattr(station_node.time, "monotonic", lambda: now_s)
    assert (checks["executive"]().level, checks["executive"]().message) == (OK, "none")
    watch._note(ExecutiveStatus(state="running"))
    assert checks["executive"]().level == OK
    now_s = 108.0
    assert checks["executive"]().level == ERROR
    assert checks["executive"]().message == "station_executive has been silent for 8 s; it was running"
    watch._note(ExecutiveStatus(state="idle"))
    now_s = 200.0
    assert checks["executive"]().level == OK


# The node, with a night of its own

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")


class Goal(GoalHandle):
    """A goal of run_schedule, and what became of it."""

    def __init__(self, schedule: str = "", resume: bool = False) -> None:
        super().__init__(RunSchedule.Goal(schedule=schedule, resume=resume))


class Bench:
    """An executive in this process, active, that records nothing; its clocks and its disk are the test's."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, folder: Path, **given: Any) -> None:
        self.wall_s, self.t_s, self.free_bytes = 1000.0, 1.8e9, 5e9
        self.folder = folder / "night"
        self.directives: list[tuple[int, str, dict[str, Any]]] = []
        self.schedules: list[Any] = []
        self.statuses: list[Any] = []
        self.alarms: list[tuple[Any, ...]] = []
        self.readings: list[JointReading] = []
        monkeypatch.setattr(station_executive, "time", SimpleNamespace(monotonic=lambda: self.wall_s))
        monkeypatch.setattr(station_executive, "shutil", SimpleNamespace(disk_usage=self._disk))
        self.node = StationExecutive()
        values = {"executive.folder": str(self.folder), **given}
        self.node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
        self.node.now_s = lambda: self.t_s
        assert self.node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason
        self.night = self.node._night
        self.night._send = lambda *directive: self.directives.append(directive)
        self.node._joints = SimpleNamespace(take=lambda: self.readings.pop() if self.readings else None)
        self.node._schedule_out = SimpleNamespace(publish=self.schedules.append)
        self.node._status_out = SimpleNamespace(publish=self.statuses.append)
        self.node._hooks.put = lambda *alarm: self.alarms.append(alarm)

    def activate(self) -> None:
        assert self.node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason

    def _disk(self, _folder: Path) -> Any:
        if self.free_bytes < 0.0:
            raise OSError("the disk is gone")
        return SimpleNamespace(free=self.free_bytes)

    def known(self, attribute: str) -> Any:
        seen = self.night.expected_state.actual(attribute)
        return None if seen is None else seen.value

    def seen_s(self, attribute: str) -> float:
        return float(self.night.expected_state.actual(attribute).t_s)

    def passes(self, *begins_s: float) -> str:
        """Return a list of passes of 300 s, named p0, p1, ... that rise so long from now."""
        return json.dumps(
            [
                {"id": f"p{index}", "target": f"bird{index}", "aos_utc": utc_text(self.t_s + begin_s),
                 "los_utc": utc_text(self.t_s + begin_s + 300.0)}
                for index, begin_s in enumerate(begins_s)
            ]
        )  # fmt: skip

    def start(self, *begins_s: float) -> Goal:
        goal = Goal(self.passes(*begins_s))
        self.node._on_accepted(goal)
        return goal

    def journal(self) -> list[dict[str, Any]]:
        text = (self.folder / "journal.jsonl").read_text(encoding="utf-8")
        return [json.loads(row) for row in text.splitlines()]

    def close(self) -> None:
        # Nights that hold stand-ins cannot be kept.
        self.node._ready_to_keep = False
        self.node.end()
        self.node._action.destroy()
        self.node.lock.release()
        self.node.destroy_node()


@pytest.fixture
def make(default_context: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    """Yield a maker of executives that share a folder."""
    made: list[Bench] = []

    def one(**given: Any) -> Bench:
        made.append(Bench(monkeypatch, tmp_path, **{"executive.record": False} | given))
        return made[-1]

    yield one
    for each in made:
        each.close()


@pytest.fixture
def bench(make: Callable[..., Bench]) -> Bench:
    """Return an active executive without a night."""
    one = make()
    one.activate()
    return one


@pytest.mark.parametrize(("rate", "moving"), [(1.1e-4, True), (-1.1e-4, True), (1e-4, False)])
def test_the_antenna_is_known_by_its_status_and_the_newest_axes(bench: Bench, rate: float, moving: bool) -> None:
    stamp = stamp_from_seconds(bench.t_s - 2.0)
    message = AntennaStatus(mode="holding", fault="f", warning="w", high_wind="h", rate_command=[0.0, rate])
    message.header.stamp = stamp
    bench.node._on_antenna(message)
    assert bench.known("antenna.azimuth") is None
    bench.readings.append(
        JointReading(t_s=bench.t_s - 1.0, position_rad=np.array([0.5, 0.7]), velocity_rad_s=np.zeros(2))
    )
    bench.node._on_antenna(message)
    found = [bench.known(f"antenna.{name}") for name in ("mode", "fault", "warning", "high_wind", "moving", "azimuth")]
    assert found == ["holding", "f", "w", "h", moving, 0.5]
    assert bench.known("antenna.elevation") == 0.7
    assert bench.seen_s("antenna.mode") == bench.t_s - 2.0
    assert bench.seen_s("antenna.azimuth") == bench.t_s - 1.0


def test_tracking_target_and_certificate_are_known_with_their_times(bench: Bench) -> None:
    tracking = TrackingStatus(mode="program_track", target="bird", seconds_tracked=12.5, held=True)
    tracking.header.stamp = stamp_from_seconds(bench.t_s - 3.0)
    bench.node._on_tracking(tracking)
    assert (bench.known("tracking.seconds_tracked"), bench.known("tracking.held")) == (12.5, True)
    assert bench.seen_s("tracking.mode") == bench.t_s - 3.0
    target = Target(target="bird", element_age=7200.0)
    target.header.stamp = stamp_from_seconds(bench.t_s)
    bench.node._on_target(target)
    assert bench.known("elements.age_h") is None, "an age without a covariance is none"
    target.covariance = [1e-9] * 16
    bench.node._on_target(target)
    assert (bench.known("elements.age_h"), bench.known("elements.target")) == (2.0, "bird")
    bench.node._on_certificate(PassCertificate(target="bird", accepted=False, refusal="too fast"))
    assert (bench.known("certificate.accepted"), bench.known("certificate.refusal")) == (False, "too fast")
    assert bench.seen_s("certificate.target") == bench.t_s


def test_the_pass_of_the_selected_target_is_the_one_in_the_schedule(bench: Bench) -> None:
    bench.node._on_passes(PassList(target="bird0"))
    assert (bench.known("ephemeris.target"), bench.known("ephemeris.pass_found")) == ("bird0", False)
    bench.start(-10.0)
    bench.node._on_antenna(AntennaStatus(mode="holding", rate_command=[0.0, 0.0]))
    bench.night._attempt = SimpleNamespace(id="p0")
    windows = [
        Pass(
            target=name,
            aos=stamp_from_seconds(bench.t_s + begin_s),
            los=stamp_from_seconds(bench.t_s + begin_s + 300.0),
        )
        for name, begin_s in (("far", 6000.0), ("near", -20.0))
    ]
    bench.node._on_passes(PassList(target="bird0", passes=windows))
    assert bench.known("ephemeris.pass").target == "near"
    assert bench.seen_s("ephemeris.pass") == bench.t_s


def diagnostics(node: str, check: str, level: bytes = OK, message: str = "", **values: str) -> DiagnosticArray:
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    status = DiagnosticStatus(
        hardware_id=node, name=f"{node.rpartition('/')[2]}: {check}", level=level, message=message, values=pairs
    )
    return DiagnosticArray(status=[status])


def test_the_health_of_the_nodes_of_its_namespace_is_known(bench: Bench) -> None:
    bench.node.get_namespace = lambda: "/gs1"
    bench.node.get_fully_qualified_name = lambda: "/gs1/station_executive"
    for other in ("/gs2/antenna_servo", "/gs1/station_executive", "/gs10/antenna_servo"):
        bench.node._on_diagnostics(diagnostics(other, "device", ERROR, "lost"))
    bench.node._observe(bench.t_s)
    assert bench.known("drive.problem") is None
    assert bench.known("antenna_servo.silent_s") is None
    bench.node._on_diagnostics(
        diagnostics("/gs1/antenna_servo", "device", ERROR, "lost", azimuth_starts="7", elevation_starts="9")
    )
    bench.node._on_diagnostics(diagnostics("/gs1/bias_calibrator", "model", WARN, "old"))
    bench.node._on_diagnostics(diagnostics("/gs1/rf_receiver", "model", ERROR, "none"))
    bench.node._on_diagnostics(diagnostics("/gs1/rf_receiver", "device", ERROR, "gone"))
    bench.wall_s += 4.0
    bench.node._observe(bench.t_s)
    assert bench.known("antenna_servo.silent_s") == 4.0
    assert bench.known("drive.problem") == "lost"
    assert (bench.known("model.health"), bench.known("model.level")) == ("old", 1)
    bench.node._on_diagnostics(diagnostics("/gs1/antenna_servo", "device", WARN, "slow", azimuth_starts="8"))
    bench.node._on_diagnostics(diagnostics("/gs1/antenna_servo", "model", ERROR, "none"))
    bench.node._observe(bench.t_s)
    assert (bench.known("drive.problem"), bench.known("relays.starts")) == ("", "8")
    assert bench.known("antenna_servo.silent_s") == 0.0


def test_what_no_message_carries_is_observed(bench: Bench) -> None:
    bench.node._observe(bench.t_s)
    assert (bench.known("disk.free_gb"), bench.known("recorder.state"), bench.known("executive.problem")) == (
        5.0,
        "idle",
        "",
    )
    bench.node._recorder = SimpleNamespace(problem="", close=lambda: SimpleNamespace(path=Path("/x/bag")))
    bench.node._report = lambda name: name
    bench.free_bytes = -1.0
    bench.node._journal_problem = "journal is full"
    bench.node._observe(bench.t_s)
    assert (bench.known("recorder.state"), bench.known("executive.problem")) == ("recording", "journal is full")
    assert (bench.known("disk.free_gb"), bench.known("disk.problem")) == (0.0, "the disk is gone")
    bench.node._recorder.problem = "no space"
    bench.node._observe(bench.t_s)
    assert bench.known("recorder.state") == "failed"


def test_the_news_of_a_partner_keep_it_alive(make: Callable[..., Bench]) -> None:
    bench = make(**{"executive.partners": " /gs2/, gs3 ,,"})
    assert set(bench.node._partner_s) == {"gs2", "gs3"}
    bench.start(600.0)
    bench.node._on_partner("gs2", Schedule(passes=[ScheduledPass(id="p0", state="active")]))
    bench.wall_s += 5.0
    bench.node._step(bench.t_s)
    assert bench.night.taken == {"p0"}
    bench.wall_s += 0.1
    bench.node._share(bench.t_s)
    assert bench.night.taken == set()
    bench.node._alive("gs2")
    bench.node._share(bench.t_s)
    assert bench.night.taken == {"p0"}


def test_a_night_ends_with_its_report_and_concludes_its_goal(bench: Bench) -> None:
    goal = bench.start(600.0)
    assert bench.night.state_name == "running"
    bench.node._step(bench.t_s)
    assert goal.ends == []
    assert [row["event"] for row in bench.journal()][:1] == ["started"]
    assert bench.journal()[0]["utc"] == utc_text(bench.t_s)
    bench.node._request("abort", bench.night.abort)
    bench.node._step(bench.t_s)
    bench.node._step(bench.t_s)
    assert bench.night.state_name == "idle"
    assert goal.ends == ["execute"]
    assert bench.node._goal is None
    (report,) = bench.folder.glob("report-*")
    assert report.name == f"report-{utc_text(bench.t_s)[:16].replace(':', '')}"
    values = json.loads((report / "night.json").read_text())
    assert values["messages"] == len(bench.alarms)
    assert (report / "night.html").is_file()
    result = bench.node._conclude(goal)
    assert (result.success, result.report, goal.ends[-1]) == (True, str(report), "succeed")


def test_each_step_observes_what_no_message_carries_and_a_night_is_finished_once(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished: list[float] = []
    monkeypatch.setattr(bench.node, "_finish", lambda: finished.append(bench.t_s))
    bench.node._step(bench.t_s)
    assert bench.known("disk.free_gb") == 5.0
    bench.free_bytes = 4e9
    bench.node._step(bench.t_s)
    assert bench.known("disk.free_gb") == 4.0
    assert finished == [], "no night"
    bench.start(600.0)
    bench.node._step(bench.t_s)
    bench.night.abort(bench.t_s)
    for _ in range(4):
        bench.node._step(bench.t_s)
    assert bench.night.state_name == "idle"
    assert len(finished) == 1


def test_the_morning_shows_disk_losses_and_health(bench: Bench) -> None:
    bench.node.inputs.lost = {"target": 3, "passes": 4}
    bench.node._healths["model"] = {"health": "old", "level": 1}
    bench.node._messages.update({"disk": 2, "wind": 1})
    found = bench.node._morning()
    assert found.messages == 3
    shown = {row[0]: row for row in found.health} if not isinstance(found.health, dict) else found.health
    assert "7" in str(shown)
    assert "5" in str(shown)
    assert "old" in str(shown)


@pytest.mark.parametrize(
    ("states", "tracked", "lost", "end"),
    [(["tracked", "tracked"], 2, 0, "succeed"), (["tracked", "lost", "weather"], 1, 2, "abort"), ([], 0, 0, "succeed")],
)
def test_the_result_counts_the_passes(bench: Bench, states: list[str], tracked: int, lost: int, end: str) -> None:
    bench.night.records = [SimpleNamespace(state=PassState(state)) for state in states]
    goal = Goal()
    result = bench.node._conclude(goal)
    assert (result.passes_tracked, result.passes_lost, result.success) == (tracked, lost, lost == 0)
    assert goal.ends == [end]
    goal.is_cancel_requested = True
    bench.node._conclude(goal)
    assert goal.ends[-1] == "canceled"


def test_goals_are_taken_one_at_a_time_while_the_node_is_active(make: Callable[..., Bench]) -> None:
    bench = make()
    assert bench.node._on_goal(RunSchedule.Goal()) == GoalResponse.REJECT
    bench.activate()
    assert bench.node._on_goal(RunSchedule.Goal()) == GoalResponse.ACCEPT
    bench.start(600.0)
    assert bench.node._on_goal(RunSchedule.Goal()) == GoalResponse.REJECT


def test_a_goal_replaces_the_schedule_unless_it_resumes(bench: Bench) -> None:
    bench.start(600.0, 1200.0)
    assert list(bench.night.schedule.entries) == ["p0", "p1"]
    refused = Goal(bench.passes(1800.0))
    bench.node._goal = None
    bench.node._on_accepted(refused)
    assert refused.ends == ["execute"]
    assert bench.node._goal is None
    result = bench.node._conclude(refused)
    assert (result.success, refused.ends[-1]) == (False, "abort")
    assert "running" in result.message
    more = Goal(bench.passes(600.0, 1200.0, 1800.0), resume=True)
    bench.night._planned_s = 1.0
    bench.node._on_accepted(more)
    assert bench.node._goal is more
    assert (len(bench.night.schedule.entries), bench.night._planned_s) == (3, -np.inf)
    assert bench.node._refusal == ""
    bench.node._request("abort", bench.night.abort)
    bench.node._step(bench.t_s)
    kept = Goal(resume=True)
    bench.node._on_accepted(kept)
    assert len(bench.night.schedule.entries) == 3
    assert len(bench.schedules[-1].passes) == 3
    bench.node._request("abort", bench.night.abort)
    bench.node._step(bench.t_s)
    bench.start(900.0)
    assert list(bench.night.schedule.entries) == ["p0"]


def test_a_goal_without_passes_is_refused(bench: Bench) -> None:
    goal = Goal()
    bench.node._on_accepted(goal)
    assert (goal.ends, bench.night.state_name) == (["execute"], "idle")
    assert "must name passes" in bench.node._conclude(goal).message


def test_a_cancelled_goal_ends_the_night_and_one_that_has_ended_is_let_be(bench: Bench) -> None:
    goal = bench.start(600.0)
    assert bench.node._on_cancel(goal) == CancelResponse.ACCEPT
    assert bench.night.state_name == "stopping"
    bench.node._step(bench.t_s)
    assert bench.night.state_name == "idle"
    assert bench.node._on_cancel(goal) == CancelResponse.ACCEPT


def test_a_request_is_answered_with_the_state_it_leads_to(bench: Bench) -> None:
    bench.start(600.0)
    published = len(bench.schedules)
    assert bench.node._request("pause", bench.night.pause) == "pause: the executive is paused"
    assert len(bench.schedules) == published, "the schedule is the same"
    bench.night.schedule.entries["p0"].reason = "new"
    bench.node._request("resume", bench.night.resume)
    assert len(bench.schedules) == published + 1


def test_the_schedule_is_changed_while_it_runs(bench: Bench) -> None:
    bench.start(600.0, 1200.0)
    bench.night._planned_s = 1.0
    with pytest.raises(ValueError, match="'p7' is not in the schedule of 2"):
        bench.node._change(ChangeSchedule.Request(remove=["p0", "p7"]))
    assert list(bench.night.schedule.entries) == ["p0", "p1"]
    added = bench.passes(600.0, 1200.0, 1800.0)
    text = bench.node._change(ChangeSchedule.Request(add=added, remove=["p1"]))
    assert text == "3 passes added, 1 removed; 3 in all"
    assert bench.night._planned_s == -np.inf
    assert len(bench.schedules[-1].passes) == 3
    assert bench.node._change(ChangeSchedule.Request(remove=["p2"])) == "0 passes added, 1 removed; 2 in all"


def test_the_schedule_is_published_when_it_changes_with_the_time(bench: Bench) -> None:
    bench.start(600.0)
    assert len(bench.schedules) == 1
    (row,) = bench.schedules[0].passes
    assert (row.id, row.target, seconds_from_stamp(row.aos)) == ("p0", "bird0", bench.t_s + 600.0)
    assert seconds_from_stamp(bench.schedules[0].header.stamp) == bench.t_s
    before = len(bench.statuses)
    bench.node._publish_if_new()
    assert (len(bench.schedules), len(bench.statuses)) == (1, before)
    bench.night.schedule.entries["p0"].reason = "new"
    bench.node._publish_if_new()
    assert (len(bench.schedules), len(bench.statuses)) == (2, before + 1)


def test_the_status_names_the_pass_the_next_and_the_alarms(bench: Bench) -> None:
    goal = bench.start(600.0, 1200.0, 1800.0)
    bench.night.schedule.replan(bench.t_s, (0.0, 0.5))
    bench.night.book.raise_("disk", 1, "full", bench.t_s - 7.0)
    bench.night.book.raise_("wind", 2, "strong", bench.t_s)
    bench.night.book.acknowledge("wind", bench.t_s)
    bench.night.book.raise_("gone", 2, "was", bench.t_s)
    bench.night.book.clear("gone", bench.t_s)
    bench.night.records = [SimpleNamespace(state=PassState.TRACKED)]
    bench.node._publish()
    status = bench.statuses[-1]
    assert (status.state, status.pass_id, status.target, status.next_id) == ("running", "", "", "p0")
    assert seconds_from_stamp(status.header.stamp) == bench.t_s
    assert seconds_from_stamp(status.next_start) == bench.t_s + 600.0
    assert [(each.name, each.level, each.message, each.acknowledged, each.count) for each in status.alarms] == [
        ("wind", 2, "strong", True, 0), ("disk", 1, "full", False, 1)
    ]  # fmt: skip
    assert seconds_from_stamp(status.alarms[1].raised) == bench.t_s - 7.0
    entries = bench.night.schedule.entries
    entries["p0"].state, entries["p1"].state = PassState.ACTIVE, PassState.LOST
    bench.node._publish()
    assert (bench.statuses[-1].target, bench.statuses[-1].next_id) == ("bird0", "p2")
    feedback = goal.feedback[-1]
    assert (feedback.state, feedback.passes_done, feedback.passes_left) == ("running", 1, 2)


def test_nothing_comes_next_when_the_schedule_is_done(bench: Bench) -> None:
    bench.node._publish()
    assert bench.statuses[-1].next_id == ""
    assert seconds_from_stamp(bench.statuses[-1].next_start) == 0.0


def test_the_status_is_published_once_a_second_while_active(make: Callable[..., Bench]) -> None:
    bench = make()
    assert bench.node.turn() == 0.05
    assert bench.statuses == []
    bench.activate()
    bench.node.turn()
    bench.wall_s += 0.99
    bench.node.turn()
    assert len(bench.statuses) == 1
    bench.wall_s += 0.01
    bench.node.turn()
    assert len(bench.statuses) == 2


def test_responses_are_polled_between_two_steps_and_in_each(bench: Bench) -> None:
    polls: list[float] = []
    bench.node._sender.poll = lambda: polls.append(bench.t_s)
    bench.node.turn()
    bench.node._step(bench.t_s)
    assert len(polls) == 2


def test_an_end_of_a_directive_is_known_and_a_failure_of_it_too(bench: Bench) -> None:
    failures: list[tuple[Any, ...]] = []
    responses: list[tuple[Any, ...]] = []
    bench.night.fail = lambda *failure: failures.append(failure)
    bench.night.respond = lambda *response: responses.append(response)
    bench.node._responded(4, True, "goes")
    assert responses == [(4, True, "goes", bench.t_s)]
    bench.node._ended(5, "track", True, {"message": "loss of signal", "seconds_tracked": 3.0})
    assert (bench.known("track.succeeded"), bench.known("track.refused"), failures) == (True, "", [])
    bench.node._ended(6, "track", False, {"message": "too fast", "seconds_tracked": 0.0})
    assert (bench.known("track.succeeded"), bench.known("track.refused")) == (False, "too fast")
    bench.node._ended(7, "track", False, {"message": "fault", "seconds_tracked": 3.0})
    assert bench.known("track.refused") == ""
    bench.node._ended(8, "calibrate", False, {"message": ""})
    assert bench.known("calibrate.succeeded") is False
    assert bench.known("calibrate.refused") is None
    assert failures == [(6, "too fast", bench.t_s), (7, "fault", bench.t_s), (8, "it has failed", bench.t_s)]


def test_an_alarm_goes_to_the_hooks_and_is_counted(bench: Bench) -> None:
    reports: list[bool] = []
    bench.node.diagnostics.publish = lambda: reports.append(True)
    bench.night.book.raise_("disk", 1, "full", bench.t_s, ask="delete")
    bench.night.book.clear("disk", bench.t_s)
    utc = utc_text(bench.t_s)
    assert bench.alarms == [
        ("raised", "disk", 1, "full", "delete", utc), ("cleared", "disk", 1, "full", "delete", utc)
    ]  # fmt: skip
    assert bench.node._messages == {"disk": 2}
    assert len(reports) == 2


def test_an_acknowledged_alarm_warns_no_more_and_is_kept(make: Callable[..., Bench], tmp_path: Path) -> None:
    bench = make(**{"executive.state_file": str(tmp_path / "kept.json")})
    bench.activate()
    assert (bench.node._alarm_health().level, bench.node._alarm_health().message) == (OK, "none")
    bench.night.book.raise_("disk", 1, "full", bench.t_s)
    bench.night.book.raise_("wind", 2, "strong", bench.t_s)
    health = bench.node._alarm_health()
    assert (health.level, health.message) == (ERROR, "wind: strong; disk: full")
    assert health.values["disk"] == f"raised {utc_text(bench.t_s)}"
    assert bench.node._acknowledge(Named.Request(name="wind")) == "acknowledged: wind"
    assert bench.node._alarm_health().level == WARN
    assert "wind" in (tmp_path / "kept.json").read_text()
    bench.node._acknowledge(Named.Request())
    assert bench.node._alarm_health().level == OK
    bench.night.book.clear("wind", bench.t_s)
    bench.night.book.clear("disk", bench.t_s)
    assert bench.node._acknowledge(Named.Request()) == "acknowledged: no alarm lasts"


def test_a_killed_executive_goes_on_with_the_night_that_it_kept(make: Callable[..., Bench], tmp_path: Path) -> None:
    given = {"executive.state_file": str(tmp_path / "kept.json")}
    first = make(**given)
    # What was not taken over yet must not be replaced.
    first.node._keep()
    assert not (tmp_path / "kept.json").exists()
    first.activate()
    first.start(600.0)
    first.node.lock.release()
    second = make(**given)
    second.activate()
    assert (second.night.state_name, list(second.night.schedule.entries)) == ("running", ["p0"])
    # A night in work is not replaced by its older state.
    second.node._request("pause", second.night.pause)
    (tmp_path / "kept.json").write_text((tmp_path / "kept.json").read_text().replace("paused", "running"))
    second.node.on_deactivate(ANY_STATE)
    second.activate()
    assert second.night.state_name == "paused"


def test_deactivation_keeps_the_night_and_ends_the_recording(make: Callable[..., Bench], tmp_path: Path) -> None:
    bench = make(**{"executive.state_file": str(tmp_path / "kept.json")})
    bench.activate()
    closed: list[str] = []
    bench.node._recorder = SimpleNamespace(close=lambda: SimpleNamespace(path=tmp_path / "p0-01" / "bag"))
    bench.node._report = closed.append
    bench.node.on_deactivate(ANY_STATE)
    assert (tmp_path / "kept.json").is_file()
    assert closed == [str(tmp_path / "p0-01")]
    assert bench.node._recorder is None


class FakeRecorder:
    """A recorder that writes nothing."""

    def __init__(self, _node: Any, namespace: str, path: Path, *, notes: dict[str, str]) -> None:
        self.namespace, self.path, self.notes, self.problem = namespace, path, notes, ""

    def close(self) -> Any:
        return SimpleNamespace(path=self.path)


def test_each_attempt_at_a_pass_has_a_recording_and_a_report_of_its_own(
    make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make(**{"executive.record": True})
    bench.activate()
    started: list[tuple[Any, dict[str, Any]]] = []
    states = [None, 0, 0]

    def process(command: Any, **options: Any) -> Any:
        started.append((command, options))
        return SimpleNamespace(poll=states.pop)

    monkeypatch.setattr(recorder, "Recorder", FakeRecorder)
    monkeypatch.setattr(station_executive.subprocess, "Popen", process)
    assert bench.node._record("p0") == str(bench.folder / "passes" / "p0-01")
    assert (bench.folder / "passes" / "p0-01").is_dir()
    assert bench.node._recorder.path == bench.folder / "passes" / "p0-01" / "bag"
    assert bench.node._recorder.notes["pass"] == "p0"
    assert started == []
    assert bench.node._record("p0") == str(bench.folder / "passes" / "p0-02")
    assert started[0][0][-1] == str(bench.folder / "passes" / "p0-01" / "bag")
    assert bench.node._end_record() == str(bench.folder / "passes" / "p0-02" / "bag")
    assert bench.node._end_record() == "nothing is recorded"
    assert (len(started), len(bench.node._reports)) == (2, 2)
    # Those that have ended are not waited for again.
    bench.node._step(bench.t_s)
    assert len(bench.node._reports) == 0


def test_a_report_that_is_still_written_is_kept(bench: Bench) -> None:
    ends = [None, 3]
    bench.node._reports = [SimpleNamespace(poll=lambda: ends[0]), SimpleNamespace(poll=lambda: ends[1])]
    bench.node._step(bench.t_s)
    assert len(bench.node._reports) == 1


def test_nothing_is_recorded_on_a_full_disk_or_where_that_is_not_wanted(
    make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "Recorder", FakeRecorder)
    bench = make(**{"executive.record": True})
    bench.activate()
    bench.node._report = lambda name: name
    bench.free_bytes = 1.99e9
    with pytest.raises(OSError, match="1.99 GB are free, must be >= 2 GB"):
        bench.node._record("p0")
    bench.free_bytes = 2e9
    bench.node._record("p0")
    bench.node._end_record()
    bench.node.lock.release()
    other = make()
    with pytest.raises(ValueError, match="record is false"):
        other.node._record("p0")


def test_the_rest_of_a_pass_is_recorded_after_a_restart(bench: Bench) -> None:
    recorded: list[str] = []

    def record(name: str) -> str:
        recorded.append(name)
        raise OSError("the disk is full")

    bench.node._record = record
    bench.node._record_again()
    assert recorded == []
    bench.night._attempt = SimpleNamespace(id="p0")
    bench.node._record_again()
    assert recorded == ["p0"]


def test_a_journal_that_cannot_be_written_is_a_warning_until_it_can(bench: Bench) -> None:
    bench.start(600.0)
    (bench.folder / "journal.jsonl").mkdir()
    bench.node._write_journal()
    assert bench.node._health().level == WARN
    assert "journal.jsonl" in bench.node._health().message
    (bench.folder / "journal.jsonl").rmdir()
    bench.night.change(bench.t_s)
    bench.node._write_journal()
    health = bench.node._health()
    assert (health.level, health.message) == (OK, "running")
    assert [row["event"] for row in bench.journal()] == ["schedule changed"]
    assert (health.values["passes"], health.values["records"]) == (1, 0)


def test_a_report_that_cannot_be_written_is_a_warning_and_the_goal_ends(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rf_pointing.report import night_report

    def write(_report: Any, _folder: Path) -> None:
        raise OSError(28, "No space left")

    monkeypatch.setattr(night_report, "write_night", write)
    goal = bench.start(600.0)
    bench.node._recorder = SimpleNamespace(problem="", close=lambda: SimpleNamespace(path=bench.folder / "p0" / "bag"))
    bench.node._report = lambda name: name
    bench.node._finish()
    assert (goal.ends, bench.node._recorder) == (["execute"], None)
    assert "No space left" in bench.node._health().message
    assert bench.node._report_folder == ""


def test_a_schedule_may_be_named_by_the_path_of_its_file(tmp_path: Path) -> None:
    file = tmp_path / "list.csv"
    file.write_text("target,aos_utc,los_utc\n")
    assert station_executive._text_of(str(file)) == "target,aos_utc,los_utc\n"
    for text in ("target", f"{file}\n", "/" * 4096):
        assert station_executive._text_of(text) == text
    with pytest.raises(OSError, match="long|No such"):
        station_executive._text_of("/" + "a" * 4094)


@pytest.mark.parametrize(("given", "refused"), [("sextant", True), ("auto", False), ("", False)])
def test_a_sensor_of_the_night_must_be_one(default_context: None, tmp_path: Path, given: str, refused: bool) -> None:
    node = StationExecutive()
    values = {"executive.sensor": given, "executive.folder": str(tmp_path)}
    node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
    result = node.on_configure(ANY_STATE)
    assert (result == TransitionCallbackReturn.FAILURE) == refused
    if not refused:
        assert node._night._sensor == (given or node.station.sensor(node.band))
    node.end()
    node._action.destroy()
    node.lock.release()
    node.destroy_node()


def test_the_executive_is_connected_while_it_is_configured(make: Callable[..., Bench]) -> None:
    node = make(**{"executive.partners": "gs2"}).node
    topics = {
        "antenna_status", "joint_states", "tracking_status", "passes", "target", "pass_certificate", "diagnostics",
        "gs2/schedule", "gs2/executive_status",
    }  # fmt: skip
    assert topics <= {each.topic_name.lstrip("/") for each in node.subscriptions}
    requests = {"pause", "resume", "stop", "abort", "skip", "acknowledge", "change_schedule"}
    assert requests <= {each.srv_name.rpartition("/")[2] for each in node.services}
    assert {"night", "alarms"} <= set(node.diagnostics._checks)
    hooks, clients = [], len(list(node.clients))
    node._hooks.close = lambda: hooks.append("closed")
    node.on_cleanup(ANY_STATE)
    assert len(list(node.clients)) < clients
    assert not (topics - {"diagnostics"}) & {each.topic_name.lstrip("/") for each in node.subscriptions}
    assert not [each.srv_name for each in node.services if each.srv_name.endswith("/skip")]


def test_work_is_timed_while_the_node_is_active(bench: Bench) -> None:
    timers = len(list(bench.node.timers))
    bench.node.on_deactivate(ANY_STATE)
    assert len(list(bench.node.timers)) == timers - 1
