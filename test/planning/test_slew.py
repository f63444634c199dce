"""Paths of slews: what the antenna really runs through stays out of hills and Sun, and a free path is found."""

import itertools
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessor, CommandPreprocessorParams
from rf_pointing.planning import AxisLimits, AxisRates, CornerPath, Gate, GateParams, HorizonMask
from rf_pointing.planning.forbidden_sky import ForbiddenSky, angle_between
from rf_pointing.planning.slew import (
    AxisSlew,
    Leg,
    Moving,
    PathFinder,
    _FreeColumns,
    _widest,
    slew_path,
)

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import slew_paths as trial

DEG = math.pi / 180.0
TICK_S = 0.02
AXES = AxisRates((1.8 * DEG, 1.8 * DEG), (0.8 * DEG, 0.8 * DEG))
VALLEY = HorizonMask(
    azimuth_rad=tuple(a * DEG for a in (0.0, 10.0, 145.0, 150.0, 190.0, 195.0, 350.0)),
    elevation_rad=tuple(e * DEG for e in (20.0, 0.0, 0.0, 50.0, 50.0, 0.0, 0.0)),
)


def flown(start: tuple[float, float], way: list[tuple[float, float]], scene: trial.Scene) -> np.ndarray:
    """Return the commands (n, 2) of the servo on its way, the encoders 0.4 s behind."""
    limits = CommandPreprocessorParams(
        rate_limit_rad_s=scene.axes.rate_rad_s,
        acceleration_limit_rad_s2=scene.axes.acceleration_rad_s2,
        travel_min_rad=scene.limits.lowest_rad,
        travel_max_rad=scene.limits.highest_rad,
    )
    corners = CornerPath(way, near_rad=0.3 * DEG, rest_rad_s=1e-3 * DEG)
    preprocessor, encoder, places = CommandPreprocessor(limits), np.array(start), []
    preprocessor.reset(start)
    for _ in range(60_000):
        goal = corners.next(tuple(encoder.tolist()), preprocessor.velocity_rad_s) or way[-1]
        position, velocity, _ = preprocessor.step(goal, (0.0, 0.0), (0.0, 0.0), TICK_S)
        encoder = encoder + TICK_S / 0.4 * (position - encoder)
        places.append(position)
        if not velocity.any() and np.max(np.abs(position - way[-1])) < 1e-6:
            return np.array(places)
    raise AssertionError("the slew has not arrived")


def worst_excess(start: tuple[float, float], way: list[tuple[float, float]], scene: trial.Scene) -> float:
    """Return by how much the command comes under the horizon, into the Sun's zone or out of the travel at worst."""
    places = flown(start, way, scene)
    deep = np.max(scene.under(places)) - max(0.0, float(scene.under(np.array(start))))
    near = min(scene.radius_rad, float(scene.from_sun(np.array(start)))) - float(np.min(scene.from_sun(places)))
    past = np.max(np.maximum(places - scene.limits.highest_rad, scene.limits.lowest_rad - places))
    return float(max(deep, near, past))


def test_the_corner_of_a_detour_is_never_inside_a_hill() -> None:
    """The turn down at azimuth 170 would end 38 deg below the mask: the way keeps its height across the hill."""
    gate = Gate(GateParams(), AxisLimits(), VALLEY, AXES)
    start, goal = (170.0 * DEG, 60.0 * DEG), (-140.0 * DEG, 12.0 * DEG)
    decision = gate.check("park", start, np.array([goal]))
    assert decision.allowed
    for azimuth, elevation in decision.way:
        assert elevation >= VALLEY.lowest_rad(azimuth)
    scene = trial.Scene(VALLEY, AxisLimits(), AXES, None, 0.0)
    assert worst_excess(start, list(decision.way), scene) < 1e-6


def test_what_the_preprocessor_makes_of_random_paths_stays_free(random: np.random.Generator) -> None:
    detours = 0
    for _ in range(12):
        scene = trial.random_scene(random)
        gate = Gate(GateParams(sun_radius_rad=scene.radius_rad), scene.limits, scene.mask, scene.axes)
        starts, goals = trial.random_places(scene, random, 12), trial.random_places(scene, random, 12)
        for start, goal in zip(map(tuple, starts.tolist()), map(tuple, goals.tolist()), strict=True):
            decision = gate.check("slew", start, np.array([goal]), sun_rad=scene.sun)
            if decision.allowed and decision.way:
                detours += 1
                assert worst_excess(start, list(decision.way), scene) < 0.02 * DEG, (scene, start, decision.way)
    assert detours > 20


