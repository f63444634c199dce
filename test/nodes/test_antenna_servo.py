"""The antenna's node: what it is asked and sends, who is obeyed, and drives that are not simulated."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import Quaternion, Vector3, Vector3Stamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.time import Time as ClockTime
from rf_pointing_msgs.srv import GoTo, InjectFault, PermitSun, SignedCall, StowInFault
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.ros import convert_planning
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.leased_services import LEASE_S, LEASED, Caller
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.station.description import read_station
from rf_pointing.station.description.remarks import remarks
from test.drives.rotctld import RealRotctld

MakeBench = Callable[..., Any]
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"
SPEED = {"rate_deg_s": 6.0, "acceleration_deg_s2": 6.0, "command_rate_deg_s": 6.0, "command_acceleration_deg_s2": 6.0}
DESCRIPTION = {
    "mount.azimuth": {"travel_deg": [-180.0, 270.0], **SPEED},
    "mount.elevation": {"travel_deg": [0.0, 90.0], **SPEED},
    "tuning.loops.preprocessor": {"travel_min_deg": [-180.0, 0.0], "travel_max_deg": [270.0, 90.0]},
    "drive.link.first_retry_s": 0.2,
    "wind.anemometer": False,
}
"""A small rotator's keys of a station description."""


def command(bench: Any, azimuth_deg: float, elevation_deg: float) -> JointTrajectory:
    """Return a goal at rest, issued now."""
    message = JointTrajectory(joint_names=["azimuth", "elevation"])
    message.header.stamp = stamp_from_seconds(bench.t_s)
    place = JointTrajectoryPoint(
        positions=[math.radians(azimuth_deg), math.radians(elevation_deg)], velocities=[0.0, 0.0],
        accelerations=[0.0, 0.0],
    )  # fmt: skip
    place.time_from_start.nanosec = 100_000_000
    message.points.append(place)
    return message


def give(bench: Any, message: JointTrajectory, key: str = "") -> None:
    """Deliver a command behind its signature, as the controller sends them."""
    signer = CommandKey(CommandKeyParams(command_key_file=key), bench.node.resolve_topic_name("joint_trajectory"))
    payload = serialize_message(message)
    bench.give("command_signature", signer.sign(payload, message.header.stamp, 1, "/pointing_controller"))
    bench.give("joint_trajectory", payload)


def place_deg(bench: Any) -> tuple[float, float]:
    azimuth, elevation = bench.sent["joint_states"][-1].position
    return math.degrees(azimuth), math.degrees(elevation)


# The simulated antenna


def test_joints_and_truth_come_with_each_tick_and_the_status_at_10_hz(make_bench: MakeBench) -> None:
    bench = make_bench(AntennaServo).up()
    bench.run(1.0)
    counts = [len(bench.sent[name]) for name in ("joint_states", "sim/boresight", "antenna_status")]
    assert counts == [51, 50, 11]
    assert bench.sent["antenna_status"][-1].mode == "holding"
    assert {"drive", "commanders", "oscillation", "memory", "executive"} <= bench.health_names()
    assert "device" not in bench.health_names()


def test_a_place_is_held_and_a_stop_latches_until_it_is_reset(make_bench: MakeBench) -> None:
    bench = make_bench(AntennaServo).up()
    bench.run(0.1)
    azimuth_deg, elevation_deg = place_deg(bench)
    goal = GoTo.Request(azimuth=math.radians(azimuth_deg + 1.0), elevation=math.radians(elevation_deg - 1.0))
    assert bench.call("~/go_to", goal).message == "go_to accepted"
    bench.run(10.0)
    assert place_deg(bench) == pytest.approx((azimuth_deg + 1.0, elevation_deg - 1.0), abs=0.01)
    assert bench.call("~/stop").message == "stopping; reset_fault allows motion again"
    bench.run(2.0)
    assert (bench.sent["antenna_status"][-1].fault, bench.health("drive").level) == ("stop was requested", ERROR)
    assert not bench.call("~/go_to", goal).success
    refused = bench.call("~/stow_in_fault", StowInFault.Request(fault="nothing"))
    assert "the latched fault is 'stop was requested', the request names 'nothing'" in refused.message
    stowed = bench.call("~/stow_in_fault", StowInFault.Request(fault="stop was requested"))
    assert stowed.message == "stowing the elevation; the azimuth is braked, and the fault stays latched"
    bench.run(1.0)
    assert bench.call("~/reset_fault").message


