"""Points of clients: motions between them, turns for the rest of a pass, and the satellite that they mean."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rf_pointing.core import Motion, angular_distance_rad, azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.core.kinematics import Kinematics
from rf_pointing.ephemeris import CatalogueSky, Elements, Site, TopocentricTrack, tle_lines
from rf_pointing.planning import AxisLimits, HorizonMask
from rf_pointing.station.clients.points import (
    ClientPoints,
    FollowParams,
    KnownSatellites,
    MatchParams,
    azimuth_still_to_come,
    identify,
    on_track,
    raised,
    turn_for,
)

T_S = 1.7e9
SITE = Site.from_degrees(48.745, 9.103, 520.0)
MATCH = MatchParams()
OTHERS = [
    Kinematics(type="x_y"),
    Kinematics(type="x_y", lower_axis="north_south"),
    Kinematics(type="ha_dec", latitude_rad=-0.6),
]


def orbit(number: int, anomaly: float, node: float) -> Elements:
    return Elements(
        name=f"SAT {number}", catalogue_number=number, epoch_t_s=T_S, inclination_rad=math.radians(97.0),
        ascending_node_rad=node % (2.0 * math.pi), eccentricity=1e-4, argument_of_perigee_rad=0.0,
        mean_anomaly_rad=anomaly % (2.0 * math.pi), mean_motion_rad_s=1.13e-3, drag_per_earth_radius=0.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def overhead() -> Elements:
    """A satellite some 500 km up that is high over the site at T_S."""

    def height(one: Elements) -> float:
        return float(TopocentricTrack(one, SITE, refraction=None).target_at(T_S).elevation_rad)

    along = math.asin(math.sin(SITE.latitude_rad) / math.sin(math.radians(97.0)))
    coarse = max((orbit(1, along, node) for node in np.radians(np.arange(0.0, 360.0, 1.0))), key=height)
    near = np.radians(np.arange(-1.5, 1.5, 0.05)) + coarse.ascending_node_rad
    best = max((orbit(1, along, node) for node in near), key=height)
    assert height(best) > math.radians(60.0)
    return best


def flown(direction: object, times: np.ndarray, params: FollowParams | None = None, decimals: int = 2) -> tuple:
    """Send points at these times; return rms and largest error (deg) of the motion, and of the points as stairs."""
    points, axes, stairs = ClientPoints(params or FollowParams()), [], []
    for t_s in times:
        azimuth, elevation = direction(float(t_s))  # type: ignore[operator]
        sent = [math.radians(round(math.degrees(each), decimals)) for each in (azimuth, elevation)]
        points.add(float(t_s), *sent)
        if not points.moving:
            continue
        ahead = t_s + np.arange(0.1, 1.15, 0.1)
        truth = np.array([direction(float(each)) for each in ahead])  # type: ignore[operator]
        found = points.motion(ahead, azimuth).position
        axes += angular_distance_rad(found[:, 0], found[:, 1], truth[:, 0], truth[:, 1]).tolist()
        stairs += angular_distance_rad(sent[0], sent[1], truth[:, 0], truth[:, 1]).tolist()
    rms = [math.degrees(math.sqrt(np.mean(np.square(each)))) for each in (axes, stairs)]
    return rms[0], math.degrees(max(axes)), rms[1]


def test_the_motion_between_points_of_two_decimals_is_a_fiftieth_of_their_stairs(overhead: Elements) -> None:
    track = TopocentricTrack(overhead, SITE, refraction=None)

    def direction(t_s: float) -> tuple[float, float]:
        look = track.target_at(t_s)
        return look.azimuth_rad, look.elevation_rad

    rms, largest, stairs = flown(direction, T_S + np.arange(-150.0, 150.0) + 0.37)
    print(f"{1e3 * rms:.1f} mdeg rms, {1e3 * largest:.1f} largest; stairs {1e3 * stairs:.0f} mdeg rms")
    assert rms < 0.008
    assert largest < 0.03
    assert stairs > 50.0 * rms


def through_north(t_s: float) -> tuple[float, float]:
    azimuth, elevation = azel_from_unit_vector([7.5 * (t_s - T_S), 300.0, 500.0])
    return float(azimuth), float(elevation)


def test_a_motion_through_north_has_one_turn_and_steady_rates() -> None:
    points, azimuths, at = ClientPoints(FollowParams()), [], -0.5
    for t_s in T_S + np.arange(-20.0, 20.0):
        points.add(float(t_s), *through_north(float(t_s)))
        if points.moving:
            motion = points.motion(t_s + np.arange(0.1, 1.05, 0.1), at)
            azimuths += motion.position[:, 0].tolist()
            at = azimuths[-1]
            # The rates belong to the positions.
            assert np.gradient(motion.position, 0.1, axis=0)[1:-1] == pytest.approx(motion.velocity[1:-1], abs=2e-4)
    assert np.all(np.abs(np.diff(azimuths)) < math.radians(0.3))
    assert azimuths[0] < -0.3 < 0.3 < azimuths[-1]


def circling(rate: float, t_s: float, elevation: float = 0.3) -> tuple[float, float]:
    """A target that goes round at one elevation."""
    return 0.5 + rate * (t_s - T_S), elevation


def followed(times: np.ndarray, direction: object, **changes: float) -> ClientPoints:
    points = ClientPoints(FollowParams(**changes))
    for t_s in times:
        points.add(float(t_s), *direction(float(t_s)))  # type: ignore[operator]
    return points


def test_the_motion_has_place_rate_and_acceleration_of_the_target() -> None:
    """At 6 mrad/s a parabola of 8 s is off by (0.006 * 4)^3 / 16 = 1e-6 rad: no more is left."""
    points = followed(T_S + np.arange(-15.0, 1.0), lambda t_s: circling(0.006, t_s))
    assert points.newest_s == T_S
    ahead = np.array([0.0, 0.4, 1.0])
    motion = points.motion(T_S + ahead, 0.5 + 4.0 * math.pi)
    np.testing.assert_allclose(motion.position[:, 0], 0.5 + 4.0 * math.pi + 0.006 * ahead, atol=1e-5)
    np.testing.assert_allclose(motion.position[:, 1], 0.3, atol=1e-5)
    np.testing.assert_allclose(motion.velocity, [[0.006, 0.0]] * 3, atol=2e-5)
    np.testing.assert_allclose(motion.acceleration, 0.0, atol=2e-5)


@pytest.mark.parametrize(("step_deg", "jumps"), [(4.8, False), (-4.8, False), (5.2, True), (-5.2, True)])
@pytest.mark.parametrize("moving", [True, False])
def test_a_point_jumps_beyond_five_degrees_of_a_motion_and_ten_of_a_place(
    step_deg: float, jumps: bool, moving: bool
) -> None:
    """Of a motion at 1.1 deg/s counts where it is expected by now."""
    rate = 0.02 if moving else 0.0
    points = followed(T_S + np.arange(6.0), lambda t_s: circling(rate, t_s, 0.0))
    assert points.moving is moving
    azimuth, _ = circling(rate, T_S + 6.0)
    assert points.add(T_S + 6.0, azimuth + math.radians(step_deg * (1.0 if moving else 2.0)), 0.0) is jumps
    # A jump begins anew.
    assert len(points.history[0]) == (1 if jumps else 7)


def test_the_step_of_a_point_is_spread_over_the_blend_with_its_own_rates() -> None:
    """Half of it is left in the middle, nothing at the end; the rates are the slopes of the places."""
    azimuth, elevation = circling(0.004, T_S + 8.0)
    ahead, moved = np.linspace(0.0, 1.0, 1001), []
    for blend_s in (0.8, 0.0):
        points = followed(T_S + np.arange(8.0), lambda t_s: circling(0.004, t_s), blend_s=blend_s)
        expected = points.motion(np.array([T_S + 8.0]), azimuth).position[0]
        points.add(T_S + 8.0, azimuth + math.radians(0.5), elevation)
        moved.append(points.motion(T_S + 8.0 + ahead, azimuth))
    left = moved[0].position - moved[1].position
    assert abs(expected[0] - moved[1].position[0, 0]) > math.radians(0.15)
    np.testing.assert_allclose(moved[0].position[0], expected, atol=1e-8)
    np.testing.assert_allclose(left[400], 0.5 * left[0], atol=1e-8)
    np.testing.assert_allclose(left[800:], 0.0, atol=1e-8)
    inside = np.r_[3:797, 804:1000]
    for values, slopes in ((moved[0].position, moved[0].velocity), (moved[0].velocity, moved[0].acceleration)):
        np.testing.assert_allclose(np.gradient(values, 1e-3, axis=0)[inside], slopes[inside], atol=2e-5)


def going(azimuth: float, elevation: float, rates: tuple[float, float]) -> Motion:
    return Motion(np.array([[azimuth, elevation]]), np.array([rates]), np.zeros((1, 2)))


@given(st.floats(-10.0, 10.0), st.floats(0.01, 1.4), st.floats(0.01, 3.13), st.sampled_from([-1.0, 1.0]))
def test_the_rest_of_a_pass_ends_half_a_turn_from_where_it_rose(
    rise: float, top: float, way: float, side: float
) -> None:
    """On the great circle through its highest point at elevation `top`, so far after the rise."""
    azimuth = rise + side * math.atan2(math.sin(way) * math.cos(top), math.cos(way))
    elevation = math.asin(math.sin(way) * math.sin(top))
    rates = side * math.cos(top) / math.cos(elevation) ** 2, math.cos(way) * math.sin(top) / math.cos(elevation)
    found = azimuth_still_to_come(going(azimuth, elevation, rates))
    assert found == pytest.approx(sorted((azimuth, rise + side * math.pi)), abs=1e-6)


@given(st.integers(-2, 1), st.floats(-3.0, 3.0), st.floats(0.0, 3.0))
def test_a_mount_of_many_turns_goes_on_with_the_one_it_is_on(turns: int, low: float, length: float) -> None:
    wide = AxisLimits(azimuth_min_rad=-20.0, azimuth_max_rad=20.0)
    turn = 2.0 * math.pi * turns
    assert turn_for(wide, (low, low + length), low + 0.5 * length + turn) == pytest.approx(turn)


def test_points_below_horizon_and_travel_are_raised() -> None:
    mask = HorizonMask(azimuth_rad=(0.0, 3.0), elevation_rad=(math.radians(10.0), math.radians(2.0)))
    limits = AxisLimits(elevation_min_rad=math.radians(4.0), elevation_max_rad=math.radians(180.0))
    found = raised(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 1.0], [0.0, 1.6]]), limits, mask, math.radians(0.1))
    assert np.degrees(found[:2, 1]) == pytest.approx([10.1, 4.1])
    assert found[2:, 1] == pytest.approx([1.0, math.pi / 2.0])
    assert found[:, 0] == pytest.approx([0.0, 3.0, 0.0, 0.0])


def sent(one: Elements, t_s: np.ndarray, lead_s: float = 0.0, decimals: int = 2) -> np.ndarray:
    track = TopocentricTrack(one, SITE, refraction=None)
    looks = [track.target_at(float(each) + lead_s) for each in t_s]
    rows = np.degrees([(look.azimuth_rad, look.elevation_rad) for look in looks])
    return unit_vector_from_azel(*np.radians(np.round(rows, decimals)).T)


@pytest.fixture(scope="module")
def sky(overhead: Elements) -> CatalogueSky:
    """The satellite among 300 others, some of them in its own plane."""
    chosen = np.random.default_rng(11)
    others = [orbit(100 + k, *chosen.uniform(0.0, 2.0 * math.pi, 2)) for k in range(250)]
    train = [
        replace(overhead, name=f"TRAIN {k}", catalogue_number=50 + k,
                mean_anomaly_rad=(overhead.mean_anomaly_rad - 0.02 * (k + 1)) % (2.0 * math.pi)) for k in range(5)
    ]  # fmt: skip
    return CatalogueSky([*others, *train, overhead], SITE, T_S)


@pytest.mark.parametrize("begin_s", [-200.0, -60.0, 0.0, 100.0])
@pytest.mark.parametrize("step_s", [1.0, 10.0])
def test_the_points_of_a_satellite_name_it_among_many(
    sky: CatalogueSky, overhead: Elements, begin_s: float, step_s: float
) -> None:
    times = T_S + begin_s + step_s * np.arange(12)
    found = identify(sky, times, sent(overhead, times), MATCH)
    assert found is not None
    assert found.catalogue_number == 1
    assert found.distance_rad < math.radians(0.02)
    assert abs(found.lead_s) < 0.5
    assert on_track(sky, found.row, times[-1] + 5.0, sent(overhead, times[-1:] + 5.0)[0], MATCH)
    assert not on_track(sky, found.row, times[-1] + 5.0, sent(overhead, times[-1:] + 120.0)[0], MATCH)


def test_points_of_no_satellite_name_none(sky: CatalogueSky, overhead: Elements) -> None:
    times = T_S + np.arange(20.0)
    unknown = unit_vector_from_azel(*np.array([through_north(float(each)) for each in times]).T)
    assert identify(sky, times, unknown, MATCH) is None
    # Too few, or too short a way.
    assert identify(sky, times[:3], sent(overhead, times[:3]), MATCH) is None
    slow = T_S + 0.1 * np.arange(6)
    assert identify(sky, slow, sent(overhead, slow), MATCH) is None
    assert identify(CatalogueSky([], SITE, T_S), times, sent(overhead, times), MATCH) is None


RATE = 0.01


class Drawn:
    """A sky of satellites that run round the equator at 10 mrad/s, each so many seconds behind the first."""

    def __init__(self, *behind_s: float) -> None:
        self.behind_s = np.array(behind_s)
        self.elements = [orbit(10 + k, 0.0, 0.0) for k in range(len(behind_s))]

    def directions(self, t_s: np.ndarray, rows: list[int] | None = None) -> tuple[np.ndarray, np.ndarray]:
        behind_s = self.behind_s if rows is None else self.behind_s[rows]
        angle = RATE * (np.asarray(t_s)[None, :] - T_S - behind_s[:, None])
        return np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1), np.ones(len(behind_s), dtype=bool)


def led(times: np.ndarray, lead_s: float, aside_rad: float = 0.0) -> np.ndarray:
    """Points ahead of the first satellite, and beside its track."""
    angle = RATE * (times - T_S + lead_s)
    high = math.cos(aside_rad)
    return np.column_stack([high * np.cos(angle), high * np.sin(angle), np.full(len(times), math.sin(aside_rad))])


NARROW = MatchParams(tolerance_rad=0.004, threshold_rad=0.1, lead_s=20.0, motion_rad=0.0299)
FOUR = T_S + np.arange(4.0)


@pytest.mark.parametrize(("lead_s", "aside_rad"), [(2.3, 0.003), (0.7, -0.002), (-2.4, 0.0), (9.5, 0.001)])
def test_a_match_tells_lead_and_distance_of_the_points(lead_s: float, aside_rad: float) -> None:
    found = identify(Drawn(0.0), FOUR, led(FOUR, lead_s, aside_rad), NARROW)  # type: ignore[arg-type]
    assert found is not None
    assert (found.row, found.name, found.catalogue_number) == (0, "SAT 10", 10)
    assert found.lead_s == pytest.approx(lead_s, abs=0.01)
    assert found.distance_rad == pytest.approx(abs(aside_rad), abs=5e-5)


@pytest.mark.parametrize(
    ("lead_s", "aside_rad", "changes"),
    [
        # Beside the track; ahead by more than the threshold, or than the longest lead; late by more than three seconds.
        (2.0, 0.0045, {}), (10.6, 0.0, {}), (5.7, 0.0, {"lead_s": 5.0}), (-3.6, 0.0, {}),
        # A way of 30 mrad, asked 31; or of so many points.
        (0.0, 0.0, {"motion_rad": 0.031}), (0.0, 0.0, {"points": 5}),
    ],
)  # fmt: skip
def test_points_that_lie_otherwise_are_no_match(lead_s: float, aside_rad: float, changes: dict[str, float]) -> None:
    params = NARROW.replace(**changes)
    assert identify(Drawn(0.0), FOUR, led(FOUR, lead_s, aside_rad), params) is None  # type: ignore[arg-type]
    near = led(FOUR, 4.7 if lead_s == 5.7 else 0.2)
    assert (identify(Drawn(0.0), FOUR, near, params) is not None) is (lead_s != 0.0)  # type: ignore[arg-type]


def test_elements_that_cannot_be_read_are_a_problem_until_they_can(overhead: Elements, tmp_path: Path) -> None:
    known, path = KnownSatellites(SITE), tmp_path / "sat.tle"
    known.load(str(path), T_S)
    while not known.problem:
        known.look()
    assert known.sky is None
    assert re.search(r"satellites cannot be identified: .*sat\.tle", known.problem)
    path.write_text("\n".join((overhead.name, *tle_lines(overhead))) + "\n")
    known.load(str(path), T_S)
    while known.sky is None:
        known.look()
    known.look()
    assert [one.catalogue_number for one in known.sky.elements] == [1]
    assert known.problem == ""
    known.close()


@given(st.sampled_from(OTHERS), st.floats(-3.1, 3.1), st.floats(0.05, 1.5), st.floats(-3.1, 3.1))
def test_on_other_axes_the_rest_of_a_pass_goes_on_until_it_sets_on_the_sky(
    mount: Kinematics, azimuth: float, elevation: float, course: float
) -> None:
    """The great circle in steps of 0.02 deg until it is below the horizon."""
    up, still = unit_vector_from_azel(azimuth, elevation), np.zeros((1, 2))
    north = unit_vector_from_azel(azimuth, elevation + 0.5 * math.pi)
    ahead = math.cos(course) * north + math.sin(course) * np.cross(up, north)
    way = np.arange(0.0, 2.0 * math.pi, math.radians(0.02))[:, None]
    path = np.cos(way) * up + np.sin(way) * ahead
    path = path[: int(np.argmax(path[:, 2] < 0.0))] @ mount.matrix
    assume(np.all(np.abs(path[:, 2]) < 0.999))
    rate = (math.sin(course) / math.cos(elevation), math.cos(course))
    now = Motion(*mount.to_axes(np.array([[azimuth, elevation]]), np.array([rate]), still))
    angles = np.unwrap(np.arctan2(path[:, 0], path[:, 1]))
    angles += float(now.position[0, 0]) - angles[0]
    low, high = azimuth_still_to_come(now, mount.matrix[2])
    assert (low, high) == pytest.approx((angles.min(), angles.max()), abs=0.02)
