"""Simulation time waits for the wall clock and for the graph, and not for ever for a stream that is gone."""

import pytest

from rf_pointing.ros.pacing import LARGEST_SPACING_S, PacedStream, Pacer

START_S = 1000.0
TICK_S = 0.02


def pacer(speed: float = 0.0, tick_s: float = TICK_S, **streams: PacedStream) -> Pacer:
    made = Pacer(start_s=START_S, tick_s=tick_s, speed=speed, streams=streams)
    made.begin(0.0)
    return made


def test_held_time_does_not_run() -> None:
    held = Pacer(start_s=START_S, tick_s=TICK_S, speed=0.0, streams={})
    assert held.wait_s(100.0) > 0.0
    assert held.now_s == START_S


@pytest.mark.parametrize("speed", [0.5, 1.0, 10.0])
def test_a_factor_of_real_time_is_kept_tick_by_tick(speed: float) -> None:
    clock, wall_s = pacer(speed), 0.0
    for tick in range(1, 200):
        wall_s += clock.wait_s(wall_s)
        assert clock.wait_s(wall_s) <= 1e-12
        assert clock.advance(wall_s) == pytest.approx(START_S + tick * TICK_S)
        assert wall_s == pytest.approx(tick * TICK_S / speed)


def test_at_full_speed_the_next_tick_is_due_at_once() -> None:
    clock = pacer()
    for _ in range(10):
        assert clock.wait_s(0.0) == 0.0
        clock.advance(0.0)
    assert clock.now_s == pytest.approx(START_S + 10 * TICK_S)


def test_time_never_gets_further_ahead_of_a_stream_than_its_lag() -> None:
    stream = PacedStream(allowed_lag_s=0.11)
    clock = pacer(joints=stream)
    stream.received(START_S)
    while clock.wait_s(0.0) == 0.0:
        clock.advance(0.0)
    assert clock.now_s == pytest.approx(START_S + 0.10)
    stream.received(START_S + 0.02)
    assert clock.wait_s(0.0) == 0.0
    assert clock.advance(0.0) == pytest.approx(START_S + 0.12)
    assert clock.wait_s(0.0) > 0.0


def test_a_stream_that_must_be_ahead_holds_time_until_it_is() -> None:
    stream = PacedStream(allowed_lag_s=-1.0)
    clock = pacer(target=stream)
    stream.received(START_S + 1.0)
    assert clock.wait_s(0.0) > 0.0
    stream.received(START_S + 1.1)
    assert clock.wait_s(0.0) == 0.0


def test_before_its_first_message_a_stream_holds_time_as_if_heard_at_the_start() -> None:
    """Else time would run away from a receiver that starts slowly, and its queue would overflow."""
    stream = PacedStream(allowed_lag_s=0.19)
    clock = pacer(tick_s=0.1, truth=stream)
    assert clock.wait_s(0.0) == 0.0
    clock.advance(0.0)
    assert clock.wait_s(0.0) == pytest.approx(clock.long_patience_s)


def test_what_is_sent_ahead_is_not_waited_for_before_it_is_heard() -> None:
    clock = pacer(target=PacedStream(allowed_lag_s=-1.0))
    for _ in range(100):
        assert clock.wait_s(0.0) == 0.0
        clock.advance(0.0)


@pytest.mark.parametrize("speed", [0.0, 1000.0])
def test_a_silent_stream_is_given_up_after_the_patience_and_waited_for_again_when_heard(speed: float) -> None:
    stream = PacedStream(allowed_lag_s=0.05)
    clock = pacer(speed, joints=stream)
    patience_s = clock.patience_s if speed else clock.long_patience_s
    stream.received(START_S)
    wall_s = 0.01
    while clock.wait_s(wall_s) == 0.0:
        clock.advance(wall_s)
    assert clock.wait_s(wall_s) == pytest.approx(patience_s)
    assert clock.wait_s(wall_s + 0.4 * patience_s) == pytest.approx(0.6 * patience_s)
    wall_s += 1.1 * patience_s
    assert clock.wait_s(wall_s) == 0.0
    assert (stream.waits, stream.abandoned) == (1, 1)
    for _ in range(100):
        wall_s += 0.001
        assert clock.wait_s(wall_s) == 0.0
        clock.advance(wall_s)
    stream.received(clock.now_s - 0.2)
    stream.received(clock.now_s - 0.1)
    assert clock.wait_s(wall_s) > 0.0


def test_a_sparse_stream_is_not_waited_for() -> None:
    """Conscan gives an error every few seconds; time must not stop for it."""
    stream = PacedStream(allowed_lag_s=0.2)
    clock = pacer(errors=stream)
    stream.received(START_S)
    stream.received(START_S + LARGEST_SPACING_S + 1.0)
    for _ in range(200):
        assert clock.wait_s(0.0) == 0.0
        clock.advance(0.0)


