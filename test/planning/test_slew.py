"""Paths of slews: what the antenna really runs through stays out of hills and Sun, and a free path is found."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessor, CommandPreprocessorParams
from rf_pointing.planning import AxisLimits, AxisRates, CornerPath, Gate, GateParams, HorizonMask
from rf_pointing.planning.forbidden_sky import ForbiddenSky
from rf_pointing.planning.slew import AxisSlew, Leg, Moving, PathFinder, slew_path

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
    at_rest = slew_path(Moving(1.0, (0.3, 0.2)), (1.4, 0.7), AXES)
    assert at_rest[0][-1] == pytest.approx(AXES.slew_s((0.3, 0.2), (1.4, 0.7)))
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


def az_slew_s(distance_deg: float, share: float) -> float:
    """Time of a long slew that brakes with a share of the limit."""
    return distance_deg / 1.8 + 0.5 * 1.8 / 0.8 * (1.0 + 1.0 / share)


def test_after_a_leg_the_axes_rest_at_the_corner() -> None:
    """Whatever they braked with: the next leg begins at rest."""
    start, corner, paths = (0.0, 0.1), (50.0 * DEG, 0.1), PathFinder(FLAT, AXES, WIDE)
    leg = Leg.begin(start)
    for goal, end_s in ((corner, az_slew_s(50.0, 0.8)), (start, 2.0 * az_slew_s(50.0, 0.8))):
        leg = paths.leg(leg, goal, None, last=False)
        assert leg.reason == ""
        assert leg.moving == (Moving(1.0, goal), Moving(0.8, goal))
        assert leg.end_s == pytest.approx(end_s)


@pytest.mark.parametrize(
    ("target_deg", "kept_deg"), [(30.0, 5.1), (5.12001, 5.1), (5.06, 5.04), (5.01, 5.0), (3.0, 5.0)]
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
