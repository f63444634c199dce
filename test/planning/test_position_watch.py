"""Jumps of a device that is polled: what may lie between two readings is what their answers left open."""

import math

import pytest

from rf_pointing.planning.position_watch import PositionLimits, PositionWatch

LIMITS = PositionLimits(resolution_rad=(1e-4, 1e-4), rate_rad_s=(0.1, 0.1))
AT_REST = (None, None)
# Of the rate in 0.2 s, times the 1.5 that are allowed, and two steps of the encoder.
ALLOWED_RAD = 1.5 * 0.1 * 0.2 + 2e-4


@pytest.mark.parametrize(
    ("within_s", "moved_rad", "fault"),
    [
        ((0.0, 0.0), ALLOWED_RAD - 1e-6, False),
        ((0.0, 0.0), ALLOWED_RAD + 1e-6, True),
        # The first answer came late: the second may be 0.4 s and more after it.
        ((0.4, 0.0), ALLOWED_RAD + 1.5 * 0.1 * 0.4 - 1e-6, False),
        ((0.1, 0.3), ALLOWED_RAD + 1.5 * 0.1 * 0.4 - 1e-6, False),
        ((0.1, 0.3), ALLOWED_RAD + 1.5 * 0.1 * 0.4 + 1e-6, True),
    ],
)
def test_a_jump_is_more_than_the_longest_time_between_two_readings_allows(
    within_s: tuple[float, float], moved_rad: float, fault: bool
) -> None:
    watch, target = PositionWatch(LIMITS), (1.0, 1.0)
    watch.step(10.0, (0.0, 0.0), AT_REST, 0.0, within_s[0])
    used, reason = watch.step(10.2, (moved_rad, 0.0), target, 0.0, within_s[1])
    assert used[0] == (0.0 if fault else moved_rad)
    assert reason == ""
    _, reason = watch.step(10.2, (2.0 * moved_rad, 0.0), target, 0.0, within_s[1])
    if fault:
        assert reason.startswith(f"azimuth encoder jumped by {math.degrees(2.0 * moved_rad):.2f} deg in ")


def test_after_a_reset_in_motion_the_rest_of_the_way_is_commanded() -> None:
    """The turn of the cables is placed while the axes are on their way: the set point is in force already."""
    watch, target = PositionWatch(LIMITS), (1.0, -1.0)
    watch.step(10.0, (0.0, 0.0), target, 0.0)
    watch.reset()
    for step in range(1, 40):
        way = 0.02 * step
        assert watch.step(10.0 + 0.2 * step, (way, -way), target, 0.0) == ((way, -way), "")


def test_a_reset_forgets_how_late_the_last_answer_was() -> None:
    watch, target = PositionWatch(LIMITS), (1.0, 1.0)
    watch.step(10.0, (0.0, 0.0), AT_REST, 0.0, 5.0)
    watch.reset()
    watch.step(10.0, (0.0, 0.0), AT_REST, 0.0)
    assert watch.step(10.2, (ALLOWED_RAD + 1e-3, 0.0), target, 0.0)[0][0] == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_drift_beyond_the_set_point_is_told_after_the_margin_and_not_before(side: float) -> None:
    """Two steps of the encoder, and what the axis moves in a period and the latency: 30.2 mrad."""
    watch, margin_rad = PositionWatch(LIMITS), 2e-4 + 0.1 * (0.2 + 0.1)
    for reading in range(40):
        angle = side * 0.001 * reading
        _, reason = watch.step(0.2 * reading, (angle, 0.0), (0.0, 0.0), 0.1)
        assert bool(reason) == (abs(angle) > margin_rad), angle
    assert reason.startswith(f"azimuth moves without a command, {math.degrees(0.039):.2f} deg beyond its set point, ")


def first_standstill_s(watch: PositionWatch, t_s: float, angle: float) -> float:
    for reading in range(1, 30):
        if watch.step(t_s + 0.3 * reading, (angle, 0.0), (1.0, 0.0), 0.0)[1]:
            return 0.3 * reading
    return math.inf


def test_a_motor_that_stops_is_told_sooner_than_a_device_that_does_not_start() -> None:
    """Standing for more than two periods, against `still_s` and two periods: at the next reading each time."""
    running, resting = PositionWatch(LIMITS), PositionWatch(LIMITS)
    running.step(-0.3, (0.0, 0.0), AT_REST, 0.0)
    for reading in range(5):
        assert running.step(0.3 * reading, (0.01 * reading, 0.0), (1.0, 0.0), 0.0)[1] == ""
    assert first_standstill_s(running, 1.2, 0.04) == pytest.approx(0.6)
    resting.step(0.0, (0.0, 0.0), AT_REST, 0.0)
    assert resting.step(0.3, (0.0, 0.0), (1.0, 0.0), 0.0)[1] == ""
    assert first_standstill_s(resting, 0.3, 0.0) == pytest.approx(1.5)
    # One that moved the other way does not run towards its set point.
    turned = PositionWatch(LIMITS)
    turned.step(-0.3, (0.0, 0.0), AT_REST, 0.0)
    for reading in range(5):
        turned.step(0.3 * reading, (-0.002 * reading, 0.0), (1.0, 0.0), 0.0)
    assert first_standstill_s(turned, 1.2, -0.008) == pytest.approx(1.5)


def test_after_a_jump_that_stayed_a_single_wrong_reading_is_bridged_again() -> None:
    watch = PositionWatch(LIMITS)
    watch.step(0.0, (0.0, 0.0), AT_REST, 0.0)
    assert watch.step(0.2, (1.0, 0.0), AT_REST, 0.0) == ((0.0, 0.0), "")
    assert "jumped" in watch.step(0.4, (1.0, 0.0), AT_REST, 0.0)[1]
    assert watch.step(0.6, (2.0, 0.0), AT_REST, 0.0) == ((1.0, 0.0), "")


def test_a_step_of_the_encoder_with_every_reading_is_motion() -> None:
    watch = PositionWatch(LIMITS)
    for reading in range(40):
        place = 0.3 + 1e-4 * reading
        assert watch.step(0.2 * reading, (place, -place), (1.0, -1.0), 0.0) == ((place, -place), "")
    # Less than a step is none.
    said = [
        watch.step(8.0 + 0.2 * reading, (place + 9e-5 * (reading % 2), -place), (1.0, -1.0), 0.0)[1]
        for reading in range(9)
    ]
    assert "azimuth stands still" in said[-1]


def test_a_number_that_is_none_is_bridged_once_and_told_then() -> None:
    watch = PositionWatch(LIMITS)
    watch.step(0.0, (0.1, 0.2), AT_REST, 0.0)
    assert watch.step(0.2, (math.nan, 0.2), AT_REST, 0.0) == ((0.1, 0.2), "")
    assert watch.step(0.4, (math.nan, 0.2), AT_REST, 0.0)[1].startswith("azimuth encoder jumped by nan deg")
    assert watch.reason != ""
    watch.reset()
    assert watch.reason == ""


def test_both_axes_tell_what_is_wrong_with_them() -> None:
    watch = PositionWatch(LIMITS)
    watch.step(0.0, (0.1, 0.2), (0.1, 0.2), 0.0)
    for reading in range(1, 30):
        drift = 0.002 * reading
        used, said = watch.step(0.2 * reading, (0.1 - drift, 0.2 + drift), (0.1, 0.2), 0.0)
        assert used == (0.1 - drift, 0.2 + drift)
    past = f"moves without a command, {math.degrees(0.058):.2f} deg beyond its set point, at most 1.16 deg"
    assert said == watch.reason == f"azimuth {past}; elevation {past}"
