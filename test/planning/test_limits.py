"""The gate every commanded position passes, and the turn that a pass is tracked on."""

import math

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, AxisRates, choose_turns
from rf_pointing.planning.limits import slew_time_s

LIMITS = AxisLimits(
    azimuth_min_rad=math.radians(-220.0), azimuth_max_rad=math.radians(220.0),
    elevation_min_rad=math.radians(4.0), elevation_max_rad=math.radians(89.0),
)  # fmt: skip
TURN_RAD = 2.0 * math.pi


def refused(azimuth_deg: float, elevation_deg: float, present_deg: tuple[float, float] | None = None) -> str:
    present = None if present_deg is None else (math.radians(present_deg[0]), math.radians(present_deg[1]))
    return LIMITS.reason(math.radians(azimuth_deg), math.radians(elevation_deg), present)


@pytest.mark.parametrize("axis", ["azimuth", "elevation"])
def test_an_empty_travel_is_refused_naming_both_ends(axis: str) -> None:
    low, high = f"{axis}_min_rad", f"{axis}_max_rad"
    with pytest.raises(ValueError, match=rf"^{low}=1\.0 must be < {high}=1\.0$"):
        AxisLimits(**{low: 1.0, high: 1.0})


def test_every_position_inside_may_be_commanded_and_none_outside(random: np.random.Generator) -> None:
    for azimuth, elevation in random.uniform((-5.0, -0.3), (5.0, 1.9), (500, 2)):
        inside = (
            LIMITS.azimuth_min_rad <= azimuth <= LIMITS.azimuth_max_rad
            and LIMITS.elevation_min_rad <= elevation <= LIMITS.elevation_max_rad
        )
        assert (LIMITS.reason(azimuth, elevation) == "") == inside


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_position_that_is_not_finite_is_an_error_not_a_refusal(bad: float) -> None:
    with pytest.raises(ValueError, match=r"^elevation=.* must be finite$"):
        LIMITS.reason(0.0, bad)


def test_from_outside_no_step_further_out_is_allowed() -> None:
    assert "azimuth 220.001 deg" in refused(220.0010, 40.0, (220.0003, 40.0))
    assert "elevation 3.500 deg" in refused(221.0, 3.5, (222.0, 40.0))


def test_the_turn_keeps_the_whole_pass_inside_and_is_the_nearest_of_those_that_do(random: np.random.Generator) -> None:
    for start, length, present in random.uniform((-12.0, 0.0, -3.8), (12.0, 4.0, 3.8), (300, 3)):
        fits = [
            k
            for k in range(-5, 6)
            if LIMITS.azimuth_min_rad <= start + k * TURN_RAD
            and start + length + k * TURN_RAD <= LIMITS.azimuth_max_rad
        ]
        if not fits:
            with pytest.raises(ValueError, match="fits no turn"):
                choose_turns(LIMITS, start, start + length, present)
            continue
        turns = choose_turns(LIMITS, start, start + length, present)
        assert turns in fits
        away = {k: abs(start + 0.5 * length + k * TURN_RAD - present) for k in fits}
        assert away[turns] == pytest.approx(min(away.values()), abs=1e-12)


def test_a_pass_longer_than_the_travel_fits_no_turn() -> None:
    with pytest.raises(
        ValueError, match=r"azimuth 0\.0 to 441\.0 deg fits no turn within the travel -220\.0 to 220\.0"
    ):
        choose_turns(LIMITS, 0.0, math.radians(441.0), 0.0)


def test_half_a_turn_either_way_is_not_decided_by_the_last_bits(random: np.random.Generator) -> None:
    for middle in random.uniform(-0.6, 0.6, 50).tolist():
        present = middle + math.pi * (1.0 + 1e-15 * random.standard_normal())
        wide = LIMITS.replace(azimuth_min_rad=-12.0, azimuth_max_rad=12.0)
        assert choose_turns(wide, middle - 0.1, middle + 0.1, present) == 0


@pytest.mark.parametrize("axis", [0, 1])
def test_a_tolerance_lies_outside_both_ends(axis: int) -> None:
    tolerance_rad, centre = math.radians(0.1), [0.0, 1.0]
    for end, outward in ((LIMITS.lowest_rad[axis], -1.0), (LIMITS.highest_rad[axis], 1.0)):
        for share, inside in ((0.9, True), (1.1, False)):
            wanted = [*centre]
            wanted[axis] = end + outward * share * tolerance_rad
            assert (LIMITS.reason(*wanted, tolerance_rad=tolerance_rad) == "") == inside
            assert LIMITS.reason(*wanted) != ""


@pytest.mark.parametrize(
    ("distance", "seconds"),
    [(0.0, 0.0), (0.5, 1.0), (4.0, math.sqrt(8.0)), (4.5, 3.0), (-4.5, 3.0), (9.0, 4.5), (-9.0, 4.5)],
)
def test_a_slew_takes_the_time_of_its_rise_its_run_and_its_fall(distance: float, seconds: float) -> None:
    """3 rad/s and 2 rad/s^2: the rate is reached from 4.5 rad on."""
    assert slew_time_s(distance, 3.0, 2.0) == pytest.approx(seconds)
    axes = AxisRates((3.0, 1.0), (2.0, 9.0))
    assert axes.slew_s((1.0, 0.3), (1.0 + distance, 0.3)) == pytest.approx(seconds)
    assert axes.slew_s((0.0, 0.0), (0.0, 2.0)) == pytest.approx(2.0 + 1.0 / 9.0)
