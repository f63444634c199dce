"""Passes: skyfield's events as independent library, brute force on a fine grid, and refusals."""

import dataclasses
import math

import numpy as np
import pytest
from skyfield.api import EarthSatellite, load, wgs84

from rf_pointing.core.constants import EARTH_MU_M3_S2
from rf_pointing.ephemeris import (
    Elements,
    TopocentricTrack,
    find_elements,
    find_passes,
    first_pass_above,
    passes_with_present,
    site,
    verification_elements,
)
from test.ephemeris.test_track import tle_lines

MASK_RAD = math.radians(5.0)
DAY_S = 86400.0
TT_MINUS_UTC_S = 65.184
"""In 2006."""
SKYFIELD_EVENT_S = 0.25
"""skyfield stops its event search at half a second."""
POLAR_MOTION_RAD = 2e-5
"""skyfield leaves polar motion out by default: 11 m on the ground, seen from 600 km or more."""


def test_first_pass_of_cbers_above_40_degrees_over_goldstone(track: TopocentricTrack, cbers: Elements) -> None:
    """Labelled snapshot, the pass that the closed-loop examples track."""
    found = first_pass_above(track, cbers.epoch_t_s, math.radians(40.0), MASK_RAD, 3.0 * DAY_S)
    assert found.aos_t_s == pytest.approx(1151384323.813, abs=0.01)
    assert found.tca_t_s == pytest.approx(1151384680.310, abs=0.01)
    assert found.los_t_s == pytest.approx(1151385038.547, abs=0.01)
    assert math.degrees(found.peak_elevation_rad) == pytest.approx(44.3093, abs=1e-3)
    assert math.degrees(found.peak_azimuth_rate_rad_s) == pytest.approx(0.5731, abs=1e-3)
    assert found.crosses_north