def test_a_command_that_cannot_be_used_is_counted_with_its_reason(make_bench: MakeBench) -> None:
    bench = make_bench(AntennaServo).up()
    bench.run(0.1)
    wrong = command(bench, *place_deg(bench))
    wrong.joint_names = ["azimuth", "roll"]
    longest = command(bench, *place_deg(bench))
    longest.points *= 1000
    for each in (wrong, longest, command(bench, *place_deg(bench))):
        give(bench, each)
    bench.run(0.1)
    values = bench.health("drive").values
    assert (values["commands_rejected"], values["commands_accepted"]) == ("2", "1")
    assert values["last_rejection"].startswith("a message of ")
    assert any(words.startswith("command rejected: unknown joint roll") for _, words in bench.log)


# Times of the points, what they carry besides positions, the stamp (None: 0), and the joints.
BOTH, TURNED = ["azimuth", "elevation"], ["elevation", "azimuth"]
GOALS: dict[str, tuple[tuple[float, ...], tuple[str, ...], float | None, list[str]]] = {
    "one point": ((1.0,), (), None, BOTH), "a point at once": ((0.0, 1.0), (), None, BOTH),
    "at once alone": ((0.0,), (), None, BOTH), "elevation first": ((1.0,), (), None, TURNED),
    "with rates": ((0.2, 1.0), ("velocities",), None, BOTH),
    "with accelerations": ((0.2, 1.0), ("velocities", "accelerations"), None, BOTH),
    "with efforts": ((0.5, 1.0), ("effort",), None, BOTH),
    "in nanoseconds": ((0.123456789, 0.987654321), (), None, BOTH),
    "many points": (tuple(0.1 * k for k in range(1, 11)), (), None, BOTH),
    "stamped now": ((1.0,), (), 0.0, BOTH), "stamped ahead": ((0.2, 0.7), (), 0.3, BOTH),
    "stamped before": ((0.5, 1.5), (), -0.3, TURNED),
}  # fmt: skip


@pytest.mark.parametrize("goal", GOALS)
def test_what_is_legal_for_controllers_of_ros_reaches_its_last_point(make_bench: MakeBench, goal: str) -> None:
    """Stamp 0 begins now; points of positions alone, or with rates at rest, in any order of joints."""
    times, fields, stamp_s, joints = GOALS[goal]
    bench = make_bench(AntennaServo).up()
    bench.run(0.1)
    place = place_deg(bench)
    message = JointTrajectory(joint_names=joints)
    message.header.stamp = stamp_from_seconds(0.0 if stamp_s is None else bench.t_s + stamp_s)
    wanted = place[0] + 0.3, place[1] - 0.3
    positions = [math.radians(wanted[BOTH.index(joint)]) for joint in joints]
    for time_s in times:
        point = JointTrajectoryPoint(positions=positions, **{field: [0.0, 0.0] for field in fields})
        point.time_from_start.nanosec, point.time_from_start.sec = round(time_s % 1.0 * 1e9), int(time_s)
        message.points.append(point)
    bench.give("joint_trajectory", message)
    bench.run(4.0)
    values = bench.health("drive").values
    assert (values["commands_rejected"], values["commands_accepted"]) == ("0", "1"), values["last_rejection"]
    assert place_deg(bench) == pytest.approx(wanted, abs=0.02)


def test_a_signed_command_must_have_its_time(make_bench: MakeBench, tmp_path: Path) -> None:
    key = str(tmp_path / "command.key")
    bench = make_bench(AntennaServo, command_key_file=key).up()
    bench.run(0.1)
    now = command(bench, *place_deg(bench))
    now.header.stamp = stamp_from_seconds(0.0)
    give(bench, now, key)
    bench.run(0.1)
    values = bench.health("drive").values
    assert (values["commands_rejected"], values["commands_accepted"]) == ("1", "0")
    assert values["last_rejection"].startswith("a signed command has stamp 0")


