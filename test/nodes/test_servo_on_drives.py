"""The antenna's node on the real rotctld, and on a vendor's node behind topics, in real time."""

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.nodes import antenna_servo
from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.ros import station_node
from rf_pointing.ros.diagnostics import ERROR, OK
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.description import read_station
from test.drives.rotctld import RealRotctld

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
TICK_S = 0.02
SPEED = {"rate_deg_s": 6.0, "acceleration_deg_s2": 6.0, "command_rate_deg_s": 6.0, "command_acceleration_deg_s2": 6.0}
MOTION = {
    "mount.azimuth": {"travel_deg": [-180.0, 270.0], **SPEED},
    "mount.elevation": {"travel_deg": [0.0, 90.0], **SPEED},
    "tuning.loops.preprocessor": {"travel_min_deg": [-180.0, 0.0], "travel_max_deg": [270.0, 90.0]},
    "drive.link.first_retry_s": 0.2,
    "wind.anemometer": False,
}
"""Keys of the description."""


class Run:
    """The node, ticked in real time."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, file: Path, **given: Any) -> None:
        values = {name.replace("__", "."): value for name, value in given.items()}
        drive = {name: value for name, value in values.items() if name.startswith("drive.")}
        read_station("dss13").write(file, MOTION | drive)
        monkeypatch.setattr(station_node, "read_station", lambda _: read_station(file))
        self.servo = AntennaServo()
        own = {name: value for name, value in values.items() if name not in drive}
        self.servo.set_parameters([Parameter(name, value=value) for name, value in own.items()])
        self.joints: list[JointState] = []
        self.others: list[Callable[[], None]] = []

    def configure(self) -> TransitionCallbackReturn:
        done = self.servo.on_configure(ANY_STATE)
        if done == TransitionCallbackReturn.SUCCESS:
            self.servo._joints.publish = self.joints.append
        return done

    def up(self) -> "Run":
        assert self.configure() == TransitionCallbackReturn.SUCCESS, self.servo._state_health().message
        assert self.servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.servo._state_health().message
        return self

    @property
    def fault(self) -> str:
        return str(self.servo._antenna.safety.latch.text)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        """Tick in real time; return the seconds that it took."""
        begun_s = self.servo.now_s()
        t_s = begun_s
        while t_s < begun_s + seconds and not until():
            t_s = self.servo.now_s()
            for other in self.others:
                other()
            self.servo._tick(round(t_s, 6))
            time.sleep(TICK_S)
        return t_s - begun_s

    def command(self, azimuth_deg: float, elevation_deg: float) -> None:
        message = JointTrajectory(joint_names=["azimuth", "elevation"])
        message.header.stamp, message.header.frame_id = stamp_from_seconds(self.servo.now_s()), "test"
        place = JointTrajectoryPoint(
            positions=[math.radians(azimuth_deg), math.radians(elevation_deg)], velocities=[0.0, 0.0],
            accelerations=[0.0, 0.0],
        )  # fmt: skip
        place.time_from_start.nanosec = 100_000_000
        message.points.append(place)
        self.servo._take(message)

    def end(self) -> None:
        self.servo.end()
        self.servo.lock.release()
        self.servo.destroy_node()


@pytest.fixture
def made(default_context: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[..., Run]]:
    runs: list[Run] = []

    def make(**given: Any) -> Run:
        runs.append(Run(monkeypatch, tmp_path / "station.yaml", **given))
        return runs[-1]

    yield make
    for run in runs:
        run.end()


@pytest.fixture
def rotctld() -> Iterator[RealRotctld]:
    server = RealRotctld()
    yield server
    server.kill()


def test_the_node_moves_the_real_rotctld_and_latches_a_fault_when_it_dies(made, rotctld: RealRotctld) -> None:
    run = made(drive__type="hamlib", drive__link__port=rotctld.port).up()
    run.run(0.5)
    assert run.servo._device_health().level == OK
    run.command(12.0, 6.0)
    run.run(5.0, lambda: rotctld.position() == (12.0, 6.0))
    assert rotctld.position() == pytest.approx((12.0, 6.0), abs=0.02)
    run.run(0.5)
    azimuth, elevation = run.joints[-1].position
    assert (math.degrees(azimuth), math.degrees(elevation)) == pytest.approx((12.0, 6.0), abs=0.05)
    run.command(60.0, 30.0)
    run.run(1.0)
    rotctld.kill()
    took_s = run.run(3.0, lambda: bool(run.fault))
    assert took_s <= 1.0
    assert "drive lost: rotctld at localhost" in run.fault
    assert run.servo._device_health().level == ERROR
    quiet = len(run.joints)
    run.run(0.3)
    assert len(run.joints) == quiet, "no joints of a lost drive"
    rotctld.start()
    run.run(5.0, lambda: len(run.joints) > quiet)
    here = rotctld.position()
    assert "the cause" not in run.servo._antenna.reset_fault()
    run.run(1.5)
    assert rotctld.position() == pytest.approx(here, abs=0.02), "nothing is resumed by itself"


def test_a_jump_of_the_clock_stops_the_real_rotctld(made, rotctld: RealRotctld) -> None:
    run = made(drive__type="hamlib", drive__link__port=rotctld.port).up()
    run.command(60.0, 30.0)
    run.run(1.5)
    run.servo._schedule.jumped_s = 5.0
    run.run(0.06)
    run.servo._schedule.jumped_s = 0.0
    run.run(2.0)
    assert "the clock jumped by +5.00 s" in run.fault
    here = rotctld.position()
    run.run(0.5)
    assert rotctld.position() == pytest.approx(here, abs=0.02)
    assert here[0] < 30.0


def test_a_node_that_stood_still_goes_on_with_its_next_command(made, rotctld: RealRotctld) -> None:
    run = made(drive__type="hamlib", drive__link__port=rotctld.port).up()
    run.command(20.0, 30.0)
    run.run(1.0)
    time.sleep(1.3)
    run.run(0.5)
    assert run.fault == ""
    for _ in range(16):
        run.command(30.0, 30.0)
        run.run(0.5, lambda: max(np.abs(np.subtract(rotctld.position(), 30.0))) < 0.1)
    assert run.fault == ""
    assert rotctld.position() == pytest.approx((30.0, 30.0), abs=0.1)


def test_a_deactivated_node_leaves_the_device_at_rest(made, rotctld: RealRotctld) -> None:
    run = made(drive__type="hamlib", drive__link__port=rotctld.port).up()
    run.command(60.0, 30.0)
    run.run(1.5)
    run.servo.on_deactivate(ANY_STATE)
    here = rotctld.position()
    time.sleep(0.5)
    assert rotctld.position() == pytest.approx(here, abs=0.05)
    assert here[0] > 1.0


def test_a_drive_that_is_not_there_leaves_the_node_unconfigured_with_the_reason(made) -> None:
    run = made(drive__type="gs232", drive__link__device="/dev/nothing")
    assert run.configure() == TransitionCallbackReturn.FAILURE
    assert "GS-232 at /dev/nothing: could not open port" in run.servo._state_health().message


def test_a_drive_that_cannot_be_used_is_given_back(made, monkeypatch) -> None:
    """Its port would stay taken for the next try."""
    run, closed = made(drive__type="gs232", drive__link__device="/dev/nothing"), []
    make_drive = antenna_servo.make_drive

    def noted(*given: Any) -> Any:
        drive = make_drive(*given)
        close = drive.close
        monkeypatch.setattr(drive, "close", lambda: closed.append(close()))
        return drive

    monkeypatch.setattr(antenna_servo, "make_drive", noted)
    assert run.configure() == TransitionCallbackReturn.FAILURE
    assert len(closed) == 1


def test_a_drive_is_looked_at_between_configuration_and_ticks_and_not_beside_them(made) -> None:
    run, looks = made(drive__type="simulated_rotator"), []
    assert run.configure() == TransitionCallbackReturn.SUCCESS
    hardware = run.servo._antenna.hardware
    look = hardware.look
    hardware.look = lambda t_s: looks.append(look(t_s))
    run.servo._look()
    assert len(looks) == 1
    assert run.servo.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    looks.clear()
    run.servo._look()
    assert looks == []
    assert "device" in run.servo.diagnostics._checks


def test_faults_are_injected_into_the_simulated_drive_alone(made) -> None:
    run = made(drive__type="simulated_rotator", enable_fault_injection=True)
    assert run.configure() == TransitionCallbackReturn.FAILURE
    assert "needs drive.type=simulated" in run.servo._state_health().message


def test_a_simulated_rotator_publishes_its_truth(made) -> None:
    run = made(drive__type="simulated_rotator", antenna__start_azimuth_deg=20.0).up()
    seen: list[Any] = []
    run.servo._boresight.publish = seen.append
    run.command(26.0, 60.0)
    run.run(3.0)
    assert math.degrees(seen[-1].azimuth) == pytest.approx(26.0, abs=0.6)


@pytest.mark.parametrize("kept", [False, True])
def test_a_one_turn_azimuth_without_a_kept_turn_waits_for_somebody_to_look(made, tmp_path: Path, kept: bool) -> None:
    given = {"drive__type": "simulated_rotator", "drive__rotator__reads_one_turn": True}
    run = made(**given, wrap_file=str(tmp_path / "wrap.json") if kept else "").up()
    run.run(0.2)
    if kept:
        assert run.fault == ""
        return
    assert "no wrap_file keeps its turn: look at the cables, then reset" in run.fault
    assert run.servo._antenna.reset_fault() == ""


class Vendor:
    """A vendor's driver node: it goes to its set point at 6 deg/s while it is enabled."""

    def __init__(self, context: Any) -> None:
        self.node = Node("vendor", context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self.position, self.goal, self.enabled, self.silent = [10.0, 45.0], None, None, False
        self._state = self.node.create_publisher(JointState, "drive/state", STREAM)
        self.node.create_subscription(JointState, "drive/set_point", self._on_set_point, STREAM)
        self.node.create_subscription(Bool, "drive/enable", self._on_enable, LATCHED)

    def _on_set_point(self, message: JointState) -> None:
        self.goal = [math.degrees(each) for each in message.position]

    def _on_enable(self, message: Bool) -> None:
        self.enabled = message.data

    def step(self) -> None:
        for _ in range(5):
            self._executor.spin_once(timeout_sec=0.0)
        if self.goal and self.enabled:
            self.position = [
                here + min(max(goal - here, -0.12), 0.12) for here, goal in zip(self.position, self.goal, strict=True)
            ]
        message = JointState(
            name=["elevation", "azimuth"], position=[math.radians(each) for each in self.position[::-1]]
        )
        message.header.stamp = self.node.get_clock().now().to_msg()
        if not self.silent:
            self._state.publish(message)

    def end(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()


def test_a_vendors_node_behind_topics_follows_and_its_silence_is_a_fault(made, monkeypatch) -> None:
    run = made(drive__type="topic", drive__rotator__resolution_deg=[0.1, 0.1])
    vendor = Vendor(run.servo.context)
    # The vendor has no process of its own here: it works while the node waits.
    sleep = time.sleep
    monkeypatch.setattr("rf_pointing.station.antenna.drive_antenna.time.sleep", lambda s: (vendor.step(), sleep(s)))
    run.up()
    monkeypatch.undo()
    run.others.append(vendor.step)
    run.command(14.0, 47.0)
    run.run(4.0)
    assert vendor.position == pytest.approx([14.0, 47.0], abs=0.1)
    assert vendor.enabled is True
    # Neither ends the node: bytes that are no state, and states that cannot be ones.
    hostile = vendor.node.create_publisher(JointState, "drive/state", STREAM)
    stamps = (Time(sec=-1), stamp_from_seconds(run.servo.now_s() + 3600.0))
    states = [JointState(name=["azimuth", "elevation"], position=[0.1, 0.2]) for _ in stamps]
    for state, stamp in zip(states, stamps, strict=True):
        state.header.stamp = stamp
    losses = run.servo._antenna.hardware.drive.losses
    for number, payload in enumerate([b"\x00\x01\x00\x00abcd", *states], start=1):
        # Until it has arrived: the first ones are sent before the endpoints match.
        for _ in range(100):
            hostile.publish(payload)
            run.run(0.04)
            if losses["state that cannot be used"] >= number:
                break
        assert losses["state that cannot be used"] >= number
        losses["state that cannot be used"] = number
    assert run.fault == ""
    vendor.silent = True
    took_s = run.run(3.0, lambda: bool(run.fault))
    assert took_s < 1.2
    assert "no message on drive/state for" in run.fault
    run.run(0.2)
    assert vendor.enabled is False
    vendor.end()
