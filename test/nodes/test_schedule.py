"""Periodic work: every instant of the grid once, in order, however the timer fires."""

import numpy as np
import pytest

from rf_pointing.nodes.schedule import Schedule

START_S = 1_151_384_000.0


def test_every_instant_comes_once_and_in_order_however_late_the_timer_fires(random: np.random.Generator) -> None:
    schedule, now_s, done = Schedule(START_S, 0.02), START_S, []
    for delay_s in random.uniform(0.0, 0.4, 400):
        now_s += delay_s
        done += schedule.due(now_s)
        assert schedule.jumped_s == 0.0
    assert done == [round(START_S + 0.02 * k, 6) for k in range(1, len(done) + 1)]
    assert now_s - 0.02 - 1e-6 < done[-1] <= now_s + 1e-3


def test_the_grid_does_not_drift() -> None:
    schedule = Schedule(START_S, 0.1)
    times = [t for k in range(1, 100_001) for t in schedule.due(START_S + 0.1 * k)]
    assert len(times) == 100_000
    assert times[-1] == START_S + 10_000.0


def test_a_timer_that_fires_twice_at_one_time_does_nothing_the_second_time() -> None:
    schedule = Schedule(START_S, 0.1)
    assert schedule.due(START_S + 0.1) == [START_S + 0.1]
    assert schedule.due(START_S + 0.1) == []


def test_nothing_is_due_before_the_first_period_is_over() -> None:
    assert Schedule(START_S, 0.1).due(START_S + 0.09) == []


@pytest.mark.parametrize("jump_s", [3600.0, -3600.0, 0.9, -0.9])
def test_a_clock_that_jumps_starts_a_new_grid_and_says_so(jump_s: float) -> None:
    schedule = Schedule(START_S, 0.02)
    schedule.due(START_S + 0.02)
    assert schedule.due(START_S + 0.04 + jump_s) == [round(START_S + 0.04 + jump_s, 6)]
    assert schedule.jumped_s == pytest.approx(jump_s, abs=1e-6)
    assert schedule.due(START_S + 0.06 + jump_s) == [round(START_S + 0.06 + jump_s, 6)]
    assert schedule.jumped_s == 0.0


def test_a_long_period_is_not_taken_for_a_jump() -> None:
    schedule = Schedule(START_S, 5.0)
    assert schedule.due(START_S + 9.9) == [START_S + 5.0]
    assert schedule.jumped_s == 0.0