def test_faults_are_injected_where_that_is_enabled_alone(make_bench: MakeBench) -> None:
    bench = make_bench(AntennaServo).up()
    with pytest.raises(ValueError, match="not enough values"):
        bench.call("~/inject_fault", InjectFault.Request(fault="encoder_jump", value=0.25))
    bench = make_bench(AntennaServo, enable_fault_injection=True).up()
    bench.run(0.06)
    answer = bench.call("~/inject_fault", InjectFault.Request(fault="encoder_jump", value=0.25))
    assert answer.message == f"encoder_jump injected at {bench.t_s:.3f}"
    bench.run(0.5)
    assert "jump" in bench.sent["antenna_status"][-1].fault
    assert not bench.call("~/inject_fault", InjectFault.Request(fault="gremlins")).success


def test_a_fault_and_the_turn_outlive_the_process_that_failed(make_bench: MakeBench, tmp_path: Path) -> None:
    files = {name: str(tmp_path / name) for name in ("state_file", "wrap_file")}
    bench = make_bench(AntennaServo, **files).up()
    bench.run(0.2)
    bench.node.fail("KeyError: 'x'")
    bench = make_bench(AntennaServo, **files).up()
    assert bench.sent["antenna_status"][-1].fault == "antenna_servo failed: KeyError: 'x' (since before the restart)"
    assert set(json.loads((tmp_path / "wrap_file").read_text())) == {"azimuth_rad"}
    assert make_bench(AntennaServo, wrap_file=str(tmp_path / "wrap_file" / "below")).step("configure") is False


def test_plant_and_laws_change_while_the_antenna_works_and_its_guards_do_not(make_bench: MakeBench) -> None:
    bench = make_bench(AntennaServo).up()
    assert bench.change(**{"plant.pinion_floor": 0.4}) == ""
    assert "cannot change while the drives are enabled" in bench.change(**{"loops.table.horizon_s": 60.0})
    assert "read when the node is configured" in bench.change(wrap_file="turn.json")
    assert bench.call("~/disable").success
    bench.run(1.0)
    assert bench.change(**{"loops.table.horizon_s": 60.0}) == ""
    assert "elevation_min_rad=-0.209" in bench.change(**{"loops.preprocessor.travel_min_deg": [-223.0, -12.0]})


