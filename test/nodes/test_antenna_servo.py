"""The antenna's node where its surroundings fail: what cannot be written must not end it in the middle of a motion."""

import itertools
import json
from pathlib import Path
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter

from rf_pointing.nodes.antenna_servo import WRAP_EVERY, AntennaServo
from rf_pointing.nodes.diagnostics import OK, WARN
from rf_pointing.nodes.main_loop import _work, make_executor

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
    wanted = {"travel_max_deg": [210.0, 90.0], "rate_limit_deg_s": [0.5, 0.5], "acceleration_limit_deg_s2": [0.1, 0.1]}
    for name, value in wanted.items():
        (result,) = servo.set_parameters([Parameter(f"loops.preprocessor.{name}", value=value)])
        assert not result.successful
        assert "cannot change while the drives are enabled (the antenna is holding); disable it first" in result.reason
    assert servo._antenna.disable() == ""
    start_s = servo.now_s()
    for tick in range(50):
        servo._tick(start_s + 0.02 * tick)
    assert servo._antenna.mode == "disabled"
    for name, value in wanted.items():
        (result,) = servo.set_parameters([Parameter(f"loops.preprocessor.{name}", value=value)])
        assert result.successful, result.reason
