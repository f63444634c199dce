"""Pictures of a station for viewers: transforms on /tf and markers, from the core's signals.

Directions are drawn on a sphere around the intersection of the axes.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Quaternion, TransformStamped
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from rf_pointing.core import BASE, BEAM, LEVEL, JointReading, Kinematics, Target
from rf_pointing.core.angles import unit_vector_from_azel
from rf_pointing.ephemeris import Site
from rf_pointing.planning import HorizonMask, PassProfile
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.streams import frame_in
from rf_pointing.station.description.urdf import joints_of

EARTH = "earth"
"""Earth-centred, Earth-fixed, of REP-105: the one frame that all antennas share."""
CIRCLE = np.linspace(0.0, 2.0 * math.pi, 49)
GREEN, BLUE, YELLOW, BROWN = (0.2, 0.8, 0.4, 1.0), (0.2, 0.5, 1.0, 1.0), (1.0, 0.8, 0.1, 1.0), (0.7, 0.4, 0.2, 1.0)
FRESH_S = 1.5
"""How long a viewer shows what is not renewed."""
Directions = NDArray[np.float64]


def joint_transforms(reading: JointReading, namespace: str, mount: Kinematics = LEVEL) -> list[TransformStamped]:
    """Return the transforms of both joints, at the stamp of the encoders."""
    transforms = []
    for joint, angle_rad in zip(joints_of(mount), reading.position_rad, strict=True):
        turn = Rotation.from_euler("xyz", joint.rpy) * Rotation.from_rotvec(angle_rad * np.array(joint.axis))
        names = frame_in(namespace, joint.parent), frame_in(namespace, joint.child)
        transforms.append(_transform(*names, (0.0, 0.0, 0.0), turn, stamp_from_seconds(reading.t_s)))
    return transforms


def beam_transform(namespace: str, mount: Kinematics = LEVEL) -> TransformStamped:
    """Return the fixed joint of the URDF."""
    names = frame_in(namespace, joints_of(mount)[1].child), frame_in(namespace, BEAM)
    return _transform(*names, (0.0, 0.0, 0.0), Rotation.identity(), Time())


def site_transform(site: Site, namespace: str) -> TransformStamped:
    """Return where the antenna stands on the Earth: it joins the antennas' trees to one."""
    # The rows of `axes` are east, north, up; the columns of the rotation are what x, y, z become.
    turn = Rotation.from_matrix(np.array(site.axes).T)
    return _transform(EARTH, frame_in(namespace, BASE), site.position_m, turn, Time())


def site_fix(site: Site, frame_id: str, t_s: float) -> NavSatFix:
    """Return where the antenna stands, in degrees, for maps; a survey has no covariance."""
    fix = NavSatFix(
        # A map leaves out what has no fix.
        status=NavSatStatus(status=NavSatStatus.STATUS_FIX),
        latitude=math.degrees(site.latitude_rad),
        longitude=math.remainder(math.degrees(site.longitude_rad), 360.0),
        altitude=site.altitude_m,
    )
    fix.header.frame_id, fix.header.stamp = frame_id, stamp_from_seconds(t_s)
    return fix


def beam_markers(frame_id: str, radius_m: float, beamwidth_rad: float) -> list[Marker]:
    """Return the beam as an arrow and the circle of its half power, in the frame of the beam."""
    arrow = _marker("beam", frame_id, Marker.ARROW, GREEN, 0.01 * radius_m)
    arrow.scale.y = arrow.scale.z = 0.02 * radius_m
    arrow.points = [Point(), Point(x=radius_m)]
    # A beam of some mdeg would be a point: what is drawn is at least a degree wide.
    half = max(0.5 * beamwidth_rad, math.radians(0.5))
    rim = np.column_stack(
        [np.full_like(CIRCLE, math.cos(half)), math.sin(half) * np.cos(CIRCLE), math.sin(half) * np.sin(CIRCLE)]
    )
    circle = _line("half_power_beam", frame_id, radius_m * rim, GREEN, 0.005 * radius_m)
    arrow.frame_locked = circle.frame_locked = True
    return [arrow, circle]


