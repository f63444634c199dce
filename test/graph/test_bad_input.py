"""Bad input on live nodes: refused with its reason, and nothing moves."""

import math
import subprocess
from types import SimpleNamespace

import pytest

from rf_pointing.ros.graph import NODES

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2", exc_type=ImportError)
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParametersAtomically
from rf_pointing_msgs.msg import AntennaStatus
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from rf_pointing.ros.qos import COMMAND, STREAM

from .conftest import ask, executable

pytestmark = pytest.mark.graph

START_RAD = (math.radians(120.0), math.radians(60.0))


class Antenna:
    """Commands to a live antenna_servo, and what it says."""

    def __init__(self, live: SimpleNamespace) -> None:
        self.live, self.status, self.positions = live, None, []
        self.commands = live.node.create_publisher(JointTrajectory, "joint_trajectory", COMMAND)
        live.node.create_subscription(AntennaStatus, "antenna_status", self._on_status, STREAM)
        live.node.create_subscription(
            JointState, "joint_states", lambda m: self.positions.append(list(m.position)), STREAM
        )
        live.start(["antenna_servo"], "/**/antenna_servo: {ros__parameters: {wind: {mean_speed_m_s: 0.0}}}")
        live.spin_until(lambda: self.status is not None and self.commands.get_subscription_count() == 1, "the antenna")

    def _on_status(self, message: AntennaStatus) -> None:
        self.status = message

    def trajectory(self, *, ahead_s: float = 0.2, velocity: float = 0.0) -> JointTrajectory:
        message = JointTrajectory(joint_names=["azimuth", "elevation"])
        message.header.stamp = self.live.node.get_clock().now().to_msg()
        for step in range(3):
            point = JointTrajectoryPoint(
                positions=[START_RAD[0] + 0.05 + velocity * 0.1 * step, START_RAD[1]],
                velocities=[velocity, 0.0],
                accelerations=[0.0, 0.0],
            )
            total = ahead_s + 0.1 * step
            point.time_from_start.sec = math.floor(total)
            point.time_from_start.nanosec = int((total - math.floor(total)) * 1e9)
            message.points.append(point)
        return message

    def rejected(self, message: JointTrajectory) -> str:
        """Publish and return why the antenna rejected it."""
        before = self.status.commands_rejected
        self.commands.publish(message)
        self.live.spin_until(lambda: self.status.commands_rejected > before, "the rejection")
        return str(self.status.last_rejection)


def test_commands_that_cannot_be_followed_are_counted_and_move_nothing(live: SimpleNamespace) -> None:
    antenna = Antenna(live)
    bad = antenna.trajectory()
    bad.points[1].positions[0] = math.nan
    assert "finite" in antenna.rejected(bad)
    bad = antenna.trajectory()
    bad.points[0].velocities[1] = math.inf
    assert "finite" in antenna.rejected(bad)
    bad = antenna.trajectory()
    bad.points[2].positions = [1.0]
    assert "points[2].positions has 1 values" in antenna.rejected(bad)
    bad = antenna.trajectory()
    bad.joint_names = ["azimuth", "polarisation"]
    assert "polarisation" in antenna.rejected(bad)
    assert "stale" in antenna.rejected(antenna.trajectory(ahead_s=-5.0))
    assert "future" in antenna.rejected(antenna.trajectory(ahead_s=3000.0))
    assert antenna.status.commands_accepted == 0
    assert max(abs(p[0] - START_RAD[0]) for p in antenna.positions) < math.radians(0.01)


def test_commands_that_run_dry_while_moving_end_in_a_controlled_stop_until_the_next_one(live: SimpleNamespace) -> None:
    antenna = Antenna(live)
    antenna.commands.publish(antenna.trajectory(velocity=math.radians(0.5)))
    live.spin_until(lambda: antenna.status.mode == "tracking", "the antenna to move")
    live.spin_until(lambda: antenna.status.mode == "holding", "the end of the stop")
    assert "ran dry" in antenna.status.warning
    assert antenna.status.fault == ""
    antenna.commands.publish(antenna.trajectory(velocity=math.radians(0.5)))
    live.spin_until(
        lambda: antenna.status.mode == "tracking" and not antenna.status.warning, "the antenna to move again"
    )


def test_every_parameter_says_what_it_is_and_a_refused_set_changes_none(live: SimpleNamespace) -> None:
    names = [name for name in NODES if name in ("antenna_servo", "pointing_controller")]
    live.start(names, state="configure")
    for node in names:
        listed = ask(live, ListParameters, f"{node}/list_parameters", ListParameters.Request()).result.names
        ours = [name for name in listed if "." in name and not name.startswith("qos_overrides")]
        assert len(ours) > 20
        described = ask(live, DescribeParameters, f"{node}/describe_parameters", DescribeParameters.Request(names=ours))
        for item in described.descriptors:
            assert item.description.endswith("]"), item.name
            if item.type == ParameterType.PARAMETER_DOUBLE:
                assert item.floating_point_range, item.name
    wanted = [("limits.elevation_min_deg", 6.0), ("limits.azimuth_max_deg", 1e9)]
    values = [
        Parameter(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))
        for name, value in wanted
    ]
    request = SetParametersAtomically.Request(parameters=values)
    answer = ask(live, SetParametersAtomically, "pointing_controller/set_parameters_atomically", request).result
    assert not answer.successful
    assert "azimuth_max_deg" in answer.reason
    kept = ask(live, GetParameters, "pointing_controller/get_parameters", GetParameters.Request(names=[wanted[0][0]]))
    assert kept.values[0].double_value == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ("limits: {azimuth_maximum_deg: 10.0}", "limits.azimuth_maximum_deg: no such parameter"),
        (
            "limits: {elevation_min_deg: 5.0}",
            "limits.elevation_min_deg is given by the station description: mount.elev",
        ),
        ("pointing: {period_s: .nan}", "period_s"),
        ("pointing: {transport_s: 0.15}", "transport_s=0.15 must be a whole number of period_s"),
        ("station: nowhere.yaml", "nowhere.yaml:1: no such file"),
        ("autotrack: {sensor: 7}", "sensor"),
    ],
)
def test_a_bad_parameter_file_leaves_the_node_unconfigured_with_the_key(
    live: SimpleNamespace, parameters: str, word: str
) -> None:
    text = f"/**/pointing_controller: {{ros__parameters: {{{parameters}}}}}"
    started = live.start(["pointing_controller"], text, state="configure")
    assert started.refused == ["pointing_controller"]
    assert word in started.processes.complaint("pointing_controller")


def test_a_second_instance_in_a_namespace_ends_at_once(live: SimpleNamespace) -> None:
    live.start(["monopulse_tracker"], state="configure")
    second = subprocess.run(
        [executable("monopulse_tracker"), "--ros-args", "-r", f"__ns:={live.namespace}"],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert second.returncode == 2
    assert "already runs" in second.stderr