@pytest.mark.parametrize("seed", [11, 12])
def test_of_random_slews_none_is_violated_and_no_free_path_is_missed(
    seed: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The full trial is benchmarks/slew_paths.py; this is one scene in four hundred of it."""
    monkeypatch.setattr(
        sys, "argv", ["slew_paths", "--trials", "600", "--each", "200", "--seed", str(seed), "--verbose"]
    )
    assert trial.main() == 0, capsys.readouterr().out


@pytest.mark.parametrize(
    ("start", "goal"),
    [((119.71, 21.78), (-261.12, 62.16)), ((26.13, 10.31), (-228.57, 33.34)), ((-57.29, 159.44), (201.48, 165.77))],
)
def test_a_long_way_up_and_down_along_steep_slopes_is_found(
    start: tuple[float, float], goal: tuple[float, float]
) -> None:
    """Four slopes of 2 deg per degree of azimuth, along which a leg is short: up to 29 corners."""
    hills = HorizonMask(
        azimuth_rad=tuple(a * DEG for a in (0.0, 19.59, 46.07, 67.4, 143.33, 156.09, 250.25, 289.43, 326.18)),
        elevation_rad=tuple(e * DEG for e in (7.76, 3.4, 17.6, 54.74, 3.51, 14.16, 51.41, 64.22, 7.62)),
    )
    limits = AxisLimits(azimuth_min_rad=-288.32 * DEG, azimuth_max_rad=288.32 * DEG,
                        elevation_min_rad=1.83 * DEG, elevation_max_rad=178.17 * DEG)  # fmt: skip
    axes, sun = AxisRates((4.905 * DEG, 1.009 * DEG), (2.749 * DEG, 0.547 * DEG)), (125.87 * DEG, 65.23 * DEG)
    scene = trial.Scene(hills, limits, axes, sun, 4.217 * DEG)
    gate = Gate(GateParams(sun_radius_rad=scene.radius_rad), limits, hills, axes)
    here = (start[0] * DEG, start[1] * DEG)
    decision = gate.check("slew", here, np.array([goal]) * DEG, sun_rad=sun)
    assert decision.allowed, decision.reason
    assert worst_excess(here, list(decision.way), scene) < 0.02 * DEG


def test_a_way_past_hill_and_sun_is_found_through_the_only_gap() -> None:
    """A ridge with a pass of 6 deg, under a Sun that closes the sky above it."""
    ridge = HorizonMask(
        azimuth_rad=tuple(a * DEG for a in (0.0, 40.0, 44.0, 45.0, 51.0, 52.0, 56.0)),
        elevation_rad=tuple(e * DEG for e in (0.0, 0.0, 70.0, 30.0, 30.0, 70.0, 0.0)),
    )
    limits = AxisLimits(azimuth_min_rad=-0.1, azimuth_max_rad=2.0, elevation_max_rad=66.0 * DEG)
    gate, sun = Gate(GateParams(sun_radius_rad=10.0 * DEG), limits, ridge, AXES), (48.0 * DEG, 55.0 * DEG)
    start, goal = (20.0 * DEG, 10.0 * DEG), (80.0 * DEG, 10.0 * DEG)
    refused = gate.check("slew", start, np.array([goal]), sun_rad=sun)
    # At 66 deg the sides of the ridge close the travel; below 66 deg only the pass would be left.
    assert "no detour is free" in refused.reason
    low = ridge.replace(elevation_rad=tuple(e * DEG for e in (0.0, 0.0, 60.0, 30.0, 30.0, 60.0, 0.0)))
    gate = Gate(GateParams(sun_radius_rad=2.0 * DEG), limits, low, AXES)
    decision = gate.check("slew", start, np.array([goal]), sun_rad=(48.0 * DEG, 64.0 * DEG))
    assert decision.allowed
    scene = trial.Scene(low, limits, AXES, (48.0 * DEG, 64.0 * DEG), 2.0 * DEG)
    assert worst_excess(start, list(decision.way), scene) < 0.01 * DEG


def test_the_path_by_columns_takes_no_longer_than_it_is_said_to() -> None:
    """Over a narrow ridge nearly all of it is elevation: how far the Sun moves on depends on that time."""
    ridge = HorizonMask(
        azimuth_rad=tuple(a * DEG for a in (0.0, 44.0, 45.0, 51.0, 52.0)),
        elevation_rad=tuple(e * DEG for e in (0.0, 0.0, 75.0, 75.0, 0.0)),
    )
    slow = AxisRates((1.8 * DEG, 0.6 * DEG), (0.8 * DEG, 0.8 * DEG))
    paths = PathFinder(ForbiddenSky(ridge, 0.0), slow, ((-0.1, 0.0), (2.0, 90.0 * DEG)))
    start, goal = (40.0 * DEG, 5.0 * DEG), (56.0 * DEG, 5.0 * DEG)
    columns = _FreeColumns(paths, start, goal, None, 10.0)
    corners = [start, *columns.corners()]
    assert len(corners) > 2
    needed_s = sum(slow.slew_s(a, b) for a, b in itertools.pairwise(corners))
    assert needed_s <= columns.duration_s < 1.5 * needed_s


@pytest.mark.parametrize("rate_deg_s", [-1.5, -0.3, 0.0, 0.4, 1.2, 1.8])
@pytest.mark.parametrize("end_deg", [-20.0, -0.2, 0.1, 3.0, 60.0])
@pytest.mark.parametrize("share", [1.0, 0.8])
def test_an_axis_under_way_ends_at_rest_within_its_limits(rate_deg_s: float, end_deg: float, share: float) -> None:
    motion = AxisSlew.between(0.0, end_deg * DEG, rate_deg_s * DEG, 1.8 * DEG, 0.8 * DEG, share)
    times = np.linspace(0.0, motion.phases_s[-1], 20_001)
    position, velocity = motion.at(times)
    assert position[0] == pytest.approx(0.0, abs=1e-12)
    assert velocity[0] == pytest.approx(rate_deg_s * DEG)
    assert position[-1] == pytest.approx(end_deg * DEG)
    assert velocity[-1] == pytest.approx(0.0, abs=1e-9)
    step = times[1] - times[0]
    assert np.gradient(position, step)[1:-1] == pytest.approx(velocity[1:-1], abs=0.81 * DEG * step)
    assert np.max(np.abs(velocity)) <= 1.8 * DEG + 1e-9
    assert np.max(np.abs(np.diff(velocity))) <= 0.8 * DEG * step * (1.0 + 1e-6)


def test_the_chords_of_a_slew_are_the_curve() -> None:
    start = Moving(0.8, (0.3, 0.2), (0.01, -0.02))
    times, positions, _ = slew_path(start, (1.4, 0.7), AXES)
    dense = np.linspace(0.0, times[-1], 20_001)
    for axis in (0, 1):
        motion = AxisSlew.between(
            start.position_rad[axis], (1.4, 0.7)[axis], start.rate_rad_s[axis], 1.8 * DEG, 0.8 * DEG, 0.8
        )
        chord = np.interp(dense, times, positions[:, axis])
        assert np.max(np.abs(motion.at(dense)[0] - chord)) < 0.0101 * DEG


FLAT = ForbiddenSky(HorizonMask(elevation_rad=(0.0,)), 5.0 * DEG)
WIDE = ((-4.0, 0.0), (4.0, 90.0 * DEG))
RIDGE = HorizonMask(azimuth_rad=(0.0, 80.0 * DEG, 90.0 * DEG, 100.0 * DEG), elevation_rad=(0.0, 0.0, 30.0 * DEG, 0.0))


@pytest.mark.parametrize(("share", "brakes_first"), [(0.999, False), (1.0 + 1e-12, False), (1.001, True)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_axis_brakes_before_it_comes_back_only_if_it_cannot_stop_at_the_end(
    share: float, brakes_first: bool, side: float
) -> None:
    """With eight tenths of the limit it stops from v in v^2 / 1.6 a."""
    rate = share * math.sqrt(1.6 * 0.8 * DEG * 1.0 * DEG)
    motion = AxisSlew.between(0.3, 0.3 + side * DEG, side * rate, 3.0 * DEG, 0.8 * DEG, 0.8)
    assert (motion.first_s > 0.0) is brakes_first
    assert (motion.begin_s > 0.0) is brakes_first
    away = AxisSlew.between(0.3, 0.3 + side * DEG, -side * 1e-4, 3.0 * DEG, 0.8 * DEG, 0.8)
    assert away.first_s == pytest.approx(1e-4 / (0.8 * DEG))


def test_a_slew_has_no_more_chords_than_a_hundredth_of_a_degree_asks_for() -> None:
    """A parabola of a t^2 / 2 leaves its chord by a dt^2 / 8; between both there is one straight line."""
    rise_s, fall_s = 1.8 / 0.8, 1.8 / (0.8 * 0.8)
    per_s, per_fall_s = (math.sqrt(a * 0.8 * DEG / (8.0 * 0.01 * DEG)) for a in (1.0, 0.8))
    times, _, _ = slew_path(Moving(0.8, (0.3, 0.2)), (1.4, 0.2), AXES)
    assert len(times) == 2 + math.ceil(rise_s * per_s) + math.ceil(fall_s * per_fall_s)
    # One that brakes first, from 1 deg/s, has chords for that too: here all 1.25 s of it and of the rise.
    back, _, _ = slew_path(Moving(1.0, (0.3, 0.2), (1.0 * DEG, 0.0)), (-0.8, 0.2), AXES)
    chords = math.ceil(1.25 * per_s) + 2 * math.ceil(rise_s * per_s)
    assert len(back) == 2 + chords


@pytest.mark.parametrize(
    ("start_deg", "end_deg", "corners_deg"),
    [
        # Half a degree above the hill is the lowest way over it.
        ((60.0, 10.0), (120.0, 10.0), [(60.0, 30.5), (120.0, 30.5), (120.0, 10.0)]),
        # At the height of the start, or of the goal, the elevation makes its way once.
        ((60.0, 50.0), (120.0, 10.0), [(60.0, 50.0), (120.0, 50.0), (120.0, 10.0)]),
        ((84.0, 15.0), (120.0, 50.0), [(84.0, 50.0), (120.0, 50.0), (120.0, 50.0)]),
        ((170.0, 5.0), (-100.0, 5.0), [(170.0, 30.5), (-100.0, 30.5), (-100.0, 5.0)]),
    ],
)
def test_the_fastest_way_over_a_hill_is_taken(
    start_deg: tuple[float, float], end_deg: tuple[float, float], corners_deg: list[tuple[float, float]]
) -> None:
    paths = PathFinder(ForbiddenSky(RIDGE, 0.0), AXES, WIDE)
    start, end = ((a * DEG, e * DEG) for a, e in (start_deg, end_deg))
    np.testing.assert_allclose(np.degrees(paths.find(start, end, None)), corners_deg, atol=1e-9)
    assert paths.find(start, (start[0] + 1.0 * DEG, start[1]), None) == [(start[0] + 1.0 * DEG, start[1])]


@pytest.mark.parametrize(("level_deg", "turns_deg"), [(38.0, 34.0), (42.0, 46.0)])
def test_the_sun_is_passed_a_degree_from_its_zone_on_the_nearer_side(level_deg: float, turns_deg: float) -> None:
    paths = PathFinder(FLAT, AXES, WIDE)
    start, end = (20.0 * DEG, level_deg * DEG), (80.0 * DEG, level_deg * DEG)
    corners = paths.find(start, end, (50.0 * DEG, 40.0 * DEG))
    np.testing.assert_allclose(
        np.degrees(corners), [(20.0, turns_deg), (80.0, turns_deg), (80.0, level_deg)], atol=1e-9
    )


def test_twelve_even_heights_of_the_travel_are_tried() -> None:
    """Hill and two suns' worth of zone leave one gap, which no obvious height meets: 6 / 11 of the travel."""
    paths = PathFinder(
        ForbiddenSky(HorizonMask(elevation_rad=(0.0,)), 0.0), AXES, ((-4.0, 4.0 * DEG), (4.0, 81.0 * DEG))
    )
    heights = {
        round(math.degrees(corners[0][1]), 6) for _, corners in paths._over_heights((0.0, 0.1), (1.0, 0.2), None)
    }
    even = {round(4.0 + 7.0 * step, 6) for step in range(12)}
    assert heights == even | {round(math.degrees(0.1), 6), round(math.degrees(0.2), 6)}
    spent = {corners[0][1]: seconds for seconds, corners in paths._over_heights((0.0, 0.1), (1.0, 0.2), None)}
    legs = [((0.0, 0.1), (0.0, 0.2)), ((0.0, 0.2), (1.0, 0.2)), ((1.0, 0.2), (1.0, 0.2))]
    assert spent[0.2] == pytest.approx(sum(AXES.slew_s(*leg) for leg in legs))


def test_the_way_over_the_top_stays_clear_of_the_hill_behind() -> None:
    """The ridge lies at azimuth 90: from 240 to 300 deg over the top, heights between 0 and 150 deg are of use."""
    paths = PathFinder(ForbiddenSky(RIDGE, 0.0), AXES, ((-4.0, 0.0), (6.0, 180.0 * DEG)))
    heights = [corners[0][1] for _, corners in paths._over_heights((4.3, 0.1), (5.2, 0.2), None)]
    assert max(heights) == pytest.approx(180.0 * DEG * 9 / 11)
    assert min(heights) == 0.0


def az_slew_s(distance_deg: float, share: float) -> float:
    """Time of a long slew that brakes with a share of the limit."""
    return distance_deg / 1.8 + 0.5 * 1.8 / 0.8 * (1.0 + 1.0 / share)


@pytest.mark.parametrize("before_s", [0.0, 1000.0])
def test_a_leg_keeps_as_much_more_from_the_sun_as_it_moves_until_the_axes_arrive(before_s: float) -> None:
    """Along the horizon past a Sun e above it, the nearest distance is e; the weaker braking takes longer."""
    start, corner, paths = (0.0, 0.0), (100.0 * DEG, 0.0), PathFinder(FLAT, AXES, WIDE)
    before = Leg("", tuple(Moving(share, start) for share in (1.0, 0.8)), before_s)
    kept_rad = 5.0 * DEG + 2.0 * math.pi / 86400.0 * (before_s + az_slew_s(100.0, 0.8))
    for off_rad, free in ((1e-4, True), (-1e-4, False)):
        leg = paths.leg(before, corner, (50.0 * DEG, kept_rad + off_rad), last=False)
        assert (leg.reason == "") is free
        assert not free or leg.end_s == pytest.approx(before_s + az_slew_s(100.0, 0.8))


def test_after_a_leg_the_axes_rest_at_the_corner() -> None:
    """Whatever they braked with: the next leg begins at rest."""
    start, corner, paths = (0.0, 0.1), (50.0 * DEG, 0.1), PathFinder(FLAT, AXES, WIDE)
    leg = Leg.begin(start)
    for goal, end_s in ((corner, az_slew_s(50.0, 0.8)), (start, 2.0 * az_slew_s(50.0, 0.8))):
        leg = paths.leg(leg, goal, None, last=False)
        assert leg.reason == ""
        assert leg.moving == (Moving(1.0, goal), Moving(0.8, goal))
        assert leg.end_s == pytest.approx(end_s)


@pytest.mark.parametrize("last", [True, False])
def test_only_the_last_leg_is_free_for_being_above_everything(last: bool) -> None:
    """The corner of another one must be known."""
    leg = PathFinder(FLAT, AXES, WIDE).leg(Leg.begin((0.0, 0.1)), (1.0, 0.3), None, last=last)
    assert (leg.reason, len(leg.moving)) == ("", 0 if last else 2)
    assert (leg.end_s == 0.0) is last


def test_a_leg_is_clear_of_all_with_what_the_elevation_runs_on() -> None:
    """From 1 deg/s downwards at 0.8 deg/s^2 the elevation runs on by 0.625 deg; upwards nothing is lost."""
    paths = PathFinder(ForbiddenSky(RIDGE, 5.0 * DEG), AXES, WIDE)

    def clear(height_deg: float, rate_deg_s: float, goal_deg: float, sun_deg: float | None = None) -> bool:
        moving = Moving(1.0, (0.0, height_deg * DEG), (0.0, rate_deg_s * DEG))
        higher = Moving(0.8, (0.0, 60.0 * DEG))
        sun = None if sun_deg is None else (0.0, sun_deg * DEG)
        return paths._clear(Leg("", (moving, higher), 100.0), (0.5 * DEG, goal_deg * DEG), sun)

    assert clear(30.63, -1.0, 40.0)
    assert not clear(30.62, -1.0, 40.0)
    assert clear(30.01, 1.0, 40.0)
    assert not clear(40.0, 0.0, 29.99)
    assert clear(40.0, 0.0, 30.01)
    # The Sun's zone, what the Sun moves in the 100 s before, in the slew and in 20 s more of corners.
    slew_s = AXES.slew_s((0.0, 60.0 * DEG), (0.5 * DEG, 55.0 * DEG))
    kept_deg = 5.0 + 360.0 / 86400.0 * (100.0 + slew_s + 20.0)
    for off_deg, free in ((0.003, True), (-0.003, False)):
        assert clear(55.0, 0.0, 55.0, 60.0 + kept_deg + off_deg) is free
        assert clear(55.0, 0.0, 55.0, 55.0 - kept_deg - off_deg) is free


@pytest.mark.parametrize(
    ("target_deg", "kept_deg"),
    [(30.0, 5.1), (5.12001, 5.1), (5.06, 5.04), (5.01, 5.0), (3.0, 5.0)],
)
def test_axes_after_a_target_keep_a_tenth_of_a_degree_more_from_the_sun_but_not_more_than_it(
    target_deg: float, kept_deg: float
) -> None:
    paths, sun = PathFinder(FLAT, AXES, WIDE), (50.0 * DEG, 40.0 * DEG)
    target = np.array([[50.0, 40.0 + target_deg], [50.0, 80.0]]) * DEG
    for off_deg, free in ((0.001, True), (-0.001, False)):
        # They come nearest in the middle; what ends nearer than the margin may have its goal there.
        places = np.array([[50.0, 30.0], [50.0, 40.0 - kept_deg - off_deg], [50.0, 30.0]]) * DEG
        still = np.zeros_like(places)
        assert (paths.barred(places, still, target, sun) == "") is free
        assert paths.barred(places, still, target, None) == ""
        # Moving on, they would stop where they come too near: 0.9 of 1 deg/s takes 0.50625 deg.
        ahead = places - [[0.0, 0.0], [0.0, 0.9**2 / 1.6 * DEG], [0.0, 0.0]]
        rates = np.array([[0.0, 0.0], [0.0, 0.9 * DEG], [0.0, 0.0]])
        assert (paths.barred(ahead, rates, target, sun) == "") is free


def test_a_path_by_columns_is_looked_for_again_while_it_takes_longer_than_assumed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The Sun moves on meanwhile: three estimates at most, the first of them the time of the straight way."""
    walls = HorizonMask(azimuth_rad=(0.5, 1.0, 1.5, 3.5, 4.0, 4.5), elevation_rad=(0.0, 1.5, 0.0, 0.0, 1.5, 0.0))
    paths = PathFinder(ForbiddenSky(walls, 0.0), AXES, ((-4.0, 0.0), (4.0, 60.0 * DEG)))
    start, end = (0.0, 0.2), (115.0 * DEG, 12.0 * DEG)
    straight_s, way = AXES.slew_s(start, end), [(0.3, 0.4), end]
    for takes_s, found_at, asked_s in (
        ([500.0, 600.0, 700.0, 800.0], None, [straight_s, 500.0, 600.0]),
        ([500.0, 500.0, 700.0], None, [straight_s, 500.0]),
        ([0.0], None, [straight_s]),
        ([500.0, 600.0], 1, [straight_s, 500.0]),
    ):
        asked: list[float] = []

        class Columns:
            def __init__(self, _paths: PathFinder, *ends: object, asked: list[float] = asked) -> None:
                assert ends[:3] == (start, end, None)
                asked.append(float(ends[3]))  # type: ignore[arg-type]

            def corners(self, asked=asked, takes_s=takes_s, found_at=found_at) -> list[tuple[float, float]]:
                self.duration_s = takes_s[len(asked) - 1]
                return way if found_at == len(asked) - 1 else []

        monkeypatch.setattr("rf_pointing.planning.slew._FreeColumns", Columns)
        found = paths.find(start, end, None)
        assert asked == pytest.approx(asked_s)
        assert found == way if found_at is not None else "no detour is free" in found


def test_the_corners_ahead_of_a_slew_are_given_until_the_axes_rest_near_them() -> None:
    corners, still = CornerPath([(0.1, 0.2), (0.3, 0.2), (0.3, 0.2)], near_rad=0.01, rest_rad_s=1e-3), (0.0, -0.99e-3)
    near, far = 0.01 - 1e-9, 0.01 + 1e-9
    assert corners.next((0.1 - far, 0.2), still) == (0.1, 0.2)
    assert corners.next((0.1, 0.2 + far), still) == (0.1, 0.2)
    for moving in ((1.01e-3, 0.0), (0.0, -1.01e-3)):
        assert corners.next((0.1, 0.2), moving) == (0.1, 0.2)
    assert corners.next((0.1 - near, 0.2 + near), still) == (0.3, 0.2)
    assert corners.next((0.0, 0.0), still) == (0.3, 0.2), "one that is passed does not come back"
    assert corners.next((0.3, 0.2), still) == (0.3, 0.2), "one at a time"
    assert corners.next((0.3, 0.2), still) is None
    assert CornerPath([], near_rad=0.01, rest_rad_s=1e-3).next((0.0, 0.0), still) is None


@pytest.mark.parametrize("lag_s", [0.0, 0.02, 0.1, 0.4, 2.0])
def test_a_steep_hill_behind_a_corner_is_cleared_however_far_the_axes_lag(lag_s: float) -> None:
    """A leg that began 0.3 deg before its corner stopped 0.12 deg below the hill with a lag of 0.4 s, 0.2 above without."""
    hill = HorizonMask(
        azimuth_rad=tuple(a * DEG for a in (0.0, 237.98, 256.14, 259.12, 271.14)),
        elevation_rad=tuple(e * DEG for e in (0.0, 4.99, 11.45, 20.64, 3.1)),
    )
    axes, corners = (
        AxisRates((1.915 * DEG, 5.77 * DEG), (0.766 * DEG, 1.56 * DEG)),
        ((-105.915, 11.579), (-103.863, 14.863), (42.966, 29.742)),
    )
    limits = AxisLimits(elevation_min_rad=0.5 * DEG)
    start, way = (-115.975 * DEG, 9.011 * DEG), [(a * DEG, e * DEG) for a, e in corners]
    scene = trial.Scene(hill, limits, axes, None, 0.0)
    assert trial.violations(scene, np.array([start]), [way], np.array([lag_s]))[0] < 0.01 * DEG


@pytest.mark.parametrize("sun_deg", [None, (30.3, 40.0), (31.0, 12.0), (-3.0, 76.0)])
def test_columns_leave_all_that_lies_within_a_corner_of_hill_and_sun_and_hardly_more(
    sun_deg: tuple[float, float] | None,
) -> None:
    """By a dense grid: half a degree above the hills, and a quarter about where the Sun goes, of all near azimuths."""
    hills = HorizonMask(
        azimuth_rad=tuple(a * DEG for a in (0.0, 18.2, 20.7, 33.1, 200.0, 215.0, 350.0)),
        elevation_rad=tuple(e * DEG for e in (5.0, 5.0, 33.0, 8.0, 3.0, 21.0, 5.0)),
    )
    sky, duration_s = ForbiddenSky(hills, 3.0 * DEG), 240.0
    travel = ((-10.0 * DEG, 4.0 * DEG), (60.0 * DEG, 160.0 * DEG))
    sun = None if sun_deg is None else (sun_deg[0] * DEG, sun_deg[1] * DEG)
    paths = PathFinder(sky, AXES, travel)
    columns = _FreeColumns(paths, (-12.0 * DEG, 0.4), (61.0 * DEG, 0.4), sun, duration_s)
    edges, pieces = columns._edges, columns._pieces
    assert (edges[0], edges[-1]) == pytest.approx((-12.0 * DEG, 61.0 * DEG))
    assert np.max(np.diff(edges)) <= 0.5 * DEG + 1e-9
    assert len(edges) < 73.0 / 0.5 + 12
    for point in (0.0, 18.2, 20.7, 33.1, 215.0 - 180.0):
        assert np.min(np.abs(edges - point * DEG)) < 1e-9
    kept = 3.0 * DEG + 2.0 * math.pi / 86400.0 * duration_s + 0.25 * DEG
    azimuths = np.arange(edges[0], edges[-1], 0.05 * DEG)
    bottoms = np.maximum(hills.lowest_all(azimuths) + 0.5 * DEG, 4.0 * DEG)
    tops = np.minimum(math.pi - hills.lowest_all(azimuths + math.pi) - 0.5 * DEG, 160.0 * DEG)
    belows, aboves = np.full(len(azimuths), math.inf), np.full(len(azimuths), -math.inf)
    if sun is not None:
        heights = sun[1] + np.arange(-6.0, 6.0, 0.02) * DEG
        grid = np.stack(np.broadcast_arrays(azimuths[:, None], heights), axis=-1)
        inside = angle_between(grid, np.array(sun)) < kept
        cut = inside.any(axis=1)
        belows[cut] = heights[np.argmax(inside[cut], axis=1)]
        aboves[cut] = heights[len(heights) - 1 - np.argmax(inside[cut][:, ::-1], axis=1)]
    # What lies within half a degree of the column is left out, what lies further off than the columns there is not.
    for column in range(len(edges) - 1):
        for reach, slack, safe in ((0.45 * DEG, 0.03 * DEG, True), (1.05 * DEG, 0.03 * DEG, False)):
            near = (azimuths >= edges[column] - reach) & (azimuths <= edges[column + 1] + reach)
            bottom, top = float(bottoms[near].max()), float(tops[near].min())
            below, above = float(belows[near].min()), float(aboves[near].max())
            free = [(bottom, min(top, below)), (max(bottom, above), top)]
            for piece, ((low, high), (lowest, highest)) in enumerate(zip(pieces[:, :, column], free, strict=True)):
                if piece == 1 and below == math.inf:
                    assert safe or low > high, "without a Sun there is one piece"
                elif safe:
                    assert low >= lowest - slack
                    assert high <= highest + slack
                elif lowest < highest:
                    rows = pieces[:, :, column].tolist()
                    assert any(row[0] <= lowest + slack and row[1] >= highest - slack for row in rows)


def test_pieces_of_neighbouring_columns_that_overlap_are_connected() -> None:
    paths = PathFinder(ForbiddenSky(HorizonMask(elevation_rad=(0.0,)), 0.0), AXES, WIDE)
    columns = _FreeColumns(paths, (0.0, 0.1), (1.0, 0.1), None, 0.0)
    low = np.array([[0.0, 0.3, 0.8, 0.0], [0.6, 9.0, 0.4, 0.6]])
    high = np.array([[0.4, 0.5, 0.9, 0.1], [0.9, -9.0, 0.6, 0.9]])
    found = columns._components(low, high)
    # Below in 0 and 1, above in 2; above in 0 alone; below in 2 with above in 3, which 2's upper piece misses by 0.
    assert found[0, 0] == found[0, 1] == found[1, 2] == found[1, 3]
    assert found[1, 3] == found[0, 2], "touching counts"
    assert found[1, 1] == -1
    assert len({int(found[0, 0]), int(found[1, 0]), int(found[0, 3])}) == 3


def stair_columns(
    pieces: np.ndarray, edges_deg: list[float], start: tuple[float, float], goal: tuple[float, float]
) -> _FreeColumns:
    """Columns of free elevations given by hand, degrees, on axes of 2 deg/s and 1 deg/s."""
    axes = AxisRates((2.0 * DEG, 1.0 * DEG), (5.0 * DEG, 5.0 * DEG))
    paths = PathFinder(ForbiddenSky(HorizonMask(elevation_rad=(0.0,)), 0.0), axes, WIDE)
    made = _FreeColumns(paths, (start[0] * DEG, start[1] * DEG), (goal[0] * DEG, goal[1] * DEG), None, 0.0)
    made._edges, made._pieces = np.array(edges_deg) * DEG, pieces * DEG
    return made


def test_stairs_go_by_the_pieces_that_take_least_time_at_the_edges_between_columns() -> None:
    """Over the step of the second column below, or above through it: down again costs more than the step."""
    lows, highs = [[10.0, 30.0, 10.0], [60.0, 45.0, 60.0]], [[40.0, 35.0, 40.0], [80.0, 70.0, 80.0]]
    made = stair_columns(np.stack([lows, highs], axis=1), [0.0, 1.0, 3.0, 4.0], (0.5, 12.0), (3.5, 15.0))
    stairs = made._stairs((0, 0, (0.5 * DEG, 12.0 * DEG)), (0, 2, (3.5 * DEG, 15.0 * DEG)))
    wanted = [(0.5, 12.0), (1.0, 12.0), (1.0, 30.0), (3.5, 30.0), (3.5, 15.0)]
    np.testing.assert_allclose(np.degrees(stairs), wanted, atol=1e-9)
    # 1 s for the second column, 0.5 s for the third, 18 deg up and 15 down: 34.5 s, a fifth more, and the corners.
    assert made.duration_s == pytest.approx(1.2 * 34.5 + 20.0)
    back = stair_columns(np.stack([lows, highs], axis=1), [0.0, 1.0, 3.0, 4.0], (3.5, 15.0), (0.5, 12.0))
    stairs = back._stairs((0, 2, (3.5 * DEG, 15.0 * DEG)), (0, 0, (0.5 * DEG, 12.0 * DEG)))
    wanted = [(3.5, 15.0), (3.0, 15.0), (3.0, 30.0), (0.5, 30.0), (0.5, 12.0)]
    np.testing.assert_allclose(np.degrees(stairs), wanted, atol=1e-9)
    # A start and a goal beside their columns are reached by legs of their own.
    assert back.duration_s == pytest.approx(1.2 * (1.0 + 0.5 + 15.0 + 18.0) + 20.0)


def test_stairs_begin_and_end_with_the_legs_to_and_from_their_columns() -> None:
    """2 deg/s and 1 deg/s at 5 deg/s^2: of elevation 4 deg take 4.2 s, 9 deg 9.2 s."""
    pieces = np.stack([np.array([[10.0, 10.0], [60.0, 60.0]]), np.array([[40.0, 40.0], [80.0, 80.0]])], axis=1)
    made = stair_columns(pieces, [0.0, 1.0, 2.0], (0.5, 6.0), (1.5, 49.0))
    stairs = made._stairs((0, 0, (0.5 * DEG, 10.0 * DEG)), (0, 1, (1.5 * DEG, 40.0 * DEG)))
    np.testing.assert_allclose(np.degrees(stairs), [(0.5, 10.0), (1.5, 10.0), (1.5, 40.0)], atol=1e-9)
    assert made.duration_s == pytest.approx(1.2 * 30.5 + 4.2 + 9.2 + 20.0)
    # The longest of all that were tried counts.
    made._stairs((0, 0, (0.5 * DEG, 10.0 * DEG)), (0, 1, (1.5 * DEG, 10.0 * DEG)))
    assert made.duration_s == pytest.approx(1.2 * 30.5 + 4.2 + 9.2 + 20.0)


def test_stairs_change_between_the_pieces_of_a_column_only_by_its_neighbours() -> None:
    """From below the zone to above it: the third column is free from one to the other."""
    lows, highs = [[10.0, 10.0, 10.0], [50.0, 50.0, 90.0]], [[30.0, 30.0, 70.0], [70.0, 70.0, 0.0]]
    made = stair_columns(np.stack([lows, highs], axis=1), [0.0, 1.0, 2.0, 3.0], (0.5, 20.0), (0.5, 60.0))
    stairs = made._stairs((0, 0, (0.5 * DEG, 20.0 * DEG)), (1, 0, (0.5 * DEG, 60.0 * DEG)))
    wanted = [(0.5, 20.0), (2.0, 20.0), (2.0, 50.0), (0.5, 50.0), (0.5, 60.0)]
    np.testing.assert_allclose(np.degrees(stairs), wanted, atol=1e-9)


@pytest.mark.parametrize("forward", [True, False])
def test_of_each_component_the_nearest_place_with_a_free_leg_is_taken(forward: bool) -> None:
    """Columns of a degree; within 4 deg of it, by the larger of both ways."""
    here, other, count = (10.5, 20.0), (90.0, 20.0), 20
    lows, highs = (
        np.array([np.full(count, 20.3), np.full(count, 21.0)]),
        np.array([np.full(count, 30.0), np.full(count, 50.0)]),
    )
    lows[0, 10], lows[1, 10] = 25.0, 20.9
    ends = (here, other) if forward else (other, here)
    made = stair_columns(np.stack([lows, highs], axis=1), [float(edge) for edge in range(count + 1)], *ends)
    component = np.stack([np.zeros(count, dtype=np.int64), np.ones(count, dtype=np.int64)])
    component[0, 11:], component[0, :7] = 2, 6
    component[:, 14], component[:, 15:] = (4, -1), 5
    found = made._reached(component, forward=forward)
    wanted = {
        0: (0, 9, (10.0, 20.3)), 1: (1, 10, (10.5, 20.9)), 2: (0, 11, (11.0, 20.3)), 4: (0, 14, (14.0, 20.3)),
    }  # fmt: skip
    assert found.keys() == wanted.keys()
    for label, (piece, column, place) in wanted.items():
        assert found[label][:2] == (piece, column)
        assert np.degrees(found[label][2]) == pytest.approx(place)


def test_a_place_is_reached_only_by_a_free_leg() -> None:
    """From under a ridge, which would have to be crossed for the nearer one of two places."""
    paths = PathFinder(ForbiddenSky(RIDGE, 0.0), AXES, WIDE)
    columns = _FreeColumns(paths, (88.0 * DEG, 26.0 * DEG), (92.0 * DEG, 26.0 * DEG), None, 0.0)
    component = columns._components(columns._pieces[:, 0], columns._pieces[:, 1])
    for forward, start in ((True, 88.0), (False, 92.0)):
        ((_, column, place),) = columns._reached(component, forward=forward).values()
        leg = ((start * DEG, 26.0 * DEG), place) if forward else (place, (start * DEG, 26.0 * DEG))
        assert paths.leg(Leg.begin(leg[0]), leg[1], None, last=False).reason == ""
        assert columns._edges[column] <= place[0] <= columns._edges[column + 1]


def test_the_widest_of_the_columns_within_a_clearance_counts() -> None:
    """Columns of 0.3 deg: the two on either side of each come within half a degree of it."""
    edges = np.arange(9) * 0.3 * DEG
    values = np.array([[0.0, 7.0, 0.0, 1.0, 0.0, 0.0, 0.0, 5.0]])
    np.testing.assert_array_equal(_widest(edges, values), [[7.0, 7.0, 7.0, 7.0, 1.0, 5.0, 5.0, 5.0]])


@pytest.mark.parametrize(
    ("longest", "tried", "found"),
    [
        (13, [13], [13]),
        (7, [13, 7, 13], [7, 13]),
        # The second leg begins with the length of the first: twice as long it is not free.
        (4, [13, 7, 4, 8, 12, 12, 13, 13], [4, 8, 12, 13]),
        (0, [13, 7, 4, 2, 1], []),
    ],
)
def test_places_are_straightened_into_long_free_legs(
    longest: int, tried: list[int], found: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Halved until a leg is free or doubled while it is; one step that is not free is no path."""
    assert straightened(14, longest, monkeypatch) == (tried, found)


def test_too_many_trials_are_no_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seven until the first of 55 legs is free, then two for each but the last."""
    tried, found = straightened(111, 2, monkeypatch)
    assert (len(tried), len(found)) == (114, 55)
    tried, found = straightened(400, 2, monkeypatch)
    assert (len(tried), found) == (120, [])


def straightened(count: int, longest: int, monkeypatch: pytest.MonkeyPatch) -> tuple[list[int], list[int]]:
    """Return by number the places that were tried, and those left of `count` in a row."""
    paths = PathFinder(FLAT, AXES, WIDE)
    columns = _FreeColumns(paths, (0.0, 0.1), (1.0, 0.1), None, 0.0)
    places, tried = [(0.001 * number, 0.1) for number in range(count)], list[int]()

    def leg(before: Leg, corner: tuple[float, float], _sun: None, *, last: bool) -> Leg:
        here, there = places.index(before.moving[0].position_rad), places.index(corner)
        assert last == (there == count - 1)
        tried.append(there)
        return Leg("" if there - here <= longest else "barred", (Moving(1.0, corner),), 0.0)

    monkeypatch.setattr(paths, "leg", leg)
    return tried, [places.index(place) for place in columns._straightened(places)]


@pytest.mark.parametrize(
    ("start_deg", "end_deg", "ends_deg"),
    [
        (-12.0, 61.0, (-12.0, 61.0)),
        (61.0, -12.0, (-12.0, 61.0)),
        (13.13, 44.44, (-10.0, 60.0)),
        (-11.0, -12.0, (-12.0, 60.0)),
        (61.0, 62.0, (-10.0, 62.0)),
    ],
)
def test_columns_reach_over_the_travel_and_both_ends_of_the_slew(
    start_deg: float, end_deg: float, ends_deg: tuple[float, float]
) -> None:
    """Axes may stand beyond the travel; both azimuths are edges, so that a path may run along them."""
    travel = ((-10.0 * DEG, 0.0), (60.0 * DEG, 90.0 * DEG))
    paths = PathFinder(ForbiddenSky(HorizonMask(elevation_rad=(0.0,)), 0.0), AXES, travel)
    edges = np.degrees(_FreeColumns(paths, (start_deg * DEG, 0.1), (end_deg * DEG, 0.1), None, 0.0)._edges)
    assert (edges[0], edges[-1]) == pytest.approx(ends_deg)
    for azimuth_deg in (start_deg, end_deg):
        assert np.min(np.abs(edges - azimuth_deg)) < 1e-9
    even = math.ceil((ends_deg[1] - ends_deg[0]) / 0.5 - 1e-9) + 1
    # Besides the even ones: both azimuths, and the horizon's point on either side.
    assert even <= len(edges) <= even + 4
    assert np.max(np.diff(edges)) <= 0.5 + 1e-9
