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
from rf_pointing.planning.forbidden_sky import angle_between
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


def overhead(peak_deg: float, turn_deg: float, seconds: float = 600.0) -> tuple[np.ndarray, ...]:
    """A straight pass over the sky that peaks at `turn_deg`, where its azimuth is fastest."""
    t_s = np.arange(0.0, seconds + 0.25, 0.5)
    along = np.tan(np.linspace(-80.0, 80.0, len(t_s)) * DEG)
    across = 1.0 / math.tan(peak_deg * DEG) if peak_deg < 90.0 else 1e-9
    azimuth = turn_deg * DEG + np.arctan2(along, across)
    position = np.column_stack([azimuth, np.arctan2(1.0, np.hypot(along, across))])
    velocity = np.gradient(position, t_s, axis=0)
    return t_s, position, velocity, np.gradient(velocity, t_s, axis=0)


@pytest.mark.parametrize(
    ("peak_deg", "turn_deg"),
    [(79.5, 277.0), (83.7, 277.0), (83.7, 271.3), (86.0, 300.0), (88.0, 330.0), (85.0, 350.0), (89.0, 280.0),
     (81.0, 355.0), (84.0, 340.0), (87.0, 320.0)],
)  # fmt: skip
def test_a_keyhole_and_an_end_of_the_travel_in_one_pass_cost_what_both_do(peak_deg: float, turn_deg: float) -> None:
    """The axis is slower than the target at the peak, and the travel ends within the pass."""
    t_s, *motion = overhead(peak_deg, turn_deg)
    position = motion[0]
    machine = MachineParams(rate_limit_rad_s=(4.0 * DEG,) * 2, acceleration_limit_rad_s2=(2.0 * DEG,) * 2)
    limits = AxisLimits(azimuth_min_rad=TURN[0], azimuth_max_rad=TURN[1], elevation_max_rad=90.0 * DEG)
    found = branch_motions(t_s, {False: (motion[0], motion[1], motion[2])}, machine, limits, GAIN, no_lag)
    inside = [one for one in found if one.crossing is not None and one.crossing.at_stop]
    assert inside
    lost_s = []
    for one in inside:
        assert np.abs(np.diff(one.axes_rad[:, 0])).max() <= 1.02 * 0.5 * machine.planned.rate_rad_s[0]
        assert np.ptp(one.axes_rad[:, 0]) <= TURN[1]
        # Off the target only within its crossing, and by what its error states.
        off = angle_between(one.axes_rad, position)
        beside = (t_s < one.crossing.t_s[0]) | (t_s > one.crossing.t_s[-1])
        assert off[beside].max(initial=0.0) < 1e-9
        assert off[~beside] == pytest.approx(one.crossing.error_rad, abs=1e-9)
        lost_s.append(0.5 * float(np.sum(GAIN(off) < 0.5)))
    outside = (position[:, 0] < TURN[0]) | (position[:, 0] > TURN[1])
    waited_s = 0.5 * min(int(outside.sum()), int((~outside).sum()))
    assert min(lost_s) <= min(waited_s, 360.0 / 4.0) + 45.0


def test_a_path_that_only_its_lag_leads_beyond_the_end_is_planned() -> None:
    t_s, *motion = path(200.0, 359.9)

    def lag(_t_s: np.ndarray, rate: np.ndarray, _bend: np.ndarray) -> tuple[np.ndarray, ...]:
        return np.full_like(rate, 0.2 * DEG), np.zeros_like(rate), np.zeros_like(rate)

    machine = MachineParams(rate_limit_rad_s=(6.0 * DEG,) * 2, acceleration_limit_rad_s2=(6.0 * DEG,) * 2)
    limits = AxisLimits(azimuth_min_rad=TURN[0], azimuth_max_rad=TURN[1], elevation_max_rad=90.0 * DEG)
    found = branch_motions(t_s, {False: (motion[0], motion[1], motion[2])}, machine, limits, GAIN, lag)
    assert found[0].crossing is None
    assert found[0].axes_rad[-1, 0] == pytest.approx(360.1 * DEG)
