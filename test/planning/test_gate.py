"""The gate: what it lets through, what it refuses and by how much, and the ways it finds round a hill and the Sun."""

import itertools
import math

import numpy as np
import pytest

from rf_pointing.planning import AxisLimits, AxisRates, Gate, GateParams, HorizonMask, motion_between
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.gate import MOTIONS
from rf_pointing.planning.slew import Moving, halting_points, slew_path

DEG = math.pi / 180.0
FLAT = HorizonMask()
HILL = HorizonMask(azimuth_rad=(0.0, 80.0 * DEG, 90.0 * DEG, 100.0 * DEG), elevation_rad=(0.0, 0.0, 30.0 * DEG, 0.0))


AXES = AxisRates((1.8 * DEG, 1.8 * DEG), (0.8 * DEG, 0.8 * DEG))


def gate(mask: HorizonMask = FLAT, axes: AxisRates = AXES, **changes: float) -> Gate:
    return Gate(GateParams(**changes), AxisLimits(), mask, axes)


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


def test_a_free_way_has_no_corners_and_a_hill_as_high_as_the_travel_has_no_way() -> None:
    assert gate().check("slew", (0.0, 0.2), deg((100.0, 40.0))).way == ()
    walls = HorizonMask(azimuth_rad=(0.5, 1.0, 1.5, 3.5, 4.0, 4.5), elevation_rad=(0.0, 1.5, 0.0, 0.0, 1.5, 0.0))
    low = Gate(GateParams(), AxisLimits(elevation_max_rad=60.0 * DEG), walls, AXES)
    refused = low.check("slew", (0.0, 0.2), deg((115.0, 12.0)))
    assert "below the horizon mask on the way, and no detour is free" in refused.reason


def test_the_zone_of_the_sun_is_no_goal_but_of_a_stow_and_may_be_left() -> None:
    sun, made = (50.0 * DEG, 40.0 * DEG), gate(sun_radius_rad=5.0 * DEG)
    aimed = made.check("slew", (20.0 * DEG, 40.0 * DEG), deg((53.0, 40.0)), sun_rad=sun)
    assert "2.298 deg from the Sun, must be >= 5.000 deg" in aimed.reason
    assert made.check("track", sun, deg((53.0, 40.0)), sun_rad=sun).allowed, "out of the Sun's zone is inward"
    assert made.check("stow", (20.0 * DEG, 40.0 * DEG), deg((50.0, 41.0)), sun_rad=sun).allowed


def test_what_is_left_of_a_stopped_motion_is_that_of_a_simulated_stop() -> None:
    rate, limit = 1.5 * DEG, 0.8 * DEG
    ahead = halting_points(np.array([[1.0, 0.5]]), np.array([[rate, -rate]]), (limit, limit))
    for share, row in zip((0.25, 0.5, 1.0), ahead[:, 0], strict=True):
        t = share * rate / limit
        moved = rate * t - 0.5 * limit * t**2
        assert row == pytest.approx([1.0 + moved, 0.5 - moved])


def test_a_way_is_free_only_if_the_axes_can_stop_anywhere_on_it() -> None:
    """Down behind a hill: a stop while both axes still run would bring the elevation down before the hill has passed."""
    here, there = (30.0 * DEG, 60.0 * DEG), (90.0 * DEG, 10.0 * DEG)
    _, positions, rates = slew_path(Moving(1.0, here), there, AXES)
    behind = float(np.interp(-10.5 * DEG, -positions[:, 1], positions[:, 0])) - 0.25 * DEG
    hill = HorizonMask(azimuth_rad=(0.0, behind - 1e-4, behind), elevation_rad=(10.5 * DEG, 10.5 * DEG, 0.0))
    sky = ForbiddenSky(hill, 0.0)
    assert sky.reason_of_path(positions[None], None) == ""
    stopped = halting_points(positions, rates, AXES.acceleration_rad_s2)
    assert "below the horizon mask" in sky.reason_of_path(stopped, None)
    assert len(gate(hill).check("slew", here, np.array([there])).way) > 1
    wall = HorizonMask(azimuth_rad=(0.0, 60.0 * DEG, 60.1 * DEG), elevation_rad=(0.0, 0.0, 40.0 * DEG))
    moving = gate(wall).guard("track", (58.5 * DEG, 20.0 * DEG), (58.5 * DEG, 20.0 * DEG), (1.8 * DEG, 0.0))
    assert moving.startswith("track would not come to rest in time: elevation 20.000 deg at azimuth 60.")
    assert gate(wall).guard("track", (58.5 * DEG, 20.0 * DEG), (58.5 * DEG, 20.0 * DEG), (0.5 * DEG, 0.0)) == ""
    assert (
        gate(wall).guard("track", (61.0 * DEG, 20.0 * DEG), (61.0 * DEG, 20.0 * DEG), (-0.5 * DEG, 0.5 * DEG)) == ""
    ), "outward from behind it"


