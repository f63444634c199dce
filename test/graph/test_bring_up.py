"""The graph as the integrator of a station finds it: names, parameters, lifecycle, remapping."""

import subprocess
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, ListParameters
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import AntennaStatus, PassCertificate, PassProfileList, TrackingStatus
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.ephemeris import Pass, first_pass_above
from rf_pointing.ephemeris.source import SourceParams, load_elements, load_track
from rf_pointing.ros import convert_planning
from rf_pointing.ros.graph import EXECUTIVE, NODES, TOPICS
from rf_pointing.ros.qos import LATCHED, STATUS, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.station.pointing.certificates import pass_profile

from .conftest import ask, executable

pytestmark = pytest.mark.graph

GLOBAL_TOPICS = {"/diagnostics", "/rosout", "/parameter_events"}
NUMBERS = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER)
ARRAYS = (ParameterType.PARAMETER_DOUBLE_ARRAY, ParameterType.PARAMETER_INTEGER_ARRAY)
STANDARD = ("use_sim_time", "start_type_description_service")


def first_pass() -> Pass:
    source = SourceParams()
    return first_pass_above(load_track(source), load_elements(source).epoch_t_s, 0.7, 0.09, 172800.0)


@pytest.fixture
def station(live: SimpleNamespace) -> Any:
    """Every node of a simulated station, its clock held a minute before a pass."""
    start_s = round(first_pass().aos_t_s) - 60.0
    text = f"/**/simulation_clock: {{ros__parameters: {{start_s: {start_s}, speed: 1.0}}}}"
    names = list(NODES)
    started = live.start(names, text, state="configure", simulated=True)
    assert started.refused == []
    activate(live, started, names[1:])
    return started


def activate(live: SimpleNamespace, started: Any, waiting: list[str]) -> None:
    """Activate nodes: the held time reaches them one by one, and one without a time refuses."""

    def activated() -> bool:
        waiting[:] = started.client.change(waiting, "activate", 30.0)
        return not waiting

    live.spin_until(activated, "activation")


def endpoints(node: Any, name: str, namespace: str) -> Iterator[str]:
    """Every topic, service and action that a node publishes, hears, offers or calls."""
    for list_names in (
        node.get_publisher_names_and_types_by_node,
        node.get_subscriber_names_and_types_by_node,
        node.get_service_names_and_types_by_node,
        node.get_client_names_and_types_by_node,
    ):
        yield from (endpoint for endpoint, _ in list_names(name, namespace))


def test_every_node_is_found_active_described_and_inside_its_namespace(live: SimpleNamespace, station: Any) -> None:
    for name in NODES:
        state = ask(live, GetState, f"{name}/get_state", GetState.Request()).current_state.label
        assert state == ("inactive" if name == "simulation_clock" else "active"), name
        outside = {
            endpoint
            for endpoint in endpoints(live.node, name, live.namespace)
            if not endpoint.startswith(f"{live.namespace}/") and endpoint not in GLOBAL_TOPICS
        }
        assert outside == set(), name
        check_parameters(live, name)
    check_topics(live)
    check_status(live)
    assert station.processes.ended() == {}


def check_parameters(live: SimpleNamespace, name: str) -> None:
    """Every parameter of a node has a description that ends with its unit, every number a range."""
    names = ask(live, ListParameters, f"{name}/list_parameters", ListParameters.Request()).result.names
    ours = [key for key in names if key not in STANDARD and not key.startswith("qos_overrides")]
    assert ours, name
    request = DescribeParameters.Request(names=ours)
    for item in ask(live, DescribeParameters, f"{name}/describe_parameters", request).descriptors:
        where = f"{name}: {item.name}"
        words, _, unit = item.description.rpartition(" [")
        assert words, where
        assert unit.endswith("]"), where
        if item.type in NUMBERS:
            (bounds,) = item.floating_point_range or item.integer_range
            assert bounds.from_value < bounds.to_value, where
        else:
            assert item.type in (ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_BOOL, *ARRAYS), where


def check_topics(live: SimpleNamespace) -> None:
    """Every topic of the table has a publisher, with the reliability and durability that the table promises."""
    for topic in TOPICS:
        # A station without an executive is whole.
        if topic.publisher == EXECUTIVE:
            continue
        name = topic.name if topic.name.startswith("/") else f"{live.namespace}/{topic.name}"
        found = live.node.get_publishers_info_by_topic(name)
        assert found, name
        for publisher in found:
            assert publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE, name
            latched = topic.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
            assert (publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) == latched, name
        wanted = topic.qos.deadline.nanoseconds
        assert topic.name != "joint_trajectory" or found[0].qos_profile.deadline.nanoseconds == wanted


def check_status(live: SimpleNamespace) -> None:
    """The clock has not ticked yet, and who comes this late still hears what the antenna said when it was activated."""
    heard: list[AntennaStatus] = []
    live.node.create_subscription(AntennaStatus, "antenna_status", heard.append, STATUS)
    live.spin_until(lambda: bool(heard), "the antenna's status")
    assert heard[-1].mode == "holding"


class Encoders:
    """What a test hears of one antenna's encoders."""

    def __init__(self, live: SimpleNamespace, topic: str) -> None:
        self.count, self.last = 0, None
        self._subscription = live.node.create_subscription(JointState, topic, self._take, STREAM)

    def _take(self, message: JointState) -> None:
        self.count += 1
        self.last = list(message.position)


