"""What viewers get: transforms that agree with the URDF, and markers where beam, target, mask and Sun are."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Quaternion
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rf_pointing_msgs.msg import PassProfile, PassProfileList, Target
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from rf_pointing.core import JointReading
from rf_pointing.core.angles import azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.nodes.station_description import TF, StationDescriptionNode
from rf_pointing.ros import convert, convert_description
from rf_pointing.ros.graph import FRAMES, GRAPH, TOPICS
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.streams import frame_in
from rf_pointing.station.description import read_station, shipped_stations
from rf_pointing.station.description.urdf import size_m, urdf

TFMessage = pytest.importorskip("tf2_msgs.msg", reason="ROS without tf2").TFMessage
NAMESPACE = "/gs4"
UNNAMED = {"joint_trajectory", "/diagnostics"}
"""Their frame_id is the commander's name; nothing."""


def rotation(q: Quaternion) -> Rotation:
    return Rotation.from_quat([q.x, q.y, q.z, q.w])


def test_transforms_are_those_of_the_beam_also_over_the_top(random: np.random.Generator) -> None:
    for azimuth, elevation in random.uniform((-8.0, -0.1), (8.0, 3.3), (100, 2)):
        reading = JointReading(t_s=1e9, position_rad=np.array([azimuth, elevation]), velocity_rad_s=np.zeros(2))
        turns = [
            *convert_description.joint_transforms(reading, NAMESPACE),
            convert_description.beam_transform(NAMESPACE),
        ]
        assert [(each.header.frame_id, each.child_frame_id) for each in turns] == [
            ("gs4/base_link", "gs4/azimuth_link"),
            ("gs4/azimuth_link", "gs4/elevation_link"),
            ("gs4/elevation_link", "gs4/beam"),
        ]
        first, second, third = (rotation(each.transform.rotation) for each in turns)
        beam = (first * second * third).apply([1.0, 0.0, 0.0])
        assert np.allclose(beam, unit_vector_from_azel(azimuth, elevation), atol=1e-12)
        assert turns[0].header.stamp == stamp_from_seconds(1e9)


@pytest.mark.parametrize("name", shipped_stations())
def test_the_tree_begins_at_the_centre_of_the_earth(name: str) -> None:
    site = read_station(name).site
    stands = convert_description.site_transform(site, NAMESPACE)
    assert (stands.header.frame_id, stands.child_frame_id) == ("earth", "gs4/base_link")
    east, north, up = rotation(stands.transform.rotation).as_matrix().T
    across, along = math.cos(site.latitude_rad), math.sin(site.latitude_rad)
    assert np.allclose(up, [across * math.cos(site.longitude_rad), across * math.sin(site.longitude_rad), along])
    assert np.allclose(np.cross(east, north), up)
    assert abs(east[2]) < 1e-12
    place = stands.transform.translation
    assert 6.3e6 < math.hypot(place.x, place.y, place.z) < 6.4e6


def test_every_header_of_the_graph_names_a_frame_of_its_antenna(ros_domain: int, default_context: None) -> None:
    node = ManagedNode("framed")
    try:
        for topic in TOPICS:
            if not hasattr(topic.message_type(), "header"):
                continue
            assert (topic.name in FRAMES) == (topic.name not in UNNAMED), topic.name
            if topic.name in FRAMES:
                message = topic.message_type()
                node.publisher(topic.message_type, topic.name, topic.qos).publish(message)
                assert message.header.frame_id in ("base_link", "beam")
    finally:
        node.end()
        node.lock.release()
        node.destroy_node()
    errors = {topic.frame for row in GRAPH for topic in row.topics if topic.name.endswith("pointing_error")}
    assert errors == {"beam"}


@pytest.mark.parametrize(
    ("namespace", "whole"), [("/", "beam"), ("/gs1", "gs1/beam"), ("/north/gs2", "north/gs2/beam")]
)
def test_frames_of_two_antennas_are_two(namespace: str, whole: str) -> None:
    # tf2 refuses a name with a slash before it.
    assert frame_in(namespace, "beam") == whole