def test_the_guard_of_a_tick_is_a_deceleration_cone_before_travel_and_sun() -> None:
    """0.8 deg/s^2 from 1.6 deg/s takes 1.6 deg."""
    made = gate()
    assert made.guard("manual", (218.3 * DEG, 0.5), (218.3 * DEG, 0.5), (1.6 * DEG, 0.0)) == ""
    assert "past the limit 220.000 deg" in made.guard(
        "manual", (218.5 * DEG, 0.5), (218.5 * DEG, 0.5), (1.6 * DEG, 0.0)
    )
    assert made.guard("manual", (220.3 * DEG, 0.5), (220.3 * DEG, 0.5), (-1.6 * DEG, 0.0)) == "", "inward from outside"
    sun = (50.0 * DEG, 0.5)
    assert "from the Sun" in made.guard("scan", (47.8 * DEG, 0.5), (47.8 * DEG, 0.5), (1.6 * DEG, 0.0), sun)
    assert made.guard("scan", (46.0 * DEG, 0.5), (46.0 * DEG, 0.5), (1.6 * DEG, 0.0), sun) == ""
    assert made.guard("stow", (47.8 * DEG, 0.5), (47.8 * DEG, 0.5), (1.6 * DEG, 0.0), sun) == ""


def test_the_guard_says_the_same_where_it_looks_at_elevations_only(
    random: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, sun = gate(HILL, sun_radius_rad=25.0 * DEG), (1.7, 0.6)
    cases = []
    for _ in range(400):
        here = (float(random.uniform(-3.9, 3.9)), float(random.uniform(0.05, 1.57)))
        rate = (float(random.uniform(-0.03, 0.03)), float(random.uniform(-0.03, 0.03)))
        cases.append((here, rate, made.guard("track", here, here, rate, sun)))
    monkeypatch.setattr(ForbiddenSky, "clear", lambda *_: False)
    assert [reason for *_, reason in cases] == [made.guard("track", here, here, rate, sun) for here, rate, _ in cases]
    assert 10 < sum(bool(reason) for *_, reason in cases) < 390


def test_one_direction_and_many_agree_over_the_top_too(random: np.random.Generator) -> None:
    sky, sun = ForbiddenSky(HILL, 30.0 * DEG), (1.7, 0.6)
    points = np.column_stack([random.uniform(-4.0, 4.0, 300), random.uniform(0.0, math.pi, 300)])
    here = np.array((0.0, 0.5 * math.pi))
    for row in points:
        single = sky.reason(float(row[0]), float(row[1]), None, sun)
        along = sky.reason_of_path(np.stack([here, row])[:, None], sun)
        assert bool(single) == bool(along)
        folded = row if row[1] <= 0.5 * math.pi else np.array([row[0] + math.pi, math.pi - row[1]])
        assert sky.under_mask(*row.tolist()) == pytest.approx(sky.under_mask(*folded.tolist()))
        assert sky.sun_distance(*row.tolist(), sun) == pytest.approx(sky.sun_distance(*folded.tolist(), sun))


def test_a_way_keeps_clear_of_where_the_sun_will_be_at_its_end() -> None:
    """A slew of 100 s passes 0.9 deg from the Sun of now with a zone of 0.8 deg: the Sun may move 0.4 deg meanwhile."""
    sky = ForbiddenSky(FLAT, 0.8 * DEG)
    line, sun = deg((40.0, 0.9), (50.0, 0.9), (60.0, 0.9))[None], (50.0 * DEG, 0.0)
    assert sky.reason_of_path(line, sun) == ""
    assert "0.900 deg from the Sun" in sky.reason_of_path(line, sun, 0.4 * DEG)


def test_high_wind_lets_only_the_stow_pass() -> None:
    for kind in MOTIONS:
        decision = gate().check(kind, (0.0, 0.5), deg((0.0, 89.0)), high_wind="gust 31.0 m/s, limit 25.0 m/s")
        assert decision.allowed == (kind == "stow")


def test_the_drives_are_not_cut_while_an_axis_swings_where_it_stood() -> None:
    made, stood = gate(), (220.3 * DEG, 0.5)
    assert made.hard((220.32 * DEG, 0.5), (0.01, 0.0), stood) == ""
    assert "past the hard limit 220.350 deg" in made.hard((220.4 * DEG, 0.5), (0.01, 0.0), stood)


def test_the_transmitter_is_inhibited_near_the_ground_on_either_side() -> None:
    for elevation in (9.0, 171.0):
        assert "below the 10.00 deg for transmitting" in gate().too_low_to_send(0.0, elevation * DEG)
    assert gate().too_low_to_send(0.0, 45.0 * DEG) == ""


@pytest.mark.parametrize(
    ("here_deg", "goal_deg", "kind"),
    [
        ((0.0, 89.0), (10.0, 91.0), "flip"),
        ((0.0, 91.0), (10.0, 89.0), "flip"),
        ((0.0, 91.0), (10.0, 100.0), "slew"),
        ((0.0, 100.0), (181.0, 100.0), "unwind"),
        ((0.0, 50.0), (-181.0, 20.0), "unwind"),
        ((-100.0, 50.0), (79.0, 20.0), "slew"),
        ((170.0, 50.0), (-9.0, 20.0), "slew"),
        ((100.0, 50.0), (-79.0, 20.0), "slew"),
    ],
)
def test_a_motion_is_a_flip_an_unwinding_of_more_than_half_a_turn_or_a_slew(
    here_deg: tuple[float, float], goal_deg: tuple[float, float], kind: str
) -> None:
    assert motion_between(*(tuple(np.radians(pair).tolist()) for pair in (here_deg, goal_deg))) == kind


def test_a_slew_takes_the_time_of_all_its_legs_and_without_a_way_that_of_the_straight_one() -> None:
    start, goal = (60.0 * DEG, 10.0 * DEG), (120.0 * DEG, 10.0 * DEG)
    legs = [(60.0, 10.0), (60.0, 30.5), (120.0, 30.5), (120.0, 10.0)]
    wanted = sum(AXES.slew_s((a[0] * DEG, a[1] * DEG), (b[0] * DEG, b[1] * DEG)) for a, b in itertools.pairwise(legs))
    assert gate(HILL).slew(start, goal) == (pytest.approx(wanted), "")
    low = Gate(GateParams(), AxisLimits(elevation_max_rad=29.0 * DEG), HILL, AXES)
    needed_s, reason = low.slew(start, goal)
    assert needed_s == AXES.slew_s(start, goal)
    assert "no detour is free" in reason
    assert gate().slew(start, goal) == (AXES.slew_s(start, goal), "")


@pytest.mark.parametrize(
    ("place_deg", "warning"),
    [
        ((217.9, 45.0), ""),
        ((218.1, 45.0), "azimuth 1.90 deg inside its limit"),
        ((-218.1, 45.0), "azimuth 1.90 deg inside its limit"),
        ((0.0, 5.5), "elevation 1.50 deg inside its limit"),
        ((0.0, 87.4), ""),
        ((0.0, 88.5), "elevation 1.00 deg inside its limit"),
        ((220.4, 45.0), "azimuth 0.40 deg beyond its limit"),
        ((0.0, 3.0), "elevation 1.00 deg beyond its limit"),
    ],
)
def test_a_warning_says_how_near_to_or_beyond_which_limit(place_deg: tuple[float, float], warning: str) -> None:
    here = (place_deg[0] * DEG, place_deg[1] * DEG)
    assert gate().warning(*here) == warning
    for kind in ("track", "slew"):
        assert gate().check(kind, here, deg((0.0, 45.0), place_deg)).warning == warning


@pytest.mark.parametrize(
    ("joint_deg", "rate_deg_s", "words"),
    [
        ((0.0, 3.8), (0.0, -1.0), ""),
        ((0.0, 3.7), (0.0, -1.0), "elevation 3.700 deg is 0.050 deg past the hard limit 3.750 deg"),
        ((0.0, 3.7), (0.0, 1.0), ""),
        ((0.0, 3.7), (0.0, 0.0), ""),
        ((-220.3, 45.0), (-1.0, 0.0), "azimuth -220.300 deg is 0.050 deg past the hard limit -220.250 deg"),
        ((-220.3, 45.0), (1.0, 0.0), ""),
        ((0.0, 89.8), (0.0, 1.0), "elevation 89.800 deg is 0.050 deg past the hard limit 89.750 deg"),
        ((220.3, 45.0), (0.0, 1.0), ""),
    ],
)
def test_the_drives_are_cut_beyond_a_limit_while_an_axis_goes_on_outwards(
    joint_deg: tuple[float, float], rate_deg_s: tuple[float, float], words: str
) -> None:
    joint, rate = ((pair[0] * DEG, pair[1] * DEG) for pair in (joint_deg, rate_deg_s))
    assert gate().hard(joint, rate) == words


@pytest.mark.parametrize(
    ("place_deg", "rate_deg_s", "words"),
    [
        ((0.0, 88.4), (0.0, 1.5), "elevation rate 1.500 deg/s needs 1.125 deg to stop, 1.100 deg are left to 89.500"),
        ((0.0, 88.3), (0.0, 1.5), ""),
        ((0.0, 88.4), (0.0, -1.5), ""),
        ((0.0, 5.1), (0.0, -1.5), "elevation rate -1.500 deg/s needs 1.125 deg to stop, 1.100 deg are left to 4.000"),
        ((0.0, 5.2), (0.0, -1.5), ""),
        (
            (-219.0, 45.0),
            (-1.5, 0.0),
            "azimuth rate -1.500 deg/s needs 1.125 deg to stop, 1.000 deg are left to -220.000",
        ),
        ((0.0, 45.0), (-2.1, 0.0), "azimuth rate -2.100 deg/s exceeds the axis limit 2.000 deg/s"),
        ((0.0, 45.0), (0.0, 1.1), "elevation rate 1.100 deg/s exceeds the axis limit 1.000 deg/s"),
        ((0.0, 45.0), (2.0, 1.0), ""),
    ],
)
def test_rates_must_be_within_the_axis_and_leave_room_to_stop(
    place_deg: tuple[float, float], rate_deg_s: tuple[float, float], words: str
) -> None:
    most = 1.0 if "elevation rate 1.1" in words else 2.0
    made = gate(axes=AxisRates((2.0 * DEG, most * DEG), (1.0 * DEG, 1.0 * DEG)))
    decision = made.check("track", (0.0, 45.0 * DEG), deg((0.0, 45.0), place_deg), deg((0.0, 0.0), rate_deg_s))
    assert decision.reason.replace("left to the limit", "left to") in (words, f"{words} deg")


def test_positions_within_the_travel_above_all_and_beside_the_sun_are_allowed_as_each_of_them_is(
    random: np.random.Generator,
) -> None:
    made, sun = gate(HILL, sun_radius_rad=20.0 * DEG), (1.7, 0.9)
    allowed = 0
    for _ in range(300):
        rows = random.uniform((-4.2, 0.0), (4.2, 1.6), (1, 2)) + random.uniform(-0.1, 0.1, (3, 2))
        decision = made.check("track", (0.0, 0.8), rows, sun_rad=sun)
        assert decision.allowed == all(not made.position(*row, (0.0, 0.8), sun) for row in rows.tolist())
        allowed += decision.allowed
    assert 100 < allowed < 250


def test_axes_that_run_after_a_target_are_held_against_hill_and_sun() -> None:
    places, still = deg((80.0, 35.0), (90.0, 31.0), (100.0, 35.0)), np.zeros((3, 2))
    assert gate(HILL).chase(places, still, places) == ""
    falling = deg((0.0, 0.0), (0.0, -1.6), (0.0, 0.0))
    assert "below the horizon mask" in gate(HILL).chase(places, falling, places)
    assert "from the Sun" in gate(HILL).chase(places, still, places + 0.3, (90.0 * DEG, 31.5 * DEG))
