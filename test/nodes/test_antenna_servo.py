"""The antenna's node where its surroundings fail: what cannot be written must not end it in the middle of a motion."""

import itertools
import json
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rf_pointing_msgs.srv import GoTo, SignedCall, StowInFault
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.nodes.antenna_servo import WRAP_EVERY, AntennaServo
from rf_pointing.nodes.command_key import CommandKey, CommandKeyParams
from rf_pointing.nodes.diagnostics import OK, WARN
from rf_pointing.nodes.leased_services import LEASE_S, LEASED, Caller, LeasedServices
from rf_pointing.nodes.main_loop import _work, make_executor
from rf_pointing.nodes.stamps import stamp_from_seconds

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
