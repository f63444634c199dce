"""The pass in hand: which profile it has, under which Sun, and how axes that join it reach the target."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, Motion
from rf_pointing.ephemeris import SITES, Pass, TopocentricTrack
from rf_pointing.ephemeris.solar import SolarDirection, SunParams
from rf_pointing.planning import AxisLimits, AxisRates, Gate, GateParams, HorizonMask, MachineParams, PassProfile
from rf_pointing.station.pointing.certificates import pass_profile
from rf_pointing.station.pointing.params import PointingParams
from rf_pointing.station.pointing.plan import SAME_PASS_S, Chased, PassPlan

RATES = AxisRates((0.1, 0.05), (0.05, 0.02))
OPEN = HorizonMask(azimuth_rad=(0.0,), elevation_rad=(-0.1,))


def reading(position: tuple[float, float], rate: tuple[float, float] = (0.0, 0.0), t_s: float = 0.0) -> JointReading:
    return JointReading(t_s=t_s, position_rad=list(position), velocity_rad_s=list(rate))


def gate(mask: HorizonMask = OPEN) -> Gate:
    return Gate(GateParams(), AxisLimits(azimuth_min_rad=-4.0, azimuth_max_rad=4.0), mask, RATES)


def running(rate: tuple[float, float], start: tuple[float, float] = (0.0, 0.5), seconds: float = 200.0) -> Chased:
    times = np.arange(0.0, seconds + 0.5)
    return Chased(times, np.array(start) + times[:, None] * np.array(rate))


# Chases


@pytest.mark.parametrize(
    ("away", "seconds"),
    # From rest over d with rate v and acceleration a: d / v + v / a, or 2 sqrt(d / a) for a short way.
    [((1.0, 0.0), 12.0), ((0.05, 0.0), 2.0), ((0.0, 0.25), 7.5), ((1.0, 0.6), 14.5), ((-1.0, 0.0), 12.0)],
)
def test_a_target_at_rest_is_reached_in_the_time_of_the_slower_axis(away: tuple[float, float], seconds: float) -> None:
    goal = (0.3 + away[0], 0.4 + away[1])
    path = Chased(np.array([0.0, 100.0]), np.array([goal, goal]))
    found = path.chase_s(5.0, reading((0.3, 0.4)), gate(), None)
    # The last few tenths go into the rate of the target.
    assert found == pytest.approx(seconds + 0.3, abs=0.3)


def test_a_target_that_runs_away_takes_longer_and_one_that_comes_less() -> None:
    """Over 1 rad at 0.1 rad/s against 0.04 rad/s; an acceleration of 0.05 rad/s^2 costs some seconds more."""
    away, coming = (
        running((rate, 0.0), (1.0, 0.5)).chase_s(0.0, reading((0.0, 0.5)), gate(), None) for rate in (0.04, -0.04)
    )
    assert away is not None
    assert coming is not None
    # Up to full rate 2 s and 0.1 rad; from it to the target's rate 1.2 s, or 2.8 s, which the relative way grows by.
    assert away == pytest.approx(1.0 / 0.06 + 2.0, abs=1.5)
    assert coming == pytest.approx(1.0 / 0.14 + 2.0, abs=1.5)
    running_already = running((0.04, 0.0), (0.0, 0.5)).chase_s(0.0, reading((0.0, 0.5), (0.04, 0.0)), gate(), None)
    assert running_already is not None
    assert running_already < 0.5


def test_a_chase_past_a_hill_is_none() -> None:
    hill = HorizonMask(
        azimuth_rad=(0.0, 0.4, 0.41, 0.6, 0.61), elevation_rad=(-0.1, -0.1, 0.8, 0.8, -0.1), clearance_rad=0.01
    )
    path = Chased(np.array([0.0, 100.0]), np.array([[1.0, 0.3], [1.0, 0.3]]))
    assert path.chase_s(0.0, reading((0.0, 0.3)), gate(), None) is not None
    assert path.chase_s(0.0, reading((0.0, 0.3)), gate(hill), None) is None
    # The Sun stands in the way, or beside it.
    assert path.chase_s(0.0, reading((0.0, 0.3)), gate(), (0.5, 0.3)) is None
    assert path.chase_s(0.0, reading((0.0, 0.3)), gate(), (0.5, 0.6)) is not None


# Profiles


@pytest.fixture(scope="module")
def profile(track: TopocentricTrack, window: Pass) -> PassProfile:
    return pass_profile(track, window)


def planned(profile: PassProfile | None = None, *, sun: bool = False, mask: HorizonMask | None = None) -> PassPlan:
    machine = MachineParams()
    made = PassPlan(
        machine, mask or HorizonMask(), GateParams(), AxisLimits(),
        SolarDirection(SunParams(watched=sun, site=SITES["Goldstone DSS-13"])), PointingParams().on_target_rad,
    )  # fmt: skip
    made.take_profiles([profile] if profile else [])
    return made


def test_a_pass_has_the_profile_of_its_name_and_time(profile: PassProfile, window: Pass) -> None:
    made = planned(profile)
    assert made.profile_of(window) is profile
    for late_s in (-SAME_PASS_S + 0.1, SAME_PASS_S - 0.1):
        assert made.profile_of(replace(window, aos_t_s=window.aos_t_s + late_s)) is profile
        assert made.profile_of(replace(window, los_t_s=window.los_t_s + late_s)) is profile
    assert made.profile_of(replace(window, name="OTHER")) is None
    assert made.profile_of(replace(window, aos_t_s=window.aos_t_s - SAME_PASS_S - 0.1)) is None
    assert made.profile_of(replace(window, los_t_s=window.los_t_s + SAME_PASS_S + 0.1)) is None
    other = replace(profile, name="OTHER")
    made.take_profiles([other, profile])
    assert made.profile_of(window) is profile
    assert made.profile_of(replace(window, name="OTHER")) is other


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_a_piece_begins_on_the_turn_of_its_window(profile: PassProfile, window: Pass, turns: int) -> None:
    """Where the whole pass crossed north before it, they differ by a turn: the axes would run past their limits."""
    whole = replace(profile, position_rad=profile.position_rad + np.array([turns * math.tau, 0.0]))
    piece = planned(profile).profile_of(replace(window, aos_t_s=window.aos_t_s + 200.0))
    found = planned(whole).profile_of(replace(window, aos_t_s=window.aos_t_s + 200.0))
    assert piece is not None
    assert found is not None
    np.testing.assert_allclose(found.position_rad, piece.position_rad, atol=1e-9)


@pytest.mark.parametrize(
    ("begin_s", "end_s"), [(100.0, -50.0), (31.0, 0.0), (0.0, -31.0), (-10.0, -100.0), (100.0, 10.0)]
)
def test_a_piece_of_a_pass_has_the_rows_of_its_time_within_the_profile(
    profile: PassProfile, window: Pass, begin_s: float, end_s: float
) -> None:
    piece = replace(window, aos_t_s=window.aos_t_s + begin_s, los_t_s=window.los_t_s + end_s)
    found = planned(profile).profile_of(piece)
    assert found is not None
    assert found is not profile
    assert found.t_s[0] == pytest.approx(max(piece.aos_t_s, profile.t_s[0]))
    assert found.t_s[-1] == pytest.approx(min(piece.los_t_s, profile.t_s[-1]))


def choose(made: PassPlan, window: Pass, begin_s: float = -300.0) -> None:
    here = reading((window.aos_azimuth_rad, window.aos_elevation_rad))
    made.choose(window.aos_t_s + begin_s, window, here, BiasModel.zero())


@pytest.mark.parametrize(("off_deg", "refused"), [(0.0, False), (0.3, False), (0.7, True), (-0.7, True)])
def test_a_pass_under_another_sun_is_refused(profile: PassProfile, window: Pass, off_deg: float, refused: bool) -> None:
    """Half a degree is more than its parallax and refraction."""
    made = planned(profile, sun=True)
    here = made.sun.at(float(profile.t_s[0]))
    assert here is not None
    rows = np.tile([here[0], here[1] + math.radians(off_deg)], (len(profile.t_s), 1))
    made.take_profiles([replace(profile, sun_rad=rows)])
    if refused:
        with pytest.raises(
            ValueError, match=r"the Sun of this site is 0.7 deg from .* must be <= 0.5 deg: another station"
        ):
            choose(made, window, 0.0)
    else:
        choose(made, window, 0.0)
    # Without a zone the Sun does not matter.
    free = PassPlan(made.machine, HorizonMask(), GateParams(sun_radius_rad=0.0), AxisLimits(), made.sun, 1e-3)
    free.take_profiles([replace(profile, sun_rad=rows)])
    choose(free, window, 0.0)


# Ways


HILL = HorizonMask(
    azimuth_rad=(0.0, 0.4, 0.41, 0.6, 0.61), elevation_rad=(-0.1, -0.1, 0.5, 0.5, -0.1), clearance_rad=0.01
)


def test_the_slew_to_a_start_goes_over_a_hill_by_its_corners_and_is_planned_once() -> None:
    made = planned(mask=HILL)
    goal = np.array([1.0, 0.3])
    assert made.approach(0.0, reading((1.2, 0.3)), goal) is None
    made.clear()
    corner = made.approach(0.0, reading((0.0, 0.3)), goal)
    assert corner is not None
    assert corner[1] > 0.5
    # On the way it stays what it was; past its last corner the way is straight.
    assert made.approach(1.0, reading((0.05, 0.35)), goal + 1e-3) == pytest.approx(corner)
    np.testing.assert_allclose(made.to_start(1.0, reading((0.05, 0.35)), goal), corner)
    np.testing.assert_allclose(made.to_start(1.0, None, goal), goal)
    with pytest.raises(ValueError, match="no slew to the start of the pass: "):
        made.approach(2.0, reading((0.0, 0.3)), np.array([0.5, 0.3]))


@pytest.mark.parametrize(
    ("away_deg", "rate_deg_s", "passed"),
    [(0.0, 0.0, True), (1.49, -0.099, True), (-1.51, 0.0, False), (0.0, -0.101, False), (1.0, 0.2, False)],
)
def test_a_corner_is_passed_by_axes_that_rest_within_a_step_of_a_rotator(
    away_deg: float, rate_deg_s: float, passed: bool
) -> None:
    """Encoders of whole degrees stop up to a degree off, and are not quite still."""
    made, goal, rates = planned(mask=HILL), np.array([1.0, 0.3]), (0.0, np.radians(rate_deg_s))
    first = made.approach(0.0, reading((0.0, 0.3)), goal)
    assert first is not None
    away = first + np.radians([away_deg, -away_deg])
    following = made.approach(1.0, reading((float(away[0]), float(away[1])), rates), goal)
    assert (following is None or not np.array_equal(following, first)) is passed


@pytest.mark.parametrize("sun", [False, True])
def test_a_search_keeps_above_the_horizon_within_the_travel_and_beside_the_sun(sun: bool) -> None:
    mask = HorizonMask(azimuth_rad=(0.0,), elevation_rad=(0.1,), clearance_rad=0.02)
    made, times = planned(mask=mask, sun=sun), 1151434800.0 + 0.1 * np.arange(600)
    sun_rad = made.sun.avoided(times[0]) or (0.0, -1.0)
    place = np.array(sun_rad) + np.array([0.0, -0.05]) if sun else np.array([1.0, 0.12])
    still, turns = np.zeros((len(times), 2)), np.linspace(0.0, 16.0 * math.pi, len(times))
    centre = Motion(still + place, still, still)
    offset = 0.2 * np.column_stack([np.cos(turns), np.sin(turns)]) * np.linspace(0.0, 1.0, len(times))[:, None]
    kept = made.kept_inside(times[0], times, centre, Motion(centre.position + offset, still, still))
    assert np.max(np.abs(kept.position - centre.position)) > 0.01, "it still looks around"
    assert np.min(kept.position[:, 1]) > 0.1
    if sun:
        assert made.gate.check("scan", (1.0, 0.5), kept.position, sun_rad=sun_rad).allowed
        unclipped = made.gate.check("scan", (1.0, 0.5), centre.position + offset, sun_rad=sun_rad)
        assert not unclipped.allowed
    assert np.max(np.abs(np.diff(kept.position, axis=0))) < 0.05, "without a jump"