def change(live: SimpleNamespace, namespace: str, node: str, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return bool(ask(live, ChangeState, f"{namespace}/{node}/change_state", request).success)


def start(namespace: str, *arguments: str) -> "subprocess.Popen[str]":
    """Start an antenna with standard ROS arguments, as an integrator does."""
    return subprocess.Popen(
        [executable("antenna_servo"), "--ros-args", "-r", f"__ns:={namespace}", "-p", "station:=dss13", *arguments],
        stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def test_a_node_is_stopped_restarted_and_remapped_without_its_neighbour_noticing(live: SimpleNamespace) -> None:
    """Two antennas on the wall clock; the first is deactivated, activated again, ended, and started under other names."""
    one, two = f"{live.namespace}/gs1", f"{live.namespace}/gs2"
    running = {namespace: start(namespace) for namespace in (one, two)}
    try:
        first, second = Encoders(live, f"{one}/joint_states"), Encoders(live, f"{two}/joint_states")
        for namespace in (one, two):
            assert change(live, namespace, "antenna_servo", Transition.TRANSITION_CONFIGURE)
            assert change(live, namespace, "antenna_servo", Transition.TRANSITION_ACTIVATE)
        live.spin_until(lambda: first.count > 20 and second.count > 20, "both antennas")

        assert change(live, one, "antenna_servo", Transition.TRANSITION_DEACTIVATE)
        silent_from, heard = first.count, second.count
        live.spin_until(lambda: second.count > heard + 50, "the neighbour")
        assert first.count <= silent_from + 1
        rested = first.last
        assert change(live, one, "antenna_servo", Transition.TRANSITION_ACTIVATE)
        live.spin_until(lambda: first.count > silent_from + 50, "the first antenna again")
        assert first.last == pytest.approx(rested, abs=1e-4), "activation does not move it"

        running[one].terminate()
        running[one].communicate(timeout=30)
        assert running[one].returncode == 0
        running[one] = start(one, "-r", "__node:=acu", "-r", "joint_states:=encoders")
        renamed = Encoders(live, f"{one}/encoders")
        assert change(live, one, "acu", Transition.TRANSITION_CONFIGURE)
        assert change(live, one, "acu", Transition.TRANSITION_ACTIVATE)
        silent_from, heard = first.count, second.count
        live.spin_until(lambda: renamed.count > 50 and second.count > heard + 50, "the renamed antenna")
        assert first.count == silent_from
        assert renamed.last == pytest.approx(second.last, abs=1e-3)
    finally:
        for process in running.values():
            process.terminate()
            process.communicate(timeout=30)


class Goal:
    """A live servo and a controller without an ephemeris, and what the controller makes of a goal."""

    NODES = ("antenna_servo", "pointing_controller")

    def __init__(self, live: SimpleNamespace) -> None:
        self.live, self.status, self.certificates, self.commands = live, TrackingStatus(), list[Any](), list[Any]()
        live.node.create_subscription(TrackingStatus, "tracking_status", self._on_status, STREAM)
        live.node.create_subscription(PassCertificate, "pass_certificate", self.certificates.append, LATCHED)
        live.node.create_subscription(JointTrajectory, "joint_trajectory", self.commands.append, STREAM)
        self.profiles = live.node.create_publisher(PassProfileList, "pass_profiles", LATCHED)
        self.client = ActionClient(live.node, TrackPass, "track_pass")

    def _on_status(self, message: TrackingStatus) -> None:
        self.status = message

    @property
    def t_s(self) -> float:
        return seconds_from_stamp(self.status.header.stamp)

    def send(self, window: Pass) -> Any:
        """Send the goal, and return the future of its result."""
        self.live.spin_until(self.client.server_is_ready, "track_pass")
        message = convert_planning.pass_to_message(window)
        sent = self.client.send_goal_async(TrackPass.Goal(target_pass=message, sensor="program"))
        self.live.spin_until(sent.done, "an answer")
        assert sent.result().accepted
        return sent.result().get_result_async()

    def spin(self, wall_s: float) -> None:
        """Let so much wall time pass."""
        end_s = time.monotonic() + wall_s
        self.live.spin_until(lambda: time.monotonic() > end_s, "the time")


def test_simulated_time_waits_for_a_late_profile_and_nothing_moves_before_the_certificate(
    live: SimpleNamespace,
) -> None:
    window, goal, wait_s = first_pass(), Goal(live), 3.0
    start_s = round(window.aos_t_s) - 1000.0
    text = f"/**/simulation_clock: {{ros__parameters: {{start_s: {start_s}, speed: 0.0, tick_s: 0.1}}}}"
    started = live.start(["simulation_clock", *Goal.NODES], text, state="configure", simulated=True)
    activate(live, started, list(Goal.NODES))
    assert started.client.change(["simulation_clock"], "activate", 20.0) == []
    # The streams of the nodes that are not there are given up after five seconds.
    live.spin_until(lambda: goal.t_s > start_s + 5.0, "simulated time")
    result = goal.send(window)
    begun_s = goal.t_s
    goal.spin(wait_s)
    assert goal.t_s - begun_s < 1.0, "of thousands without a hold"
    assert (goal.certificates, goal.commands, result.done()) == ([], [], False)
    profile = convert_planning.profile_to_message(pass_profile(load_track(SourceParams()), window))
    goal.profiles.publish(PassProfileList(profiles=[profile]))
    live.spin_until(lambda: bool(goal.commands), "the first command")
    assert seconds_from_stamp(goal.certificates[0].header.stamp) - begun_s < 1.0
    assert started.client.change(["simulation_clock"], "deactivate", 20.0) == []
