"""The motions through a pass: planned within what the lags of the mount leave, joined to the target's own path."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, AxisRates, MachineParams
from rf_pointing.planning.branch_motion import Triple, _joined, _planned, branch_motions, no_lag
from rf_pointing.planning.crossing import AxisMotionLimits, Crossing
from test.planning.test_crossing import LIMITS, beam
from test.planning.test_over_the_top import sides

Array = np.ndarray
DEG = math.pi / 180.0
MOST = AxisRates((0.04, 0.03), (0.02, 0.01))
T_S = np.arange(12.0)
# The crossing lies in rows 4 to 7.
PART = slice(4, 8)


def path(rate: float = 0.0) -> Triple:
    """A target whose own rates outside the crossing are no matter of it."""
    rows = np.arange(24.0).reshape(12, 2)
    return 1e-3 * rows, np.full((12, 2), rate), np.full((12, 2), rate)


class Planner:
    """Makes crossings at the limits, in one row of it, and notes what limits it was given."""

    def __init__(self, share: float = 1.0, row: int = 1) -> None:
        self.asked: list[AxisMotionLimits] = []
        self.share, self.row = share, row

    def __call__(self, limits: AxisMotionLimits) -> Crossing:
        self.asked.append(limits)
        rates, bends = np.zeros((4, 2)), np.zeros((4, 2))
        rates[self.row], bends[self.row] = limits.rate_rad_s, limits.acceleration_rad_s2
        position = np.full((4, 2), 0.1)
        position[self.row, 1] = limits.elevation_max_rad
        return Crossing(T_S[PART], position, self.share * rates, self.share * bends, np.zeros(4))

    def shares(self) -> Array:
        """What was asked for over the most: calls, rates and accelerations, axes."""
        return np.array([[one.rate_rad_s, one.acceleration_rad_s2] for one in self.asked]) / np.array(MOST)


def planned(
    planner: Callable[[AxisMotionLimits], Crossing | None], rate_lag: Array, bend_lag: Array, lift_rad: float = 0.0
) -> tuple[Crossing | None, Array]:
    """Plan with lags in proportion to rate and acceleration, the axes `lift_rad` above the beam."""

    def lag(_t_s: Array, rate: Array, bend: Array) -> Triple:
        return np.full_like(rate, lift_rad) * [0.0, 1.0], rate_lag * rate, bend_lag * bend

    return _planned(T_S, path(10.0), path(20.0), MOST, 1.5, lag, planner)


@pytest.mark.parametrize("row", [0, 1, 3])
def test_only_the_axes_that_lags_drag_over_their_limits_get_less_of_them(row: int) -> None:
    planner = Planner(row=row)
    planned(planner, np.array([0.25, 0.0]), np.array([0.0, 0.1]), -0.02)
    np.testing.assert_allclose(planner.shares()[0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(planner.shares()[1:], [[[0.8, 1.0], [1.0, 1.0 / 1.1]]], rtol=1e-12)
    assert [one.elevation_max_rad for one in planner.asked] == [1.5, 1.5], "they are lower than they may be"


@pytest.mark.parametrize(
    ("share", "lag", "calls"),
    [
        (1.0, 0.005, 1),  # a hundredth is allowed
        (0.98, 0.015, 1),  # within the limits
        (1.2, 0.0, 1),  # the target itself is too fast
        (1.0, 0.02, 2),
    ],
)
def test_a_crossing_is_planned_again_when_lags_cost_more_than_a_hundredth_of_the_limit(
    share: float, lag: float, calls: int
) -> None:
    planner = Planner(share)
    planned(planner, np.full(2, lag), np.full(2, lag))
    assert len(planner.asked) == calls


def test_axes_above_the_end_of_the_travel_are_planned_lower_by_as_much() -> None:
    for lift_rad, tops in ((0.02, [1.5, 1.48]), (5e-7, [1.5]), (-0.02, [1.5])):
        planner = Planner()
        planned(planner, np.zeros(2), np.zeros(2), lift_rad)
        assert [one.elevation_max_rad for one in planner.asked] == pytest.approx(tops)


@pytest.mark.parametrize(
    ("factor", "shares"),
    [
        # Each time the limit is lowered by what the axes are too fast, until less than half is left of it.
        (2.0, [1.0, 1.0 / 2.0, 1.0 / 8.0]),
        # Four rounds, then what was found is taken.
        (1.1, [1.0, 1.1**-1, 1.1**-3, 1.1**-7]),
    ],
)
def test_a_crossing_that_lags_never_fit_is_taken_after_four_rounds_or_half_of_the_limit(
    factor: float, shares: list[float]
) -> None:
    """The slower the beam, the larger the lag: the azimuth axis always has to move so many times too fast."""
    planner = Planner()

    def lag(_t_s: Array, rate: Array, bend: Array) -> Triple:
        extra = np.where(rate > 0.0, factor * np.array(MOST.rate_rad_s) - rate, 0.0) * [1.0, 0.0]
        return np.zeros_like(rate), extra, np.zeros_like(bend)

    found, _ = _planned(T_S, path(), path(), MOST, 1.5, lag, planner)
    assert found is not None
    np.testing.assert_allclose(planner.shares()[:, 0, 0], shares, rtol=1e-9)
    np.testing.assert_allclose(planner.shares()[:, 0, 1], 1.0)


def test_the_axes_stand_ahead_of_the_beam_all_the_way() -> None:
    crossing, axes = planned(Planner(), np.zeros(2), np.zeros(2), -0.02)
    assert crossing is not None
    wanted = path()[0] - [0.0, 0.02]
    wanted[PART] = crossing.position_rad - [0.0, 0.02]
    np.testing.assert_allclose(axes, wanted, atol=1e-15)
    nothing, axes = planned(lambda _limits: None, np.zeros(2), np.zeros(2), 0.3)
    assert nothing is None
    np.testing.assert_allclose(axes, path()[0] + [0.0, 0.3], atol=1e-15)


def test_a_motion_with_a_crossing_is_one_side_before_it_and_the_other_after() -> None:
    made = Planner()(LIMITS)
    crossing = Crossing(
        made.t_s, made.position_rad, made.velocity_rad_s, made.acceleration_rad_s2, np.zeros(4), 6.0, 6.2
    )
    joined = _joined(T_S, path(1.0), crossing, path(2.0))
    inside = (crossing.position_rad, crossing.velocity_rad_s, crossing.acceleration_rad_s2)
    for part, before, between, after, turn in zip(joined, path(1.0), inside, path(2.0), (6.2, 0.0, 0.0), strict=True):
        np.testing.assert_array_equal(part[:4], before[:4])
        np.testing.assert_array_equal(part[4:8], between)
        np.testing.assert_array_equal(part[8:], after[8:] + np.array([turn, 0.0]))


def test_a_dish_that_leans_may_go_over_from_either_side() -> None:
    """The way back over the top is the same with the dish turned: it loses as much."""
    t, first, second = sides(0.4, 1.0)
    machine = MachineParams(rate_limit_rad_s=LIMITS.rate_rad_s, acceleration_limit_rad_s2=LIMITS.acceleration_rad_s2)
    travel = AxisLimits(elevation_max_rad=176.0 * DEG)
    found = branch_motions(t, {False: first, True: second}, machine, travel, beam(0.264), no_lag)
    over = {one.plunge: one for one in found if one.crossing is not None and one.crossing.over_t_s is not None}
    assert [one.plunge for one in found] == [False, True, False, True]
    for plunge, ends in ((False, (first, second)), (True, (second, first))):
        motion = over[plunge]
        assert motion.required is ends[0]
        np.testing.assert_allclose(motion.axes_rad[0], ends[0][0][0], atol=1e-12)
        turn = [motion.crossing.turn_rad, 0.0]
        np.testing.assert_allclose(motion.axes_rad[-1], ends[1][0][-1] + turn, atol=1e-12)
        assert np.max(np.abs(np.diff(motion.axes_rad, axis=0))) < 0.21 * DEG, "no jump of the axes"
    # The pass is the same backwards: which of two equal crossings is taken is up to the last bits.
    lost = {plunge: float(np.sum(1.0 - beam(0.264)(one.crossing.error_rad))) for plunge, one in over.items()}
    assert lost[True] == pytest.approx(lost[False], rel=1e-6)
    assert over[True].crossing.error_rad.max() == pytest.approx(over[False].crossing.error_rad.max(), rel=1e-6)
    assert all(one.crossing.t_s[0] < one.crossing.over_t_s < one.crossing.t_s[-1] for one in over.values())
    # Without the other side, or without a crossing, there is no way over.
    (alone,) = branch_motions(t, {False: first}, machine, travel, beam(0.264), no_lag)
    assert alone.crossing is not None
    assert alone.crossing.over_t_s is None


def test_the_plunged_side_is_not_bent_by_the_end_of_the_travel_and_the_direct_one_is() -> None:
    """Below 60 deg of elevation the plunged axes are beyond the travel of the direct ones for the whole pass."""
    t, first, second = sides(20.0, 1.0)
    machine = MachineParams(rate_limit_rad_s=LIMITS.rate_rad_s, acceleration_limit_rad_s2=LIMITS.acceleration_rad_s2)
    travel = AxisLimits(elevation_max_rad=65.0 * DEG)
    direct, turned = branch_motions(t, {False: first, True: second}, machine, travel, beam(0.264), no_lag)
    assert direct.crossing is not None
    assert direct.axes_rad[:, 1].max() == pytest.approx(65.0 * DEG)
    assert turned.crossing is None
    np.testing.assert_array_equal(turned.axes_rad, second[0])
