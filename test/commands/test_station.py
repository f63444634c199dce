"""The command line of `station`, what each request does to the station, and how its lines read."""

import json
import math
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import ParameterType, ParameterValue, SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.serialization import deserialize_message
from rf_pointing_msgs.action import RunSchedule, TrackPass
from rf_pointing_msgs.msg import (
    Alarm,
    AntennaStatus,
    ExecutiveStatus,
    Pass,
    PassBranch,
    PassCertificate,
    PassList,
    ProcedureBlock,
    Schedule,
    ScheduledPass,
    TrackingStatus,
)
from rf_pointing_msgs.srv import ChangeSchedule, GoTo, Jog, Named, PermitSun
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

import rf_pointing.report
from rf_pointing.commands import station
from rf_pointing.core.parameters import leaves
from rf_pointing.ephemeris.target_offsets import TargetOffsets
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.main_loop import ros_domain
from rf_pointing.ros.qos import LATCHED, STATUS
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_client import StationClient
from rf_pointing.station.clients.alarm_hooks import NO_WAY
from test.ros.fake_station import FakeStation, fake

__all__ = ["fake"]

NEAR_S = 1_151_380_800.0
OFFSETS: dict[str, Any] = dict.fromkeys(("request", *leaves(TargetOffsets())))


@pytest.mark.parametrize(
    "line",
    [
        "", "fly", "go 120", "go 120 high", "go 1001 10", "go -1001 10", "go 10 201", "go 10 -21", "track",
        "track ISS --sensor nose", "track ISS --min-peak 91", "track ISS --near tomorrow", "night dance",
        "offset --along 61", "offset --along -61", "offset --cross 5.8", "offset --cross -5.8", "log -n many",
        "--namespace a b status",
    ],
)  # fmt: skip
def test_wrong_lines_end_with_2_before_the_station_is_looked_for(fake: FakeStation, line: str) -> None:
    assert run(*line.split()) == 2
    assert fake.life == []


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("queue /nowhere/night.csv", "no such file: /nowhere/night.csv"),
        ("queue wrong.csv --start", "row 1: start='tomorrow'"),
        ("queue", "queue needs a file, --remove or --start"),
        ("offset --along 1 --clear", "offset takes numbers, or one of --clear, --keep, --recall"),
        ("jog", "jog needs a direction, or a terminal with arrow keys"),
        ("permit-sun --band X", "permit-sun needs --until, or --withdraw"),
        ("permit-sun --band X --withdraw --until 2026-06-21T12:00:00Z", "permit-sun needs --until, or"),
        ("--key /nowhere/command.key park", "/nowhere/command.key: no such file"),
    ],
)
def test_what_cannot_be_asked_has_its_reason(
    fake: FakeStation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str], line: str, reason: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("wrong.csv").write_text("target,aos_utc,los_utc\nISS,tomorrow,2026-01-01T00:10:00\n")
    assert run(*line.split()) == 2
    assert reason in capsys.readouterr().err
    assert fake.life == []


@pytest.mark.parametrize(
    ("line", "call", "wanted"),
    [
        ("passes", "show_passes", {"as_json": False}),
        ("track ISS", "track", {"satellite": "ISS", "sensor": "auto", "min_peak_rad": 0.0, "near_s": None,
                                "output": None, "band": "", "record": True}),
        ("track ISS --sensor program --min-peak 90 --near 2006-06-27T04:00:00 --output out --no-record", "track",
         {"satellite": "ISS", "sensor": "program", "min_peak_rad": math.pi / 2, "near_s": NEAR_S,
          "output": Path("out"), "band": "", "record": False}),
        ("queue --start", "queue", {"text": None, "remove": [], "start": True}),
        ("status --watch --json", "show_status", {"watch": True, "as_json": True, "forget": False}),
        ("go -1000 -20", "go", {"azimuth_rad": math.radians(-1000.0), "elevation_rad": math.radians(-20.0)}),
        ("go 1000 200", "go", {"azimuth_rad": math.radians(1000.0), "elevation_rad": math.radians(200.0)}),
        ("offset --along -60", "offsets", OFFSETS | {"along_track_offset_s": -60.0}),
        ("offset --along 60 --cross -5.7", "offsets",
         OFFSETS | {"along_track_offset_s": 60.0, "cross_track_offset_deg": -5.7}),
        ("night skip p1", "night", {"request": "skip", "name": "p1"}),
        ("log", "show_journal", {"count": 30}),
        ("log -n 5", "show_journal", {"count": 5}),
    ],
)  # fmt: skip
def test_a_command_line_means_a_call(line: str, call: str, wanted: dict[str, Any]) -> None:
    request = station.request_of(["--namespace", "roof", *line.split()])
    assert request.namespace == "/roof"
    assert request.call is getattr(StationClient, call)
    assert request.arguments == wanted


