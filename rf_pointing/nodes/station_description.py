"""Executable `station_description`: the antenna as viewers show it.

Subscribes: joint_states, target, pass_profiles.
Publishes: beam_markers (5 Hz: beam, target, the zone around the Sun) and sky_markers (latched:
horizon mask, the pass in progress or the next one) as visualization_msgs/MarkerArray; site
(latched, NavSatFix) and /tf_static (where the antenna stands on the Earth); and unless
robot_state_publisher does it (view.publish_tf) robot_description (latched) and /tf.  Parameters:
view.*.

The tree is earth (REP-105) -> base_link (x east, y north, z up, at the intersection of the axes)
-> azimuth_link -> elevation_link -> beam, all but earth below the antenna's namespace.  The beam is
that of the joints: errors of the mount, some tenths of a degree at most, are not drawn.
"""

import math
from typing import Any

from rclpy.qos import QoSProfile
from rf_pointing_msgs.msg import PassProfileList, Target
from sensor_msgs.msg import JointState, NavSatFix
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    # ROS without tf2: nobody there can use a transform.
    TFMessage = None

from rf_pointing.core.signals import BASE, BEAM
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.planning import PassProfile
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros import convert_description as draw
from rf_pointing.ros.diagnostics import Health
from rf_pointing.ros.graph import DESCRIPTION
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.streams import frame_in
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.derive.band import Band
from rf_pointing.station.description.urdf import size_m, urdf
from rf_pointing.station.parameters import ViewParams

TF_PERIOD_S = 0.05
"""Period of /tf, which is the default of robot_state_publisher as well."""
TF = QoSProfile(depth=100)
SIZES = 3.0
"""Radius of the sphere of directions, in diameters of the antenna."""


class StationDescriptionNode(StationNode):
    """Draws what others publish; nothing depends on it."""

    def __init__(self) -> None:
        super().__init__(DESCRIPTION)
        self._profiles: list[PassProfile] = []
        self._drawn: PassProfile | None = None

    def configure(self) -> None:
        params: ViewParams = self.parameters.value("view")
        content = self.station.content
        self._mount = kinematics_of(content)
        self._radius_m = params.radius_m or SIZES * size_m(self.station)
        self.use_band()
        self._zone_rad = math.radians(self.station.content.sun.radius_deg)
        self._base, self._beam = (frame_in(self.get_namespace(), name) for name in (BASE, BEAM))
        self._sun = SolarDirection(SunParams(watched=self._zone_rad > 0.0, site=self.station.site))
        self._profiles, self._drawn = [], None
        target, joints = convert.target_from_message, convert.joints_from_message
        self._targets = self.listen_latest(Target, "target", target, STREAM, required=True)
        self._joints = self.listen_latest(JointState, "joint_states", joints, STREAM, required=True)
        self.listen(PassProfileList, "pass_profiles", self._on_profiles, LATCHED)
        self._moving = self.publisher(MarkerArray, "beam_markers", STREAM)
        self._latched = self.publisher(MarkerArray, "sky_markers", LATCHED)
        fix = draw.site_fix(self.station.site, self._base, self.now_s())
        self.publisher(NavSatFix, "site", LATCHED).publish(fix)
        self._tf = self._describe(params.publish_tf)
        self._draw_sky()
        self.diagnostics.add("view", self._health)

    def use_band(self) -> None:
        self._beamwidth_rad = math.radians(Band(self.station.content, self.band).beamwidth_deg)

    def _describe(self, joints: bool) -> Any:
        """Publish URDF and what is fixed; return the publisher of the joints' transforms."""
        if joints:
            self.publisher(String, "robot_description", LATCHED).publish(String(data=urdf(self.station)))
        if TFMessage is None:
            return None
        namespace = self.get_namespace()
        fixed = [
            draw.site_transform(self.station.site, namespace),
            *([draw.beam_transform(namespace, self._mount)] * joints),
        ]
        self.publisher(TFMessage, "/tf_static", LATCHED).publish(TFMessage(transforms=fixed))
        return self.publisher(TFMessage, "/tf", TF) if joints else None

    def activate(self) -> None:
        if self._tf is not None:
            self.every(TF_PERIOD_S, self._turn)
        self.every(self.parameters.value("view").period_s, self._draw)

    def _turn(self, _now_s: float) -> None:
        reading = self._joints.take()
        if reading is not None:
            turned = draw.joint_transforms(reading, self.get_namespace(), self._mount)
            self._tf.publish(TFMessage(transforms=turned))

    def _draw(self, now_s: float) -> None:
        markers = draw.beam_markers(self._beam, self._radius_m, self._beamwidth_rad)
        # Targets are published ahead of their time.
        if target := self._targets.take(now_s):
            markers += draw.target_markers(target, self._base, self._radius_m)
        if direction := self._sun.at(now_s):
            markers.append(draw.sun_marker(direction, self._zone_rad, self._base, self._radius_m))
        self._moving.publish(draw.marker_array(markers, now_s))
        if self._pass_at(now_s) is not self._drawn:
            self._draw_sky()

    def _on_profiles(self, message: PassProfileList) -> None:
        self._profiles = [convert_planning.profile_from_message(each) for each in message.profiles]
        self._draw_sky()

    def _draw_sky(self) -> None:
        self._drawn = self._pass_at(self.now_s())
        mask = draw.mask_marker(self.station.mask, self._base, self._radius_m)
        profile = draw.pass_marker(self._drawn, self._base, self._radius_m)
        self._latched.publish(draw.marker_array([mask, profile]))

    def _pass_at(self, now_s: float) -> PassProfile | None:
        """Return the pass in progress, or the next one."""
        return next((each for each in self._profiles if each.t_s[-1] >= now_s), None)

    def _health(self) -> Health:
        params: ViewParams = self.parameters.value("view")
        source = "this node" if self._tf is not None else "no node" if params.publish_tf else "robot_state_publisher"
        words = "tf2_msgs is not installed: no tf is published" if source == "no node" else "drawn"
        return Health(message=words, values={"radius_m": self._radius_m, "tf_published_by": source})


main = StationDescriptionNode.main
