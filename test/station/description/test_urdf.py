"""The URDF of a station: forward kinematics by the URDF's own rules gives the beam of docs/conventions.md."""

import math
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from rf_pointing.commands import check_station
from rf_pointing.core import AXES, BASE, BEAM, unit_vector_from_azel
from rf_pointing.station.derive.axes import kinematics_of
from rf_pointing.station.derive.band import BEAM_FACTOR_DEG, Band
from rf_pointing.station.description import read_station, shipped_stations
from rf_pointing.station.description.urdf import size_m, urdf

ROUNDED_RAD = 1e-11
"""Of the numbers in the text."""


def numbers(text: str | None) -> list[float]:
    assert text is not None
    return [float(word) for word in text.split()]


def turned(axis: list[float], angle_rad: float) -> np.ndarray:
    """Rodrigues' rotation about a unit vector."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle_rad) * cross + (1.0 - math.cos(angle_rad)) * cross @ cross


def fixed_axes(rpy: list[float]) -> np.ndarray:
    """Rz(yaw) Ry(pitch) Rx(roll), as the URDF standard defines rpy."""
    roll, pitch, yaw = rpy
    return turned([0, 0, 1], yaw) @ turned([0, 1, 0], pitch) @ turned([1, 0, 0], roll)


def joints_of(text: str) -> list[ElementTree.Element]:
    """Return the joints from the root to the beam."""
    root = ElementTree.fromstring(text)
    links = [link.get("name") for link in root.iter("link")]
    joints = {joint.find("parent").get("link"): joint for joint in root.iter("joint")}  # type: ignore[union-attr]
    assert len(joints) == len(links) - 1
    lower, upper = (joint.get("name") for joint in joints.values() if joint.get("type") == "revolute")
    frames = (BASE, f"{lower}_link", f"{upper}_link", BEAM)
    assert tuple(links) == frames
    for parent, child in pairwise(frames):
        assert joints[parent].find("child").get("link") == child  # type: ignore[union-attr]
    return [joints[parent] for parent in frames[:-1]]


def rotation(text: str, position: dict[str, float]) -> np.ndarray:
    """Return what takes components in `beam` to `base_link`."""
    total = np.eye(3)
    for joint in joints_of(text):
        origin = joint.find("origin")
        assert origin is not None
        assert numbers(origin.get("xyz")) == [0.0, 0.0, 0.0]
        total = total @ fixed_axes(numbers(origin.get("rpy")))
        if joint.get("type") != "fixed":
            axis = joint.find("axis")
            assert axis is not None
            total = total @ turned(numbers(axis.get("xyz")), position[str(joint.get("name"))])
    return total


@pytest.mark.parametrize("name", shipped_stations())
def test_the_beam_looks_where_the_joint_states_say_also_over_the_top(name: str, random: np.random.Generator) -> None:
    station = read_station(name)
    text, mount = urdf(station), kinematics_of(station.content)
    axes = mount.axes
    limits = {str(joint.get("name")): joint.find("limit") for joint in joints_of(text)}
    travel = {axis: (float(limits[axis].get("lower")), float(limits[axis].get("upper"))) for axis in axes}  # type: ignore
    for share in random.uniform(size=(200, 2)):
        angles = [low + each * (high - low) for each, (low, high) in zip(share, travel.values(), strict=True)]
        turn = rotation(text, dict(zip(axes, angles, strict=True)))
        assert np.allclose(turn[:, 0], unit_vector_from_azel(*angles) @ mount.matrix.T, atol=1e-10)
        if not mount.level:
            continue
        # y of the beam is level and to its left, so a beam over the top is upside down and not mirrored.
        assert np.allclose(turn[:, 1], [-math.cos(angles[0]), math.sin(angles[0]), 0.0], atol=1e-10)
    if name in ("leo_3m7", "vhf_uhf_yagi"):
        assert travel["elevation"][1] > math.radians(180.0)


@pytest.mark.parametrize("name", shipped_stations())
def test_limits_are_those_of_the_description(name: str) -> None:
    station = read_station(name)
    plant = station.parameters("antenna_servo")
    for joint, axis, section in zip(joints_of(urdf(station)), AXES, station.content.mount.pair, strict=False):
        limit, soft = joint.find("limit"), joint.find("safety_controller")
        assert limit is not None
        assert soft is not None
        wanted = {
            "lower": plant[f"plant.{axis}.travel_min_deg"],
            "upper": plant[f"plant.{axis}.travel_max_deg"],
            "velocity": section.rate_deg_s,
        }
        for key, degrees in wanted.items():
            assert float(str(limit.get(key))) == pytest.approx(math.radians(degrees), abs=ROUNDED_RAD)
        soft_deg = [math.degrees(float(str(soft.get(f"soft_{end}_limit")))) for end in ("lower", "upper")]
        assert soft_deg == pytest.approx(section.travel_deg, abs=1e-9)
        assert float(str(limit.get("effort"))) > 0.0


def shapes(name: str) -> dict[str, list[tuple[str, list[float]]]]:
    """Return kind and measures, centre and angles, of every shape of each link, in sizes of the antenna."""
    station = read_station(name)
    size, found = size_m(station), {}
    for link in ElementTree.fromstring(urdf(station)).iter("link"):
        rows = []
        for visual in link.iter("visual"):
            origin, body = visual.find("origin"), visual.find("geometry")[0]  # type: ignore[index]
            measures = [each for text in body.attrib.values() for each in numbers(text)]
            lengths = np.array([*measures, *numbers(origin.get("xyz"))]) / size  # type: ignore[union-attr]
            rows.append((body.tag, [*lengths.tolist(), *numbers(origin.get("rpy"))]))  # type: ignore[union-attr]
        found[str(link.get("name"))] = rows
    return found


@pytest.mark.parametrize("name", shipped_stations())
def test_shapes_lie_on_the_axis_that_turns_them_and_touch_each_other(name: str) -> None:
    """The pedestal is upright below the axes; dish or boom lie along x of the elevation link, the beam."""
    found, (lower, upper) = shapes(name), read_station(name).content.mount.kind.axes
    (kind, (_, length, *centre, roll, pitch, yaw)) = found["base_link"][0]
    assert (kind, centre[:2], roll, pitch, yaw) == ("cylinder", [0.0, 0.0], 0.0, 0.0, 0.0)
    top = centre[2] + 0.5 * length
    assert -0.1 < top < 0.0, "it ends below the axes, in the box that turns with the azimuth"
    (_, (_, _, height, *middle, _, _, _)) = found[f"{lower}_link"][0]
    assert middle[2] - 0.5 * height < top + 1e-9
    assert middle[2] + 0.5 * height >= 0.0
    spans = []
    for kind, row in found[f"{upper}_link"]:
        *measures, x, y, z, roll, pitch, yaw = row
        assert (y, z, roll, yaw) == (0.0, 0.0, 0.0, 0.0)
        assert pitch == pytest.approx(0.5 * math.pi if kind == "cylinder" else 0.0)
        half = {"cylinder": 0.5 * measures[-1], "sphere": measures[0], "box": 0.5 * measures[0]}[kind]
        spans.append((x - half, x + half))
    spans.sort()
    assert spans[0][0] < 0.1
    assert spans[-1][1] < 1.0
    end = spans[0][1]
    for begin, far in spans[1:]:
        assert begin <= end + 1e-9
        end = max(end, far)
    if read_station(name).content.dish:
        assert max(row[0] for kind, row in found[f"{upper}_link"] if kind == "cylinder") == pytest.approx(0.5)


UPRIGHT, ALONG_X = [0.0, 0.0, 0.0], [0.0, 0.5 * math.pi, 0.0]


@pytest.mark.parametrize("name", shipped_stations())
def test_masses_moments_and_efforts_are_those_of_the_simulated_plant(name: str) -> None:
    """A thin disc: m d^2 / 16 about its diameter, twice that about its axis; what turns in both is counted once."""
    station = read_station(name)
    plant, size = station.parameters("antenna_servo"), size_m(station)
    whole, upper = (plant[f"plant.{axis}.inertia_kg_m2"] for axis in AXES)
    text = urdf(station)
    bodies = list(ElementTree.fromstring(text).iter("inertial"))
    for body, wanted in zip(bodies, (max(whole - upper, 0.1 * whole), upper), strict=True):
        mass = float(str(body.find("mass").get("value")))  # type: ignore[union-attr]
        assert mass * size**2 / 16.0 == pytest.approx(wanted, rel=1e-9)
        moments = {key: float(str(value)) for key, value in body.find("inertia").attrib.items()}  # type: ignore
        assert moments == pytest.approx(
            {"ixx": 2.0 * wanted, "iyy": wanted, "izz": wanted, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}, rel=1e-9
        )
        assert body.find("origin").attrib == {"xyz": "0 0 0", "rpy": "0 0 0"}  # type: ignore[union-attr]
    for joint, axis, inertia in zip(joints_of(text), AXES, (whole, upper), strict=False):
        bend = math.radians(plant[f"plant.{axis}.acceleration_limit_deg_s2"])
        assert float(str(joint.find("limit").get("effort"))) == pytest.approx(inertia * bend, rel=1e-9)  # type: ignore


def test_the_size_is_the_reflectors_or_that_of_the_beam() -> None:
    """Of the band's wavelength, 70 deg of it over the beamwidth."""
    assert size_m(read_station("leo_3m7")) == 3.7
    yagi = read_station("vhf_uhf_yagi")
    band = Band(yagi.content, yagi.default_band)
    assert size_m(yagi) == pytest.approx(BEAM_FACTOR_DEG * band.wavelength_m / band.beamwidth_deg)


def test_the_command_prints_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as ended:
        check_station.main(["leo_3m7", "--urdf"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.strip() == urdf(read_station("leo_3m7")).strip()