class Viewer:
    """Everything that a viewer gets from one running node."""

    def __init__(self, ros_domain: int, *parameters: str) -> None:
        arguments = ["--ros-args", "-r", f"__ns:={NAMESPACE}", *(word for each in parameters for word in ("-p", each))]
        rclpy.init(args=arguments, domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
        self.node = StationDescriptionNode()
        self.rest = Node("viewer")
        self.executor = SingleThreadedExecutor()
        self.got: dict[str, list[Any]] = {}
        for kind, topic, qos in (
            (MarkerArray, "beam_markers", STREAM), (TFMessage, "/tf", TF), (TFMessage, "/tf_static", LATCHED),
            (String, "robot_description", LATCHED),
        ):  # fmt: skip
            self.subscribe(kind, topic, qos)
        for each in (self.rest, self.node):
            self.executor.add_node(each)

    def bring_up(self) -> None:
        self.node.brings_itself_up = True
        self.node.bring_up()
        assert self.node.active

    def subscribe(self, kind: Any, topic: str, qos: Any) -> None:
        self.got[topic] = []
        self.rest.create_subscription(kind, topic, self.got[topic].append, qos)

    def until(self, condition: Callable[[], bool]) -> None:
        for _ in range(3000):
            self.executor.spin_once(timeout_sec=0.01)
            if condition():
                return
        raise AssertionError({topic: len(messages) for topic, messages in self.got.items()})

    def newest(self, topic: str) -> dict[str, Marker]:
        """Return the newest marker of each kind."""
        return {marker.ns: marker for array in self.got[topic] for marker in array.markers}

    def close(self) -> None:
        self.executor.shutdown()
        self.node.end()
        self.node.lock.release()
        for each in (self.node, self.rest):
            each.destroy_node()
        rclpy.shutdown()


@pytest.fixture
def view(ros_domain: int) -> Iterator[Callable[..., Viewer]]:
    """Yield a maker of a node with these parameters, not yet up, and who looks at it."""
    made: list[Viewer] = []

    def make(*parameters: str) -> Viewer:
        made.append(Viewer(ros_domain, *parameters))
        return made[-1]

    yield make
    for each in made:
        each.close()


def direction(marker: Marker) -> tuple[float, float]:
    place = marker.pose.position
    azimuth, elevation = azel_from_unit_vector(np.array([place.x, place.y, place.z]))
    return float(azimuth), float(elevation)


def test_a_viewer_sees_beam_target_mask_pass_and_sun(view: Callable[..., Viewer]) -> None:
    seen = view("station:=leo_3m7", "view.radius_m:=20.0")
    seen.bring_up()
    now_s = seen.node.now_s()
    joints = seen.rest.create_publisher(JointState, "joint_states", STREAM)
    targets = seen.rest.create_publisher(Target, "target", STREAM)
    passes = seen.rest.create_publisher(PassProfileList, "pass_profiles", LATCHED)
    seen.until(lambda: joints.get_subscription_count() == targets.get_subscription_count() == 1)
    reading = JointReading(t_s=now_s, position_rad=np.array([1.0, 2.5]), velocity_rad_s=np.zeros(2))
    joints.publish(convert.joints_to_message(reading))
    # Published ahead of its time: only the first one is of now.
    for ahead_s, azimuth in ((-0.1, 0.3), (30.0, 0.9)):
        message = Target(target="BIRD", azimuth=azimuth, elevation=0.7)
        message.header.stamp = stamp_from_seconds(now_s + ahead_s)
        targets.publish(message)
    seen.until(lambda: bool(seen.got["/tf"]) and "target" in seen.newest("beam_markers"))
    assert [each.child_frame_id for each in seen.got["/tf"][-1].transforms] == [
        "gs4/azimuth_link",
        "gs4/elevation_link",
    ]
    fixed = seen.got["/tf_static"][-1].transforms
    assert [each.child_frame_id for each in fixed] == ["gs4/base_link", "gs4/beam"]
    assert seen.got["robot_description"][-1].data == urdf(read_station("leo_3m7"))
    markers = seen.newest("beam_markers")
    assert {name: marker.header.frame_id for name, marker in markers.items()} == {
        "beam": "gs4/beam", "half_power_beam": "gs4/beam", "target": "gs4/base_link", "target_name": "gs4/base_link",
        "sun_zone": "gs4/base_link",
    }  # fmt: skip
    assert markers["target_name"].text == "BIRD"
    assert direction(markers["target"]) == pytest.approx((0.3, 0.7))
    assert markers["beam"].points[1].x == 20.0
    assert [markers["beam"].points[1].y, markers["beam"].points[1].z] == [0.0, 0.0]
    sun = seen.node._sun.at(now_s)
    rim = np.array([[p.x, p.y, p.z] for p in markers["sun_zone"].points]) / 20.0
    apart = np.degrees(np.arccos(rim @ unit_vector_from_azel(*sun)))
    # The Sun is renewed once in 10 s, in which it moves 0.04 deg.
    assert apart == pytest.approx(read_station("leo_3m7").content.sun.radius_deg, abs=0.05)
    # A viewer that comes late gets mask and pass.
    passes.publish(PassProfileList(profiles=[profile(now_s - 100.0, 50.0), profile(now_s + 100.0, 60.0)]))
    seen.until(lambda: seen.node._drawn is not None)
    seen.subscribe(MarkerArray, "sky_markers", LATCHED)
    seen.until(lambda: bool(seen.got["sky_markers"]))
    sky = seen.newest("sky_markers")
    azimuth, elevation = azel_from_unit_vector(np.array([[p.x, p.y, p.z] for p in sky["mask"].points]))
    assert elevation == pytest.approx(read_station("leo_3m7").mask.lowest_all(azimuth), abs=1e-9)
    assert len(azimuth) >= 360
    assert len(sky["pass"].points) == 3
    assert math.atan2(sky["pass"].points[0].x, sky["pass"].points[0].y) == pytest.approx(1.0)
    assert sky["pass"].action == Marker.ADD


def profile(aos_s: float, duration_s: float) -> PassProfile:
    """A pass that has begun, or is to come, and looks somewhere."""
    columns = ("azimuth_rate", "elevation_rate", "azimuth_acceleration", "elevation_acceleration", "sun_azimuth",
               "sun_elevation", "satellite_gain")  # fmt: skip
    return PassProfile(
        target="BIRD", aos=stamp_from_seconds(aos_s), time=[0.0, 0.5 * duration_s, duration_s],
        azimuth=[1.0, 1.5, 2.0], elevation=[0.1, 0.9, 0.1], range=[2e6, 1e6, 2e6],
        **{name: [0.0, 0.0, 0.0] for name in columns},
    )  # fmt: skip


def test_where_robot_state_publisher_runs_it_alone_turns_the_joints(view: Callable[..., Viewer]) -> None:
    seen = view("station:=vhf_uhf_yagi", "view.publish_tf:=false")
    seen.bring_up()
    seen.until(lambda: bool(seen.got["/tf_static"]) and len(seen.got["beam_markers"]) >= 2)
    assert [each.child_frame_id for each in seen.got["/tf_static"][-1].transforms] == ["gs4/base_link"]
    topics = {name for name, _ in seen.node.get_publisher_names_and_types_by_node("station_description", NAMESPACE)}
    assert not topics & {"/tf", f"{NAMESPACE}/robot_description"}
    # Its beam may look into the Sun.
    assert "sun_zone" not in seen.newest("beam_markers")
    # Directions are drawn three diameters of the antenna away.
    radius_m = 3.0 * size_m(read_station("vhf_uhf_yagi"))
    assert seen.newest("beam_markers")["beam"].points[1].x == pytest.approx(radius_m)
    health = seen.node._health()
    assert health.values == {"radius_m": radius_m, "tf_published_by": "robot_state_publisher"}
    assert health.message == "drawn"


def test_nothing_is_drawn_more_often_than_five_times_a_second(view: Callable[..., Viewer]) -> None:
    seen = view("view.period_s:=0.1")
    assert any("period_s" in reason and "0.2" in reason for reason in seen.node.parameters.reasons)