@pytest.mark.parametrize("number", ["28057", "29238", "28129", "8195"])
def test_events_agree_with_skyfield(number: str) -> None:
    scale = load.timescale(builtin=True)
    elements, place = find_elements(verification_elements(), number), site("Canberra DSS-43")
    satellite = EarthSatellite(*tle_lines(number), number, scale)
    observer = wgs84.latlon(math.degrees(place.latitude_rad), math.degrees(place.longitude_rad), place.altitude_m)
    start, end = (
        scale.utc(1970, 1, 1 + t // DAY_S, 0, 0, t % DAY_S) for t in (elements.epoch_t_s, elements.epoch_t_s + DAY_S)
    )
    times, kinds = satellite.find_events(observer, start, end, altitude_degrees=5.0)
    posix = (times.whole - 2440587.5 + times.tt_fraction) * DAY_S - TT_MINUS_UTC_S
    track = TopocentricTrack(elements, place, refraction=None, light_time="none")
    passes = find_passes(track, elements.epoch_t_s, DAY_S, MASK_RAD)
    rises = [p.aos_t_s for p in passes if not p.rises_before]
    sets = [p.los_t_s for p in passes if not p.sets_after]
    np.testing.assert_allclose(rises, posix[kinds == 0], rtol=0.0, atol=SKYFIELD_EVENT_S)
    np.testing.assert_allclose(sets, posix[kinds == 2], rtol=0.0, atol=SKYFIELD_EVENT_S)
    ours = np.array(rises + sets)
    at_ours = scale.utc(1970, 1, 1 + ours // DAY_S, 0, 0, ours % DAY_S)
    altitude = (satellite - observer).at(at_ours).altaz()[0].radians
    np.testing.assert_allclose(altitude, MASK_RAD, rtol=0.0, atol=POLAR_MOTION_RAD)


def test_no_pass_is_missed_against_a_fine_grid(track: TopocentricTrack, cbers: Elements) -> None:
    elevation = track.sample(cbers.epoch_t_s + np.arange(0.0, 2.0 * DAY_S, 4.0)).elevation_rad
    for mask_deg in (0.0, 19.3, 40.5, 80.0):
        up = elevation > math.radians(mask_deg)
        rises = np.count_nonzero(up[1:] & ~up[:-1]) + int(up[0])
        assert len(find_passes(track, cbers.epoch_t_s, 2.0 * DAY_S, math.radians(mask_deg))) == rises


def test_the_spike_of_a_pass_through_the_zenith_is_found_between_steps(track: TopocentricTrack) -> None:
    """Peak azimuth rate of a straight fly-by is speed over height over cos(peak): 0.55 deg/s / cos 89.90 deg."""
    (found,) = find_passes(track, 1151518000.0, 2000.0, MASK_RAD)
    assert math.degrees(found.peak_elevation_rad) == pytest.approx(89.9003, abs=1e-3)
    fly_by = found.peak_elevation_rate_rad_s / math.cos(found.peak_elevation_rad)
    assert found.peak_azimuth_rate_rad_s == pytest.approx(fly_by, rel=0.02)


def test_a_pass_under_way_is_cut_off_and_says_so(track: TopocentricTrack) -> None:
    (found,) = find_passes(track, 1151384500.0, 300.0, MASK_RAD)
    assert (found.aos_t_s, found.los_t_s) == (1151384500.0, 1151384800.0)
    assert found.rises_before
    assert found.sets_after


def test_a_geostationary_satellite_is_one_long_pass_or_none() -> None:
    elements = find_elements(verification_elements(), "24208")
    always = find_passes(TopocentricTrack(elements, site("Canberra DSS-43")), elements.epoch_t_s, DAY_S, MASK_RAD)
    assert [(p.rises_before, p.sets_after) for p in always] == [(True, True)]
    above = TopocentricTrack(elements, site("Canberra DSS-43"))
    present = passes_with_present(above, elements.epoch_t_s, DAY_S, MASK_RAD)[0]
    assert present.aos_t_s <= elements.epoch_t_s
    assert present.rises_before
    never = TopocentricTrack(elements, site("Goldstone DSS-13"))
    assert find_passes(never, elements.epoch_t_s, DAY_S, MASK_RAD) == []
    with pytest.raises(ValueError, match=r"ITALSAT 2 has no pass above 20\.00 deg in 24\.00 h .* none rises above"):
        first_pass_above(never, elements.epoch_t_s, math.radians(20.0), MASK_RAD, DAY_S)


@pytest.mark.parametrize(
    ("after_s", "duration_s", "mask_rad", "message"),
    [
        (13.5 * DAY_S, DAY_S, MASK_RAD, "days from the epoch"),
        (0.0, DAY_S, 2.0, "min_elevation_rad"),
        (0.0, -5.0, MASK_RAD, "duration_s"),
        (0.0, DAY_S, MASK_RAD, r"no pass above 60.00 deg in 24.00 h .*: 5 passes, the highest reaches 44.31 deg"),
    ],
)
def test_what_cannot_be_searched_or_is_never_high_enough_is_refused(
    after_s: float, duration_s: float, mask_rad: float, message: str, track: TopocentricTrack, cbers: Elements
) -> None:
    with pytest.raises(ValueError, match=message):
        first_pass_above(track, cbers.epoch_t_s + after_s, math.radians(60.0), mask_rad, duration_s)


@pytest.mark.parametrize("share", [0.1, 0.9, None])
def test_a_pass_that_is_going_on_keeps_its_own_rise(
    track: TopocentricTrack, cbers: Elements, share: float | None
) -> None:
    """Between two passes there is none such."""
    wanted = find_passes(track, cbers.epoch_t_s, DAY_S, MASK_RAD)
    at_s = wanted[1].los_t_s + 60.0 if share is None else wanted[2].aos_t_s + share * wanted[2].duration_s
    found = passes_with_present(track, at_s, DAY_S, MASK_RAD)
    for ours, theirs in zip(found[:2], wanted[2:4], strict=True):
        assert (ours.aos_t_s, ours.los_t_s) == pytest.approx((theirs.aos_t_s, theirs.los_t_s), abs=1e-3)
        assert not ours.rises_before


def test_every_stay_above_a_horizon_is_a_pass(track: TopocentricTrack, cbers: Elements) -> None:
    """A hill in the middle of a pass makes two of it; brute force on a grid of 0.1 s says where."""
    flat = find_passes(track, cbers.epoch_t_s, DAY_S, MASK_RAD)
    whole = max(flat, key=lambda one: one.peak_elevation_rad)
    middle = float(track.sample([whole.tca_t_s]).azimuth_rad[0])

    def hill(azimuth_rad: np.ndarray) -> np.ndarray:
        off = np.abs(np.mod(azimuth_rad - middle + np.pi, 2.0 * np.pi) - np.pi)
        return np.maximum(MASK_RAD, np.radians(60.0) * (1.0 - off / np.radians(30.0)))

    found = [
        one for one in find_passes(track, cbers.epoch_t_s, DAY_S, hill) if abs(one.tca_t_s - whole.tca_t_s) < 900.0
    ]
    assert len(found) == 2
    looks = track.sample(np.arange(whole.aos_t_s - 5.0, whole.los_t_s + 5.0, 0.1))
    clear = looks.elevation_rad > hill(looks.azimuth_rad)
    edges = looks.t_s[:-1][clear[1:] != clear[:-1]] + 0.05
    assert [t for one in found for t in (one.aos_t_s, one.los_t_s)] == pytest.approx(edges.tolist(), abs=0.051)
    assert found[0].peak_elevation_rad == pytest.approx(float(track.sample([found[0].los_t_s]).elevation_rad[0]))
    assert found[0].tca_t_s == found[0].los_t_s


def test_a_horizon_far_below_the_level_is_refused(track: TopocentricTrack, cbers: Elements) -> None:
    """No hill of the ground is seen 12 deg below the level: such a mask has wrong signs or units."""

    def dipping(azimuth_rad: np.ndarray) -> np.ndarray:
        return np.where(azimuth_rad < 1.0, -lowest_rad, 0.1)

    lowest_rad = 0.18
    assert find_passes(track, cbers.epoch_t_s, 6.0 * 3600.0, dipping)
    lowest_rad = 0.22
    with pytest.raises(ValueError, match="min_elevation_rad"):
        find_passes(track, cbers.epoch_t_s, 6.0 * 3600.0, dipping)


def decaying(rng: np.random.Generator) -> Elements:
    """Draw a low orbit that drag takes down within the fourteen days of its elements."""
    elements = find_elements(verification_elements(), "28057")
    return dataclasses.replace(
        elements, mean_motion_rad_s=rng.uniform(16.1, 16.35) * 2.0 * math.pi / DAY_S,
        eccentricity=rng.uniform(1e-4, 8e-3), inclination_rad=rng.uniform(0.9, 1.8),
        ascending_node_rad=rng.uniform(0.0, 2.0 * math.pi),
        argument_of_perigee_rad=rng.uniform(0.0, 2.0 * math.pi),
        drag_per_earth_radius=10.0 ** rng.uniform(-3.0, -2.3),
    )  # fmt: skip


def test_the_span_of_an_eccentric_orbit_ends_where_sun_and_moon_sink_its_perigee(random: np.random.Generator) -> None:
    """At 0.95 they move the perigee by up to 1000 km, of which its mean over the periods shows nothing."""
    base, finite = find_elements(verification_elements(), "28057"), 0
    for _ in range(24):
        eccentricity = random.uniform(0.93, 0.96)
        axis_m = random.uniform(6.6e6, 7.0e6) / (1.0 - eccentricity)
        elements = dataclasses.replace(
            base, eccentricity=eccentricity, mean_motion_rad_s=math.sqrt(EARTH_MU_M3_S2 / axis_m**3),
            **{name: random.uniform(0.2, 2.8) for name in
               ("inclination_rad", "ascending_node_rad", "argument_of_perigee_rad", "mean_anomaly_rad")},
        )  # fmt: skip
        track = TopocentricTrack(elements, site("Canberra DSS-43"))
        last_s = min(track.spans_t_s[0][1], elements.epoch_t_s + 13.9 * DAY_S)
        track.target.motion_at(np.arange(elements.epoch_t_s, last_s, 60.0))
        finite += math.isfinite(track.spans_t_s[0][1])
    assert finite > 2


def test_a_search_through_the_decay_of_an_object_finds_the_passes_before_it(random: np.random.Generator) -> None:
    ends_days, count = [], 0
    for _ in range(8):
        elements = decaying(random)
        track = TopocentricTrack(elements, site("Canberra DSS-43"))
        ((_, last_s),) = track.spans_t_s
        assert math.isfinite(last_s)
        ends_days.append((last_s - elements.epoch_t_s) / DAY_S)
        # On its way down: 20 km, or where the theory itself fails.
        height_m = math.hypot(*track.target.motion_at(last_s).position) - 6.378135e6
        assert 15e3 < height_m < 150e3
        passes = find_passes(track, elements.epoch_t_s, 13.9 * DAY_S, MASK_RAD)
        assert passes == find_passes(track, elements.epoch_t_s, last_s - elements.epoch_t_s, MASK_RAD)
        assert all(one.los_t_s <= last_s for one in passes)
        assert any("decays" in reason for reason in track.warnings(elements.epoch_t_s))
        assert not track.covers(last_s + 60.0)
        # SGP4 may raise a fallen object again; nobody tracks its ghost.
        with pytest.raises(ValueError, match="outside the usable span"):
            find_passes(track, last_s + 600.0, DAY_S, MASK_RAD)
        count += len(passes)
    assert count > 8
    assert max(ends_days) - min(ends_days) > 1.0


@pytest.mark.parametrize(
    ("low_deg", "high_deg", "crosses"),
    [(10.0, 350.0, False), (-20.0, -5.0, False), (365.0, 700.0, False), (-5.0, 5.0, True), (350.0, 361.0, True)],
)
def test_a_pass_crosses_north_where_its_azimuths_are_of_two_turns(
    low_deg: float, high_deg: float, crosses: bool, track: TopocentricTrack, cbers: Elements
) -> None:
    found = find_passes(track, cbers.epoch_t_s, 6.0 * 3600.0, MASK_RAD)[0]
    found = dataclasses.replace(found, azimuth_min_rad=math.radians(low_deg), azimuth_max_rad=math.radians(high_deg))
    assert found.crosses_north == crosses


def test_a_pass_states_what_the_track_does_between_its_rise_and_its_set(
    track: TopocentricTrack, cbers: Elements
) -> None:
    """By brute force every 0.02 s; passes are found from samples a second apart, the last is cut off."""
    passes = find_passes(track, cbers.epoch_t_s, DAY_S, MASK_RAD)
    assert [one.sets_after for one in passes] == [False] * 4 + [True]
    for found in passes:
        looks = track.sample(np.append(np.arange(found.aos_t_s, found.los_t_s, 0.02), found.los_t_s))
        assert found.name == "CBERS 2"
        assert found.aos_t_s < found.tca_t_s
        assert (found.tca_t_s == found.los_t_s) == found.sets_after
        assert found.duration_s == found.los_t_s - found.aos_t_s
        assert looks.elevation_rad[0] == pytest.approx(MASK_RAD, abs=1e-6)
        assert found.sets_after or looks.elevation_rad[-1] == pytest.approx(MASK_RAD, abs=1e-6)
        assert found.peak_elevation_rad == pytest.approx(looks.elevation_rad.max(), abs=1e-9)
        assert found.tca_t_s == pytest.approx(looks.t_s[np.argmax(looks.elevation_rad)], abs=0.03)
        assert found.aos_elevation_rad == pytest.approx(looks.elevation_rad[0], abs=1e-12)
        azimuths = looks.azimuth_rad[[0, -1]]
        assert (found.aos_azimuth_rad, found.los_azimuth_rad) == pytest.approx(azimuths, abs=1e-9)
        ends = looks.azimuth_rad.min(), looks.azimuth_rad.max()
        assert (found.azimuth_min_rad, found.azimuth_max_rad) == pytest.approx(ends, abs=1e-6)
        for name in ("azimuth_rate_rad_s", "elevation_rate_rad_s", "azimuth_acceleration_rad_s2"):
            largest = np.abs(getattr(looks, name)).max()
            assert getattr(found, f"peak_{name}") == pytest.approx(largest, rel=1e-4), name
        assert found.smallest_range_m == pytest.approx(looks.range_m.min(), abs=1.0)