def test_a_stream_known_to_be_slow_is_waited_for() -> None:
    stream = PacedStream(allowed_lag_s=2.5, spacing_s=2.5)
    clock = pacer(poses=stream)
    for k in (0.0, 2.0):
        stream.received(START_S + k)
    while clock.wait_s(0.0) == 0.0:
        clock.advance(0.0)
    assert clock.now_s == pytest.approx(START_S + 4.5)


def test_without_the_antenna_time_runs_no_faster_than_the_wall_clock() -> None:
    stream = PacedStream(allowed_lag_s=0.05, essential=True)
    clock = pacer(joints=stream)
    stream.received(START_S)
    while clock.wait_s(0.0) == 0.0:
        clock.advance(0.0)
    wall_s = clock.long_patience_s + 0.1
    assert clock.wait_s(wall_s) == 0.0
    clock.advance(wall_s)
    for _ in range(5):
        assert clock.wait_s(wall_s) == pytest.approx(TICK_S)
        wall_s += TICK_S
        assert clock.wait_s(wall_s) == pytest.approx(0.0, abs=1e-12)
        clock.advance(wall_s)


def test_the_antenna_is_waited_for_longer_than_the_others_in_real_time() -> None:
    essential, other = PacedStream(allowed_lag_s=0.05, essential=True), PacedStream(allowed_lag_s=0.05)
    for stream in (essential, other):
        clock = pacer(1.0, joints=stream)
        wall_s = 0.0
        stream.received(START_S)
        while (wait_s := clock.wait_s(wall_s)) <= 2.0 * TICK_S:
            wall_s += wait_s
            if wait_s == 0.0:
                clock.advance(wall_s)
        assert wait_s == pytest.approx(clock.long_patience_s if stream.essential else clock.patience_s)


def test_a_pace_lost_to_the_graph_is_not_made_up_in_a_rush() -> None:
    clock = pacer(speed=1.0)
    clock.advance(TICK_S)
    clock.advance(10.0)
    assert clock.wait_s(10.0) == pytest.approx(TICK_S)


def test_a_short_delay_is_made_up() -> None:
    clock = pacer(speed=1.0)
    clock.advance(0.5)
    assert clock.wait_s(0.5) == 0.0


def test_several_streams_all_hold_time() -> None:
    first, second = PacedStream(allowed_lag_s=0.05), PacedStream(allowed_lag_s=0.05)
    clock = pacer(first=first, second=second)
    first.received(START_S + 10.0)
    second.received(START_S)
    while clock.wait_s(0.0) == 0.0:
        clock.advance(0.0)
    assert clock.now_s == pytest.approx(START_S + 0.04)


def test_time_held_or_due_says_how_long_to_wait() -> None:
    held = Pacer(start_s=START_S, tick_s=TICK_S, speed=0.0, streams={})
    assert held.wait_s(100.0) == 0.5
    # Time that is held again begins where it was, without a rush.
    clock = pacer(2.0)
    for _ in range(50):
        clock.advance(0.0)
    clock.begin(7.0)
    assert clock.wait_s(7.0) == pytest.approx(0.5 * TICK_S)


def test_a_spacing_of_250_ms_is_waited_for_and_more_is_sparse() -> None:
    stream = PacedStream(allowed_lag_s=0.2)
    stream.received(START_S)
    stream.received(START_S + 0.25)
    assert stream.waited_for
    stream.received(START_S + 0.501)
    assert not stream.waited_for
    # An older stamp is a repetition: the newest stays.
    stream.received(START_S)
    assert (stream.newest_s, stream.waited_for) == (START_S + 0.501, True)


def test_a_stamp_rounded_to_a_microsecond_holds_no_tick() -> None:
    stream = PacedStream(allowed_lag_s=0.1)
    clock = pacer(joints=stream)
    stream.received(START_S - 0.08 - 0.9e-3 * TICK_S)
    stream.newest_s = START_S - 0.08 - 0.9e-3 * TICK_S
    assert clock.wait_s(0.0) == 0.0
    stream.newest_s = START_S - 0.08 - 1.2e-3 * TICK_S
    assert clock.wait_s(0.0) > 0.0


def test_a_delay_of_a_second_is_made_up_and_more_is_not() -> None:
    for late_s, wait_s in ((1.0, 0.0), (1.01, TICK_S)):
        clock = pacer(speed=1.0)
        clock.advance(TICK_S + late_s)
        assert clock.wait_s(TICK_S + late_s) == pytest.approx(wait_s)


def test_each_wait_for_a_stream_is_counted_once() -> None:
    stream = PacedStream(allowed_lag_s=0.05)
    clock = pacer(joints=stream)
    stream.received(START_S - 1.0)
    stream.newest_s = START_S - 1.0
    for wall_s in (0.0, 0.1, 0.2):
        assert clock.wait_s(wall_s) == pytest.approx(5.0 - wall_s)
    assert (stream.waits, stream.abandoned) == (1, 0)
    stream.received(START_S + 1.0)
    stream.waited_for = True
    assert clock.wait_s(0.3) == 0.0
    assert (stream.waits, stream.waiting_since_s) == (1, None)
