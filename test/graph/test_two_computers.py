"""A station on two computers, which are network namespaces: its hops, a cut link, and clocks that differ."""

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")

pytestmark = pytest.mark.graph
SCRIPT = Path(__file__).parents[2] / "benchmarks" / "two_computers.py"
OFFSET_S = 0.05


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("two_computers", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if reason := module.why_not():
        pytest.skip(reason)
    if not module.FAKETIME:
        pytest.skip("no libfaketime: the clock of the second computer cannot be set ahead")
    return module


@pytest.fixture(scope="module")
def flown(script: ModuleType, ros_domain: int) -> Any:
    """A pass over two computers with the discovery of an installation, the clock of the second one ahead."""
    return script.fly(offset_s=OFFSET_S, seconds=14.0)


def test_messages_hop_within_milliseconds_and_none_is_lost(flown: dict[str, Any]) -> None:
    assert flown["hops"] == flown["hops_sent"] > 500
    assert flown["hop_median_ms"] < 5.0
    assert flown["lost_before_cut"] == 0


def test_a_clock_that_is_50_ms_ahead_is_a_warning_with_its_size(flown: dict[str, Any]) -> None:
    assert flown["clocks_level"] == 1
    sentences = flown["clocks"].split("; ")
    assert [each.split(" is ")[0] for each in sentences] == ["the clock of antenna_servo", "the clock of rf_receiver"]
    for each in sentences:
        assert each.endswith(" ms ahead of this computer's")
        assert float(each.split(" is ")[1].split()[0]) == pytest.approx(1e3 * OFFSET_S, abs=10.0)


def test_a_pass_goes_on_after_a_cut_of_five_seconds(flown: dict[str, Any], script: ModuleType) -> None:
    assert flown["silent_s"] > script.CUT_S - 0.5
    assert flown["fault"] == ""
    assert flown["antenna_back_s"] < 5.0
    assert flown["held_again_s"] < 20.0
    assert script.CUT_S - 1.5 < flown["seconds_lost_by_cut"] < 30.0
    assert flown["end"] == "the goal was cancelled"
