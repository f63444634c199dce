"""The clock between its topics: held time is repeated, a killed clock goes on, and only its own graph sets it."""

from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from rf_pointing.nodes.simulation_clock import SimulationClock
from rf_pointing.ros.graph import TOPICS
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds

START_S = 1_151_384_000.0
PACED = [topic for topic in TOPICS if topic.allowed_lag_s is not None]


@pytest.fixture
def make(make_bench: Callable[..., Any]) -> Callable[..., Any]:
    """Return a maker of clocks that start at START_S, of which some bring themselves up."""

    def clock(autostart: bool = False, **given: Any) -> Any:
        bench = make_bench(SimulationClock, start_s=START_S, **given)
        bench.node.brings_itself_up = autostart
        assert bench.node.turn() == 0.1
        assert bench.step("configure")
        return bench

    return clock


def times(bench: Any) -> list[float]:
    return [seconds_from_stamp(message.clock) - START_S for message in bench.sent["clock"]]


def follow(bench: Any, t_s: float) -> None:
    """Let everything that time waits for be published with this stamp."""
    for topic in PACED:
        message = topic.message_type()
        message.header.stamp = stamp_from_seconds(START_S + t_s)
        bench.give(topic.name, message)


def test_held_time_is_repeated_every_100_ms_and_active_time_goes_on_with_the_wall_clock(
    make: Callable[..., Any],
) -> None:
    bench = make(tick_s=0.25)
    for later_s, count in ((0.0, 1), (0.09, 1), (0.02, 2)):
        bench.wait(later_s)
        assert bench.node.turn() == 0.1
        assert times(bench) == [0.0] * count
    follow(bench, 10.0)
    assert bench.health("pacing").message == "held"
    assert bench.step("activate")
    assert bench.node.turn() == 0.1, "a wait is cut, so that time is repeated"
    bench.wait(0.2)
    assert bench.node.turn() == pytest.approx(0.05)
    bench.wait(0.06)
    assert (bench.node.turn(), times(bench)[-1], bench.health("pacing").message) == (0.0, 0.25, "running")


def test_time_waits_for_the_stamps_of_the_graph(make: Callable[..., Any]) -> None:
    bench = make(speed=0.0, tick_s=0.1)
    assert bench.step("activate")
    for followed_s in (0.0, 50.0):
        follow(bench, followed_s)
        for _ in range(600):
            bench.node.turn()
        assert followed_s - 3.0 < max(times(bench)) < followed_s + 1.0
    assert bench.health("pacing").values["abandoned target"] == "0"


@pytest.mark.parametrize(
    ("node", "counts"), [("/antenna_servo", True), ("", False), ("antenna_servo", False), ("/simulation_clock", False)]
)
def test_the_time_of_its_own_graph_sets_a_clock_that_brings_itself_up(
    make: Callable[..., Any], node: str, counts: bool
) -> None:
    bench = make(autostart=True)
    # Silently: a first message could be a jump back.
    assert (bench.node.turn(), times(bench), bench.node.ready()) == (0.1, [], False)
    message = DiagnosticArray(status=[DiagnosticStatus(hardware_id=node)] if node else [])
    message.header.stamp = stamp_from_seconds(START_S + 70.0)
    bench.give("/diagnostics", message)
    bench.wait(0.3)
    assert bench.node.ready() is counts
    bench.wait(1.3)
    assert bench.node.ready()
    bench.publishers["/diagnostics"] = ["/antenna_servo"]
    assert bench.node.ready() is counts, "a neighbour will report its time within 5 s"
    bench.node.brings_itself_up = False
    bench.node.turn()
    assert times(bench) == [70.0 if counts else 0.0]
