"""The motions through a pass: planned within what the lags of the mount leave, joined to the target's own path."""

import math

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, MachineParams
from rf_pointing.planning.branch_motion import branch_motions, no_lag
from test.planning.test_crossing import LIMITS, beam
from test.planning.test_over_the_top import sides

DEG = math.pi / 180.0


def test_a_dish_that_leans_may_go_over_from_either_side() -> None:
    """The way back over the top is the same with the dish turned: it loses as much."""
    t, first, second = sides(0.4, 1.0)
    machine = MachineParams(rate_limit_rad_s=LIMITS.rate_rad_s, acceleration_limit_rad_s2=LIMITS.acceleration_rad_s2)
    travel = AxisLimits(azimuth_min_rad=-270.0 * DEG, azimuth_max_rad=270.0 * DEG, elevation_max_rad=176.0 * DEG)
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
    direct, turned, *_ = branch_motions(t, {False: first, True: second}, machine, travel, beam(0.264), no_lag)
    assert direct.crossing is not None
    assert direct.axes_rad[:, 1].max() == pytest.approx(65.0 * DEG)
    assert turned.crossing is None
    np.testing.assert_array_equal(turned.axes_rad, second[0])
