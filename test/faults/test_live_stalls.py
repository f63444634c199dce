"""A live pass in wall time goes on through the worst outages; `benchmarks/live_stalls.py` has every node and case."""

import importlib.util
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="the graph needs ROS 2")

pytestmark = [pytest.mark.graph, pytest.mark.alone]
SCRIPT = Path(__file__).parents[2] / "benchmarks" / "live_stalls.py"
SILENT_S = 1.0


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Iterator[Any]:
    """Yield a live pass, with shorter times before, in and after an outage than the benchmark has."""
    spec = importlib.util.spec_from_file_location("live_stalls", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    sys.modules["live_stalls"] = script
    spec.loader.exec_module(script)
    script.BEFORE_S, script.AFTER_S, script.LOSS_S = 2.0, 3.0, 6.0
    # Without a sensor: what a search costs after an outage is another question, and takes longer.
    with script.LivePass(tmp_path_factory.mktemp("stalls"), ros_domain, "program") as live:
        yield live


@pytest.mark.parametrize(
    ("node", "case"), [("antenna_servo", "kill"), ("pointing_controller", "5"), ("every node", "loss")]
)
def test_an_outage_costs_a_live_pass_at_most_itself_and_five_seconds(flown: Any, node: str, case: str) -> None:
    found = flown.outage(node, case)
    print(found)
    assert found.lost_s <= found.allowed_s


def test_without_any_datagram_nothing_arrives(flown: Any) -> None:
    """So the library that drops a fifth of them does drop them."""
    flown.lose(1.0)
    begun_s = time.monotonic()
    flown.until(lambda: time.monotonic() - begun_s > SILENT_S, "the silence")
    stamp = flown.status.header.stamp
    flown.until(lambda: time.monotonic() - begun_s > 2.0 * SILENT_S, "the silence")
    assert flown.status.header.stamp == stamp
