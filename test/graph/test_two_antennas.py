"""Two antennas that share a pass, on two network namespaces and two real rotctld: one transmits, whatever fails."""

import shutil
from types import ModuleType
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")

from test.conftest import within
from test.scripts import script_module

pytestmark = [pytest.mark.graph, pytest.mark.alone]
WARNED_S, SILENT_S = 2.0, 10.0
"""Longest gap in which nobody receives, or transmits: where the antenna says that it fails, and where it cannot."""
LEGS = {"fault": WARNED_S, "drive": WARNED_S, "cut": SILENT_S, "executive": SILENT_S}


@pytest.fixture(scope="module")
def script() -> ModuleType:
    computers = script_module("benchmarks/two_computers.py")
    module = script_module("benchmarks/two_antennas.py")
    if reason := computers.why_not():
        pytest.skip(reason)
    if missing := [each for each in ("rotctld", "rigctld") if shutil.which(each) is None]:
        pytest.skip(f"no {' and '.join(missing)}: install libhamlib-utils")
    return module


@pytest.fixture(scope="module")
def flown(script: ModuleType, ros_domain: int) -> Any:
    """A latched fault, a lost drive, a link that is cut and heals, and an executive that is killed, in one pass."""
    return script.fly("rotctld", list(LEGS))


def test_never_do_both_transmit(flown: dict[str, Any]) -> None:
    assert flown["both_transmit_s"] == 0.0


@pytest.mark.parametrize("leg", LEGS)
def test_the_other_antenna_goes_on_with_the_pass(flown: dict[str, Any], leg: str) -> None:
    gaps_s = flown[leg]["gap_s"]
    assert within(gaps_s["received"], LEGS[leg]), flown
    assert within(gaps_s["transmitted"], LEGS[leg]), flown
