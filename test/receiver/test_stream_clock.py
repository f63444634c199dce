"""Times of a stream: whatever is late or stands still, no time is made that has not come."""

from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.receiver.stream_clock import (
    FAR_OFF,
    JUDGED_S,
    STALL_S,
    WINDOW_S,
    WITHIN_S,
    SmoothClock,
    StreamClock,
)  # fmt: skip

STEP_S, LOOK_S = 0.02, 0.005
RATE_HZ, PIECE_S = 1e5, 0.05


@given(st.lists(st.tuples(st.floats(0.03, 0.4), st.floats(0.0, 0.3)), max_size=20))
def test_a_clock_that_is_received_late_goes_on_meanwhile(rounds: list[tuple[float, float]]) -> None:
    """Free for a while, then busy: only while free its steps are received."""
    steady_s, received_s = 0.0, 1000.0
    clock = SmoothClock(lambda: received_s, lambda: steady_s)
    for free_s, busy_s in [(0.1, 0.0), *rounds]:
        until_s = steady_s + free_s
        while steady_s < until_s + busy_s:
            if steady_s < until_s:
                received_s = 1000.0 + STEP_S * int(steady_s / STEP_S)
            assert -STEP_S - 1e-9 <= clock.now_s() - 1000.0 - steady_s <= 1e-9
            steady_s += LOOK_S


@given(st.floats(0.0, 20.0), st.floats(-5.0, 5.0))
def test_a_clock_that_stands_or_is_set_is_followed(stands_s: float, set_s: float) -> None:
    steady_s, received_s = 0.0, 1000.0
    clock = SmoothClock(lambda: received_s, lambda: steady_s)
    for _ in range(200):
        assert abs(clock.now_s() - received_s) < 1e-9
        steady_s, received_s = steady_s + LOOK_S, received_s + LOOK_S
    until_s = steady_s + stands_s
    while steady_s < until_s:
        assert received_s - 1e-9 <= clock.now_s() <= received_s + STALL_S + LOOK_S
        steady_s += LOOK_S
    received_s += set_s
    for _ in range(round(2.0 * WITHIN_S / LOOK_S)):
        steady_s, received_s = steady_s + LOOK_S, received_s + LOOK_S
        clock.now_s()
    assert abs(clock.now_s() - received_s) < LOOK_S


@given(st.floats(6.0, 12.0), st.floats(3.0, 9.0), st.sampled_from([0.3, 0.5, 0.7, 1.5, 2.0]))
def test_a_wrong_rate_is_named_and_2_s_after_its_end_gone_with_what_it_made_of_the_times(
    right_s: float, wrong_s: float, share: float
) -> None:
    clock, index, now_s, named_s = StreamClock(RATE_HZ), 0, 1000.0, [0.0]
    for rate_hz, seconds in ((RATE_HZ, right_s), (share * RATE_HZ, wrong_s), (RATE_HZ, 2.2)):
        for piece in range(round(seconds / PIECE_S)):
            index, now_s = index + round(rate_hz * PIECE_S), now_s + PIECE_S
            clock.take(index, now_s)
            if rate_hz != RATE_HZ and clock.wrong_rate:
                named_s.append(piece * PIECE_S)
    # At the latest after a whole window of the right rate.
    after_s = FAR_OFF * WINDOW_S / (abs(share - 1.0) - FAR_OFF)
    assert named_s[1] < max(after_s, JUDGED_S) + 2.0 * PIECE_S
    assert not clock.wrong_rate
    assert abs((clock.time_s(index) or 0.0) - now_s) < FAR_OFF + PIECE_S