def test_while_a_signed_commander_has_the_antenna_only_who_has_the_key_is_served(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    key = str(tmp_path / "command.key")
    bench = make_bench(AntennaServo, command_key_file=key)
    assert "cannot change" in bench.change(command_key_file="")
    bench.up().run(0.1)
    here = place_deg(bench)
    requests = {name: Trigger.Request() for name in LEASED} | {
        "antenna_servo/go_to": GoTo.Request(azimuth=math.radians(here[0]), elevation=math.radians(here[1])),
        "antenna_servo/stow_in_fault": StowInFault.Request(fault="x"),
        "antenna_servo/permit_sun": PermitSun.Request(by="x"),
    }
    assert bench.call("~/go_to", requests["antenna_servo/go_to"]).success, "no commander: everybody is served"
    give(bench, command(bench, *here), key)
    give(bench, command(bench, *here), str(tmp_path / "other"))
    bench.give("joint_trajectory", command(bench, here[0] + 5.0, here[1]))
    for name, request in requests.items():
        message = bench.call(f"~/{name.rpartition('/')[2]}", request).message
        assert message.startswith(f"/{name} is refused: /pointing_controller commands the antenna.")
    health = bench.health("commanders")
    assert (health.level, health.values["calls_refused"], health.values["foreign_commands"]) == (
        ERROR, str(len(LEASED)), "1",
    )  # fmt: skip
    caller = Caller(bench.node, CommandKey(CommandKeyParams(command_key_file=key)))
    call = caller.request("antenna_servo/go_to", requests["antenna_servo/go_to"])
    assert isinstance(call, SignedCall.Request)
    assert bench.call("~/signed", call).message == "go_to accepted"
    assert bench.call("~/signed", call).message.endswith("was sent before")
    assert bench.call("~/stop").success, "stop is for everybody"
    assert bench.step("deactivate")
    assert "while /pointing_controller commands it" in bench.change(**{"loops.table.horizon_s": 60.0})
    bench.wait(LEASE_S + 0.1)
    assert bench.change(**{"loops.table.horizon_s": 60.0}) == ""


@pytest.mark.parametrize("allowed", [True, False])
def test_a_commander_of_another_stack_has_the_antenna_between_passes_where_the_station_says_so(
    make_bench: MakeBench, tmp_path: Path, allowed: bool
) -> None:
    """It signs nothing, and its frame_id is a frame."""
    key, station = str(tmp_path / "command.key"), tmp_path / "station.yaml"
    read_station("dss13").write(station, {"mount.unsigned_commands": allowed})
    said = [each for each in remarks(read_station(station)) if each.startswith("mount.unsigned_commands: anybody")]
    assert len(said) == allowed
    bench = make_bench(AntennaServo, command_key_file=key, station=str(station)).up()
    bench.run(0.1)
    here = place_deg(bench)

    def foreign(wait_s: float) -> str:
        message = command(bench, here[0] + 1.0, here[1])
        message.header.frame_id = "base_link"
        message.points[0].time_from_start.sec = 2
        bench.give("joint_trajectory", message)
        bench.run(wait_s)
        return str(bench.health("drive").values["last_rejection"])

    give(bench, command(bench, *here), key)
    in_a_pass = foreign(0.2)
    assert "/pointing_controller commands, an unnamed one is refused" in in_a_pass or not allowed
    assert not bench.call("~/park").success, "the lease is of the signed one"
    bench.run(LEASE_S)
    between = foreign(1.2)
    assert between.startswith("conflict: a command without a signature is refused") is not allowed
    assert place_deg(bench)[0] - here[0] > 0.1 or not allowed
    assert bench.call("~/park").success, "an unsigned commander has no lease"


# Real drives


@pytest.fixture
def on_drive(make_bench: MakeBench, tmp_path: Path) -> MakeBench:
    """Return a maker of nodes on a small rotator, whose keyword arguments are keys of its description."""

    def make(real_time: bool = True, own: dict[str, Any] | None = None, **keys: Any) -> Any:
        file = tmp_path / "station.yaml"
        read_station("dss13").write(file, DESCRIPTION | {f"drive.{name}": value for name, value in keys.items()})
        return make_bench(AntennaServo, real_time=real_time, station=str(file), **(own or {}))

    return make


@pytest.fixture
def rotctld() -> Iterator[RealRotctld]:
    server = RealRotctld()
    yield server
    server.kill()


def until(bench: Any, condition: Callable[[], bool], seconds: float) -> bool:
    """Run in real time until a condition holds; return whether it does."""
    for _ in range(round(seconds / 0.1)):
        if condition():
            return True
        bench.run(0.1, 0.02)
    return condition()


def test_the_node_moves_the_real_rotctld_and_latches_a_fault_when_it_dies(on_drive, rotctld: RealRotctld) -> None:
    bench = on_drive(**{"type": "hamlib", "link.port": rotctld.port}).up()
    bench.run(0.5, 0.02)
    assert bench.health("device").level == OK
    bench.give("joint_trajectory", command(bench, 12.0, 6.0))
    assert until(bench, lambda: rotctld.position() == pytest.approx((12.0, 6.0), abs=0.02), 8.0)
    bench.run(0.5, 0.02)
    assert place_deg(bench) == pytest.approx((12.0, 6.0), abs=0.05)
    bench.give("joint_trajectory", command(bench, 60.0, 30.0))
    bench.run(1.0, 0.02)
    rotctld.kill()
    assert until(bench, lambda: "drive lost: rotctld at localhost" in bench.sent["antenna_status"][-1].fault, 3.0)
    assert bench.health("device").level == ERROR
    quiet = len(bench.sent["joint_states"])
    bench.run(0.3, 0.02)
    assert len(bench.sent["joint_states"]) == quiet, "no joints of a lost drive"
    rotctld.start()
    assert until(bench, lambda: len(bench.sent["joint_states"]) > quiet, 5.0)
    here = rotctld.position()
    assert until(bench, lambda: bench.call("~/reset_fault").success, 5.0)
    bench.run(1.0, 0.02)
    assert rotctld.position() == pytest.approx(here, abs=0.02), "nothing is resumed by itself"


def test_a_drive_that_is_not_there_leaves_the_node_unconfigured_with_the_reason(on_drive) -> None:
    bench = on_drive(real_time=False, **{"type": "gs232", "link.device": "/dev/nothing"})
    assert not bench.step("configure")
    assert "drive: GS-232 at /dev/nothing" in bench.health("state").message


def test_faults_are_injected_into_the_simulated_drive_alone(on_drive) -> None:
    bench = on_drive(real_time=False, own={"enable_fault_injection": True}, type="simulated_rotator")
    assert not bench.step("configure")
    assert "needs drive.type=simulated" in bench.health("state").message


def test_a_simulated_rotator_is_kept_connected_publishes_its_truth_and_has_no_anemometer_to_hear(on_drive) -> None:
    own = {"antenna.start_azimuth_deg": 20.0}
    bench = on_drive(real_time=False, own=own, type="simulated_rotator")
    assert bench.step("configure")
    bench.run(2.0)
    assert bench.step("activate"), "it was looked at meanwhile"
    bench.give("joint_trajectory", command(bench, 26.0, 60.0))
    bench.run(3.0)
    assert math.degrees(bench.sent["sim/boresight"][-1].azimuth) == pytest.approx(26.0, abs=0.6)
    with pytest.raises(KeyError):
        bench.give("weather/wind", Vector3Stamped())


def test_the_wind_of_the_station_stows_the_antenna(make_bench: MakeBench, tmp_path: Path) -> None:
    read_station("dss13").write(tmp_path / "station.yaml", {"drive.type": "simulated_rotator", "wind.anemometer": True})
    bench = make_bench(AntennaServo, station=str(tmp_path / "station.yaml")).up()
    for _ in range(8):
        message = Vector3Stamped(vector=Vector3(x=18.0, y=-24.0, z=5.0))
        message.header.stamp = stamp_from_seconds(bench.t_s)
        bench.give("weather/wind", message)
        bench.run(0.5)
    status = bench.sent["antenna_status"][-1]
    assert (status.mode, "30.0 m/s" in status.high_wind) == ("stowing", True)


def test_the_imu_of_a_ship_turns_its_readings_and_is_refused_where_it_is_not_one(
    make_bench: MakeBench, tmp_path: Path
) -> None:
    keys = {"drive.type": "simulated_rotator", "base.coast_s": 2.0}
    read_station("dss13").write(tmp_path / "station.yaml", keys)
    bench = make_bench(AntennaServo, station=str(tmp_path / "station.yaml")).up()
    deck_rad = bench.sent["joint_states"][-1].position[0]
    # The bow to the east: no yaw in the frame of ROS.
    for quaternion_w in (1.0,) * 20 + (0.5,):
        message = Imu(orientation=Quaternion(w=quaternion_w))
        message.header.stamp = stamp_from_seconds(bench.t_s - 0.02)
        bench.give("base/imu", message)
        bench.run(0.02)
    level, report = math.degrees(bench.sent["joint_states"][-1].position[0]), bench.health("base")
    assert math.remainder(level - math.degrees(deck_rad), 360.0) == pytest.approx(90.0, abs=0.1)
    assert "quaternion has length 0.5" in report.values["last_refusal"]
    odometry = Odometry()
    odometry.pose.pose.orientation.w = 1.0
    odometry.header.stamp = stamp_from_seconds(bench.t_s)
    bench.give("base/odometry", odometry)
    bench.run(2.5)
    assert bench.sent["antenna_status"][-1].mode == "stowing"


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
        self.node.create_timer(0.02, self._step)

    def _on_set_point(self, message: JointState) -> None:
        self.goal = [math.degrees(each) for each in message.position]

    def _on_enable(self, message: Bool) -> None:
        self.enabled = message.data

    def spin(self) -> None:
        for _ in range(5):
            self._executor.spin_once(timeout_sec=0.0)

    def _step(self) -> None:
        if self.goal and self.enabled:
            pairs = zip(self.position, self.goal, strict=True)
            self.position = [here + min(max(goal - here, -0.12), 0.12) for here, goal in pairs]
        radians = [math.radians(each) for each in self.position[::-1]]
        message = JointState(name=["elevation", "azimuth"], position=radians)
        message.header.stamp = self.node.get_clock().now().to_msg()
        if not self.silent:
            self._state.publish(message)

    def end(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()


def test_a_vendors_node_behind_topics_follows_and_its_silence_is_a_fault(on_drive, monkeypatch) -> None:
    bench = on_drive(**{"type": "topic", "rotator.resolution_deg": [0.1, 0.1]})
    vendor = Vendor(bench.node.context)
    # The vendor has no process of its own here: it works while the node waits or ticks.
    monkeypatch.setattr("rf_pointing.station.antenna.drive_antenna.LOOK_S", 0.0)
    turn = bench.node.turn
    monkeypatch.setattr(bench.node, "turn", lambda: (vendor.spin(), turn())[1])
    spin = SingleThreadedExecutor.spin_once
    monkeypatch.setattr(
        SingleThreadedExecutor, "spin_once",
        lambda self, **given: (spin(vendor._executor, timeout_sec=0.0), spin(self, **given))[1],
    )  # fmt: skip
    bench.up()
    bench.give("joint_trajectory", command(bench, 14.0, 47.0))
    assert until(bench, lambda: vendor.position == pytest.approx([14.0, 47.0], abs=0.1), 8.0)
    bench.run(0.5, 0.02)
    assert bench.sent["antenna_status"][-1].fault == ""
    vendor.silent = True
    assert until(bench, lambda: "no message on drive/state for" in bench.sent["antenna_status"][-1].fault, 3.0)
    assert until(bench, lambda: vendor.enabled is False, 2.0)
    vendor.end()


def test_in_simulated_time_a_command_counts_behind_the_ticks_of_its_time_whichever_arrives_first(
    make_bench: MakeBench,
) -> None:
    moved: list[list[float]] = []
    for early in (True, False):
        bench = make_bench(AntennaServo, use_sim_time=True)
        bench.node.get_clock().set_ros_time_override(ClockTime(seconds=bench.t_s))
        bench.up().run(0.1, 0.1)
        azimuth, elevation = place_deg(bench)
        goal = command(bench, azimuth + 5.0, elevation)
        goal.header.stamp = stamp_from_seconds(bench.t_s + 0.1)
        for given in (early, not early):
            if given:
                give(bench, goal)
            bench.run(0.1, 0.1)
        bench.run(0.2, 0.1)
        moved.append([each.velocity[0] for each in bench.sent["joint_states"]])
    assert moved[0] == moved[1]
    assert abs(moved[0][-1]) > math.radians(0.05)


def test_a_permission_for_the_sun_is_given_by_name_shown_and_withdrawn(make_bench: MakeBench) -> None:
    bench = make_bench(AntennaServo).up()
    bench.run(0.2)
    until = stamp_from_seconds(bench.t_s + 60.0)
    answer = bench.call("~/permit_sun", PermitSun.Request(by="alice", band="S", until=until))
    assert (answer.success, answer.message) == (False, "band='S' must be 'X', the band in use")
    answer = bench.call("~/permit_sun", PermitSun.Request(by="alice", band="X", until=until))
    assert answer.message.startswith("alice lets the X beam look into the Sun until ")
    bench.run(0.2)
    assert convert_planning.sun_permit_from_message(bench.sent["antenna_status"][-1]).by == "alice"
    assert bench.call("~/permit_sun", PermitSun.Request()).message == "the Sun is no longer permitted"
    bench.run(0.2)
    assert convert_planning.sun_permit_from_message(bench.sent["antenna_status"][-1]) is None
