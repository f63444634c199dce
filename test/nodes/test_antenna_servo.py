"""The antenna's node where its surroundings fail: what cannot be written must not end it in the middle of a motion."""

import dataclasses
import itertools
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import Vector3Stamped
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rf_pointing_msgs.srv import GoTo, InjectFault, SignedCall, StowInFault
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.nodes.antenna_servo import WRAP_EVERY, AntennaServo
from rf_pointing.planning import WrapCount
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import ERROR, OK, WARN
from rf_pointing.ros.leased_services import LEASE_S, LEASED, Caller, LeasedServices
from rf_pointing.ros.main_loop import _work, make_executor
from rf_pointing.ros.stamps import stamp_from_seconds

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
TICKS_A_STATUS = 5


@pytest.fixture
def servo(default_context: None) -> Any:
    """Yield the node, unconfigured."""
    node = AntennaServo()
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


def configured(servo: AntennaServo, **files: Path) -> TransitionCallbackReturn:
    servo.set_parameters([Parameter(name, value=str(path)) for name, path in files.items()])
    return servo.on_configure(ANY_STATE)


@pytest.mark.parametrize("name", ["wrap_file", "state_file"])
def test_a_file_that_cannot_be_written_is_refused_before_the_antenna_moves(
    servo: AntennaServo, tmp_path: Path, name: str
) -> None:
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "kept.json"
    assert configured(servo, **{name: path}) == TransitionCallbackReturn.FAILURE
    refusal = servo._state_health().message
    assert f"{path} cannot be written" in refusal
    assert configured(servo, **{name: tmp_path / "other" / "kept.json"}) == TransitionCallbackReturn.SUCCESS


