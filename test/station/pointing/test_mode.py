"""Seconds tracked and lost, and the rms of what the sensor said."""

import math

import pytest

from rf_pointing.core import PointingError
from rf_pointing.station.pointing.mode import PassStatistics


def error(right_rad: float = 0.0, up_rad: float = 0.0, valid: bool = True) -> PointingError:
    return PointingError(t_s=0.0, sensor="monopulse", cross_elevation_rad=right_rad, elevation_rad=up_rad, valid=valid)


def test_before_the_pass_nothing_counts() -> None:
    tally = PassStatistics()
    tally.count(0.1, "slew", None, False)
    assert (tally.tracked_s, tally.lost_s, tally.share) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("mode", "sensed", "tracked"),
    [
        ("program_track", None, True),
        ("conscan", None, True),
        ("monopulse", error(), True),
        ("monopulse", error(valid=False), False),
        ("monopulse", None, False),
        ("search", error(), False),
        ("slew", None, False),
        ("coast", error(), False),
    ],
)
def test_what_counts_as_tracked(mode: str, sensed: PointingError | None, tracked: bool) -> None:
    tally = PassStatistics()
    tally.count(0.1, mode, sensed, True)
    assert (tally.tracked_s, tally.lost_s) == ((0.1, 0.0) if tracked else (0.0, 0.1))


def test_share_and_rms_over_a_pass() -> None:
    tally = PassStatistics()
    for k in range(100):
        tally.count(0.1, "monopulse", error(0.003 if k % 2 else -0.003, 0.004), True)
    for _ in range(25):
        tally.count(0.1, "coast", None, True)
    assert tally.share == pytest.approx(0.8)
    assert tally.rms_rad == (pytest.approx(0.003), pytest.approx(0.004))


def test_without_samples_the_rms_is_zero() -> None:
    assert PassStatistics().rms_rad == (0.0, 0.0)
    assert not math.isnan(PassStatistics().share)