def target_markers(target: Target, frame_id: str, radius_m: float) -> list[Marker]:
    """Return the target as a sphere with its name."""
    place = _points(radius_m * unit_vector_from_azel([target.azimuth_rad], [target.elevation_rad]))[0]
    sphere = _marker("target", frame_id, Marker.SPHERE, BLUE, 0.03 * radius_m)
    sphere.scale.y = sphere.scale.z = sphere.scale.x
    name = _marker("target_name", frame_id, Marker.TEXT_VIEW_FACING, BLUE, 0.0)
    name.scale.z, name.text = 0.05 * radius_m, target.name
    for marker in (sphere, name):
        marker.pose.position = place
        marker.lifetime.sec, marker.lifetime.nanosec = 1, round((FRESH_S - 1.0) * 1e9)
    name.pose.position = Point(x=place.x, y=place.y, z=place.z + 0.05 * radius_m)
    return [sphere, name]


def sun_marker(direction_rad: tuple[float, float], zone_rad: float, frame_id: str, radius_m: float) -> Marker:
    """Return the zone around the Sun that the beam keeps out of."""
    rim = _circle_around(unit_vector_from_azel(*direction_rad), max(zone_rad, math.radians(0.27)))
    marker = _line("sun_zone", frame_id, radius_m * rim, YELLOW, 0.005 * radius_m)
    marker.lifetime.sec, marker.lifetime.nanosec = 1, round((FRESH_S - 1.0) * 1e9)
    return marker


def mask_marker(mask: HorizonMask, frame_id: str, radius_m: float) -> Marker:
    """Return the horizon mask, a point each degree of azimuth and at its surveyed points."""
    azimuth = np.unique(np.concatenate([np.radians(np.arange(361.0)), mask.azimuth_rad]))
    places = unit_vector_from_azel(azimuth, mask.lowest_all(azimuth))
    return _line("mask", frame_id, radius_m * places, BROWN, 0.008 * radius_m)


def pass_marker(profile: PassProfile | None, frame_id: str, radius_m: float) -> Marker:
    """Return the marker of the pass's path, or one that deletes the previous path."""
    if profile is None:
        marker = _marker("pass", frame_id, Marker.LINE_STRIP, BLUE, 0.0)
        marker.action = Marker.DELETE
        return marker
    places = unit_vector_from_azel(*profile.position_rad.T)
    return _line("pass", frame_id, radius_m * places, BLUE, 0.005 * radius_m)


def marker_array(markers: Sequence[Marker], t_s: float | None = None) -> MarkerArray:
    """Return the message; without a time a viewer takes the newest transform."""
    for marker in markers:
        marker.header.stamp = Time() if t_s is None or marker.frame_locked else stamp_from_seconds(t_s)
    return MarkerArray(markers=markers)


def _circle_around(direction: Directions, radius_rad: float) -> Directions:
    """Return directions (n, 3) at an angle from one."""
    # Any axis that is not along it spans the plane across it.
    other = np.eye(3)[int(np.argmin(np.abs(direction)))]
    first = np.cross(direction, other)
    first /= np.linalg.norm(first)
    second = np.cross(direction, first)
    across = np.outer(np.cos(CIRCLE), first) + np.outer(np.sin(CIRCLE), second)
    return np.asarray(math.cos(radius_rad) * direction + math.sin(radius_rad) * across)


def _line(kind: str, frame_id: str, places: Directions, colour: tuple[float, ...], width_m: float) -> Marker:
    marker = _marker(kind, frame_id, Marker.LINE_STRIP, colour, width_m)
    marker.points = _points(places)
    return marker


def _marker(kind: str, frame_id: str, shape: int, colour: tuple[float, ...], width_m: float) -> Marker:
    red, green, blue, alpha = colour
    marker = Marker(ns=kind, type=shape, action=Marker.ADD, color=ColorRGBA(r=red, g=green, b=blue, a=alpha))
    marker.header.frame_id, marker.scale.x, marker.pose.orientation.w = frame_id, width_m, 1.0
    return marker


def _points(places: Directions) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in places.tolist()]


def _transform(parent: str, child: str, place_m: Sequence[float], turn: Rotation, stamp: Any) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    message.transform.translation.x, message.transform.translation.y, message.transform.translation.z = place_m
    x, y, z, w = turn.as_quat().tolist()
    message.transform.rotation = Quaternion(x=x, y=y, z=z, w=w)
    return message
