"""What the layouts of RViz, Foxglove and PlotJuggler show is published: every topic, field, type and frame of them."""

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState

from rf_pointing.core import AXES
from rf_pointing.core.signals import FRAMES
from rf_pointing.ros.graph import TOPICS, VIEWS
from rf_pointing.ros.streams import frame_in

FOLDER = Path(__file__).parents[2] / "config" / "viewers"
NAMESPACE = "/gs1"
PUBLISHED = {
    topic.name if topic.name.startswith("/") else f"{NAMESPACE}/{topic.name}": topic for topic in (*TOPICS, *VIEWS)
}
SHOWN_AS = {
    "rviz_default_plugins/RobotModel": "std_msgs/String",
    "rviz_default_plugins/MarkerArray": "visualization_msgs/MarkerArray",
}
"""What a display of RViz subscribes to."""
TO_DEGREES = ".@rad2deg"
RADIANS = re.compile(r"azimuth|elevation|position|velocity|commanded|axis_error|rate")
"""Fields in rad or rad/s; a viewer shows degrees."""
NUMBER = re.compile(r"(double|float|u?int\d+|boolean)\b")


def kind_of(topic: str, path: list[str]) -> str:
    """Return the type of a field, `name[index]` or `name` at each step; raise for one that does not exist."""
    kind: Any = PUBLISHED[topic].message_type
    for depth, step in enumerate(path):
        name, _, index = step.partition("[")
        text = str(kind.get_fields_and_field_types()[name])
        listed = re.fullmatch(r"(?:sequence<(.+)>|(.+)\[(\d+)\])", text)
        if bool(index) != bool(listed):
            raise KeyError(f"{step} of {topic} is {text}")
        if listed and listed[3] and int(index[:-1]) >= int(listed[3]):
            raise KeyError(f"{step} of {topic} has {listed[3]} elements")
        text = (listed[1] or listed[2]) if listed else text
        if depth == len(path) - 1:
            return text
        kind = type(getattr(kind(), name))
    return PUBLISHED[topic].type_name


def foxglove_paths(configuration: dict[str, Any]) -> Iterator[tuple[str, str, list[str]]]:
    """Yield panel, topic and field path of whatever a layout shows."""
    for panel, config in configuration["configById"].items():
        paths = [each["value"] for each in config.get("paths", [])]
        paths += [config[key] for key in ("topicPath", "topicToRender") if key in config]
        for path in (*paths, *config.get("topics", {})):
            topic, *fields = path.removesuffix(TO_DEGREES).split(".")
            yield panel.partition("!")[0], topic, fields


def panels_of(layout: Any) -> Iterator[str]:
    if isinstance(layout, str):
        yield layout
    else:
        for side in ("first", "second"):
            yield from panels_of(layout[side])


def test_foxglove_shows_what_is_published() -> None:
    layout = json.loads((FOLDER / "foxglove.json").read_text())
    assert sorted(panels_of(layout["layout"])) == sorted(layout["configById"])
    found = list(foxglove_paths(layout))
    assert len(found) >= 12
    for panel, topic, fields in found:
        kind = kind_of(topic, fields)
        if panel == "Plot":
            assert NUMBER.fullmatch(kind), (topic, fields, kind)
        elif panel == "StateTransitions":
            assert kind in ("string", "boolean")
        elif panel == "DiagnosticSummary":
            assert kind == "diagnostic_msgs/DiagnosticArray"
        elif panel == "3D":
            assert kind in SHOWN_AS.values()
    scene = layout["configById"]["3D!station"]
    assert scene["followTf"] == frame_in(NAMESPACE, FRAMES[0])
    assert scene["topics"][f"{NAMESPACE}/robot_description"]["framePrefix"] == frame_in(NAMESPACE, "") + "/"


def test_plotjuggler_draws_what_is_published() -> None:
    curves = [str(each.get("name")) for each in ElementTree.parse(FOLDER / "plotjuggler.xml").iter("curve")]
    assert len(curves) >= 20
    for curve in curves:
        assert NUMBER.fullmatch(plotted(curve)), curve


def test_angles_are_shown_in_degrees_under_titles_that_say_so() -> None:
    shown: dict[str, list[tuple[str, bool]]] = {}
    for panel in json.loads((FOLDER / "foxglove.json").read_text())["configById"].values():
        for path in (each["value"] for each in panel.get("paths", []) if "title" in panel):
            shown.setdefault(panel["title"], []).append((path, path.endswith(TO_DEGREES)))
    for area in ElementTree.parse(FOLDER / "plotjuggler.xml").iter("DockArea"):
        for curve in area.iter("curve"):
            scaled = [float(str(each.get("value_scale"))) for each in curve.iter("options")]
            assert scaled in ([], [pytest.approx(math.degrees(1.0), rel=1e-12)])
            shown.setdefault(str(area.get("name")), []).append((str(curve.get("name")), bool(scaled)))
    assert len(shown) > 10
    for title, paths in shown.items():
        for path, degrees in paths:
            field = path.removesuffix(TO_DEGREES).removeprefix(NAMESPACE)
            assert degrees == bool(RADIANS.search(field)) == ("[deg" in title), (title, path)
    assert "rad]" not in str(shown)


def plotted(curve: str) -> str:
    """Return the type behind a curve; PlotJuggler names joints by their names, and other lists by index."""
    topic = max((name for name in PUBLISHED if curve.startswith(f"{name}/")), key=len)
    fields = curve.removeprefix(f"{topic}/").split("/")
    if PUBLISHED[topic].message_type is JointState:
        joint, quantity = fields
        assert joint in AXES
        fields = [f"{quantity}[0]"]
    return kind_of(topic, fields)


def test_rviz_shows_what_is_published_in_frames_that_exist() -> None:
    manager = yaml.safe_load((FOLDER / "station.rviz").read_text())["Visualization Manager"]
    frames = {frame_in(NAMESPACE, each) for each in FRAMES}
    assert manager["Global Options"]["Fixed Frame"] in frames
    assert manager["Views"]["Current"]["Target Frame"] in frames
    shown = {}
    for display in manager["Displays"]:
        assert display.get("Reference Frame", manager["Global Options"]["Fixed Frame"]) in frames
        for key in ("Topic", "Description Topic"):
            if key in display:
                shown[display[key]["Value"]] = display[key]["Durability Policy"]
                assert PUBLISHED[display[key]["Value"]].type_name == SHOWN_AS[display["Class"]]
        if display["Class"].endswith("RobotModel"):
            assert display["TF Prefix"] == frame_in(NAMESPACE, "")
    # A map is not a display of RViz.
    assert set(shown) == {f"{NAMESPACE}/{topic.name}" for topic in VIEWS if topic.name != "site"}
    for name, durability in shown.items():
        # What is latched would never reach a display that does not ask for it.
        assert durability == ("Transient Local" if kept(PUBLISHED[name].qos) else "Volatile")


def kept(qos: QoSProfile) -> bool:
    return bool(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.parametrize(
    ("topic", "path"),
    [
        ("/gs1/no_such", []),
        ("/gs1/target", ["azimut"]),
        ("/gs1/target", ["azimuth[0]"]),
        ("/gs1/antenna_status", ["commanded"]),
        ("/gs1/antenna_status", ["commanded[2]"]),
    ],
)
def test_a_topic_or_field_that_does_not_exist_is_noticed(topic: str, path: list[str]) -> None:
    with pytest.raises(KeyError):
        kind_of(topic, path)
