"""The gate: what it lets through, what it refuses and by how much, and the ways it finds round a hill and the Sun."""

import math
import timeit

import numpy as np
import pytest

from rf_pointing.planning import MOTIONS, AxisLimits, Gate, GateParams, HorizonMask

DEG = math.pi / 180.0
FLAT = HorizonMask()
HILL = HorizonMask(azimuth_rad=(0.0, 80.0 * DEG, 90.0 * DEG, 100.0 * DEG), elevation_rad=(0.0, 0.0, 30.0 * DEG, 0.0))


def gate(mask: HorizonMask = FLAT, **changes: float) -> Gate:
    return Gate(GateParams(**changes), AxisLimits(), mask)


def deg(*pairs: tuple[float, float]) -> np.ndarray:
    return np.array(pairs) * DEG


@pytest.mark.parametrize("kind", MOTIONS)
@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ((221.0, 45.0), "azimuth 221.000 deg is 1.000 deg past the limit 220.000 deg"),
        ((-220.5, 45.0), "azimuth -220.500 deg is 0.500 deg past the limit -220.000 deg"),
        ((0.0, 3.0), "elevation 3.000 deg is 1.000 deg past the limit 4.000 deg"),
        ((0.0, 90.0), "elevation 90.000 deg is 0.500 deg past the limit 89.500 deg"),
        ((90.0, 20.0), "elevation 20.000 deg at azimuth 90.0 deg is 10.000 deg below the horizon mask"),
    ],
)
def test_every_kind_of_motion_is_refused_with_the_limit_and_by_how_much(
    kind: str, goal: tuple[float, float], words: str
) -> None:
    decision = gate(HILL).check(kind, (0.0, 45.0 * DEG), deg(goal))
    assert not decision.allowed
    assert decision.reason == words


@pytest.mark.parametrize("past_deg", [0.0003, 0.4])
def test_from_slightly_outside_every_motion_inward_is_allowed(past_deg: float) -> None:
    outside = ((220.0 + past_deg) * DEG, 45.0 * DEG)
    for goal in ((220.0 + 0.5 * past_deg, 45.0), (0.0, 45.0), (220.0 + past_deg, 50.0)):
        assert gate().check("manual", outside, deg(goal)).allowed
    further = gate().check("manual", outside, deg((220.1 + past_deg, 45.0)))
    assert "0.100 deg past the limit" in further.reason
    under = (90.0 * DEG, 25.0 * DEG)
    assert gate(HILL).check("manual", under, deg((90.0, 26.0))).allowed
    assert not gate(HILL).check("manual", under, deg((90.0, 24.0))).allowed


def test_the_way_between_two_free_points_goes_over_the_hill_between_them() -> None:
    decision = gate(HILL).check("slew", (60.0 * DEG, 10.0 * DEG), deg((120.0, 10.0)))
    assert decision.allowed
    corners = np.array(decision.way) / DEG
    assert corners[-1] == pytest.approx([120.0, 10.0])
    assert np.max(corners[:, 1]) > 30.0
    here = (60.0 * DEG, 10.0 * DEG)
    for corner in decision.way:
        leg = gate().path(here, corner)
        assert np.all(leg[:, 1] >= HILL.lowest_all(leg[:, 0]) - 1e-9)
        here = corner


def test_a_free_way_has_no_corners_and_a_hill_as_high_as_the_travel_has_no_way() -> None:
    assert gate().check("slew", (0.0, 0.2), deg((100.0, 40.0))).way == ()
    walls = HorizonMask(azimuth_rad=(0.5, 1.0, 1.5, 3.5, 4.0, 4.5), elevation_rad=(0.0, 1.5, 0.0, 0.0, 1.5, 0.0))
    low = Gate(GateParams(), AxisLimits(elevation_max_rad=60.0 * DEG), walls)
    refused = low.check("slew", (0.0, 0.2), deg((115.0, 12.0)))
    assert "below the horizon mask on the way, and no detour is free" in refused.reason


def test_a_slew_through_the_sun_is_led_round_it() -> None:
    sun, here = (50.0 * DEG, 40.0 * DEG), (20.0 * DEG, 40.0 * DEG)
    made = gate(sun_radius_rad=5.0 * DEG)
    decision = made.check("slew", here, deg((80.0, 40.0)), sun_rad=sun)
    assert decision.allowed
    assert len(decision.way) > 1
    for corner in decision.way:
        for azimuth, elevation in made.path(here, corner).tolist():
            near = math.acos(
                math.sin(elevation) * math.sin(sun[1])
                + math.cos(elevation) * math.cos(sun[1]) * math.cos(azimuth - sun[0])
            )
            assert near >= 5.0 * DEG - 1e-9
        here = corner
    aimed = made.check("slew", (20.0 * DEG, 40.0 * DEG), deg((53.0, 40.0)), sun_rad=sun)
    assert "2.298 deg from the Sun, must be >= 5.000 deg" in aimed.reason
    assert made.check("track", sun, deg((53.0, 40.0)), sun_rad=sun).allowed, "out of the Sun's zone is inward"
    assert made.check("stow", (20.0 * DEG, 40.0 * DEG), deg((50.0, 41.0)), sun_rad=sun).allowed


def test_high_wind_lets_only_the_stow_pass() -> None:
    for kind in MOTIONS:
        decision = gate().check(kind, (0.0, 0.5), deg((0.0, 89.0)), high_wind="gust 31.0 m/s, limit 25.0 m/s")
        assert decision.allowed == (kind == "stow")


def test_a_rate_that_cannot_stop_before_the_limit_is_refused() -> None:
    """1 deg/s^2 from 1.5 deg/s takes 1.125 deg."""
    made = gate(deceleration_rad_s2=(1.0 * DEG, 1.0 * DEG))
    rate = deg((1.5, 0.0))
    assert made.check("manual", (0.0, 0.5), deg((218.8, 45.0)), rate).allowed
    refused = made.check("manual", (0.0, 0.5), deg((219.0, 45.0)), rate)
    assert "needs 1.125 deg to stop, 1.000 deg are left to the limit 220.000 deg" in refused.reason
    assert made.check("manual", (0.0, 0.5), deg((219.0, 45.0)), -rate).allowed
    assert "exceeds the axis limit" in made.check("manual", (0.0, 0.5), deg((0.0, 45.0)), deg((2.5, 0.0))).reason


def test_the_tiers_follow_each_other_outward() -> None:
    made = gate()
    assert made.warning(0.0, 45.0 * DEG) == ""
    assert made.warning(218.5 * DEG, 45.0 * DEG) == "azimuth 1.50 deg inside its limit"
    assert made.hard(220.2 * DEG, 0.5, 0.01, 0.0) == ""
    assert "0.050 deg past the hard limit 220.250 deg" in made.hard(220.3 * DEG, 0.5, 0.01, 0.0)
    assert made.hard(220.3 * DEG, 0.5, -0.01, 0.0) == "", "inward"


def test_the_transmitter_is_inhibited_near_the_ground_on_either_side() -> None:
    for elevation in (9.0, 171.0):
        assert "below the 10.00 deg for transmitting" in gate().transmit_inhibit(elevation * DEG)
    assert gate().transmit_inhibit(45.0 * DEG) == ""


def test_the_checks_of_a_tick_take_microseconds() -> None:
    """A tick has 20 ms; its gate is a thousandth of that, an allowance of ten for a busy machine."""
    made = gate(HILL)
    spent = min(timeit.repeat(lambda: made.hard(1.0, 0.5, 0.01, 0.0), number=1000, repeat=5)) / 1000
    assert spent < 200e-6
