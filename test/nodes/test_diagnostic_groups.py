"""What diagnostic_aggregator makes of /diagnostics: the analyzers that are shipped, by its own rules, on real names."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus

from rf_pointing.nodes.antenna_servo import AntennaServo
from rf_pointing.nodes.bias_calibrator import BiasCalibrator
from rf_pointing.nodes.conscan_tracker import ConscanTrackerNode
from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.monopulse_tracker import MonopulseTrackerNode
from rf_pointing.nodes.operator_page import OperatorPage
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.nodes.simulation_clock import SimulationClock
from rf_pointing.nodes.station_alarms import AlarmNode
from rf_pointing.nodes.station_description import StationDescriptionNode
from rf_pointing.nodes.station_executive import StationExecutive
from rf_pointing.ros.graph import ALARMS, DESCRIPTION, EXECUTIVE, NODES, OPERATOR_PAGE
from rf_pointing.ros.managed import ManagedNode
from test.nodes.bench import Bench

ROOT = Path(__file__).parents[2]
ANTENNA = "gs1"
KINDS: tuple[type[ManagedNode], ...] = (
    AntennaServo, BiasCalibrator, ConscanTrackerNode, EphemerisPublisher, MonopulseTrackerNode, OperatorPage,
    PointingControllerNode, RfReceiver, SimulationClock, AlarmNode, StationDescriptionNode, StationExecutive,
)  # fmt: skip
FOLDERS: dict[Any, str] = {
    StationExecutive: "executive.folder", AlarmNode: "folder", BiasCalibrator: "calibrator.folder",
    OperatorPage: "page.reports",
}  # fmt: skip
"""Of the nodes that use files, whatever they do."""
KEY = re.compile(r"[a-z][a-z0-9_]*|(lost|refused|waited|abandoned) [a-z0-9_/ ]+")
"""A word of a script, or what became of the messages of a topic."""
UNIT = re.compile(r"_(s|h|m|deg|deg_s|k|db|db_hz|hz|m_s)$")


@pytest.fixture(scope="module")
def published(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> list[DiagnosticStatus]:
    """Return what every node of one antenna publishes on /diagnostics when it is configured."""
    folder = tmp_path_factory.mktemp("nodes")
    found: list[DiagnosticStatus] = []
    for kind in KINDS:
        given = {FOLDERS[kind]: str(folder)} if kind in FOLDERS else {}
        if kind is OperatorPage:
            given["page.port"] = 0
        with pytest.MonkeyPatch.context() as patch:
            bench = Bench(kind, patch, ros_domain, namespace=f"/{ANTENNA}", **given)
            try:
                assert bench.step("configure"), bench.health("state").message
                bench.node.diagnostics.publish()
                found += bench.sent["/diagnostics"][-1].status
            finally:
                bench.close()
    return found


def listed(value: str | list[str]) -> list[str]:
    return [value] if isinstance(value, str) else value


def matches(analyzer: dict[str, Any], name: str) -> bool:
    """The rules of diagnostic_aggregator's GenericAnalyzer on the name of a status."""
    rules = {key: listed(value) for key, value in analyzer.items() if key not in ("type", "path")}
    starts = rules.get("startswith", rules.get("find_and_remove_prefix", []))
    return (
        any(re.fullmatch(each, name) for each in rules.get("regex", []))
        or name in (*rules.get("expected", []), *rules.get("name", []))
        or any(name.startswith(each) for each in starts)
        or any(each in name for each in rules.get("contains", []))
    )


def shown(analyzer: dict[str, Any], name: str) -> str:
    """The name in the aggregator's output: a slash becomes a space, and a prefix is removed."""
    text = name.replace("/", " ")
    for prefix in listed(analyzer.get("remove_prefix", analyzer.get("find_and_remove_prefix", []))):
        text = text.removeprefix(prefix.replace("/", " "))
    return text.strip()


def analyzers() -> dict[str, dict[str, Any]]:
    group = yaml.safe_load((ROOT / "config/diagnostic_analyzers.yaml").read_text())
    antenna = group["analyzers"]["ros__parameters"][ANTENNA]
    assert antenna["type"] == "diagnostic_aggregator/AnalyzerGroup"
    return dict(antenna["analyzers"])


def test_every_status_is_in_one_group_under_a_name_of_its_own(published: list[DiagnosticStatus]) -> None:
    seen: dict[tuple[str, str], str] = {}
    for status in published:
        (group,) = [name for name, each in analyzers().items() if matches(each, status.name)]
        place = group, shown(analyzers()[group], status.name)
        assert place not in seen, (place, seen.get(place), status.name)
        seen[place] = status.name
    assert {group for group, _ in seen} == set(analyzers())
    assert ("antenna", "drive") in seen
    assert ("sensors", "monopulse_tracker: state") in seen


def test_what_is_expected_is_published(published: list[DiagnosticStatus]) -> None:
    names = {status.name for status in published}
    wanted = {name for each in analyzers().values() for name in listed(each.get("expected", []))}
    assert len(wanted) == 6
    assert wanted <= names


def test_another_antenna_is_in_no_group(published: list[DiagnosticStatus]) -> None:
    for status in published:
        for other in ("gs10", "gs2", "north/gs1"):
            name = status.name.replace(f"{ANTENNA}/", f"{other}/", 1)
            assert not any(matches(each, name) for each in analyzers().values()), name


def test_names_and_hardware_ids_are_those_of_the_nodes(published: list[DiagnosticStatus]) -> None:
    nodes = set()
    for status in published:
        node, _, check = status.name.partition(": ")
        assert re.fullmatch(r"[a-z][a-z ]*", check), status.name
        assert status.hardware_id == f"/{node}"
        nodes.add(node.removeprefix(f"{ANTENNA}/"))
    assert nodes == {*NODES, ALARMS, EXECUTIVE, DESCRIPTION, OPERATOR_PAGE}


def test_keys_are_words_and_numbers_with_a_fraction_have_a_unit(published: list[DiagnosticStatus]) -> None:
    keys = [(status.name, pair.key, pair.value) for status in published for pair in status.values]
    assert len(keys) > 40
    for name, key, value in keys:
        assert KEY.fullmatch(key), (name, key)
        if re.fullmatch(r"-?\d+\.\d+(e[+-]?\d+)?", value):
            assert UNIT.search(key), (name, key, value)
