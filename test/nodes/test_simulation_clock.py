"""A clock that was killed goes on where time stood, and one that was not begins at its start."""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rf_pointing_msgs.msg import Target

from rf_pointing.nodes import simulation_clock
from rf_pointing.nodes.simulation_clock import ClockMemory, SimulationClock
from rf_pointing.ros.graph import ESSENTIAL, TOPICS
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")
START_S = 1_151_384_000.0


def test_the_newest_time_outlives_the_process(tmp_path: Path) -> None:
    kept = ClockMemory(tmp_path / "clock.time", START_S)
    for tick in range(5):
        kept.keep(START_S + 0.02 * tick, 100.0 + tick)
    assert ClockMemory(tmp_path / "clock.time", START_S).recover(105.0) == START_S + 0.08


@pytest.mark.parametrize(
    ("start_s", "wall_s"), [(START_S, 130.0), (START_S, 50.0), (START_S + 1.0, 101.0)], ids=["late", "reboot", "start"]
)
def test_another_run_begins_anew(tmp_path: Path, start_s: float, wall_s: float) -> None:
    """Longer ago than a graph waits, before the machine was started, or with another beginning of time."""
    ClockMemory(tmp_path / "clock.time", START_S).keep(START_S + 7.0, 100.0)
    assert ClockMemory(tmp_path / "clock.time", start_s).recover(wall_s) is None


def test_an_orderly_end_and_a_broken_file_leave_nothing(tmp_path: Path) -> None:
    path = tmp_path / "clock.time"
    assert ClockMemory(path, START_S).recover(1.0) is None
    kept = ClockMemory(path, START_S)
    kept.keep(START_S + 7.0, 100.0)
    kept.forget()
    assert not path.exists()
    path.write_bytes(b"half")
    assert ClockMemory(path, START_S).recover(101.0) is None


def test_a_clock_is_resumed_within_20_s_of_its_last_tick(tmp_path: Path) -> None:
    path = tmp_path / "clock.time"
    ClockMemory(path, START_S).keep(START_S + 7.0, 100.0)
    assert ClockMemory(path, START_S).recover(100.0) == START_S + 7.0
    assert ClockMemory(path, START_S).recover(120.0) == START_S + 7.0
    assert ClockMemory(path, START_S).recover(120.1) is None
    assert ClockMemory(path, START_S).recover(99.9) is None


def test_a_file_with_more_than_one_record_is_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "clock.time"
    path.write_bytes(struct.pack("<3d", START_S, 100.0, START_S + 7.0) + b"x")
    assert ClockMemory(path, START_S).recover(101.0) is None
    # A clock that takes over the file leaves nothing of what it held.
    kept = ClockMemory(path, START_S)
    kept.keep(START_S + 8.0, 102.0)
    assert path.stat().st_size == 24
    assert ClockMemory(path, START_S).recover(102.0) == START_S + 8.0
    kept.forget()
    kept.keep(START_S + 9.0, 103.0)
    assert ClockMemory(path, START_S).recover(103.0) == START_S + 9.0
    kept.forget()


# The node


