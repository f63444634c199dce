"""Simulation time waits for the wall clock and for the graph, not for ever, and goes on where a killed clock was."""

import os
import struct
from functools import partial
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from rf_pointing.station.clients.pacing import ClockMemory, ClockStart, PacedStream, Pacer

START_S = 1000.0
TICK_S = 0.02
Memory = partial(ClockMemory, open_file=lambda path, flags: os.open(path, flags | os.O_CREAT))


def pacer(speed: float = 0.0, tick_s: float = TICK_S, **streams: PacedStream) -> Pacer:
    made = Pacer(start_s=START_S, tick_s=tick_s, speed=speed, streams=streams)
    made.begin(0.0)
    return made


def run_dry(clock: Pacer, wall_s: float = 0.0) -> float:
    """Take every tick that is due at one instant, and return the wait for the next one."""
    while (wait_s := clock.wait_s(wall_s)) == 0.0:
        clock.advance(wall_s)
    return wait_s


class Graph(RuleBasedStateMachine):
    """A clock with the antenna and another stream; messages come, or the wall clock goes on."""

    @initialize(speed=st.sampled_from([0.0, 0.5, 1.0, 20.0]), lags=st.tuples(*[st.floats(0.03, 0.3)] * 2))
    def begin(self, speed: float, lags: tuple[float, float]) -> None:
        self.streams = PacedStream(allowed_lag_s=lags[0], essential=True), PacedStream(allowed_lag_s=lags[1])
        self.clock, self.wall_s = pacer(speed, antenna=self.streams[0], other=self.streams[1]), 0.0

    @rule(which=st.booleans(), late_s=st.floats(0.0, 0.2))
    def a_message_comes(self, which: bool, late_s: float) -> None:
        self.streams[which].received(self.clock.now_s - late_s)

    @rule(seconds=st.floats(0.0, 2.0))
    def nothing_comes(self, seconds: float) -> None:
        self.wall_s += seconds

    @precondition(lambda self: self.clock.wait_s(self.wall_s) == 0.0)
    @rule()
    def a_tick_is_taken(self) -> None:
        clock, before = self.clock, self.clock.now_s
        assert clock.advance(self.wall_s) == pytest.approx(before + TICK_S)
        for stream in self.streams:
            late_s = clock.now_s - stream.newest_s - stream.allowed_lag_s
            assert not stream.waited_for or late_s <= 1e-3 * TICK_S + 1e-9, "ahead of a stream that time waits for"

    @invariant()
    def time_is_not_ahead_of_the_wall_clock_and_waits_no_longer_than_the_patience(self) -> None:
        clock = self.clock
        assert 0.0 <= clock.wait_s(self.wall_s) <= max(clock.long_patience_s, TICK_S / (clock.speed or 1.0)) + 1e-9
        if clock.speed:
            assert clock.now_s - START_S <= clock.speed * self.wall_s + 1e-6


TestGraph = Graph.TestCase
TestGraph.settings = settings(max_examples=60, stateful_step_count=60, deadline=None)


@pytest.mark.parametrize("speed", [0.5, 1.0, 10.0])
def test_a_factor_of_real_time_is_kept_tick_by_tick(speed: float) -> None:
    clock, wall_s = pacer(speed), 0.0
    for tick in range(1, 200):
        wall_s += clock.wait_s(wall_s)
        assert clock.wait_s(wall_s) <= 1e-12
        assert clock.advance(wall_s) == pytest.approx(START_S + tick * TICK_S)
        assert wall_s == pytest.approx(tick * TICK_S / speed)
    # Time that is held again begins where it was, without a rush.
    clock.begin(7.0 + wall_s)
    assert clock.wait_s(7.0 + wall_s) == pytest.approx(TICK_S / speed)


