"""What viewers get: transforms that agree with the URDF, and markers where beam, target, mask and Sun are."""

import math
from collections.abc import Callable
from typing import Any

import erfa
import numpy as np
import pytest
from geometry_msgs.msg import Quaternion
from rf_pointing_msgs.msg import PassProfile, PassProfileList, Target
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import NavSatStatus
from visualization_msgs.msg import Marker

from rf_pointing.core import JointReading, azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.nodes.station_description import StationDescriptionNode
from rf_pointing.ros import convert, convert_description
from rf_pointing.ros.graph import FRAMES, GRAPH, TOPICS
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.streams import frame_in
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.description import read_station, shipped_stations
from rf_pointing.station.description.urdf import size_m, urdf

TFMessage = pytest.importorskip("tf2_msgs.msg", reason="ROS without tf2").TFMessage
NAMESPACE = "/gs4"
UNNAMED = {"/diagnostics", "alarms"}
"""What has no frame."""


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


@pytest.mark.parametrize("name", ["xy_7m3", "polar_3m"])
def test_transforms_of_other_axes_are_those_of_their_mount(name: str, random: np.random.Generator) -> None:
    mount = kinematics_of(read_station(name).content)
    for angles in random.uniform(-1.5, 1.5, size=(20, 2)):
        reading = JointReading(t_s=1e9, position_rad=angles, velocity_rad_s=np.zeros(2))
        first, second = convert_description.joint_transforms(reading, NAMESPACE, mount)
        end = convert_description.beam_transform(NAMESPACE, mount)
        links = [f"gs4/{axis}_link" for axis in mount.axes]
        assert [first.child_frame_id, second.child_frame_id, end.header.frame_id] == [*links, links[1]]
        turn = rotation(first.transform.rotation) * rotation(second.transform.rotation)
        beam = turn.apply([1.0, 0.0, 0.0])
        assert np.allclose(beam, unit_vector_from_azel(*mount.sky_at(*angles.tolist())), atol=1e-12)


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
    fix = convert_description.site_fix(site, "gs4/base_link", 1e9)
    assert (fix.header.frame_id, fix.status.status) == ("gs4/base_link", NavSatStatus.STATUS_FIX)
    assert abs(fix.longitude) <= 180.0
    wgs84 = erfa.gd2gc(1, math.radians(fix.longitude), math.radians(fix.latitude), fix.altitude)
    assert wgs84 == pytest.approx([place.x, place.y, place.z], abs=1e-6)


