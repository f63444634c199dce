"""Points of clients: motions between them, turns for the rest of a pass, and the satellite that they mean."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.core import angular_distance_rad, azel_from_unit_vector, unit_vector_from_azel
from rf_pointing.ephemeris import CatalogueSky, Elements, Site, TopocentricTrack
from rf_pointing.planning import AxisLimits, HorizonMask
from rf_pointing.station.pointing.client_points import (
    ClientPoints,
    FollowParams,
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


def test_a_new_point_changes_the_motion_without_a_step() -> None:
    chosen = np.random.default_rng(4)
    points, before = ClientPoints(FollowParams()), None
    for t_s in T_S + np.arange(-10.0, 10.0):
        azimuth, elevation = through_north(float(t_s))
        expected = points.motion(np.array([t_s]), azimuth) if points.moving else None
        points.add(float(t_s), azimuth + math.radians(chosen.normal(0.0, 0.02)), elevation)
        if expected is not None:
            now = points.motion(np.array([t_s]), azimuth)
            assert now.position == pytest.approx(expected.position, abs=1e-9)
            before = now
    assert before is not None


@pytest.mark.parametrize(
    ("times", "moving"),
    [([0.0], False), ([0.0, 1.0], False), ([0.0, 1.0, 2.0], True), ([0.0, 5.0, 10.0, 15.0], False),
     ([0.0, 1.0, 2.0, 6.0], False), ([0.0, 1.0, 2.0, 2.01], True)],
)  # fmt: skip
def test_three_points_no_more_than_the_interval_apart_are_a_motion(times: list[float], moving: bool) -> None:
    points = ClientPoints(FollowParams())
    for t_s in times:
        points.add(T_S + t_s, *through_north(T_S + t_s))
    assert points.moving is moving


def test_points_that_stand_still_are_a_place_and_a_jump_begins_anew() -> None:
    points = ClientPoints(FollowParams())
    for t_s in range(8):
        assert not points.add(T_S + t_s, 1.0, 0.5)
    assert not points.moving
    for t_s in range(8, 16):
        points.add(T_S + t_s, *through_north(T_S + t_s - 8))
    assert points.moving
    assert points.add(T_S + 16, 3.0, 0.3)
    assert not points.moving
    assert len(points.history[0]) == 1


@pytest.mark.parametrize(("moved_deg", "moving"), [(0.02, False), (0.06, True)])
def test_the_newest_point_alone_may_show_that_a_place_is_left(moved_deg: float, moving: bool) -> None:
    """Less than 0.03 deg is the rounding of a client."""
    points = ClientPoints(FollowParams())
    for t_s, step_deg in enumerate((0.0, 0.0, moved_deg)):
        points.add(T_S + t_s, 1.0, 0.5 + math.radians(step_deg))
    assert points.moving is moving


def test_the_rest_of_a_motion_decides_the_turn() -> None:
    limits = AxisLimits(azimuth_min_rad=math.radians(-270.0), azimuth_max_rad=math.radians(270.0))
    points = ClientPoints(FollowParams())
    for t_s in T_S + np.arange(-200.0, -195.0):
        points.add(float(t_s), *through_north(float(t_s)))
    low, high = azimuth_still_to_come(points.motion(np.array([T_S - 195.0]), 4.9))
    # From the west through north to the east: the azimuth rises by nearly half a turn.
    assert math.degrees(high - low) == pytest.approx(168.0, abs=3.0)
    turn = turn_for(limits, (low, high), math.radians(250.0))
    assert limits.azimuth_min_rad <= low + turn
    assert high + turn <= limits.azimuth_max_rad
    short = AxisLimits(azimuth_min_rad=0.0, azimuth_max_rad=math.radians(100.0))
    assert turn_for(short, (math.radians(-80.0), math.radians(90.0)), 0.0) == 0.0


def test_points_below_horizon_and_travel_are_raised() -> None:
    mask = HorizonMask(azimuth_rad=(0.0, 3.0), elevation_rad=(math.radians(10.0), math.radians(2.0)))
    limits = AxisLimits(elevation_min_rad=math.radians(4.0), elevation_max_rad=math.radians(180.0))
    found = raised(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 1.0], [0.0, 1.6]]), limits, mask, math.radians(0.1))
    assert np.degrees(found[:2, 1]) == pytest.approx([10.1, 4.1])
    assert found[2:, 1] == pytest.approx([1.0, math.pi / 2.0])


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


def test_a_client_that_points_ahead_by_its_threshold_is_still_understood(sky: CatalogueSky, overhead: Elements) -> None:
    times = T_S - 100.0 + 8.0 * np.arange(6)
    found = identify(sky, times, sent(overhead, times, lead_s=4.0, decimals=1), MATCH)
    assert found is not None
    assert found.catalogue_number == 1
    assert found.lead_s == pytest.approx(4.0, abs=0.5)


def test_points_of_no_satellite_name_none(sky: CatalogueSky, overhead: Elements) -> None:
    times = T_S + np.arange(20.0)
    unknown = unit_vector_from_azel(*np.array([through_north(float(each)) for each in times]).T)
    assert identify(sky, times, unknown, MATCH) is None
    # Too few, or too short a way.
    assert identify(sky, times[:3], sent(overhead, times[:3]), MATCH) is None
    slow = T_S + 0.1 * np.arange(6)
    assert identify(sky, slow, sent(overhead, slow), MATCH) is None
    assert identify(CatalogueSky([], SITE, T_S), times, sent(overhead, times), MATCH) is None