@pytest.mark.parametrize(("speed", "essential", "patience_s"), [(0.0, False, 5.0), (1e3, False, 1.0), (0.0, True, 5.0)])
def test_a_silent_stream_is_given_up_after_the_patience_and_waited_for_again_when_heard(
    speed: float, essential: bool, patience_s: float
) -> None:
    clock = pacer(speed, joints=(stream := PacedStream(allowed_lag_s=0.05, essential=essential)))
    stream.received(START_S)
    assert run_dry(clock, 0.01) == pytest.approx(patience_s)
    assert clock.wait_s(0.01 + 0.4 * patience_s) == pytest.approx(0.6 * patience_s)
    wall_s = 0.01 + 1.1 * patience_s
    assert clock.wait_s(wall_s) == 0.0
    assert (stream.waits, stream.abandoned) == (1, 1)
    for _ in range(5):
        clock.advance(wall_s)
        # Without the antenna time runs no faster than the wall clock.
        assert clock.wait_s(wall_s) == pytest.approx(TICK_S if essential else 0.0, abs=1e-4)
        wall_s += TICK_S
        assert clock.wait_s(wall_s) == pytest.approx(0.0, abs=1e-9)
    stream.received(clock.now_s - 0.2)
    stream.received(clock.now_s - 0.1)
    assert clock.wait_s(wall_s) > TICK_S


# Where time begins


@pytest.mark.parametrize(
    ("start_s", "wall_s", "recovered"),
    [
        (START_S, 104.0, True), (START_S, 124.0, True), (START_S, 124.1, False), (START_S, 103.9, False),
        (START_S + 1.0, 104.0, False),
    ],
    ids=["at once", "in 20 s", "late", "reboot", "other start"],
)  # fmt: skip
def test_a_killed_clock_of_the_same_run_goes_on_within_20_s(
    tmp_path: Path, start_s: float, wall_s: float, recovered: bool
) -> None:
    kept = Memory(tmp_path / "clock.time", START_S)
    for tick in range(5):
        kept.keep(START_S + TICK_S * tick, 100.0 + tick)
    found = Memory(tmp_path / "clock.time", start_s).recover(wall_s)
    assert found == (START_S + 4.0 * TICK_S if recovered else None)
    kept.forget()
    assert not (tmp_path / "clock.time").exists(), "a clock that ends in order leaves nothing"


@pytest.mark.parametrize("content", [b"", b"half", struct.pack("<3d", START_S, 100.0, START_S + 7.0) + b"x"])
def test_a_torn_file_is_not_believed_and_is_taken_over_whole(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "clock.time"
    path.write_bytes(content)
    kept = Memory(path, START_S)
    assert kept.recover(101.0) is None
    for t_s in (START_S + 8.0, START_S + 9.0):
        kept.keep(t_s, 102.0)
        assert (path.stat().st_size, kept.recover(102.0)) == (24, t_s)
        kept.forget()


@pytest.mark.parametrize(("neighbours", "patience_s"), [(False, 1.5), (True, 5.0)])
def test_a_clock_waits_for_the_time_of_a_running_graph(neighbours: bool, patience_s: float) -> None:
    clock = pacer()
    start = ClockStart(clock, None, 50.0)
    assert not start.known(50.0 + patience_s - 0.01, neighbours)
    assert start.known(50.0 + patience_s, neighbours)
    # A graph that has no time yet is not waited for.
    start.report(0.0, 50.5)
    assert (start.known(51.49, neighbours), start.known(51.5, neighbours), clock.now_s) == (False, True, START_S)


def test_a_clock_goes_on_200_ms_after_the_first_report_at_the_newest_time() -> None:
    clock = pacer()
    start = ClockStart(clock, None, 50.0)
    for wall_s, stated_s in ((50.1, START_S + 70.0), (50.2, START_S + 71.0), (50.25, START_S + 69.0)):
        start.report(stated_s, wall_s)
    assert not start.known(50.29, True)
    assert start.known(50.31, True)
    assert clock.now_s == START_S + 71.0
    clock.advance(0.0)
    start.report(START_S + 90.0, 50.4)
    assert clock.now_s == pytest.approx(START_S + 71.0 + TICK_S), "once time runs no report sets it"
