"""What becomes of commands: taken, or refused with the reason and without any other effect."""

import dataclasses

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.servo import WindParams
from rf_pointing.station.antenna.loops import LoopParams
from test.station.stepped_antenna import ENCODER_RAD, STANDING, START_S, Clock, antenna, enabled, hold_at, ramp


def test_brakes_hold_an_inactive_antenna_and_commands_are_rejected() -> None:
    clock = Clock(antenna(wind=WindParams(mean_speed_m_s=8.0)))
    assert clock.antenna.accept(ramp(START_S), START_S) == "the antenna is not active"
    clock.run(3.0)
    status = clock.antenna.status(clock.t_s)
    assert (status.mode, status.commands_accepted, status.commands_rejected) == ("inactive", 0, 1)
    assert np.max(np.abs(np.array(clock.position) - STANDING)) < ENCODER_RAD


def test_a_command_beyond_the_travel_is_refused_with_the_limit_and_moves_nothing() -> None:
    loops = LoopParams(preprocessor=CommandPreprocessorParams(travel_max_rad=(3.9, STANDING[1] + 0.05)))
    clock = enabled(loops=loops)
    refused = clock.antenna.accept(hold_at(clock.t_s + 0.1, STANDING + np.array([0.0, 0.5])), clock.t_s)
    assert refused == "elevation 88.648 deg is 25.783 deg past the limit 62.865 deg"
    assert clock.antenna.status(clock.t_s).last_rejection == refused
    clock.run(2.0)
    assert np.max(np.abs(np.array(clock.commanded) - STANDING)) < ENCODER_RAD


def test_rejected_commands_change_nothing_but_the_count() -> None:
    """Two antennas of one seed, one of them pestered: bit for bit the same motion."""
    calm, pestered = enabled(wind=WindParams(mean_speed_m_s=8.0)), enabled(wind=WindParams(mean_speed_m_s=8.0))
    for step in range(30):
        for clock in (calm, pestered):
            good = ramp(clock.t_s)
            assert clock.antenna.accept(good, clock.t_s) == ""
            if clock is pestered:
                far = dataclasses.replace(good, position_rad=good.position_rad + 1.0)
                for shift_s in (-5.0, 100.0, -0.05):
                    assert clock.antenna.accept(dataclasses.replace(far, t_s=far.t_s + shift_s), clock.t_s) != ""
                assert clock.antenna.accept(good, clock.t_s) == "duplicate of the latest message"
                clock.antenna.reject("position_rad must be finite")
            clock.run(0.1)
        np.testing.assert_array_equal(pestered.position[-1], calm.position[-1], err_msg=f"step {step}")
    assert calm.antenna.status(calm.t_s).commands_rejected == 0
    status = pestered.antenna.status(pestered.t_s)
    assert (status.commands_accepted, status.commands_rejected) == (30, 150)
    assert status.last_rejection == "position_rad must be finite"


@pytest.mark.parametrize(
    ("shift_s", "words"),
    [
        (-1.2, "stale: its last point is"),
        (70.0, "future: it begins"),
        (-0.05, "out of order: it begins 0.050 s before"),
    ],
)
def test_commands_out_of_time_are_rejected_with_the_reason(shift_s: float, words: str) -> None:
    clock = enabled()
    good = ramp(START_S)
    clock.antenna.accept(good, START_S)
    reason = clock.antenna.accept(dataclasses.replace(good, t_s=good.t_s + shift_s), START_S)
    assert words in reason
    assert clock.antenna.status(START_S).last_rejection == reason


def test_a_message_far_ahead_does_not_keep_later_ones_out() -> None:
    """One that begins 59 s ahead made every later one out of order for 51 s, without a fault."""
    clock = enabled()
    far = ramp(START_S, 1.0, lead_s=0.1)
    far = dataclasses.replace(far, t_s=far.t_s + 59.0)
    assert "must be <= 3.0 s" in clock.antenna.accept(far, START_S)
    assert clock.antenna.accept(ramp(START_S), START_S) == ""


def test_nothing_moves_for_a_commander_that_has_gone() -> None:
    """A table that lies still for 6 s and then moves, from a commander that sends it once: the axes are not moved."""
    clock = enabled()
    table = ramp(START_S, 10.0, rate_rad_s=np.radians(1.0), lead_s=0.1)
    still = table.t_s < START_S + 6.0
    table = dataclasses.replace(
        table,
        position_rad=np.where(
            still[:, None], STANDING, STANDING + (table.t_s - START_S - 6.0)[:, None] * np.radians([1.0, -1.0])
        ),
        velocity_rad_s=np.where(still[:, None], 0.0, table.velocity_rad_s),
    )
    assert clock.antenna.accept(table, START_S, "controller") == ""
    clock.run(12.0)
    status = clock.antenna.status(clock.t_s)
    assert status.fault.startswith("the commander has been silent for ")
    # The segment in which the table gets under way lasts one tick before it is seen to move.
    assert np.max(np.abs(np.array(clock.commanded) - STANDING)) < np.radians(0.01)


def test_a_commander_that_repeats_a_goal_or_has_named_one_is_followed_to_its_end() -> None:
    clock = enabled()
    assert clock.antenna.accept(hold_at(clock.t_s + 0.1, STANDING + np.radians([-15.0, 0.0])), clock.t_s) == ""
    clock.run(20.0)
    status = clock.antenna.status(clock.t_s)
    assert (status.mode, status.fault) == ("holding", "")
    np.testing.assert_allclose(status.commanded_rad, STANDING + np.radians([-15.0, 0.0]), atol=1e-9)


def test_the_status_says_why_nothing_is_transmitted() -> None:
    made = antenna()
    assert made.status(START_S).transmit_inhibit == "the antenna is inactive"
    made.enable()
    assert made.status(START_S).transmit_inhibit == ""
    made.axes.encoder_rad = np.array([2.0, np.radians(9.0)])
    assert "10.0" in made.status(START_S).transmit_inhibit


def test_a_commander_holds_the_antenna_until_it_is_silent_or_the_antenna_moves_by_itself() -> None:
    for free in ("", "stop", "go"):
        clock = enabled()
        assert clock.antenna.accept(ramp(clock.t_s), clock.t_s, "controller") == ""
        assert clock.antenna.status(clock.t_s).commander == "controller"
        clock.run(0.5)
        assert "conflict: controller commands, panel is refused" in clock.antenna.accept(
            ramp(clock.t_s), clock.t_s, "panel"
        )
        if free == "stop":
            clock.antenna.stop()
        elif free == "go":
            assert clock.antenna.park() == ""
        else:
            clock.run(1.1)
        if free:
            assert clock.antenna.status(clock.t_s).commander == ""
        if free != "go":
            clock.run(5.0)
            here = clock.antenna.reading(clock.t_s).position_rad
            assert clock.antenna.accept(hold_at(clock.t_s + 0.1, here), clock.t_s, "panel") == ""
            assert clock.antenna.status(clock.t_s).commander == "panel"
