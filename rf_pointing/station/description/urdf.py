"""The antenna as a URDF: two revolute joints, named and signed as `joint_states`; simple shapes.

    base_link (x east, y north, z up) -- azimuth --> azimuth_link -- elevation --> elevation_link
    elevation_link -- fixed --> beam

The origin of every link is the intersection of the axes.  The axes follow REP-103: joint positions
are the astronomical azimuth and the elevation, and x of `beam` is

    (cos el sin az, cos el cos az, sin el) in base_link, also for el > 90 deg.

Other mounts have the names of their axes, and their fixed rotations before the lower joint.

Limits are the mechanical stops, soft limits the travel that may be commanded.  Inertia is that of
the simulated plant, motors included; shapes are for the eye.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from rf_pointing.core import AXES, BASE, BEAM, Array
from rf_pointing.core.kinematics import UP, Kinematics, Turn
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.derive.band import BEAM_FACTOR_DEG, Band
from rf_pointing.station.description.description import StationDescription

WHITE, GREY = "0.92 0.92 0.90 1", "0.45 0.47 0.50 1"


def size_m(station: StationDescription) -> float:
    """Return the diameter of the reflector, or of the one that has the beam of other antennas."""
    if station.content.dish:
        return station.content.dish.diameter_m
    band = Band(station.content, station.default_band)
    return BEAM_FACTOR_DEG * band.wavelength_m / band.beamwidth_deg


class Joint(NamedTuple):
    """One axis: rotation from parent to child at position 0, and about what the child turns."""

    name: str
    parent: str
    child: str
    rpy: tuple[float, float, float]
    axis: tuple[float, float, float]


def joints_of(mount: Kinematics) -> tuple[Joint, Joint]:
    """Return the lower and the upper joint of a mount."""
    (lower, upper), turned = mount.axes, mount.matrix
    # An axis that counts the other way turns about the opposite of its pole, in a frame of its own.
    sense = 1.0 if np.linalg.det(turned) > 0.0 else -1.0
    turned = turned * np.array([sense, 1.0, 1.0])
    # Azimuth 0 looks ahead, along y, and is clockwise from above; elevation goes up.
    rpy = (0.0, 0.0, math.pi / 2.0) if mount.level else _rpy(turned @ Turn(UP, math.pi / 2.0).matrix())
    first = Joint(lower, BASE, f"{lower}_link", rpy, (0.0, 0.0, -sense))
    return first, Joint(upper, first.child, f"{upper}_link", (0.0, 0.0, 0.0), (0.0, -1.0, 0.0))


def _rpy(turn: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw about the fixed axes of the parent, of a rotation (3, 3)."""
    level = math.hypot(turn[0, 0], turn[1, 0])
    pitch = math.atan2(-turn[2, 0], level)
    # Where x points up or down, roll and yaw turn about the same axis.
    if level < 1e-9:
        return 0.0, pitch, math.atan2(-turn[0, 1], turn[1, 1])
    return math.atan2(turn[2, 1], turn[2, 2]), pitch, math.atan2(turn[1, 0], turn[0, 0])


def urdf(station: StationDescription) -> str:
    """Return the URDF of a station's antenna, as XML text with one element a line."""
    joints = joints_of(kinematics_of(station.content))
    robot = ElementTree.Element("robot", name=station.name)
    plant = station.parameters("antenna_servo")
    inertia = {axis: float(plant[f"plant.{axis}.inertia_kg_m2"]) for axis in AXES}
    size = size_m(station)
    base = _link(robot, BASE)
    _shape(base, "cylinder", {"radius": 0.07 * size, "length": 0.6 * size}, (0.0, 0.0, -0.36 * size), colour=GREY)
    azimuth = _link(robot, joints[0].child)
    # What turns with the elevation turns with the azimuth as well: the plant counts it in both.
    own = max(inertia[AXES[0]] - inertia[AXES[1]], 0.1 * inertia[AXES[0]])
    _inertial(azimuth, own, size)
    _shape(azimuth, "box", {"size": (0.12 * size, 0.24 * size, 0.12 * size)}, (0.0, 0.0, -0.02 * size), colour=GREY)
    elevation = _link(robot, joints[1].child)
    _inertial(elevation, inertia[AXES[1]], size)
    _reflector(elevation, size) if station.content.dish else _boom(elevation, size)
    _link(robot, BEAM)
    for axis, each in zip(AXES, joints, strict=True):
        joint = _joint(robot, each.name, "revolute", each.parent, each.child, each.rpy)
        ElementTree.SubElement(joint, "axis", xyz=_words(each.axis))
        _limits(joint, plant, station, axis, inertia[axis])
    _joint(robot, BEAM, "fixed", joints[1].child, BEAM, (0.0, 0.0, 0.0))
    ElementTree.indent(robot)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, encoding="unicode")}\n'


