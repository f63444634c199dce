"""Ends of the azimuth travel crossed in mid-pass: within them, on the target elsewhere, at the axis's limits."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.core import gaussian_gain
from rf_pointing.planning import AxisLimits, MachineParams
from rf_pointing.planning.branch_motion import branch_motions, no_lag
from rf_pointing.planning.crossing import AxisMotionLimits
from rf_pointing.planning.stops import within_stops

DEG = math.pi / 180.0
GAIN = partial(gaussian_gain, beamwidth_rad=2.0 * DEG)
LIMITS = AxisMotionLimits((6.0 * DEG, 6.0 * DEG), (6.0 * DEG, 6.0 * DEG), math.inf)
TURN = (0.0, 360.0 * DEG)


def path(begin_deg: float, end_deg: float, seconds: float = 600.0) -> tuple[np.ndarray, ...]:
    """A target at 40 deg that moves evenly in azimuth."""
    t_s = np.arange(0.0, seconds + 0.5, 0.5)
    azimuth = np.linspace(begin_deg, end_deg, len(t_s)) * DEG
    position = np.column_stack([azimuth, np.full(len(t_s), 40.0 * DEG)])
    velocity = np.column_stack([np.full(len(t_s), (end_deg - begin_deg) * DEG / seconds), np.zeros(len(t_s))])
    return t_s, position, velocity, np.zeros_like(position)


@settings(deadline=None, max_examples=40)
@given(st.floats(180.0, 350.0), st.floats(5.0, 170.0), st.booleans())
def test_an_axis_stays_within_its_travel_and_limits_and_loses_a_turn_at_most(
    begin_deg: float, beyond_deg: float, mirrored: bool
) -> None:
    ends = (begin_deg, 360.0 + beyond_deg)
    t_s, position, velocity, acceleration = path(*((360.0 - e for e in ends) if mirrored else ends))
    found = within_stops(t_s, position, velocity, acceleration, TURN, GAIN, LIMITS)
    assert found is not None
    assert TURN[0] <= found.position_rad[:, 0].min() <= found.position_rad[:, 0].max() <= TURN[1]
    assert np.abs(found.velocity_rad_s[:, 0]).max() <= 1.001 * LIMITS.rate_rad_s[0]
    assert np.abs(found.acceleration_rad_s2[:, 0]).max() <= 1.05 * LIMITS.acceleration_rad_s2[0]
    lost_s = 0.5 * float(np.sum(GAIN(found.error_rad) < 0.5))
    # Waiting costs what lies beyond the stop, unwinding 60 s at 6 deg/s; the better one is taken.
    beyond_s = 600.0 * beyond_deg / (360.0 + beyond_deg - begin_deg)
    assert lost_s <= min(beyond_s, 66.0) + 2.0
    assert found.turn_rad == pytest.approx(0.0 if found.turn_t_s and not found.turn_rad else -math.copysign(
        2.0 * math.pi, -1.0 if mirrored else 1.0
    ))  # fmt: skip
    if found.t_s[-1] < t_s[-1]:
        last = int(np.searchsorted(t_s, found.t_s[-1]))
        assert found.position_rad[-1, 0] == pytest.approx(position[last, 0] + found.turn_rad, abs=1e-3 * DEG)


def test_a_pass_that_just_touches_the_stop_loses_nothing_of_a_wide_beam() -> None:
    """0.2 deg beyond it, and back: the axis waits."""
    t_s, position, velocity, acceleration = path(200.0, 360.2)
    found = within_stops(t_s, position, velocity, acceleration, TURN, GAIN, LIMITS)
    assert found is not None
    assert found.turn_rad == 0.0
    assert GAIN(found.error_rad).min() > 0.9


def test_a_pass_that_fits_a_turn_has_no_such_branch_and_one_that_does_not_has_it_alone() -> None:
    machine = MachineParams(rate_limit_rad_s=(6.0 * DEG,) * 2, acceleration_limit_rad_s2=(6.0 * DEG,) * 2)
    limits = AxisLimits(azimuth_min_rad=TURN[0], azimuth_max_rad=TURN[1], elevation_max_rad=90.0 * DEG)
    for ends, expected in (((10.0, 350.0), [False]), ((300.0, 420.0), [False, True, True])):
        t_s, *motion = path(*ends)
        sides = {False: (motion[0], motion[1], motion[2])}
        found = branch_motions(t_s, sides, machine, limits, GAIN, no_lag)
        assert [one.crossing is not None and one.crossing.at_stop for one in found] == expected
