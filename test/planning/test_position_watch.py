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
        assert reason == f"azimuth encoder jumped by {math.degrees(2.0 * moved_rad):.2f} deg"


def test_a_reset_forgets_how_late_the_last_answer_was() -> None:
    watch, target = PositionWatch(LIMITS), (1.0, 1.0)
    watch.step(10.0, (0.0, 0.0), AT_REST, 0.0, 5.0)
    watch.reset()
    watch.step(10.0, (0.0, 0.0), AT_REST, 0.0)
    assert watch.step(10.2, (ALLOWED_RAD + 1e-3, 0.0), target, 0.0)[0][0] == 0.0