def test_every_header_of_the_graph_names_a_frame_of_its_antenna(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(StationDescriptionNode)
    for topic in TOPICS:
        if hasattr(topic.message_type(), "header"):
            assert (topic.name in FRAMES) == (topic.name not in UNNAMED), topic.name
        if topic.name in FRAMES:
            bench.node.publisher(topic.message_type, topic.name, topic.qos).publish(topic.message_type())
            assert bench.sent[topic.name][-1].header.frame_id in ("base_link", "beam")
    errors = {topic.frame for row in GRAPH for topic in row.topics if topic.name.endswith("pointing_error")}
    assert errors == {"beam"}


@pytest.mark.parametrize(
    ("namespace", "whole"), [("/", "beam"), ("/gs1", "gs1/beam"), ("/north/gs2", "north/gs2/beam")]
)
def test_frames_of_two_antennas_are_two(namespace: str, whole: str) -> None:
    # tf2 refuses a name with a slash before it.
    assert frame_in(namespace, "beam") == whole


@pytest.fixture
def view(make_bench: Callable[..., Any]) -> Callable[..., Any]:
    """Return a maker of active nodes."""
    return lambda **given: make_bench(StationDescriptionNode, namespace=NAMESPACE, **given).up()


def newest(bench: Any, topic: str) -> dict[str, Marker]:
    """Return the newest marker of each kind."""
    return {marker.ns: marker for array in bench.sent[topic] for marker in array.markers}


def direction(marker: Marker) -> tuple[float, float]:
    place = marker.pose.position
    azimuth, elevation = azel_from_unit_vector(np.array([place.x, place.y, place.z]))
    return float(azimuth), float(elevation)


def points(marker: Marker) -> np.ndarray:
    return np.array([[point.x, point.y, point.z] for point in marker.points])


def test_a_viewer_sees_beam_target_mask_pass_and_sun(view: Callable[..., Any]) -> None:
    bench, station = view(station="leo_3m7", **{"view.radius_m": 20.0}), read_station("leo_3m7")
    reading = JointReading(t_s=bench.t_s, position_rad=np.array([1.0, 2.5]), velocity_rad_s=np.zeros(2))
    bench.give("joint_states", convert.joints_to_message(reading))
    # Published ahead of its time: only the first one is of now.
    for ahead_s, azimuth in ((0.1, 0.3), (30.0, 0.9)):
        message = Target(target="BIRD", azimuth=azimuth, elevation=0.7, range=1e6)
        message.header.stamp = stamp_from_seconds(bench.t_s + ahead_s)
        bench.give("target", message)
    bench.run(0.2)
    children = lambda topic: [each.child_frame_id for each in bench.sent[topic][-1].transforms]  # noqa: E731
    assert children("/tf") == ["gs4/azimuth_link", "gs4/elevation_link"]
    assert children("/tf_static") == ["gs4/base_link", "gs4/beam"]
    assert bench.sent["robot_description"][-1].data == urdf(station)
    assert bench.sent["site"][-1].latitude == pytest.approx(math.degrees(station.site.latitude_rad))
    markers = newest(bench, "beam_markers")
    assert {name: marker.header.frame_id for name, marker in markers.items()} == {
        "beam": "gs4/beam", "half_power_beam": "gs4/beam", "target": "gs4/base_link", "target_name": "gs4/base_link",
        "sun_zone": "gs4/base_link",
    }  # fmt: skip
    assert markers["target_name"].text == "BIRD"
    assert direction(markers["target"]) == pytest.approx((0.3, 0.7))
    assert points(markers["beam"])[1] == pytest.approx([20.0, 0.0, 0.0])
    sun = SolarDirection(SunParams(watched=True, site=station.site)).at(bench.t_s)
    apart = np.degrees(np.arccos(points(markers["sun_zone"]) / 20.0 @ unit_vector_from_azel(*sun)))
    # The Sun is renewed once in 10 s, in which it moves 0.04 deg.
    assert apart == pytest.approx(station.content.sun.radius_deg, abs=0.05)
    azimuth, elevation = azel_from_unit_vector(points(newest(bench, "sky_markers")["mask"]))
    assert elevation == pytest.approx(station.mask.lowest_all(azimuth), abs=1e-9)
    assert len(azimuth) >= 360


def profile(aos_s: float, azimuth: float) -> PassProfile:
    """A pass of 50 s."""
    columns = ("azimuth_rate", "elevation_rate", "azimuth_acceleration", "elevation_acceleration", "sun_azimuth",
               "sun_elevation", "satellite_gain")  # fmt: skip
    return PassProfile(
        target="BIRD", aos=stamp_from_seconds(aos_s), time=[0.0, 25.0, 50.0], azimuth=[azimuth, 1.5, 2.0],
        elevation=[0.1, 0.9, 0.1], range=[2e6, 1e6, 2e6], **{name: [0.0, 0.0, 0.0] for name in columns},
    )  # fmt: skip


def test_the_pass_in_progress_or_the_next_one_is_drawn_until_it_is_over(view: Callable[..., Any]) -> None:
    bench = view()
    assert newest(bench, "sky_markers")["pass"].action == Marker.DELETE
    begins_s = {0.5: bench.t_s - 100.0, 1.0: bench.t_s + 100.0}
    bench.give("pass_profiles", PassProfileList(profiles=[profile(t_s, azimuth) for azimuth, t_s in begins_s.items()]))
    for waited_s, action in ((0.0, Marker.ADD), (140.0, Marker.ADD), (20.0, Marker.DELETE)):
        bench.wait(waited_s)
        bench.run(0.2)
        marker = newest(bench, "sky_markers")["pass"]
        assert marker.action == action
        if action == Marker.ADD:
            assert math.atan2(marker.points[0].x, marker.points[0].y) == pytest.approx(1.0)


def test_where_robot_state_publisher_runs_it_alone_turns_the_joints(view: Callable[..., Any]) -> None:
    bench = view(station="vhf_uhf_yagi", **{"view.publish_tf": False})
    bench.run(0.4)
    assert [each.child_frame_id for each in bench.sent["/tf_static"][-1].transforms] == ["gs4/base_link"]
    assert not bench.sent["/tf"] + bench.sent["robot_description"]
    # Its beam may look into the Sun.
    assert "sun_zone" not in newest(bench, "beam_markers")
    # Directions are drawn three diameters of the antenna away.
    radius_m = 3.0 * size_m(read_station("vhf_uhf_yagi"))
    assert points(newest(bench, "beam_markers")["beam"])[1][0] == pytest.approx(radius_m)
    health = bench.health("view")
    assert (health.message, health.values["tf_published_by"]) == ("drawn", "robot_state_publisher")


def test_nothing_is_drawn_more_often_than_five_times_a_second(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(StationDescriptionNode, **{"view.period_s": 0.1})
    assert not bench.step("configure")
    assert "period_s" in bench.health("state").message