class Bench:
    """A clock in this process, on a wall clock of the test; `times` are what it has published."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, autostart: bool, **given: Any) -> None:
        self.wall_s = 50.0
        self.times: list[float] = []
        self.doors: dict[str, Callable[[bytes], None]] = {}
        monkeypatch.setattr(
            simulation_clock,
            "time",
            SimpleNamespace(perf_counter=lambda: self.wall_s, monotonic=lambda: 1000.0 + self.wall_s),
        )
        self.node: Any = SimulationClock()
        create = self.node.create_subscription

        def noted(message_type: Any, topic: str, callback: Any, qos: Any, **options: Any) -> Any:
            self.doors[topic] = callback
            return create(message_type, topic, callback, qos, **options)

        self.node.create_subscription = noted
        self.node.set_parameters(
            [Parameter(name, value=value) for name, value in {"start_s": START_S, **given}.items()]
        )
        self.node.brings_itself_up = autostart
        self.others: list[Any] = []
        self.node.get_publishers_info_by_topic = lambda _topic: self.others
        assert self.node.turn() == 0.1
        assert self.node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS, self.node._reason
        self.node._output = SimpleNamespace(
            publish=lambda message: self.times.append(seconds_from_stamp(message.clock) - START_S)
        )

    def activate(self) -> None:
        assert self.node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS

    def report(self, t_s: float, node: str = "/antenna_servo") -> None:
        """Let a node report its time on /diagnostics."""
        message = DiagnosticArray(status=[DiagnosticStatus(hardware_id=node)] if node else [])
        message.header.stamp = stamp_from_seconds(t_s)
        self.doors["/diagnostics"](serialize_message(message))

    def sees(self, name: str, namespace: str = "/") -> None:
        self.others = [SimpleNamespace(node_name=name, node_namespace=namespace)]

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


def test_held_time_is_repeated_every_100_ms(make: Callable[..., Bench]) -> None:
    bench = make()
    assert bench.node.turn() == 0.1
    bench.wall_s += 0.09
    bench.node.turn()
    assert bench.times == [0.0]
    bench.wall_s += 0.02
    bench.node.turn()
    assert bench.times == [0.0, 0.0]
    assert bench.node._health().message == "held"


def test_active_time_goes_on_with_the_wall_clock(make: Callable[..., Bench]) -> None:
    bench = make(tick_s=0.25)
    for stream in bench.node._pacer.streams.values():
        stream.newest_s = START_S + 10.0
    bench.activate()
    assert bench.node.turn() == 0.1, "a wait is cut, so that time is repeated"
    assert bench.times == [0.0]
    bench.wall_s += 0.2
    assert bench.node.turn() == pytest.approx(0.05)
    assert bench.times == [0.0, 0.0]
    bench.wall_s += 0.06
    assert bench.node.turn() == 0.0
    assert bench.times[2:] == [0.25]
    bench.node.turn()
    assert len(bench.times) == 3
    health = bench.node._health()
    assert (health.message, health.values["time_s"]) == ("running", START_S + 0.25)


def test_time_waits_for_what_the_graph_publishes(make: Callable[..., Bench]) -> None:
    bench = make(speed=0.0, tick_s=1.0)
    paced = {topic.name: topic for topic in TOPICS if topic.allowed_lag_s is not None}
    assert set(bench.node._pacer.streams) == set(paced)
    assert [name for name, stream in bench.node._pacer.streams.items() if stream.essential] == [ESSENTIAL]
    assert bench.node._pacer.streams["target"].allowed_lag_s == paced["target"].allowed_lag_s
    message = Target()
    message.header.stamp = stamp_from_seconds(START_S + 3.0)
    bench.doors["target"](serialize_message(message))
    assert bench.node._pacer.streams["target"].newest_s == START_S + 3.0
    bench.doors["target"](b"short")
    assert bench.node.inputs.refused == {"target": 1}
    values = bench.node._health().values
    assert (values["waited target"], values["abandoned target"]) == (0, 0)


def test_a_clock_that_brings_itself_up_waits_1500_ms_for_a_running_graph(make: Callable[..., Bench]) -> None:
    bench = make(autostart=True)
    # Silently: a first message could be a jump back.
    assert bench.node.turn() == 0.1
    assert bench.times == []
    bench.wall_s += 1.49
    assert not bench.node.ready()
    bench.wall_s += 0.02
    assert bench.node.ready()


@pytest.mark.parametrize(
    ("name", "namespace", "patience_s"),
    [("antenna_servo", "/", 5.0), ("simulation_clock", "/", 1.5), ("antenna_servo", "/gs2", 1.5)],
)
def test_while_other_nodes_are_seen_a_clock_waits_5_s_for_their_time(
    make: Callable[..., Bench], name: str, namespace: str, patience_s: float
) -> None:
    bench = make(autostart=True)
    bench.sees(name, namespace)
    bench.wall_s += patience_s - 0.01
    assert not bench.node.ready()
    bench.wall_s += 0.02
    assert bench.node.ready()


def test_a_clock_goes_on_200_ms_after_the_first_report_at_the_newest_time(make: Callable[..., Bench]) -> None:
    bench = make(autostart=True)
    bench.sees("antenna_servo")
    bench.report(START_S + 70.0)
    bench.wall_s += 0.15
    bench.report(START_S + 71.0)
    bench.report(START_S + 69.0, "/pointing_controller")
    assert not bench.node.ready()
    bench.wall_s += 0.06
    assert bench.node.ready()
    bench.activate()
    assert bench.node._pacer.now_s == START_S + 71.0


@pytest.mark.parametrize("node", ["", "antenna_servo", "/simulation_clock"])
def test_reports_of_others_and_its_own_set_no_time(make: Callable[..., Bench], node: str) -> None:
    bench = make(autostart=True)
    bench.report(START_S + 70.0, node)
    assert bench.node._pacer.now_s == START_S
    bench.wall_s += 1.0
    assert not bench.node.ready()


def test_a_report_without_a_time_shows_a_graph_that_has_none(make: Callable[..., Bench]) -> None:
    bench = make(autostart=True)
    bench.sees("antenna_servo")
    bench.report(0.0)
    bench.wall_s += 1.49
    assert not bench.node.ready()
    bench.wall_s += 0.02
    assert bench.node.ready()
    assert bench.node._pacer.now_s == START_S


def test_once_time_runs_no_report_sets_it(make: Callable[..., Bench]) -> None:
    bench = make(autostart=True)
    bench.activate()
    bench.node._pacer.advance(bench.wall_s)
    bench.report(START_S + 70.0)
    assert bench.node._pacer.now_s - START_S == pytest.approx(0.02, abs=1e-6)


def test_a_killed_clock_is_resumed_at_once_and_one_that_ends_is_not(
    make: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch, default_context: None
) -> None:
    first = make(autostart=True, speed=0.0, tick_s=1.0)
    first.activate()
    for stream in first.node._pacer.streams.values():
        stream.newest_s = START_S + 100.0
    for _ in range(3):
        first.node.turn()
    assert first.times == [1.0, 2.0, 3.0]
    # Killed: nothing is deactivated.
    first.node.lock.release()
    second = Bench(monkeypatch, True)
    second.wall_s = 60.0
    assert second.node.ready()
    assert second.node._pacer.now_s == START_S + 3.0
    second.node.brings_itself_up = True
    second.activate()
    second.close()
    third = Bench(monkeypatch, True)
    assert not third.node.ready()
    assert third.node._pacer.now_s == START_S
    third.close()