def _link(robot: ElementTree.Element, name: str) -> ElementTree.Element:
    return ElementTree.SubElement(robot, "link", name=name)


def _joint(
    robot: ElementTree.Element, name: str, kind: str, parent: str, child: str, rpy: tuple[float, ...]
) -> ElementTree.Element:
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    ElementTree.SubElement(joint, "origin", xyz="0 0 0", rpy=_words(rpy))
    return joint


def _limits(
    joint: ElementTree.Element, plant: Mapping[str, float], station: StationDescription, axis: str, inertia: float
) -> None:
    of = {
        name: math.radians(plant[f"plant.{axis}.{name}"])
        for name in ("travel_min_deg", "travel_max_deg", "rate_limit_deg_s", "acceleration_limit_deg_s2")
    }
    low, high = map(math.radians, station.content.mount.pair[AXES.index(axis)].travel_deg)
    ElementTree.SubElement(
        joint, "limit", lower=_number(of["travel_min_deg"]), upper=_number(of["travel_max_deg"]),
        velocity=_number(of["rate_limit_deg_s"]),
        effort=_number(inertia * of["acceleration_limit_deg_s2"]),
    )  # fmt: skip
    # The standard demands a gain of the controller that nobody applies here.
    ElementTree.SubElement(
        joint, "safety_controller", soft_lower_limit=_number(low), soft_upper_limit=_number(high), k_velocity="0"
    )


def _inertial(link: ElementTree.Element, inertia_kg_m2: float, size: float) -> None:
    """A thin disc of this inertia about its diameter; a description gives no mass."""
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz="0 0 0", rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=_number(16.0 * inertia_kg_m2 / size**2))
    # In the order of the standard: xx, xy, xz, yy, yz, zz.
    moments = (2.0 * inertia_kg_m2, 0.0, 0.0, inertia_kg_m2, 0.0, inertia_kg_m2)
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    ElementTree.SubElement(inertial, "inertia", dict(zip(names, map(_number, moments), strict=True)))


def _reflector(link: ElementTree.Element, size: float) -> None:
    """Rim, back structure and subreflector along x, where the beam leaves."""
    along_x = (0.0, math.pi / 2.0, 0.0)
    _shape(link, "cylinder", {"radius": 0.5 * size, "length": 0.04 * size}, (0.2 * size, 0.0, 0.0), along_x)
    _shape(link, "cylinder", {"radius": 0.25 * size, "length": 0.12 * size}, (0.12 * size, 0.0, 0.0), along_x)
    _shape(link, "cylinder", {"radius": 0.01 * size, "length": 0.35 * size}, (0.375 * size, 0.0, 0.0), along_x, GREY)
    _shape(link, "sphere", {"radius": 0.05 * size}, (0.55 * size, 0.0, 0.0))


def _boom(link: ElementTree.Element, size: float) -> None:
    """A boom along x with crossed elements."""
    _shape(link, "cylinder", {"radius": 0.015 * size, "length": size}, (0.4 * size, 0.0, 0.0), (0.0, math.pi / 2, 0.0))
    for share in (0.0, 0.2, 0.4, 0.6, 0.8):
        for box in ((0.01, 0.35, 0.01), (0.01, 0.01, 0.35)):
            scaled = tuple(size * edge for edge in box)
            _shape(link, "box", {"size": scaled}, (share * size, 0.0, 0.0), colour=GREY)


def _shape(
    link: ElementTree.Element, kind: str, measures: Mapping[str, float | tuple[float, ...]],
    centre: tuple[float, float, float], rpy: tuple[float, float, float] = (0.0, 0.0, 0.0),
    colour: str = WHITE,
) -> None:  # fmt: skip
    visual = ElementTree.SubElement(link, "visual")
    ElementTree.SubElement(visual, "origin", xyz=_words(centre), rpy=_words(rpy))
    geometry = ElementTree.SubElement(visual, "geometry")
    values = {name: _words(each if isinstance(each, tuple) else (each,)) for name, each in measures.items()}
    ElementTree.SubElement(geometry, kind, values)
    material = ElementTree.SubElement(visual, "material", name="white" if colour == WHITE else "grey")
    ElementTree.SubElement(material, "color", rgba=colour)


def _words(numbers: tuple[float, ...]) -> str:
    return " ".join(map(_number, numbers))


def _number(value: float) -> str:
    # Sixteen digits would only show the last bits of a conversion from degrees.
    return f"{value + 0.0:.12g}"
