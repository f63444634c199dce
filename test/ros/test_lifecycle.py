"""The life of a node: transitions in any order, what refuses them, and periodic work on a grid of time."""

import re
import sys
from collections.abc import Callable
from itertools import pairwise
from typing import Any, ClassVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.time import Time
from std_msgs.msg import Header

from rf_pointing.ros.diagnostics import WARN
from rf_pointing.ros.lifecycle import Lifecycle, Schedule
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM

START_S = 1_151_384_000.0


class Subject(ManagedNode):
    """A node that refuses or fails as the test sets it, and notes its work."""

    def __init__(self) -> None:
        super().__init__("managed_subject")
        self.refusal: Exception | None = None
        self.order: list[str] = []
        self.ticks: list[float] = []
        self.is_ready = True

    def configure(self) -> None:
        self.stream(Header, "target", STREAM)
        self.listen(Header, "error", self.order.append, STREAM)
        self._maybe_refuse()

    def activate(self) -> None:
        self.schedule = self.every(0.1, self.ticks.append)
        self._maybe_refuse()

    def _maybe_refuse(self) -> None:
        if self.refusal:
            raise self.refusal

    def deactivate(self) -> None:
        self.order.append("deactivate")

    def fail(self, reason: str) -> None:
        self.order.append(f"fail {reason}")

    def ready(self) -> bool:
        return self.is_ready and super().ready()


@pytest.fixture
def bench(make_bench: Callable[..., Any]) -> Any:
    return make_bench(Subject)


def entities(node: Any) -> list[int]:
    """Return how much a node has in the graph, and its timers."""
    return [len(list(kind)) for kind in (node.publishers, node.subscriptions, node.offered, node.timers)]


# Transitions

MOVES = {
    "configure": ("unconfigured", "inactive"), "activate": ("inactive", "active"),
    "deactivate": ("active", "inactive"), "cleanup": ("inactive", "unconfigured"),
}  # fmt: skip
IDS = {"configure": 1, "cleanup": 2, "activate": 3, "deactivate": 4}


class Machine(RuleBasedStateMachine):
    """Any transitions, through the service as a manager requests them, some refused by the node."""

    def __init__(self, bench: Any) -> None:
        super().__init__()
        self.bench, self.node = bench, bench.node
        self.node.refusal, self.state, self.reason = None, "unconfigured", ""
        # Whatever the machine before has left.
        for move in ("deactivate", "cleanup", "configure", "cleanup"):
            if bench.health("state").values["state"] == MOVES[move][0]:
                bench.step(move)
        self.bare = entities(self.node)

    @rule(move=st.sampled_from(sorted(MOVES)), refusal=st.sampled_from([None, "gain=9 must be <= 5"]))
    def change(self, move: str, refusal: str | None) -> None:
        self.node.refusal = ValueError(refusal) if refusal else None
        request = ChangeState.Request(transition=Transition(id=IDS[move]))
        answer = self.bench.call("~/change_state", request)
        before, after = MOVES[move]
        possible = self.state == before
        refused = possible and move in ("configure", "activate") and bool(refusal)
        assert answer.success == (possible and not refused)
        if refused:
            self.reason = refusal or ""
        elif possible:
            self.state = after
            self.reason = "" if move in ("configure", "activate") else self.reason

    @rule()
    def work(self) -> None:
        count = len(self.node.ticks)
        self.bench.run(0.2)
        assert (len(self.node.ticks) > count) == (self.state == "active")

    @invariant()
    def the_state_is_known_and_leaves_nothing_behind(self) -> None:
        health = self.bench.health("state")
        assert (health.values["state"], self.node.active) == (self.state, self.state == "active")
        assert health.message == (self.reason or self.state)
        assert self.node.parameters.configured == (self.state != "unconfigured")
        extra = [here - bare for here, bare in zip(entities(self.node), self.bare, strict=True)]
        topics = self.state != "unconfigured"
        assert extra == [topics, topics, 0, self.state == "active"]


def test_transitions_in_any_order_are_taken_or_refused_and_leave_nothing_behind(bench: Any) -> None:
    limits = settings(max_examples=15, stateful_step_count=15, deadline=None)
    bench.node.log_once("", "")
    run_state_machine_as_test(lambda: Machine(bench), settings=limits)


@pytest.mark.parametrize("refusal", [ValueError("gain=9"), FileNotFoundError(2, "No such file", "model.yaml")])
def test_a_refused_configuration_says_why_in_log_and_diagnostics(bench: Any, refusal: Exception) -> None:
    bench.node.refusal = refusal
    assert not bench.step("configure")
    assert bench.health("state").message == str(refusal)
    assert ("error", f"not configured: {refusal}") in bench.log


def test_shutdown_and_end_stop_an_active_node_once_and_say_so(make_bench: Callable[..., Any]) -> None:
    for how in ("trigger_shutdown", "end"):
        bench = make_bench(Subject)
        bare = entities(bench.node)
        bench.up()
        getattr(bench.node, how)()
        bench.node.end()
        assert (bench.node.order, entities(bench.node)) == (["deactivate"], bare)
        assert bench.health("state").values == {"state": "finalized"}
    failed = make_bench(Subject).up()
    said = len(failed.sent["/diagnostics"])
    failed.node.failure = ValueError("it must be missed")
    failed.node.end()
    assert len(failed.sent["/diagnostics"]) == said


