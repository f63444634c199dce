"""Going over the top: within the axes' limits, from one side's path to the other's, and no further off than it must be."""

import math

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, MachineParams, plunged
from rf_pointing.planning.branch_motion import branch_motions, no_lag
from rf_pointing.planning.crossing import AxisMotionLimits, cross
from rf_pointing.planning.forbidden_sky import angle_between
from rf_pointing.planning.over_the_top import cross_over
from test.planning.test_crossing import LIMITS, STEP_S, beam, overhead

Array = np.ndarray
DEG = math.pi / 180.0


def sides(miss_deg: float, side: float) -> tuple[Array, tuple[Array, ...], tuple[Array, ...]]:
    t, *path = overhead(miss_deg)
    first = tuple(part * np.array([side, 1.0]) for part in path)
    return t, first, plunged(*first)


@pytest.mark.parametrize("miss_deg", [0.05, 0.4, 1.0, 4.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_dish_goes_over_within_the_limits_and_joins_both_paths(miss_deg: float, side: float) -> None:
    t, first, second = sides(miss_deg, side)
    found = cross_over(t, first, second, LIMITS, beam(0.264))
    assert found is not None
    rates = np.diff(found.position_rad, axis=0) / STEP_S
    bends = np.diff(rates, axis=0) / STEP_S
    assert np.all(np.abs(rates).max(axis=0) <= np.array(LIMITS.rate_rad_s) * 1.001)
    assert np.all(np.abs(bends).max(axis=0) <= np.array(LIMITS.acceleration_rad_s2) * 1.1)
    row = round((found.t_s[0] - t[0]) / STEP_S)
    last = row + len(found.t_s) - 1
    np.testing.assert_allclose(found.position_rad[0], first[0][row], atol=1e-9)
    np.testing.assert_allclose(found.position_rad[-1], second[0][last] + [found.turn_rad, 0.0], atol=1e-9)
    assert found.t_s[0] < found.over_t_s < found.t_s[-1]
    over = found.t_s >= found.over_t_s
    assert found.position_rad[over, 1].min() >= 0.5 * math.pi - 1e-9
    # The azimuth makes what is left of the target's half turn, not the half turn.
    assert np.ptp(found.position_rad[:, 0]) < 0.75 * math.pi


@pytest.mark.parametrize("miss_deg", [0.05, 0.4, 1.0, 4.0])
def test_the_error_is_the_true_angle_and_at_least_what_the_target_misses_the_zenith_by(miss_deg: float) -> None:
    t, first, second = sides(miss_deg, 1.0)
    found = cross_over(t, first, second, LIMITS, beam(0.264))
    part = slice(round((found.t_s[0] - t[0]) / STEP_S), None)
    target = first[0][part][: len(found.t_s)]
    np.testing.assert_allclose(found.error_rad, angle_between(found.position_rad, target), atol=2e-6)
    assert found.error_rad.max() >= 0.98 * miss_deg * DEG
    assert found.error_rad.max() <= 1.2 * miss_deg * DEG


@pytest.mark.parametrize(("miss_deg", "share"), [(0.05, 0.02), (1.0, 0.3), (4.0, 0.6)])
def test_it_loses_less_than_turning_on_one_side(miss_deg: float, share: float) -> None:
    t, first, second = sides(miss_deg, 1.0)
    gain = beam(0.264)
    over, aside = cross_over(t, first, second, LIMITS, gain), cross(t, *first, LIMITS, gain)
    lost = [float(np.sum(1.0 - gain(found.error_rad)) * STEP_S) for found in (over, aside)]
    assert lost[0] < share * lost[1]


def test_an_elevation_axis_that_is_too_slow_cannot_go_over() -> None:
    t, first, second = sides(0.4, 1.0)
    slow = AxisMotionLimits(LIMITS.rate_rad_s, (LIMITS.rate_rad_s[0], 1e-5 * DEG), LIMITS.elevation_max_rad)
    assert cross_over(t, first, second, slow, beam(0.264)) is None


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_of_little_rate_crosses_within_it_or_not_at_all(axis: int) -> None:
    """From far below to just above the rate that a fast antenna takes; accelerations are ample."""
    t, first, second = sides(1.0, 1.0)
    ample = AxisMotionLimits((2.0 * DEG, 2.0 * DEG), (5.0 * DEG, 5.0 * DEG), LIMITS.elevation_max_rad)
    free = cross_over(t, first, second, ample, beam(0.264))
    assert free is not None
    taken = float(np.abs(np.diff(free.position_rad[:, axis])).max()) / STEP_S
    outcomes = []
    for share in (0.05, 0.7, 1.05):
        rate = [2.0 * DEG, 2.0 * DEG]
        rate[axis] = share * taken
        slow = AxisMotionLimits((rate[0], rate[1]), ample.acceleration_rad_s2, ample.elevation_max_rad)
        found = cross_over(t, first, second, slow, beam(0.264))
        outcomes.append(found is not None)
        if found is not None:
            assert np.abs(np.diff(found.position_rad[:, axis])).max() / STEP_S <= 1.001 * rate[axis]
    assert outcomes[-1]


def test_an_azimuth_error_of_the_mount_is_blended_in_within_the_limits() -> None:
    """Half a degree on the far side costs the beam nothing: it is the axis that it moves."""
    t, first, second = sides(0.4, 1.0)
    found = cross_over(t, first, (second[0] + np.array([0.5 * DEG, 0.0]), *second[1:]), LIMITS, beam(0.264))
    assert found is not None
    rates = np.diff(found.position_rad, axis=0) / STEP_S
    assert np.all(np.abs(rates).max(axis=0) <= np.array(LIMITS.rate_rad_s) * 1.001)
    assert found.error_rad.max() == pytest.approx(0.4 * DEG, rel=0.01)


def test_a_crossing_does_not_depend_on_the_zero_of_time() -> None:
    """The mount's errors change along the pass, so the lines that blend them in have slopes."""
    t, first, second = sides(0.4, 1.0)
    slope = np.column_stack([1e-5 * t, -4e-6 * t])
    mount = (second[0] + slope, second[1] + np.array([1e-5, -4e-6]), second[2])
    here, late = (cross_over(times, first, mount, LIMITS, beam(0.264)) for times in (t, t + 5e4))
    assert here is not None
    assert late is not None
    np.testing.assert_allclose(late.position_rad, here.position_rad, atol=1e-6)
    np.testing.assert_allclose(late.error_rad, here.error_rad, atol=1e-6)
    assert late.over_t_s - here.over_t_s == pytest.approx(5e4)


def test_only_an_elevation_axis_that_passes_the_zenith_goes_over_it() -> None:
    t, first, second = sides(0.4, 1.0)
    machine = MachineParams(rate_limit_rad_s=LIMITS.rate_rad_s, acceleration_limit_rad_s2=LIMITS.acceleration_rad_s2)
    for most_deg, over in ((89.0, False), (95.0, True)):
        travel = AxisLimits(elevation_max_rad=most_deg * DEG)
        found = branch_motions(t, {False: first, True: second}, machine, travel, beam(0.264), no_lag)
        assert any(one.crossing is not None and one.crossing.over_t_s is not None for one in found) is over
