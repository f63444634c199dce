"""The clock between its topics: held time is repeated, a killed clock goes on, and only its own graph sets it."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from rf_pointing.nodes import simulation_clock
from rf_pointing.nodes.simulation_clock import SimulationClock
from rf_pointing.ros.graph import TOPICS
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
PACED = [topic for topic in TOPICS if topic.allowed_lag_s is not None]
START_S = 1_151_384_000.0


class Bench:
    """A clock in this process, on a wall clock of the test; `times` are what it has published."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, autostart: bool, **given: Any) -> None:
        self.wall_s = 50.0
        self.times: list[float] = []
        clocks = SimpleNamespace(perf_counter=lambda: self.wall_s, monotonic=lambda: 1000.0 + self.wall_s)
        monkeypatch.setattr(simulation_clock, "time", clocks)
        self.node: Any = SimulationClock()
        self.node.set_parameters(
            [Parameter(name, value=value) for name, value in {"start_s": START_S, **given}.items()]
        )
        self.node.brings_itself_up = autostart
        self.node.get_publishers_info_by_topic = lambda _topic: []
        publish = lambda message: self.times.append(seconds_from_stamp(message.clock) - START_S)  # noqa: E731
        self.node.publisher = lambda *_: SimpleNamespace(publish=publish)
        assert self.node.turn() == 0.1
        assert self.node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS

    def activate(self) -> None:
        assert self.node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS

    def give(self, topic: str, message: Any) -> None:
        for each in self.node.subscriptions:
            if each.topic_name == topic:
                each.callback(serialize_message(message))

    def follow(self, t_s: float) -> None:
        """Let everything that time waits for be published with this stamp."""
        for topic in PACED:
            message = topic.message_type()
            message.header.stamp = stamp_from_seconds(START_S + t_s)
            self.give(f"/{topic.name}", message)

    def turns(self, count: int) -> None:
        for _ in range(count):
            self.node.turn()

    def close(self) -> None:
        self.node.end()
        self.node.lock.release()
        self.node.destroy_node()


@pytest.fixture
def make(default_context: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Bench]]:
    """Yield a maker of clocks."""
    made: list[Bench] = []

    def one(autostart: bool = False, **given: Any) -> Bench:
        made.append(Bench(monkeypatch, autostart, **given))
        return made[-1]

    yield one
    for each in made:
        each.close()


def test_held_time_is_repeated_every_100_ms_and_active_time_goes_on_with_the_wall_clock(
    make: Callable[..., Bench],
) -> None:
    bench = make(tick_s=0.25)
    for later_s, count in ((0.0, 1), (0.09, 1), (0.02, 2)):
        bench.wall_s += later_s
        assert bench.node.turn() == 0.1
        assert bench.times == [0.0] * count
    bench.follow(10.0)
    bench.activate()
    assert bench.node.turn() == 0.1, "a wait is cut, so that time is repeated"
    bench.wall_s += 0.2
    assert bench.node.turn() == pytest.approx(0.05)
    bench.wall_s += 0.06
    assert bench.node.turn() == 0.0
    assert bench.times[-1] == 0.25


def test_time_waits_for_the_stamps_of_the_graph(make: Callable[..., Bench]) -> None:
    bench = make(speed=0.0, tick_s=0.1)
    bench.activate()
    bench.turns(200)
    assert max(bench.times, default=0.0) < 1.0, "nobody follows"
    bench.follow(50.0)
    bench.turns(200)
    assert max(bench.times) > 19.0


@pytest.mark.parametrize(
    ("node", "counts"), [("/antenna_servo", True), ("", False), ("antenna_servo", False), ("/simulation_clock", False)]
)
def test_the_time_of_its_own_graph_sets_a_clock_that_brings_itself_up(
    make: Callable[..., Bench], node: str, counts: bool
) -> None:
    bench = make(autostart=True)
    # Silently: a first message could be a jump back.
    assert (bench.node.turn(), bench.times, bench.node.ready()) == (0.1, [], False)
    message = DiagnosticArray(status=[DiagnosticStatus(hardware_id=node)] if node else [])
    message.header.stamp = stamp_from_seconds(START_S + 70.0)
    bench.give("/diagnostics", message)
    bench.wall_s += 0.3
    assert bench.node.ready() is counts
    bench.node.brings_itself_up = False
    bench.node.turn()
    assert bench.times == [70.0 if counts else 0.0]


def test_a_killed_clock_is_resumed_at_once_and_one_that_ends_is_not(make: Callable[..., Bench]) -> None:
    first = make(autostart=True, speed=0.0)
    first.activate()
    first.turns(3)
    assert len(first.times) == 3
    # Killed: nothing is deactivated.
    first.node.lock.release()
    second = make(autostart=True)
    assert second.node.ready()
    second.activate()
    second.turns(1)
    assert second.times == [first.times[-1]]
    second.close()
    third = make(autostart=True)
    assert not third.node.ready()