def test_a_node_brings_itself_up_once_when_it_is_ready(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(Subject, **{"lifecycle.autostart": True})
    bench.node.is_ready = False
    bench.node.bring_up()
    assert bench.health("state").message == "inactive"
    bench.node.is_ready = True
    bench.node.bring_up()
    assert bench.node.active
    assert bench.step("deactivate")
    bench.node.bring_up()
    assert bench.health("state").message == "inactive", "a deactivated node stays so"
    bench = make_bench(Subject)
    bench.node.bring_up()
    assert bench.health("state").message == "unconfigured"


def test_a_node_tries_again_until_it_is_active_and_says_once_what_it_waits_for(make_bench: Callable[..., Any]) -> None:
    """Whatever raises is waited for; the waits double from 1 s to 8 s."""
    bench = make_bench(Subject, **{"lifecycle.autostart": True})
    bench.node.refusal, tried_s = KeyError("axis"), [bench.t_s]
    bench.node.bring_up()
    assert "KeyError: 'axis'; please report it" in bench.health("state").message
    bench.node.refusal = ValueError("drive: Connection refused")
    attempts, configure = [bench.t_s], bench.node.configure

    def counted() -> None:
        attempts.append(bench.t_s)
        configure()

    bench.node.configure = counted
    for _ in range(300):
        bench.wait(0.1)
        bench.node.bring_up()
    waits_s = [b - a for a, b in pairwise(attempts)]
    assert waits_s == pytest.approx([1.0, 2.0, 4.0, 8.0, 8.0], abs=0.25), tried_s
    health = bench.health("state")
    assert (health.level, health.values["state"]) == (WARN, "unconfigured")
    assert health.message == "waits, and tries again every 8 s: drive: Connection refused"
    said = [words for _, words in bench.log if "Connection refused" in words]
    assert said == ["not configured yet: drive: Connection refused; tried again until it is"]
    bench.node.refusal = None
    for _ in range(90):
        bench.wait(0.1)
        bench.node.bring_up()
    assert (bench.node.active, bench.health("state").message) == (True, "active")


def test_simulated_time_is_waited_for(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(Subject, use_sim_time=True)
    assert bench.step("configure")
    assert not bench.step("activate")
    assert bench.health("state").message.startswith("use_sim_time is set, but no time has been received")
    assert not bench.node.ready()
    bench.node.get_clock().set_ros_time_override(Time(seconds=5, clock_type=bench.node.get_clock().clock_type))
    assert bench.step("activate")
    assert Lifecycle.now_s(bench.node) == 5.0
    bench.node.catch_up()
    assert bench.node.ticks == []
    bench.t_s += 0.3
    bench.node.catch_up(0.4)
    assert bench.node.ticks == []
    for _ in range(2):
        bench.node.catch_up()
    assert len(bench.node.ticks) == 3, "each instant once, although no timer has fired"
    assert bench.step("deactivate")
    bench.node.catch_up()
    assert len(bench.node.ticks) == 3


# Periodic work


def test_work_is_done_for_each_instant_and_a_stall_differs_from_a_jump(bench: Any) -> None:
    bench.up()
    begun_s = bench.t_s
    bench.run(0.3)
    bench.wait(2.0)
    bench.turn()
    assert [round(t_s - begun_s, 6) for t_s in bench.node.ticks] == [0.1, 0.2, 0.3, 2.3]
    assert (bench.node.schedule.jumped_s, bench.node.schedule.stalled_s) == (0.0, pytest.approx(2.0))
    bench.t_s += 2.0
    bench.turn()
    assert bench.node.schedule.jumped_s == pytest.approx(1.9, abs=1e-6), "the steady clock did not go on"


@given(
    delays_s=st.lists(st.floats(0.0, 0.4), min_size=1, max_size=60), period_s=st.sampled_from([0.02, 0.1, 1.0 / 3.0]),
    start_s=st.floats(0.0, 2e9),
)  # fmt: skip
def test_every_instant_of_the_grid_comes_once_and_in_order_however_late_the_timer_fires(
    delays_s: list[float], period_s: float, start_s: float
) -> None:
    schedule, now_s, done = Schedule(start_s, period_s), start_s, list[float]()
    for delay_s in delays_s:
        now_s += delay_s
        done += schedule.due(now_s)
        assert schedule.jumped_s == schedule.stalled_s == 0.0
        assert schedule.due(now_s) == [], "a timer that fires twice does nothing the second time"
    numbers = [t_s / period_s for t_s in done]
    assert numbers == pytest.approx([round(number) for number in numbers], abs=1e-6 / period_s + 1e-6)
    assert done == pytest.approx([done[0] + period_s * k for k in range(len(done))] if done else [], abs=2e-6)
    last_s = done[-1] if done else start_s
    assert now_s - period_s - 1e-3 * period_s - 2e-6 < last_s <= now_s + 1e-3 * period_s + 1e-6


@given(
    clock_s=st.floats(-3600.0, 3600.0), steady_s=st.floats(0.0, 3600.0), period_s=st.sampled_from([0.02, 0.1, 5.0])
)  # fmt: skip
def test_a_gap_is_made_up_or_else_a_stall_if_the_steady_clock_went_on_as_far_or_else_a_jump(
    clock_s: float, steady_s: float, period_s: float
) -> None:
    schedule, gap_s = Schedule(START_S, period_s), max(0.5, 2.0 * period_s)
    schedule.due(START_S + period_s, 100.0)
    now_s = START_S + 2.0 * period_s + clock_s
    due = schedule.due(now_s, 100.0 + steady_s)
    near = min(abs(abs(clock_s) - gap_s), abs(abs(clock_s - steady_s) - gap_s)) < 1e-5
    if near:
        return
    if abs(clock_s) < gap_s:
        assert (schedule.jumped_s, schedule.stalled_s) == (0.0, 0.0)
    elif abs(clock_s - steady_s) < gap_s:
        assert (schedule.jumped_s, schedule.stalled_s) == (0.0, pytest.approx(steady_s))
    else:
        assert (schedule.jumped_s, schedule.stalled_s) == (pytest.approx(clock_s - steady_s, abs=1e-5), 0.0)
    if abs(clock_s) > gap_s:
        assert len(due) == 1, "what is past is not made up for"
    # The next period is a usual one.
    schedule.due(now_s + period_s, 100.0 + steady_s + period_s)
    assert schedule.jumped_s == schedule.stalled_s == 0.0


def test_a_device_gets_one_tick_at_the_present_time_for_all_that_were_missed() -> None:
    schedule, now_s, done = Schedule(0.0, 0.02, 50.0, catches_up=False), 0.0, list[float]()
    for delay_s in (0.02, 0.021, 0.3, 0.005, 0.02, 0.0395, 0.0005, 0.02, 0.48, 0.02):
        now_s += delay_s
        due = schedule.due(now_s, 50.0 + now_s)
        assert due in ([], [pytest.approx(now_s)])
        assert schedule.jumped_s == schedule.stalled_s == 0.0
        done += due
    assert all(b - a >= 0.5 * 0.02 for a, b in pairwise(done))


@given(st.floats(0.0, 1.0), st.lists(st.floats(-0.2, 0.2), min_size=3, max_size=40))
def test_a_device_gets_a_tick_whenever_its_timer_fires_whatever_the_phase(phase: float, jitter: list[float]) -> None:
    schedule = Schedule(0.0, 0.02, 50.0, catches_up=False)
    for number, late in enumerate(jitter, 1):
        now_s = 0.02 * (number + phase + late)
        assert schedule.due(now_s, 50.0 + now_s) == [now_s]


def test_a_first_tick_long_after_the_activation_is_a_stall() -> None:
    schedule = Schedule(100.0, 0.02, 50.0)
    schedule.due(100.7, 50.7)
    assert (schedule.jumped_s, schedule.stalled_s) == (0.0, pytest.approx(0.7))


# The process


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--nonsense"], r"argument '--nonsense' is not known; usage: NAME --ros-args"),
        (["--ros-args", "--nonsense"], r"\['--nonsense'\]"),
        (["--ros-args", "-p"], r".* trailing -p flag\. .*"),
        (["--ros-args", "--params-file", "nowhere.yaml"], r".*'--params-file nowhere.yaml'. Error: Error opening YAML"),
        (["--ros-args", "-r", "__ns:=gs1"], r".*'-r __ns:=gs1'.*"),
    ],
)
def test_wrong_arguments_of_a_node_are_named_in_one_line_and_it_is_not_started(
    arguments: list[str], words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["managed_subject", *arguments])
    with pytest.raises(SystemExit) as left:
        run(Subject)
    assert left.value.code == 2
    (line,) = (line for line in capsys.readouterr().err.splitlines() if line.startswith("rf_pointing: "))
    assert re.match(rf"rf_pointing: not started: {words}", line), line
    assert ".c:" not in line


class Failing(Subject):
    """A node whose periodic work fails at its third instant, and which notes how it ends."""

    ended: ClassVar[list[str]] = []

    def activate(self) -> None:
        self.order = self.ended
        self.every(0.02, self._work)

    def _work(self, t_s: float) -> None:
        self.ticks.append(t_s)
        if len(self.ticks) == 3:
            raise KeyError("gone")


def test_a_node_whose_periodic_work_raises_stops_what_moves_and_ends(
    ros_domain: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["failing", "--ros-args", "-p", "lifecycle.autostart:=true"])
    with pytest.raises(SystemExit) as left:
        run(Failing)
    assert (left.value.code, Failing.ended) == (1, ["fail KeyError: 'gone'", "deactivate"])
    assert "the node ends after a controlled stop, please report it: KeyError: 'gone'" in capfd.readouterr().err
