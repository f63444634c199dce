"""Axes that follow are trusted; silent, frozen and running ones are found within 2 s, and pauses are no fault."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from rf_pointing.core import JointReading
from rf_pointing.station.pointing.antenna_watch import AntennaWatch, AntennaWatchParams, AxisState

DEG = math.pi / 180.0
PERIOD_S = 0.1
PARAMS = AntennaWatchParams()
TOLERANCE_RAD = 0.05 * DEG
STANDING = np.array([1.0, 0.7])
Moved = Callable[[float, np.ndarray], np.ndarray | None]


def fly(
    moved: Moved, rate_deg_s: tuple[float, float] = (0.3, -0.1), seconds: float = 20.0,
    begin_s: float = 10.0, watch: AntennaWatch | None = None,
) -> list[tuple[float, AxisState]]:  # fmt: skip
    """Step a watch on axes that follow a command at this rate, from `begin_s` on as `moved` says; None: no reading."""
    watch = watch or AntennaWatch(PARAMS, TOLERANCE_RAD)
    watch.restart(0.0)
    reading, states = None, []
    for k in range(1, round(seconds / PERIOD_S)):
        t_s = round(PERIOD_S * k, 6)
        told_s = t_s - PERIOD_S
        command = STANDING + np.array(rate_deg_s) * DEG * told_s
        position = command if told_s < begin_s else moved(told_s - begin_s, command)
        if position is not None:
            reading = JointReading(t_s=told_s, position_rad=position, velocity_rad_s=np.zeros(2))
        watch.take_command(t_s, STANDING + np.array(rate_deg_s) * DEG * t_s)
        states.append((t_s, watch.step(t_s, reading)))
    return states


def found_s(states: list[tuple[float, AxisState]], what: str, begin_s: float = 10.0) -> float:
    """Return how long after the beginning a state has this text."""
    return next(t_s for t_s, state in states if what in (state.fault or state.doubt)) - begin_s


def test_axes_that_follow_are_on_source_and_trusted() -> None:
    states = fly(lambda _t, command: command + np.array([0.02, -0.02]) * DEG)
    assert not any(state.fault or state.doubt for _, state in states)
    last = states[-1][1]
    assert last.on_source
    assert last.settle_count > PARAMS.settle_periods
    assert last.age_s == pytest.approx(PERIOD_S)
    assert last.distance_rad == pytest.approx(math.hypot(0.02 * math.cos(0.7 - 0.03), 0.02) * DEG, rel=0.02)
    np.testing.assert_allclose(last.error_rad, [-0.02 * DEG * math.cos(0.7 - 0.03), 0.02 * DEG], rtol=0.02)


def test_silence_is_told_after_a_second_and_ends_the_pass_when_patience_does() -> None:
    states = fly(lambda _t, _command: None, seconds=40.0)
    assert found_s(states, "joint_states has been silent for") <= 1.2
    assert next(t_s for t_s, state in states if state.fault) - 10.0 == pytest.approx(PARAMS.patience_s, abs=0.2)
    lost = next(state for t_s, state in states if t_s >= 20.0)
    assert lost.distance_rad == pytest.approx(10.0 * math.hypot(0.3 * math.cos(0.68), 0.1) * DEG, rel=0.1)
    assert not lost.on_source


@pytest.mark.parametrize("rate_deg_s", [(0.3, -0.1), (0.1, 0.0), (0.0, 1.5), (5.0, 0.5), (0.05, 0.0)])
def test_frozen_encoders_are_found_within_two_seconds(rate_deg_s: tuple[float, float]) -> None:
    kept: list[np.ndarray] = []

    def frozen(_t: float, command: np.ndarray) -> np.ndarray:
        kept.append(command)
        return kept[0]

    assert found_s(fly(frozen, rate_deg_s), "encoder is frozen") <= 2.0


def test_one_frozen_encoder_is_found_while_the_other_axis_moves_and_named() -> None:
    kept: list[float] = []

    def half_frozen(_t: float, command: np.ndarray) -> np.ndarray:
        kept.append(command[0])
        return np.array([kept[0], command[1]])

    assert found_s(fly(half_frozen, (0.3, 0.4)), "the azimuth encoder is frozen") <= 2.0


def test_a_step_of_the_command_is_followed_as_late_as_the_drive_may() -> None:
    """A step scan on a rotator: it stands for most of a second, and starts half a second after each step."""
    rotator = PARAMS.replace(reaction_s=0.8)

    def command(t_s: float) -> np.ndarray:
        return np.array([1.0, 0.7 + (0.4 * (int(t_s / 1.6) % 2) + 0.02 * t_s) * DEG])

    def stepping(params: AntennaWatchParams) -> list[str]:
        watch, faults = AntennaWatch(params, TOLERANCE_RAD), []
        watch.restart(0.0)
        for tick in range(1, 400):
            t_s = tick * PERIOD_S
            told_s = t_s - PERIOD_S
            watch.take_command(t_s, command(t_s))
            stands = command(1.6 * int(max(told_s - 0.6, 0.0) / 1.6) + 0.01)
            state = watch.step(t_s, JointReading(t_s=told_s, position_rad=stands, velocity_rad_s=np.zeros(2)))
            faults.append(state.fault)
        return [fault for fault in faults if fault]

    assert stepping(rotator) == []
    assert "frozen" in stepping(PARAMS)[0], "a servo that reacts so late has a fault"


@pytest.mark.parametrize("rate_deg_s", [0.6, 1.8, -6.0])
def test_a_runaway_is_found_within_two_seconds(rate_deg_s: float) -> None:
    states = fly(lambda t_s, command: command + np.array([0.0, rate_deg_s * DEG * t_s]), (0.1, 0.02))
    assert found_s(states, "the axes run away") <= 2.0


@pytest.mark.parametrize("late_s", [0.2, 0.8])
def test_axes_that_follow_a_fast_command_late_do_not_run_away(late_s: float) -> None:
    """As at the end of a turn at 6 deg/s: up to 4.8 deg behind it and still falling back, but on its way."""

    def lagging(t_s: float, command: np.ndarray) -> np.ndarray:
        return command - np.array([0.0, 6.0 * DEG * min(late_s, 0.5 * t_s)])

    states = fly(lagging, (0.0, 6.0), seconds=12.0, begin_s=5.0)
    assert max(state.distance_rad for _, state in states) == pytest.approx(6.0 * late_s * DEG, rel=0.01)
    assert not any(state.fault for _, state in states)


def test_axes_that_run_ahead_of_a_fast_command_or_fall_back_for_good_run_away() -> None:
    for ahead in (3.0, -3.0):
        states = fly(
            lambda t_s, command, by=ahead: command + np.array([0.0, by * DEG * t_s]), (0.0, 6.0), seconds=15.0,
            begin_s=5.0,
        )  # fmt: skip
        # Behind its command an axis must first be later than the window.
        assert found_s(states, "the axes run away", 5.0) <= (2.0 if ahead > 0.0 else 4.0)


def test_axes_pushed_off_that_come_back_do_not_run_away() -> None:
    """A gust of 0.45 deg: on the sky beyond the tolerance, below what counts as a runaway."""
    states = fly(lambda t_s, command: command + np.array([0.0, 0.45 * DEG * math.sin(min(t_s, math.pi))]))
    assert not any(state.fault for _, state in states)


def test_a_slew_to_the_command_is_neither_frozen_nor_a_runaway() -> None:
    """The axes stand for 3 s, then come from 40 deg away by way of a corner: they have not settled before."""

    def slewing(t_s: float, command: np.ndarray) -> np.ndarray:
        away = 40.0 if t_s < 3.0 else 40.0 + 5.0 * (t_s - 3.0) if t_s < 5.0 else max(50.0 - 8.0 * (t_s - 5.0), 0.0)
        return command + np.array([0.0, 0.0]) if away == 0.0 else STANDING + np.array([away * DEG, 0.0])

    assert not any(state.fault for _, state in fly(slewing, begin_s=0.0))


def test_a_pause_is_a_doubt_with_its_name_and_no_fault() -> None:
    watch = AntennaWatch(PARAMS, TOLERANCE_RAD)

    def paused(t_s: float, command: np.ndarray) -> np.ndarray:
        watch.take_status("paused" if t_s < 5.0 else "tracking", "")
        return command if t_s > 6.0 else STANDING

    states = fly(paused, watch=watch)
    assert found_s(states, "the antenna is paused") <= 0.2
    assert not any(state.fault for _, state in states)


def test_a_latched_fault_of_the_antenna_is_the_fault_of_the_pass() -> None:
    watch = AntennaWatch(PARAMS, TOLERANCE_RAD)
    watch.take_status("fault", "drives cut: oscillation of azimuth")
    watch.restart(0.0)
    assert watch.step(0.1, None).fault == "antenna fault: drives cut: oscillation of azimuth"