def test_a_list_of_passes_leaves_the_file_that_follows_it(tmp_path: Path) -> None:
    night = tmp_path / "night.csv"
    night.write_text("target,aos_utc,los_utc\nISS,2026-11-26T18:00:00,2026-11-26T18:10:00\n")
    asked = station.request_of(["queue", "--remove", "a", "b", str(night)]).arguments
    assert (asked["remove"], asked["text"]) == (["a", "b"], night.read_text())


def test_a_tracker_of_another_package_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    choices = dict(station.SENSOR_CHOICES)
    monkeypatch.setattr(station, "SENSOR_CHOICES", choices)
    monkeypatch.setattr(station, "load_trackers", lambda: choices.update(nose="nose"))
    assert station.request_of(["track", "ISS", "--sensor", "nose"]).arguments["sensor"] == "nose"


def run(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        station.main([*words])
    assert isinstance(ended.value.code, int)
    return ended.value.code


# Requests that are one call of a service


def trigger(success: bool, message: str = "as you wish") -> Any:
    return lambda _: Trigger.Response(success=success, message=message)


@pytest.mark.parametrize(
    ("line", "name", "kind", "values"),
    [
        ("park", "antenna_servo/park", Trigger, {}),
        ("stow", "antenna_servo/stow", Trigger, {}),
        ("pause", "antenna_servo/pause", Trigger, {}),
        ("release", "antenna_servo/resume", Trigger, {}),
        ("disable", "antenna_servo/disable", Trigger, {}),
        ("reset", "antenna_servo/reset_fault", Trigger, {}),
        ("stop", "pointing_controller/stop", Trigger, {}),
        ("stop --antenna", "antenna_servo/stop", Trigger, {}),
        ("night pause", "station_executive/pause", Trigger, {}),
        ("night resume", "station_executive/resume", Trigger, {}),
        ("night stop", "station_executive/stop", Trigger, {}),
        ("night abort", "station_executive/abort", Trigger, {}),
        ("night skip p1", "station_executive/skip", Named, {"name": "p1"}),
        ("night ack", "station_executive/acknowledge", Named, {"name": ""}),
        (
            "permit-sun --band X --by alice --until 2026-06-21T12:00:00Z",
            "antenna_servo/permit_sun",
            PermitSun,
            {"by": "alice", "band": "X", "until": Time(sec=1782043200)},
        ),
        ("permit-sun --band X --withdraw", "antenna_servo/permit_sun", PermitSun, {"by": "", "band": "X"}),
        ("status --forget", "ephemeris_publisher/forget_learned", Trigger, {}),
        ("offset --clear", "ephemeris_publisher/clear_offsets", Trigger, {}),
        ("offset --keep A", "ephemeris_publisher/keep_offsets", Named, {"name": "A"}),
        ("offset --recall A", "ephemeris_publisher/recall_offsets", Named, {"name": "A"}),
        ("offset --forget A", "ephemeris_publisher/forget_offsets", Named, {"name": "A"}),
        ("go 120 45", "antenna_servo/go_to", GoTo, {"azimuth": math.radians(120.0), "elevation": math.radians(45.0)}),
        ("queue --remove a b", "station_executive/change_schedule", ChangeSchedule, {"add": [], "remove": ["a", "b"]}),
    ],
)
@pytest.mark.parametrize("success", [True, False])
def test_a_request_calls_its_service_and_ends_with_its_success(
    fake: FakeStation, capsys: pytest.CaptureFixture[str], line: str, name: str, kind: Any,
    values: dict[str, Any], success: bool,
) -> None:  # fmt: skip
    fake.services[name] = lambda _: kind.Response(success=success, message="the reason")
    assert run(*line.split()) == (0 if success else 1)
    called, request = fake.calls[-1]
    assert called == name
    assert {key: getattr(request, key) for key in values} == values
    assert capsys.readouterr().err == "station: the reason\n"
    assert fake.life == ["begun", "executor shut down", "destroyed", "over"]


def test_a_station_that_is_not_there_ends_with_2_after_ten_seconds(
    fake: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("--namespace", "/roof", "night", "pause") == 2
    assert (
        capsys.readouterr().err
        == f"station: station_executive/pause not seen within 10 s in /roof of ROS domain {ros_domain()}\n"
    )
    assert fake.wall.passed_s == pytest.approx(10.0, abs=0.1)
    assert fake.name == f"station_{os.getpid()}", "several operators may look at one station"


def test_an_answer_that_never_comes_ends_with_2(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    fake.services["station_executive/pause"], fake.answer_s = trigger(True), math.inf
    assert run("night", "pause") == 2
    assert "an answer of station_executive/pause not seen within 10 s" in capsys.readouterr().err


@pytest.mark.parametrize("sign", [2, 15])
def test_a_signal_ends_the_wait(fake: FakeStation, capsys: pytest.CaptureFixture[str], sign: int) -> None:
    fake.at(1.0, lambda: fake.handlers[sign]())
    assert run("night", "pause") == 2
    assert capsys.readouterr().err == "station: interrupted\n"
    assert fake.wall.passed_s < 1.1


# The key


def key_file(*paths: str) -> Any:
    values = [ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=path) for path in paths]
    return lambda _: GetParameters.Response(values=values)


@pytest.mark.usefixtures("ros_domain")
def test_what_moves_the_antenna_is_signed_with_its_key(fake: FakeStation, tmp_path: Path) -> None:
    path = tmp_path / "command.key"
    servo = CommandKey(CommandKeyParams(command_key_file=str(path)))
    fake.services["antenna_servo/get_parameters"] = key_file(str(path))
    fake.services["antenna_servo/signed"] = fake.services["station_executive/pause"] = trigger(True)
    assert run("park") == 0
    (first, request), (name, call) = fake.calls
    assert (first, request.names) == ("antenna_servo/get_parameters", ["command_key_file"])
    assert (name, call.service) == ("antenna_servo/signed", "/gs1/antenna_servo/park")
    servo.check_call(call)
    assert isinstance(deserialize_message(bytes(call.request), Trigger.Request), Trigger.Request)
    # What moves nothing needs no key.
    assert run("night", "pause") == 0
    assert [each for each, _ in fake.calls[2:]] == ["station_executive/pause"]
    assert run("--key", str(path), "park") == 0
    assert [each for each, _ in fake.calls[3:]] == ["antenna_servo/signed"], "a key that is given is not looked for"


def test_the_key_of_another_computer_or_user_is_not_used(
    fake: FakeStation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "command.key"
    fake.services["antenna_servo/park"] = trigger(True)
    for given in ("", str(path)):
        fake.services["antenna_servo/get_parameters"] = key_file(given)
        assert run("park") == 0
        assert fake.calls[-1][0] == "antenna_servo/park"
    CommandKey(CommandKeyParams(command_key_file=str(path)))
    other = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    assert run("park") == 0
    assert fake.calls[-1][0] == "antenna_servo/park"


# Passes

T_S = 1_151_384_323.0
ENTRY = ScheduledPass(
    id="p1", target="ISS", priority=5, aos=stamp_from_seconds(T_S), los=stamp_from_seconds(T_S + 600.0),
    peak_elevation=math.radians(43.21), state="lost", reason="drives cut",
)  # fmt: skip
WINDOW = Pass(
    target="ISS", aos=stamp_from_seconds(T_S), los=stamp_from_seconds(T_S + 600.0), peak_elevation=math.radians(43.21)
)


def test_the_schedule_is_shown_as_soon_as_it_is_there(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    fake.publish(0.2, "schedule", Schedule(passes=[ENTRY]))
    fake.publish(0.1, "passes", PassList(target="Moon", passes=[WINDOW]))
    assert run("passes") == 0
    line = f"2006-06-27T04:58:43 05:08:43  43.21 deg  {'ISS':<24}     5 lost     p1: drives cut\n"
    assert capsys.readouterr().out == line
    assert fake.wall.passed_s < 0.3


def test_without_a_schedule_the_passes_of_the_target_are_shown(
    fake: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.publish(0.1, "schedule", Schedule())
    fake.publish(5.0, "passes", PassList(target="SUN", passes=[WINDOW]))
    assert run("passes", "--json") == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["target"], row["aos_utc"][:19], row["peak_deg"]) == ("SUN", "2006-06-27T04:58:43", 43.21)
    assert fake.wall.passed_s == pytest.approx(5.0, abs=0.1)


def test_passes_that_nobody_publishes_end_with_2(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("passes") == 2
    assert "passes not seen within 10 s" in capsys.readouterr().err
    assert fake.wall.passed_s == pytest.approx(11.5, abs=0.1)


# Track


@pytest.fixture
def reports(fake: FakeStation, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[Path, Path]]:
    """Let a station fly the pass of `WINDOW`; return bag and folder of every report."""
    made: list[tuple[Path, Path]] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(rf_pointing.report, "write_report", lambda bag, folder: made.append((bag, folder)))
    fake.results["track_pass"] = TrackPass.Result(
        success=True, message="loss of signal", seconds_tracked=600.0, target_pass=WINDOW, predicted_loss=-1.0
    )
    limit, place = [0.1, 0.1], [PassBranch(works=True)]
    certificate = PassCertificate(
        target="ISS", accepted=True, branches=place, rate_limit=limit, acceleration_limit=limit, sky_peak=0.75
    )
    # After the look for an executive.
    fake.publish(2.0, "pass_certificate", certificate)
    return made


def test_a_pass_is_tracked_recorded_and_reported(
    fake: FakeStation, reports: list[tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    fake.recorder.result.problem = "the disk is full"
    line = "track ISS --sensor conscan --min-peak 30 --near 2006-06-27T04:00:00 --output out"
    assert run(*line.split()) == 0
    ((name, goal),) = fake.goals
    assert (name, goal.satellite, goal.sensor) == ("track_pass", "ISS", "conscan")
    assert goal.minimum_peak_elevation == pytest.approx(math.radians(30.0))
    assert seconds_from_stamp(goal.near) == NEAR_S
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("certificate of ISS")
    assert lines[-4:] == [
        "station: ISS: AOS 2006-06-27T04:58:43.000Z, LOS 2006-06-27T05:08:43.000Z, peak 43.2 deg",
        "station: recording stopped: the disk is full",
        "station: report out/report.html",
        "station: tracked: loss of signal; 600 s held, 0 s lost; mean pointing loss 0.00 dB",
    ]
    assert reports == [(Path("out/bag"), Path("out"))]
    assert fake.recorder.closed


def test_the_folder_of_a_pass_is_named_after_satellite_and_time(
    fake: FakeStation, reports: list[tuple[Path, Path]]
) -> None:
    assert run("track", "A/B") == 0
    ((bag, folder),) = reports
    assert bag == folder / "bag"
    assert folder.parent == Path("runs")
    assert folder.match("A_B-*T*")
    assert seconds_from_stamp(fake.goals[0][1].near) == 0.0


def test_a_pass_may_be_tracked_without_a_recording(fake: FakeStation, reports: list[tuple[Path, Path]]) -> None:
    assert run("track", "ISS", "--no-record") == 0
    assert (fake.recorder.given, reports) == ((), [])


def test_a_satellite_without_a_pass_ends_with_2_and_leaves_no_bag(
    fake: FakeStation, reports: list[tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    fake.results["track_pass"] = TrackPass.Result(message="ISS has no pass above 80 deg")
    assert run("track", "ISS", "--output", "out") == 2
    assert "station: ISS has no pass above 80 deg\n" in capsys.readouterr().err
    assert (list(Path("out").iterdir()), reports) == ([], [])


def test_a_goal_that_is_refused_ends_with_2_and_closes_the_bag(
    fake: FakeStation, reports: list[tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    fake.results["track_pass"] = None
    assert run("track", "ISS", "--output", "out") == 2
    assert "the goal was refused: pointing_controller" in capsys.readouterr().err
    assert (fake.recorder.closed, reports) == (True, [])


def test_an_output_with_a_bag_is_refused_and_kept(
    fake: FakeStation, reports: list[tuple[Path, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("out/bag").mkdir(parents=True)
    assert run("track", "ISS", "--output", "out") == 2
    assert capsys.readouterr().err == "station: output=out holds a bag already\n"
    assert (fake.goals, Path("out/bag").exists()) == ([], True)


@pytest.mark.parametrize(("state", "code"), [("running", 2), ("paused", 0), ("idle", 0)])
def test_a_pass_is_not_tracked_into_the_schedule_of_the_executive(
    fake: FakeStation, reports: list[tuple[Path, Path]], state: str, code: int
) -> None:
    fake.publish(0.1, "executive_status", ExecutiveStatus(state=state))
    assert run("track", "ISS", "--output", "out") == code
    assert len(fake.goals) == len(reports) == (code == 0)


def test_an_interrupted_pass_is_cancelled_once_and_keeps_its_report(
    fake: FakeStation, reports: list[tuple[Path, Path]]
) -> None:
    fake.result_s = 60.0
    fake.at(10.0, lambda: fake.handlers[2]())
    fake.results["track_pass"].success = False
    assert run("track", "ISS", "--output", "out") == 1
    assert fake.cancelled_s == [pytest.approx(10.0, abs=0.2)]
    assert len(reports) == 1


# The schedule

ROWS = json.dumps(
    [{"name": "ISS", "catalogue_number": 25544, "aos_utc": "2026-01-01T00:00:00", "los_utc": "2026-01-01T00:10:00",
      "fate": fate} for fate in ("tracked", "yields")]
)  # fmt: skip
TIMES = {"aos": stamp_from_seconds(1_767_225_600.0), "los": stamp_from_seconds(1_767_226_200.0)}
PASSES = [ScheduledPass(id="25544-1767225900", target="25544", name="ISS", **TIMES)]


@pytest.fixture
def night(tmp_path: Path) -> str:
    (tmp_path / "night.json").write_text(ROWS)
    return str(tmp_path / "night.json")


@pytest.mark.parametrize("success", [True, False])
def test_the_passes_of_a_plan_are_given_to_the_executive(
    fake: FakeStation, night: str, capsys: pytest.CaptureFixture[str], success: bool
) -> None:
    """What `plan_passes` lists as yielding to another pass is not counted."""
    answer = ChangeSchedule.Response(success=success, message="the schedule")
    fake.services["station_executive/change_schedule"] = lambda _: answer
    assert run("queue", night, "--remove", "p9") == (0 if success else 1)
    ((_, request),) = fake.calls
    assert (request.add, request.remove) == (PASSES, ["p9"])
    counted = ["station: 1 passes from 2026-01-01T00:00:00.000Z"] if success else []
    assert capsys.readouterr().err.splitlines() == ["station: the schedule", *counted]


@pytest.mark.parametrize("success", [True, False])
def test_a_schedule_is_run_to_its_end(
    fake: FakeStation, night: str, capsys: pytest.CaptureFixture[str], success: bool
) -> None:
    fake.results["run_schedule"] = RunSchedule.Result(success=success, message="1 tracked", report="/nights/1")
    state = RunSchedule.Feedback(state="running", target="ISS", step="track", passes_done=1, passes_left=2)
    fake.at(0.5, lambda: fake.feedback(SimpleNamespace(feedback=state)))
    assert run("queue", night, "--start") == (0 if success else 1)
    ((name, goal),) = fake.goals
    assert (name, goal.passes, goal.resume) == ("run_schedule", PASSES, False)
    assert capsys.readouterr().err.splitlines() == [
        "running, 1 done, 2 left, ISS: track", "station: 1 tracked", "station: morning report /nights/1/night.html",
    ]  # fmt: skip


def test_without_a_list_the_kept_schedule_goes_on(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    fake.results["run_schedule"] = RunSchedule.Result(success=True, message="nothing to do")
    fake.at(0.5, lambda: fake.feedback(SimpleNamespace(feedback=RunSchedule.Feedback(state="running", passes_left=2))))
    assert run("queue", "--start") == 0
    ((_, goal),) = fake.goals
    assert (goal.passes, goal.resume) == ([], True)
    assert capsys.readouterr().err == "running, 0 done, 2 left, between passes\nstation: nothing to do\n"


def test_an_interrupted_night_goes_on_without_its_client(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    fake.results["run_schedule"], fake.result_s = RunSchedule.Result(success=True), 60.0
    fake.at(3.0, lambda: fake.handlers[2]())
    assert run("queue", "--start") == 2
    assert capsys.readouterr().err == "station: no longer followed; the night goes on\n"
    assert fake.wall.passed_s == pytest.approx(3.0, abs=0.2)
    assert fake.cancelled_s == []


@pytest.mark.parametrize(
    ("states", "code"), [(["tracked", "skipped"], 0), (["tracked", "lost", "missed", "weather"], 1)]
)
def test_the_end_of_a_night_whose_executive_was_started_again_is_seen_in_its_state(
    fake: FakeStation, capsys: pytest.CaptureFixture[str], states: list[str], code: int
) -> None:
    """It does not answer the goal of its predecessor; idle for 5 s after it ran, the night is over."""
    fake.results["run_schedule"], fake.result_s = RunSchedule.Result(success=True), 600.0
    fake.publish(0.1, "schedule", Schedule(passes=[ScheduledPass(state=state) for state in states]))
    # Idle before the night has begun does not end it, nor does a moment between two states.
    for at_s, state in ((0.1, "idle"), (20.0, "running"), (30.0, "idle"), (32.0, "running"), (40.0, "idle")):
        fake.publish(at_s, "executive_status", ExecutiveStatus(state=state))
    assert run("queue", "--start") == code
    assert fake.wall.passed_s == pytest.approx(45.0, abs=0.2)
    assert f"the night has ended: 1 tracked, {3 * code} not" in capsys.readouterr().err


# Status

ANTENNA = AntennaStatus(mode="tracking", commanded=[1.0, 0.5])


def test_the_status_is_shown_as_soon_as_all_of_it_is_there(
    fake: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.publish(0.1, "antenna_status", ANTENNA)
    fake.publish(0.1, "joint_states", JointState())
    fake.publish(0.2, "tracking_status", TrackingStatus(mode="conscan", target="ISS"))
    fake.publish(0.3, "executive_status", ExecutiveStatus(state="idle"))
    assert run("status", "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    names = ("antenna", "azimuth_deg", "elevation_deg", "tracking", "target", "executive")
    assert [shown[name] for name in names] == ["tracking", 57.296, 28.648, "conscan", "ISS", "idle"]
    assert fake.wall.passed_s < 0.4


def test_an_antenna_alone_has_a_status_and_none_has_not(fake: FakeStation, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("status") == 2
    assert capsys.readouterr().err == f"station: no antenna in /gs1 of ROS domain {ros_domain()}\n"
    fake.publish(fake.wall.passed_s + 0.1, "antenna_status", ANTENNA)
    assert run("status") == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.endswith("antenna tracking az 57.30 el 28.65 deg  no controller   executive none: nothing")
    assert fake.wall.passed_s == pytest.approx(3.0, abs=0.1)


@pytest.mark.parametrize(
    ("fault", "level", "code"), [("", None, 0), ("", 1, 0), ("", 2, 1), ("drives cut", None, 1), ("drives cut", 1, 1)]
)
def test_a_fault_or_an_error_gives_exit_code_1(
    fake: FakeStation, capsys: pytest.CaptureFixture[str], fault: str, level: int | None, code: int
) -> None:
    alarms = [] if level is None else [Alarm(name="full_disk", level=level, message="0.1 GB", acknowledged=level == 1)]
    executive = ExecutiveStatus(
        state="running", pass_id="p1", blocks=[ProcedureBlock(name="pass", state="executing")], alarms=alarms
    )
    fake.publish(0.1, "antenna_status", AntennaStatus(fault=fault))
    fake.publish(0.1, "executive_status", executive)
    assert run("status") == code
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.endswith("executive running: p1 pass: executing")
    words = {1: ["  warning full_disk: 0.1 GB (acknowledged)"], 2: ["  ERROR full_disk: 0.1 GB"]}
    assert lines == ([f"  fault: {fault}"] if fault else []) + words.get(level or 0, [])


def test_a_watched_status_is_a_line_each_second_until_the_signal(
    fake: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.publish(0.1, "antenna_status", ANTENNA)
    fake.publish(0.1, "joint_states", JointState())
    for name, message in (("tracking_status", TrackingStatus()), ("executive_status", ExecutiveStatus())):
        fake.publish(0.1, name, message)
    fake.publish(4.5, "antenna_status", AntennaStatus(mode="stopped"))
    fake.at(10.5, lambda: fake.handlers[15]())
    assert run("status", "--watch") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[2] for line in lines] == ["tracking"] * 5 + ["stopped"] * 7, "at 0.1, 1.1 ... 10.1 and 10.5 s"
    assert fake.wall.passed_s == pytest.approx(10.5, abs=0.1)


def test_kept_messages_are_requested_where_they_are_published_so(fake: FakeStation) -> None:
    """A volatile publisher does not match a request for kept messages, and a kept schedule must be received."""
    StationClient("/gs1")
    kept = {name for name, (_, _, qos) in fake.topics.items() if qos in (LATCHED, STATUS)}
    assert kept == {"schedule", "executive_status", "passes", "antenna_status"}
    assert fake.topics.keys() - kept == {"tracking_status", "joint_states"}


def test_a_jog_calls_several_times_a_second_for_as_long_as_it_was_said(fake: FakeStation) -> None:
    """Slow: a quarter of the beam a second, or a tenth of the largest rate if that is less."""
    fake.publish(0.1, "antenna_status", AntennaStatus(rate_limit=[0.1, 0.2]))
    fake.publish(0.1, "tracking_status", TrackingStatus(beamwidth=0.06))
    fake.services["antenna_servo/jog"] = lambda _: Jog.Response(success=True)
    assert run("jog", "left", "--seconds", "2") == 0
    calls = [request for name, request in fake.calls if name == "antenna_servo/jog"]
    assert 8 <= len(calls) <= 20, "more often than the 0.5 s after which the antenna stops"
    assert all((each.azimuth, each.elevation) == (pytest.approx(-0.01), 0.0) for each in calls)
    fake.calls.clear()
    fake.publish(fake.wall.passed_s + 0.1, "antenna_status", AntennaStatus(rate_limit=[0.1, 0.2]))
    fake.services["antenna_servo/jog"] = lambda _: Jog.Response(message="the antenna is parked")
    assert run("jog", "up", "--fast") == 1
    (refused,) = [request for name, request in fake.calls if name == "antenna_servo/jog"]
    assert (refused.azimuth, refused.elevation) == (0.0, 0.1)


# Parameters and journal


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("--cross 0", {"source.cross_track_offset_deg": 0.0}),
        ("--time 2 --az 0.1", {"source.time_offset_s": 2.0, "source.azimuth_offset_deg": 0.1}),
        (
            "--cross-el 0.1 --ra 0.2 --dec 0.3 --el 0.4",
            {
                "source.elevation_offset_deg": 0.4,
                "source.cross_elevation_offset_deg": 0.1,
                "source.right_ascension_offset_deg": 0.2,
                "source.declination_offset_deg": 0.3,
            },
        ),
        ("--along -1 --cross 0.01", {"source.along_track_offset_s": -1.0, "source.cross_track_offset_deg": 0.01}),
    ],
)
@pytest.mark.parametrize("reason", ["", "out of range"])
def test_an_offset_is_set_in_one_step(
    fake: FakeStation, capsys: pytest.CaptureFixture[str], line: str, wanted: dict[str, float], reason: str
) -> None:
    answer = SetParametersAtomically.Response(result=SetParametersResult(successful=not reason, reason=reason))
    fake.services["ephemeris_publisher/set_parameters_atomically"] = lambda _: answer
    assert run("offset", *line.split()) == (1 if reason else 0)
    ((_, request),) = fake.calls
    assert {row.name: row.value.double_value for row in request.parameters} == wanted
    texts = [f"{name.removeprefix('source.')}={value}" for name, value in wanted.items()]
    assert capsys.readouterr().err == f"station: {reason or ', '.join(texts)}\n"


def test_the_last_lines_of_the_journal_are_shown(
    fake: FakeStation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake.services["station_executive/get_parameters"] = key_file(str(tmp_path))
    assert run("log") == 2
    assert f"no journal at {tmp_path}/journal.jsonl on this computer" in capsys.readouterr().err
    rows = [
        {"utc": f"T{k}", "event": "begin", "block": "pass", "directive": "go" if k % 2 else "", "detail": f"number {k}"}
        for k in range(10)
    ]
    (tmp_path / "journal.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in rows), encoding="utf-8")
    assert run("log", "-n", "2") == 0
    assert capsys.readouterr().out.splitlines() == [
        f"T8 begin            {'pass':<28} number 8", f"T9 begin            {'pass.go':<28} number 9",
    ]  # fmt: skip
    assert fake.calls[-1][1].names == ["executive.folder"]


def hooks_of(node: str, **values: str) -> DiagnosticArray:
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name=f"{node}: hooks", hardware_id=f"/{node}", values=pairs)])


def test_every_way_out_of_the_station_is_tried_and_each_says_what_came_of_it(
    fake: FakeStation, capsys: pytest.CaptureFixture[str]
) -> None:
    """One way sends at once, one fails after a while; of a node without a way there is nothing to try."""
    utc = "2026-01-01T00:00:00Z"
    fake.services["station_executive/test_alarms"] = trigger(True, f"{utc} command, mail_server")
    fake.services["station_alarms/test_alarms"] = trigger(True, f"{utc} {NO_WAY}")
    for at_s, message in (
        (0.1, hooks_of("gs1/station_alarms")), (0.2, hooks_of("gs1/station_executive", command="no message yet")),
        (5.0, hooks_of("gs1/station_executive", command=f"sent: test of {utc}", mail_server="no message yet")),
        (40.0, hooks_of("gs1/station_executive", command=f"sent: test of {utc}",
                        mail_server=f"not sent: test of {utc}: refused")),
    ):  # fmt: skip
        fake.publish(at_s, "/diagnostics", message)
    assert run("test-alarms") == 1
    said = capsys.readouterr().err
    assert f"station_executive: command: sent: test of {utc}" in said
    assert f"station_executive: mail_server: not sent: test of {utc}: refused" in said
    assert f"station_alarms: {NO_WAY}" in said
