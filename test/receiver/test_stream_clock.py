"""Times of a stream: whatever is late or stands still, no time is made that has not come."""

from hypothesis import given
from hypothesis import strategies as st

from rf_pointing.receiver.stream_clock import STALL_S, WITHIN_S, SmoothClock

STEP_S, LOOK_S = 0.02, 0.005


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