def test_an_antenna_whose_disk_fails_goes_on_and_says_so(servo: AntennaServo, tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    files = {"wrap_file": folder / "wrap.json", "state_file": folder / "state.json"}
    assert configured(servo, **files) == TransitionCallbackReturn.SUCCESS
    assert servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    assert servo._memory_health().level == OK
    folder.rename(tmp_path / "aside")
    folder.write_text("")
    servo._antenna.park()
    start_s = servo.now_s()
    for tick in range(300):
        servo._tick(start_s + 0.02 * tick)
    health = servo._memory_health()
    assert health.level == WARN
    for path in files.values():
        assert f"{path} cannot be written" in health.message
    assert servo._antenna.status(start_s).mode == "parking"
    folder.unlink()
    for tick in range(300, 300 + TICKS_A_STATUS * WRAP_EVERY):
        servo._tick(start_s + 0.02 * tick)
    assert (servo._memory_health().level, servo._memory_health().message) == (OK, "kept")
    assert sorted(found.name for found in folder.iterdir()) == ["state.json", "wrap.json"]


def test_a_tick_that_raises_ends_in_a_controlled_stop_with_the_fault_kept(
    servo: AntennaServo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {"wrap_file": tmp_path / "wrap.json", "state_file": tmp_path / "state.json"}
    assert configured(servo, **files) == TransitionCallbackReturn.SUCCESS
    assert servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    antenna = servo._antenna
    assert antenna.park() == ""
    start_s = servo.now_s()
    for tick in range(100):
        servo._tick(start_s + 0.02 * tick)
    assert antenna.axes.moving
    rates: list[float] = []
    step = antenna.step

    def noted(t_s: float) -> Any:
        rates.append(float(abs(antenna.axes.path.preprocessor.state.velocity_rad_s).max()))
        return step(t_s)

    monkeypatch.setattr(antenna, "step", noted)
    monkeypatch.setattr(servo._joints, "publish", lambda _message: 1 / 0)
    executor = make_executor()
    executor.add_node(servo)
    assert _work(servo, executor, []) == "ZeroDivisionError: division by zero"
    executor.shutdown()
    assert rates[-1] <= 0.02 * antenna.axes.limits.acceleration_limit_rad_s2[0]
    limit = antenna.axes.limits.acceleration_limit_rad_s2[0]
    assert max(a - b for a, b in itertools.pairwise(rates)) <= 0.02 * limit * 1.001, "decelerated at the limit"
    assert not antenna.axes.hardware.powered
    kept = json.loads(files["state_file"].read_text())
    assert kept["fault"].startswith("antenna_servo failed: ZeroDivisionError")


def test_travel_that_the_gate_does_not_take_is_refused_as_a_parameter(servo: AntennaServo) -> None:
    """It used to be accepted and to raise in the middle of a motion."""
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    (result,) = servo.set_parameters([Parameter("loops.preprocessor.travel_min_deg", value=[-223.0, -12.0])])
    assert not result.successful
    assert "elevation_min_rad=-0.209" in result.reason
    (result,) = servo.set_parameters(
        [
            Parameter("loops.lqg_file", value="/nowhere.json"),
        ]
    )
    assert result.successful
    (result,) = servo.set_parameters([Parameter("loops.law", value="lqg")])
    assert not result.successful
    assert "/nowhere.json" in result.reason


def test_limits_that_guard_the_machine_change_only_while_the_drives_are_disabled(servo: AntennaServo) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    assert servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    wanted: dict[str, Any] = {
        "preprocessor.travel_max_deg": [210.0, 90.0],
        "preprocessor.rate_limit_deg_s": [0.5, 0.5],
        "preprocessor.acceleration_limit_deg_s2": [0.1, 0.1],
        "azimuth.rate_limit_deg_s": 3.0,
        "lqg_elevation.rate_limit_deg_s": 3.0,
        "oscillation.threshold_deg": 0.03,
        "table.horizon_s": 60.0,
    }
    for name, value in wanted.items():
        (result,) = servo.set_parameters([Parameter(f"loops.{name}", value=value)])
        assert not result.successful
        assert "cannot change while the drives are enabled (the antenna is holding); disable it first" in result.reason
    assert servo._antenna.disable() == ""
    start_s = servo.now_s()
    for tick in range(50):
        servo._tick(start_s + 0.02 * tick)
    assert servo._antenna.mode == "disabled"
    for name, value in wanted.items():
        (result,) = servo.set_parameters([Parameter(f"loops.{name}", value=value)])
        assert result.successful, result.reason


def command_at(servo: AntennaServo, key: CommandKey) -> JointTrajectory:
    """Return a signed goal at rest where the antenna stands."""
    here = [float(angle) for angle in servo._antenna.axes.encoder_rad]
    message = JointTrajectory(joint_names=["azimuth", "elevation"])
    message.header.stamp = stamp_from_seconds(servo.now_s())
    message.points = [JointTrajectoryPoint(positions=here, velocities=[0.0, 0.0], accelerations=[0.0, 0.0])]
    message.points[0].time_from_start.nanosec = 100_000_000
    key.sign(message, "/pointing_controller")
    return message


def answer_of(servo: AntennaServo, name: str, kind: Any, request: Any) -> Any:
    (service,) = (each for each in servo.services if each.service_name == f"/antenna_servo/{name}")
    return service.callback(request, kind.Response())


def signed_call(servo: AntennaServo, key: CommandKey, name: str, request: Any) -> SignedCall.Request:
    call = Caller(servo, key).request(f"antenna_servo/{name}", request)
    assert isinstance(call, SignedCall.Request)
    return call


def test_while_a_signed_commander_has_the_antenna_only_who_has_the_key_is_served(
    servo: AntennaServo, tmp_path: Path
) -> None:
    path = tmp_path / "command.key"
    assert configured(servo, command_key_file=path) == TransitionCallbackReturn.SUCCESS
    assert servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    key = CommandKey(CommandKeyParams(command_key_file=str(path)), "/joint_trajectory")
    azimuth, elevation = (float(angle) for angle in servo._antenna.axes.encoder_rad)
    requests = {name.rpartition("/")[2]: (Trigger, Trigger.Request()) for name in LEASED} | {
        "go_to": (GoTo, GoTo.Request(azimuth=azimuth, elevation=elevation)),
        "stow_in_fault": (StowInFault, StowInFault.Request(fault="x")),
    }
    assert answer_of(servo, "go_to", *requests["go_to"]).success, "no commander: everybody is served"
    servo._take(command_at(servo, key))
    servo._take(command_at(servo, CommandKey(CommandKeyParams(command_key_file=str(tmp_path / "other")), "")))
    for name, (kind, request) in requests.items():
        answer = answer_of(servo, name, kind, request)
        assert not answer.success
        assert answer.message.startswith(
            f"/antenna_servo/{name} is refused: /pointing_controller commands the antenna."
        )
    assert servo._commander_health().values["calls_refused"] == len(LEASED) == 8
    call = signed_call(servo, key, *("go_to", requests["go_to"][1]))
    assert answer_of(servo, "signed", SignedCall, call).message == "go_to accepted"
    assert answer_of(servo, "signed", SignedCall, call).message.endswith("was sent before")
    assert answer_of(servo, "stop", Trigger, Trigger.Request()).success, "stop is for everybody"
    start_s = servo.now_s()
    for tick in range(50):
        servo._tick(start_s + 0.02 * tick)
    servo._take(command_at(servo, key))
    servo.on_deactivate(ANY_STATE)
    (result,) = servo.set_parameters([Parameter("loops.table.horizon_s", value=60.0)])
    assert result.reason.endswith("cannot change while /pointing_controller commands it")
    assert servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    servo._take(command_at(servo, key))
    refused = answer_of(servo, "reset_fault", Trigger, Trigger.Request()).message
    assert "/pointing_controller commands the antenna" in refused, "it still sends commands"
    reset = signed_call(servo, key, "reset_fault", Trigger.Request())
    assert answer_of(servo, "signed", SignedCall, reset).success
    time.sleep(LEASE_S)
    assert answer_of(servo, "reset_fault", Trigger, Trigger.Request()).message == "no fault is latched"


def test_a_key_cannot_be_taken_away_while_the_node_runs(servo: AntennaServo, tmp_path: Path) -> None:
    (result,) = servo.set_parameters([Parameter("command_key_file", value=str(tmp_path / "command.key"))])
    assert result.successful
    (result,) = servo.set_parameters([Parameter("command_key_file", value="")])
    assert result.reason == "command_key_file is given when antenna_servo starts, and cannot change"


CHANGES: dict[str, Callable[[SignedCall.Request], object]] = {
    "service": lambda call: setattr(call, "service", "/antenna_servo/stow"),
    "caller": lambda call: setattr(call, "caller", "/elsewhere"),
    "request": lambda call: setattr(call, "request", [*call.request, 0]),
    "time": lambda call: setattr(call.stamp, "sec", call.stamp.sec + 1),
    "signature": lambda call: setattr(call, "signature", call.signature[:-1]),
    "none": lambda call: setattr(call, "signature", ""),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_call_is_refused(servo: AntennaServo, tmp_path: Path, change: str) -> None:
    path = tmp_path / "command.key"
    assert configured(servo, command_key_file=path) == TransitionCallbackReturn.SUCCESS
    key = CommandKey(CommandKeyParams(command_key_file=str(path)))
    call = signed_call(servo, key, "park", Trigger.Request())
    CHANGES[change](call)
    answer = answer_of(servo, "signed", SignedCall, call)
    assert not answer.success
    assert "is not signed with the key of this antenna" in answer.message


@pytest.mark.parametrize(
    ("age_s", "words"), [(60.0, "is 60.0 s old"), (-60.0, "is -60.0 s old"), (1.0, "was sent before")]
)
def test_a_call_of_another_time_or_before_the_start_is_refused(
    servo: AntennaServo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, age_s: float, words: str
) -> None:
    path = tmp_path / "command.key"
    assert configured(servo, command_key_file=path) == TransitionCallbackReturn.SUCCESS
    key = CommandKey(CommandKeyParams(command_key_file=str(path)))
    now_s = time.time()
    with monkeypatch.context() as earlier:
        earlier.setattr(time, "time", lambda: now_s - age_s)
        call = signed_call(servo, key, "park", Trigger.Request())
    assert words in answer_of(servo, "signed", SignedCall, call).message


def test_a_command_that_is_sent_again_or_not_signed_makes_no_lease(servo: AntennaServo, tmp_path: Path) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    assert servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    servo._take(command_at(servo, CommandKey(CommandKeyParams(), "/joint_trajectory")))
    assert servo._antenna.status(servo.now_s()).commander == "/pointing_controller"
    assert servo._leased.holder == "", "without a key"
    leased = LeasedServices(
        SimpleNamespace(serve_action=lambda *_: None, now_s=servo.now_s), SimpleNamespace(signed=True)
    )  # type: ignore[arg-type]
    leased.note("old", servo.now_s() - 2.0 * LEASE_S)
    assert leased.holder == "", "an old one that is sent again"
    leased.note("new", servo.now_s())
    leased.note("old", servo.now_s() - 1.0)
    assert leased.holder == "new"


def up(servo: AntennaServo, **files: Path) -> Any:
    """Return the active node; what it publishes is collected in `sent`, by topic."""
    assert configured(servo, **files) == TransitionCallbackReturn.SUCCESS, servo._reason
    node: Any = servo
    node.sent = {"joints": [], "boresight": [], "status": []}
    for name, messages in node.sent.items():
        vars(node)[f"_{name}"] = SimpleNamespace(publish=messages.append)
    assert servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS, servo._reason
    return node


def ticked(node: Any, first: int, last: int, start_s: float = 1_200_000_000.0) -> None:
    """Do the ticks of these numbers."""
    for number in range(first, last):
        node._tick(round(start_s + 0.02 * number, 6))


def test_each_tick_gives_joints_and_truth_and_each_fifth_a_status(servo: AntennaServo) -> None:
    node = up(servo)
    assert [len(each) for each in node.sent.values()] == [1, 0, 1], "with the activation"
    ticked(node, 1, 101)
    assert [len(each) for each in node.sent.values()] == [101, 100, 21]
    stamps = [each.header.stamp.nanosec for each in node.sent["status"][1:4]]
    assert stamps == [100_000_000, 200_000_000, 300_000_000]
    assert node.sent["joints"][1].header.stamp.nanosec == 20_000_000


@pytest.mark.parametrize(("tick_s", "every"), [(0.02, 5), (0.08, 1), (0.04, 2)])
def test_a_status_comes_each_tenth_of_a_second_or_with_each_tick(
    servo: AntennaServo, tick_s: float, every: int
) -> None:
    (done,) = servo.set_parameters([Parameter("antenna.tick_s", value=tick_s)])
    assert done.successful, done.reason
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    assert servo._status_every == every


def test_the_turn_is_kept_with_each_tenth_status(
    servo: AntennaServo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, kept = up(servo, wrap_file=tmp_path / "wrap.json"), []
    monkeypatch.setattr(node._wrap, "keep", kept.append)
    ticked(node, 1, 50)
    assert kept == []
    ticked(node, 50, 101)
    assert len(kept) == 2
    assert kept[0] == pytest.approx(float(node._antenna.axes.encoder_rad[0]), abs=1e-5)
    # A fault leaves the turn of before it in the file.
    node._antenna.stop("somebody pressed the button")
    ticked(node, 101, 301)
    assert len(kept) == 2


def test_a_deactivated_antenna_keeps_its_turn(
    servo: AntennaServo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, kept = up(servo, wrap_file=tmp_path / "wrap.json"), []
    monkeypatch.setattr(node._wrap, "keep", kept.append)
    ticked(node, 1, 20)
    servo.on_deactivate(ANY_STATE)
    assert kept == [pytest.approx(float(node._antenna.axes.encoder_rad[0]), abs=1e-5)]


def test_a_configured_antenna_reports_on_all_that_it_watches_and_can_be_identified(servo: AntennaServo) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    assert {"drive", "commanders", "oscillation", "memory"} <= set(servo.diagnostics._checks)
    assert "device" not in servo.diagnostics._checks
    assert servo._identification._antenna is servo._antenna


def test_a_fault_is_published_in_its_own_tick_and_once(servo: AntennaServo, monkeypatch: pytest.MonkeyPatch) -> None:
    node = up(servo)
    reports: list[int] = []
    monkeypatch.setattr(node.diagnostics, "publish", lambda: reports.append(1))
    ticked(node, 1, 3)
    assert len(node.sent["status"]) == 1
    node._antenna.stop("the door is open")
    ticked(node, 3, 5)
    assert [each.fault for each in node.sent["status"][1:]] == ["the door is open"]
    assert len(reports) == 1
    # It ends as it came.
    ticked(node, 5, 300)
    assert answer_of(servo, "reset_fault", Trigger, Trigger.Request()).success
    count = len(node.sent["status"])
    ticked(node, 301, 302)
    assert (len(reports), len(node.sent["status"])) == (2, count + 1)
    assert node.sent["status"][-1].fault == ""


@pytest.mark.parametrize(
    ("jumped_s", "stalled_s", "fault", "mode"),
    [(1.5, 0.0, "the clock jumped by +1.50 s", "fault"), (0.0, 1.3, "", "holding"), (0.0, 0.0, "", "parking")],
)
def test_a_jump_of_the_clock_is_a_fault_and_a_stall_a_stop(
    servo: AntennaServo, jumped_s: float, stalled_s: float, fault: str, mode: str
) -> None:
    node = up(servo)
    ticked(node, 1, 3)
    assert node._antenna.park() == ""
    node._schedule = SimpleNamespace(jumped_s=jumped_s, stalled_s=stalled_s)
    ticked(node, 3, 4)
    node._schedule = SimpleNamespace(jumped_s=0.0, stalled_s=0.0)
    ticked(node, 4, 100)
    assert node._antenna.safety.latch.text == fault
    assert node._antenna.mode == mode


def test_the_lateness_of_a_tick_is_the_wall_time_beyond_the_period(
    servo: AntennaServo, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, wall = up(servo), iter([100.0, 100.05, 100.06])
    with monkeypatch.context() as patch:
        patch.setattr(time, "perf_counter", lambda: next(wall))
        node._measure_lateness(0.02)
        assert node._lateness_s == 0.0
        node._measure_lateness(0.02)
        assert node._lateness_s == pytest.approx(0.03, abs=1e-9)
        node._measure_lateness(0.02)
    assert node._lateness_s == pytest.approx(-0.01, abs=1e-9)
    node._publish_status(node.now_s())
    assert node.sent["status"][-1].tick_lateness == pytest.approx(-0.01, abs=1e-9)


def test_a_command_waits_for_the_tick_of_its_stamp(servo: AntennaServo, monkeypatch: pytest.MonkeyPatch) -> None:
    node, key, start_s = up(servo), CommandKey(CommandKeyParams()), 1_200_000_000.0
    ticked(node, 0, 1)
    clock, taken = [start_s + 0.03], list[float]()
    monkeypatch.setattr(node, "now_s", lambda: clock[0])

    def accept(command: Any, now_s: float, _commander: str) -> str:
        taken.append(round(float(command.t_s[0]) - 0.1 - start_s, 6))
        assert now_s == clock[0]
        return ""

    monkeypatch.setattr(node._antenna, "accept", accept)

    def arrives(after_s: float) -> None:
        message = command_at(servo, key)
        message.header.stamp = stamp_from_seconds(start_s + after_s)
        node._on_trajectory(message)

    for after_s in (-0.01, 0.0, 0.02, 0.03, 0.031):
        arrives(after_s)
    assert taken == [-0.01, 0.0, 0.031], "of the past, of this tick, and of the future: the gate judges them"
    ticked(node, 1, 2)
    assert taken[3:] == [0.02]
    ticked(node, 2, 3)
    assert taken[4:] == [0.03]
    # A restart forgets what waits.
    clock[0] = start_s + 0.07
    arrives(0.06)
    node.on_deactivate(ANY_STATE)
    arrives(0.06)
    assert taken[5:] == [0.06], "not active: nothing will tick"
    assert node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    ticked(node, 4, 8)
    assert len(taken) == 6


def test_a_refused_command_is_counted_with_its_reason(servo: AntennaServo) -> None:
    node = up(servo)
    message = command_at(servo, CommandKey(CommandKeyParams()))
    message.joint_names = ["azimuth", "roll"]
    node._take(message)
    health = node._health()
    assert (health.values["commands_rejected"], health.values["commands_accepted"]) == (1, 0)
    assert health.values["last_rejection"].startswith("unknown joint roll")
    node._take(command_at(servo, CommandKey(CommandKeyParams())))
    values = node._health().values
    assert (values["commands_accepted"], values["commander"]) == (1, "/pointing_controller")


def test_the_longest_command_has_the_bytes_of_its_points(servo: AntennaServo) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    most = servo.parameters.value("loops").table.max_points
    assert servo._longest_command() == 4096 + 112 * most


def test_a_stop_latches_and_go_to_moves_both_axes(servo: AntennaServo) -> None:
    node = up(servo)
    here = [float(angle) for angle in node._antenna.axes.encoder_rad]
    answer = answer_of(servo, "go_to", GoTo, GoTo.Request(azimuth=here[0] + 0.01, elevation=here[1] + 0.02))
    assert (answer.success, answer.message) == (True, "go_to accepted")
    ticked(node, 1, 500)
    assert [float(angle) for angle in node._antenna.axes.encoder_rad] == pytest.approx(
        [here[0] + 0.01, here[1] + 0.02], abs=1e-4
    )
    refused = answer_of(servo, "stow_in_fault", StowInFault, StowInFault.Request(fault="nothing"))
    assert not refused.success
    assert answer_of(servo, "stop", Trigger, Trigger.Request()).success
    ticked(node, 500, 501)
    assert node._health().level == ERROR
    assert node._health().message == node._antenna.safety.latch.text == "stop was requested"
    assert float(node._health().values["fault_at_s"]) == pytest.approx(1_200_000_000.0 + 9.98, abs=0.05)
    moved = answer_of(servo, "go_to", GoTo, GoTo.Request(azimuth=here[0], elevation=here[1]))
    assert not moved.success
    ticked(node, 501, 700)
    stowed = answer_of(servo, "stow_in_fault", StowInFault, StowInFault.Request(fault="stop was requested"))
    assert stowed.success, stowed.message


def test_a_healthy_antenna_shows_its_mode_and_a_limit_is_a_warning(
    servo: AntennaServo, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = up(servo)
    health = node._health()
    assert (health.level, health.message) == (OK, "holding")
    assert "fault_at_s" not in health.values
    status = node._antenna.status(node.now_s())
    for change in ({"at_limit": (False, True)}, {"warning": "the wind is high"}):
        monkeypatch.setattr(node._antenna, "status", lambda _t_s, change=change: dataclasses.replace(status, **change))
        health = node._health()
        assert (health.level, health.message) == (WARN, change.get("warning", "holding"))


def test_faults_are_injected_where_that_is_enabled_alone(servo: AntennaServo) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    assert not [each for each in servo.services if each.service_name.endswith("inject_fault")]
    assert servo.on_cleanup(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    servo.set_parameters([Parameter("enable_fault_injection", value=True)])
    node = up(servo)
    ticked(node, 1, 3)
    request = InjectFault.Request(fault="encoder_jump", value=0.25)
    answer = answer_of(servo, "inject_fault", InjectFault, request)
    assert answer.message == "encoder_jump injected at 1200000000.040"
    assert (node._antenna.injected.kind, node._antenna.injected.value) == ("encoder_jump", 0.25)
    assert not answer_of(servo, "inject_fault", InjectFault, InjectFault.Request(fault="gremlins")).success


def test_a_turn_that_is_not_the_encoder_s_latches_a_fault(servo: AntennaServo, tmp_path: Path) -> None:
    path = tmp_path / "wrap.json"
    node = up(servo, wrap_file=path)
    ticked(node, 1, 51)
    azimuth = float(node._antenna.axes.encoder_rad[0])
    node.on_deactivate(ANY_STATE)
    node.on_cleanup(ANY_STATE)
    node = up(servo, wrap_file=path)
    assert node._antenna.safety.latch.text == "", "the same turn"
    node.on_deactivate(ANY_STATE)
    node.on_cleanup(ANY_STATE)
    WrapCount(path).keep(azimuth + 2.0 * math.pi)
    node = up(servo, wrap_file=path)
    assert "the wrap file names another turn than the encoder" in node._antenna.safety.latch.text


def test_a_stop_that_fails_leaves_the_brakes(servo: AntennaServo, monkeypatch: pytest.MonkeyPatch) -> None:
    node = up(servo)
    ticked(node, 1, 3)

    def fails() -> None:
        raise RuntimeError("no answer")

    with monkeypatch.context() as patch:
        patch.setattr(node._antenna, "deactivate", fails)
        with pytest.raises(RuntimeError, match="no answer"):
            node.deactivate()
    assert node._antenna.safety.latch.text == "the stop has failed: no answer"
    assert not node._antenna.hardware.powered


def test_a_failed_node_that_is_not_active_writes_no_fault(servo: AntennaServo, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    assert configured(servo, state_file=path) == TransitionCallbackReturn.SUCCESS
    servo.fail("KeyError: 'x'")
    assert servo._antenna.safety.latch.text == ""
    node = up(servo, state_file=path)
    ticked(node, 1, 6)
    node.fail("KeyError: 'x'")
    assert json.loads(path.read_text())["fault"] == "antenna_servo failed: KeyError: 'x'"


@pytest.mark.parametrize(("age_s", "taken"), [(0.5, True), (-0.5, True), (60.0, False)])
def test_wind_counts_with_its_horizontal_speed_unless_it_is_old(
    servo: AntennaServo, monkeypatch: pytest.MonkeyPatch, age_s: float, taken: bool
) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    speeds: list[float] = []
    params = SimpleNamespace(params=SimpleNamespace(silence_s=30.0))
    monkeypatch.setattr(servo, "_antenna", SimpleNamespace(
        safety=SimpleNamespace(wind=params), hardware=SimpleNamespace(note_wind=speeds.append)
    ))  # fmt: skip
    monkeypatch.setattr(servo, "now_s", lambda: 1e9)
    message = Vector3Stamped()
    message.vector.x, message.vector.y, message.vector.z = -3.0, 4.0, 12.0
    message.header.stamp = stamp_from_seconds(1e9 - age_s)
    servo._on_wind(message)
    assert speeds == ([5.0] if taken else [])
    message.header.stamp = stamp_from_seconds(1e9 - 30.0)
    servo._on_wind(message)
    assert speeds[-1:] == [5.0], "as old as silence_s"
    monkeypatch.undo()


def test_an_oscillating_axis_is_an_error_with_its_swings(servo: AntennaServo, monkeypatch: pytest.MonkeyPatch) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    assert (servo._oscillation_health().level, servo._oscillation_health().message) == (OK, "none")
    watch = [
        SimpleNamespace(oscillating=False, reason="", state=SimpleNamespace(row=[])),
        SimpleNamespace(oscillating=True, reason="0.3 deg at 1.2 Hz", state=SimpleNamespace(row=[1, 2, 3])),
    ]
    monkeypatch.setattr(servo._antenna.axes.loops, "watch", watch)
    health = servo._oscillation_health()
    assert (health.level, health.message) == (ERROR, "elevation: 0.3 deg at 1.2 Hz")
    assert health.values == {"azimuth_swings_in_a_row": 0, "elevation_swings_in_a_row": 3}


@pytest.mark.parametrize(("fault", "temperature_k"), [("", None), ("the device is silent", 301.26)])
def test_the_device_shows_its_counts_and_its_age(
    servo: AntennaServo, monkeypatch: pytest.MonkeyPatch, fault: str, temperature_k: float | None
) -> None:
    assert configured(servo) == TransitionCallbackReturn.SUCCESS
    reading = SimpleNamespace(age_s=lambda _now_s: 1.234, status="tracking", temperature_k=temperature_k)
    counts = SimpleNamespace(commands=17, starts=(3, 4), reversals=(1, 2))
    rotator = SimpleNamespace(reading=reading, counts=lambda: counts, latency_s=0.256)
    drive = SimpleNamespace(losses={"answers": 5})
    hardware = SimpleNamespace(rotator=rotator, drive=drive, fault=fault)
    monkeypatch.setattr(servo, "_antenna", SimpleNamespace(hardware=hardware))
    health = servo._device_health()
    assert (health.level, health.message) == (ERROR, fault) if fault else (OK, "simulated")
    assert health.values == {
        "lost answers": 5, "set_points": 17, "azimuth_starts": 3, "elevation_starts": 4, "azimuth_reversals": 1,
        "elevation_reversals": 2, "latency_s": "0.26", "age_s": "1.23", "status": "tracking",
        **({} if temperature_k is None else {"temperature_k": "301.3"}),
    }  # fmt: skip
    monkeypatch.undo()


def test_plant_and_laws_change_while_the_antenna_works(servo: AntennaServo) -> None:
    (early,) = servo.set_parameters([Parameter("plant.pinion_floor", value=0.35)])
    assert early.successful, "before there is an antenna"
    node = up(servo)
    assert node._antenna.hardware.params.pinion_floor == 0.35
    (done,) = servo.set_parameters([Parameter("plant.pinion_floor", value=0.4)])
    assert done.successful, done.reason
    assert node._antenna.hardware.params.pinion_floor == 0.4
    assert node._commander_health().values["lease"] == ""
    (late,) = servo.set_parameters([Parameter("safety.park_azimuth_deg", value=10.0)])
    assert not late.successful
