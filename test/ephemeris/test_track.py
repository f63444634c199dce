"""Look angles: skyfield and astropy as independent libraries, derivatives, light time, offsets, refusals."""

import dataclasses
import json
import math
from pathlib import Path

import astropy_iers_data
import erfa
import numpy as np
import pytest
import sgp4
from skyfield.api import EarthSatellite, load, wgs84
from skyfield.data import iers

from rf_pointing.core import MDEG, angular_distance_rad, sky_offset_rad, unit_vector_from_azel, wrap_rad
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.dates import from_utc_text, utc_text
from rf_pointing.core.refraction import RadioRefraction
from rf_pointing.ephemeris import (
    Elements,
    Site,
    TopocentricTrack,
    find_elements,
    radio_source,
    site,
    verification_elements,
)
from rf_pointing.ephemeris.look_angles import LookAngles
from rf_pointing.ephemeris.sgp4_orbit import Sgp4Orbit
from test.ephemeris.conftest import AssumedOrientation

SKYFIELD_MDEG = 0.005
ASTROPY = json.loads((Path(__file__).parent / "data" / "astropy.json").read_text())
ASTROPY_MDEG = 1e-4
RATE_MDEG_S = 2e-4
ACCELERATION_MDEG_S2 = 5e-3
RANGE_M = 0.002
RANGE_RATE_M_S = 0.001
STEP_S = 0.25
ORBITS = {"LEO": "28057", "LEO 230 km": "29238", "GPS": "28129", "HEO": "8195", "GEO": "24208"}


@pytest.fixture(scope="module")
def timescale():
    scale = load.timescale(builtin=True)
    with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
        iers.install_polar_motion_table(scale, iers.parse_x_y_dut1_from_finals_all(file))
    return scale


def tle_lines(number: str) -> list[str]:
    lines = (Path(sgp4.__file__).parent / "SGP4-VER.TLE").read_text().splitlines()
    return [line[:69] for line in lines if line[0] in "12" and line[2:7] == number.zfill(5)][:2]


def up(looks: LookAngles) -> np.ndarray:
    return looks.elevation_rad > math.radians(5.0)


@pytest.mark.parametrize("orbit", ORBITS)
@pytest.mark.parametrize("name", ["Goldstone DSS-13", "Canberra DSS-43", "Bangalore ISTRAC", "Madrid DSS-63"])
def test_geometric_direction_agrees_with_skyfield(orbit: str, name: str, timescale) -> None:
    place, number = site(name), ORBITS[orbit]
    elements = find_elements(verification_elements(), number)
    t_s = elements.epoch_t_s + np.arange(0.0, 2.0 * 86400.0, 97.0)
    looks = TopocentricTrack(elements, place, refraction=None, light_time="none").sample(t_s)
    observer = wgs84.latlon(
        math.degrees(place.latitude_rad), math.degrees(place.longitude_rad), elevation_m=place.altitude_m
    )
    times = timescale.utc(1970, 1, 1 + t_s // 86400.0, 0, 0, t_s % 86400.0)
    elevation, azimuth, distance = (EarthSatellite(*tle_lines(number), orbit, timescale) - observer).at(times).altaz()
    apart = angular_distance_rad(azimuth.radians, elevation.radians, looks.azimuth_rad, looks.elevation_rad)
    assert np.all(apart[up(looks)] < SKYFIELD_MDEG * MDEG)
    np.testing.assert_allclose(looks.range_m[up(looks)], distance.m[up(looks)], rtol=0.0, atol=0.1)


def test_geometric_direction_agrees_with_astropy() -> None:
    for number, name, t_s, azimuth, elevation, distance_m in ASTROPY["satellites"]:
        elements = find_elements(verification_elements(), number)
        target = TopocentricTrack(elements, site(name), refraction=None, light_time="none").target_at(t_s)
        apart = angular_distance_rad(azimuth, elevation, target.azimuth_rad, target.elevation_rad)
        assert apart < ASTROPY_MDEG * MDEG, (number, name, t_s)
        assert target.range_m == pytest.approx(distance_m, abs=0.002)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"refraction": None, "light_time": "none"},
        {"light_time": "transmit", "along_track_offset_s": -3.0},
        {"cross_track_offset_rad": 0.01, "along_track_offset_s": 2.0},
    ],
)
@pytest.mark.parametrize("number", ["28057", "8195"])
def test_rates_and_accelerations_are_derivatives(number: str, options: dict, goldstone: Site) -> None:
    track = TopocentricTrack(find_elements(verification_elements(), number), goldstone, **options)
    t_s = track.target.elements.epoch_t_s + np.arange(0.0, 86400.0, 11.0)
    looks, around = track.sample(t_s), [track.sample(t_s + k * STEP_S) for k in (-2, -1, 1, 2)]
    seen = (looks.elevation_rad > math.radians(0.5)) & (looks.elevation_rad < math.radians(85.0))
    assert seen.sum() > 100
    for axis in ("azimuth", "elevation"):
        for of, derivative, tolerance in (
            (f"{axis}_rad", f"{axis}_rate_rad_s", RATE_MDEG_S),
            (f"{axis}_rate_rad_s", f"{axis}_acceleration_rad_s2", ACCELERATION_MDEG_S2),
        ):
            a, b, c, d = (getattr(looks_near, of) for looks_near in around)
            differences = (a - 8.0 * b + 8.0 * c - d) / (12.0 * STEP_S)
            off = np.abs(differences - getattr(looks, derivative))[seen]
            assert off.max() < tolerance * MDEG, derivative
    a, b, c, d = (looks_near.range_m for looks_near in around)
    np.testing.assert_allclose((a - 8 * b + 8 * c - d) / (12 * STEP_S), looks.range_rate_m_s, rtol=0.0, atol=0.002)


def test_one_time_and_many_times_give_the_same_target(track: TopocentricTrack, cbers: Elements) -> None:
    t_s = cbers.epoch_t_s + np.linspace(0.0, 6000.0, 50)
    looks = track.sample(t_s)
    for index, time in enumerate(t_s.tolist()):
        target = track.target_at(time)
        assert target.name == "CBERS 2"
        assert abs(wrap_rad(target.azimuth_rad - looks.azimuth_rad[index])) < 1e-12
        # Rates and accelerations pass through zero.
        for name in ("elevation_rad", "azimuth_rate_rad_s", "elevation_acceleration_rad_s2", "range_m"):
            assert getattr(target, name) == pytest.approx(getattr(looks, name)[index], rel=1e-9, abs=1e-13)


def test_an_inserted_leap_second_is_a_second_of_flight(cbers: Elements, goldstone: Site) -> None:
    """From 23:59:59.5 to 00:00:00.5 of 2016-12-31 two seconds pass, although the wire time counts one."""
    leap_t_s = from_utc_text("2017-01-01T00:00:00")
    track = TopocentricTrack(dataclasses.replace(cbers, epoch_t_s=leap_t_s - 7200.0), goldstone, light_time="none")
    position = [track.target.motion_at(leap_t_s + k).position for k in (-0.5, 0.5, 1.5)]
    speed_m_s = math.dist(position[1], position[2])
    assert math.dist(position[0], position[1]) == pytest.approx(2.0 * speed_m_s, rel=1e-3)


def test_azimuth_is_continuous_across_north_and_follows_the_turn_asked_for(track: TopocentricTrack) -> None:
    t_s = np.arange(1151384330.0, 1151385030.0, 1.0)
    azimuth = track.sample(t_s).azimuth_rad
    assert 0.0 <= azimuth[0] < 2.0 * np.pi
    assert azimuth.min() < 0.0
    assert np.abs(np.diff(azimuth)).max() < math.radians(1.0)
    turned = track.target_at(float(t_s[-1]), near_azimuth_rad=float(azimuth[-2]) + 4.0 * math.pi)
    assert turned.azimuth_rad == pytest.approx(azimuth[-1] + 4.0 * math.pi, abs=1e-12)


def test_light_time_moves_the_target_back_along_its_path(cbers: Elements, goldstone: Site) -> None:
    """v/c of a low orbit is 25 microradians: about 1.4 mdeg near closest approach, and twice that to transmit."""
    tca = 1151384680.0
    received, geometric, sent = (
        TopocentricTrack(cbers, goldstone, refraction=None, light_time=sense).target_at(tca)
        for sense in ("receive", "none", "transmit")
    )
    delay_s = geometric.range_m / 299792458.0
    moved_rad = geometric.azimuth_rate_rad_s * delay_s
    assert abs(math.cos(geometric.elevation_rad) * moved_rad) > 1.0 * MDEG
    assert received.azimuth_rad == pytest.approx(geometric.azimuth_rad - moved_rad, abs=0.03 * MDEG)
    assert sent.azimuth_rad == pytest.approx(geometric.azimuth_rad + moved_rad, abs=0.03 * MDEG)


@pytest.mark.parametrize("sense", ["receive", "transmit"])
@pytest.mark.parametrize("number", [*ORBITS.values(), "6251", "20413"])
def test_range_and_its_rate_are_those_of_the_light_time(number: str, sense: str, random: np.random.Generator) -> None:
    """Against the iterated light-time equation in TEME: the antenna where it is at the time of reception."""
    elements, orientation = find_elements(verification_elements(), number), AssumedOrientation(0.2)
    record, sign = elements.satrec(), 1.0 if sense == "receive" else -1.0
    for place in (site("Bangalore ISTRAC"), site("Canberra DSS-43")):
        track = TopocentricTrack(elements, place, refraction=None, light_time=sense, orientation=orientation)

        def travel_s(t_s: float, place: Site = place) -> float:
            days = t_s // 86400.0
            turn_rad = erfa.gmst82(2440587.5 + days, (t_s - days * 86400.0 + 0.2) / 86400.0)
            x, y, z = place.position_m
            c, s = math.cos(turn_rad), math.sin(turn_rad)
            tau = 0.0
            for _ in range(20):
                target = record.sgp4_tsince((t_s - elements.epoch_t_s - sign * tau) / 60.0)[1]
                tau = math.dist([1e3 * a for a in target], (c * x - s * y, s * x + c * y, z)) / SPEED_OF_LIGHT_M_S
            return tau

        # A whole microsecond is 7 mm of a low orbit: times that a float holds exactly.
        for t_s in np.round(elements.epoch_t_s + random.uniform(0.0, 86400.0, 20)).tolist():
            seen = track.target_at(t_s)
            assert seen.range_m == pytest.approx(SPEED_OF_LIGHT_M_S * travel_s(t_s), abs=RANGE_M)
            rate_m_s = SPEED_OF_LIGHT_M_S * (travel_s(t_s + 0.5) - travel_s(t_s - 0.5))
            later, earlier = travel_s(t_s + 1.0), travel_s(t_s - 1.0)
            rate_m_s = (4.0 * rate_m_s - 0.5 * SPEED_OF_LIGHT_M_S * (later - earlier)) / 3.0
            assert seen.range_rate_m_s == pytest.approx(rate_m_s, abs=RANGE_RATE_M_S)


def test_along_track_offset_is_an_earlier_arrival_while_the_earth_waits(cbers: Elements, goldstone: Site) -> None:
    t_s, ahead_s = 1151384680.0, 0.5
    frozen = {"orientation": AssumedOrientation(), "refraction": None}
    plain = TopocentricTrack(cbers, goldstone, **frozen)
    ahead = TopocentricTrack(cbers, goldstone, along_track_offset_s=ahead_s, **frozen).target_at(t_s)
    later = plain.target_at(t_s + ahead_s)
    moved = angular_distance_rad(ahead.azimuth_rad, ahead.elevation_rad, later.azimuth_rad, later.elevation_rad)
    earth_turn_rad = 7.292e-5 * ahead_s * 6.4e6 / ahead.range_m
    assert 0.1 * earth_turn_rad < moved < 1.2 * earth_turn_rad


@pytest.mark.parametrize("offset_mdeg", [-300.0, 20.0])
@pytest.mark.parametrize("t_s", [1151384400.0, 1151384680.0, 1151384990.0])
def test_cross_track_offset_lies_to_the_right_of_the_motion(
    cbers: Elements, goldstone: Site, t_s: float, offset_mdeg: float
) -> None:
    plain = TopocentricTrack(cbers, goldstone, refraction=None)
    moved = plain.with_offsets(along_track_offset_s=0.0, cross_track_offset_rad=offset_mdeg * MDEG).target_at(t_s)
    here, next_ = plain.target_at(t_s), plain.target_at(t_s + 0.01)
    right = np.cross(
        unit_vector_from_azel(next_.azimuth_rad, next_.elevation_rad),
        unit_vector_from_azel(here.azimuth_rad, here.elevation_rad),
    )
    direction = unit_vector_from_azel(moved.azimuth_rad, moved.elevation_rad)
    assert math.asin(direction @ right / np.linalg.norm(right)) == pytest.approx(offset_mdeg * MDEG, abs=0.01 * MDEG)
    assert math.hypot(
        *sky_offset_rad(moved.azimuth_rad, moved.elevation_rad, here.azimuth_rad, here.elevation_rad)
    ) == pytest.approx(abs(offset_mdeg) * MDEG, abs=1e-9)


def test_hold_freezes_the_direction_and_zeroes_the_rates(track: TopocentricTrack) -> None:
    start = track.target_at(1151384600.0)
    held = track.with_offsets(along_track_offset_s=0.0, cross_track_offset_rad=0.0, hold_t_s=1151384600.0)
    later = held.target_at(1151384700.0)
    assert held.hold_t_s == 1151384600.0
    assert (later.azimuth_rad, later.elevation_rad) == (start.azimuth_rad, start.elevation_rad)
    assert (later.azimuth_rate_rad_s, later.elevation_acceleration_rad_s2, later.range_rate_m_s) == (0.0, 0.0, 0.0)
    assert later.t_s == 1151384700.0
    held_looks = held.sample([1151384700.0, 1151384800.0])
    np.testing.assert_allclose(held_looks.elevation_rad, start.elevation_rad, rtol=0.0, atol=1e-12)
    released = held.with_offsets(along_track_offset_s=0.0, cross_track_offset_rad=0.0)
    assert released.target_at(1151384700.0) == track.target_at(1151384700.0)


def test_refraction_lifts_the_elevation_by_what_the_weather_says(cbers: Elements, goldstone: Site) -> None:
    weather = RadioRefraction(pressure_hpa=880.0, temperature_k=300.0, relative_humidity=0.3)
    dry = TopocentricTrack(cbers, goldstone, refraction=None).target_at(1151384330.0)
    wet = TopocentricTrack(cbers, goldstone, refraction=weather).target_at(1151384330.0)
    assert wet.elevation_rad == pytest.approx(weather.apply(dry.elevation_rad), abs=1e-12)
    assert 0.1 < math.degrees(wet.elevation_rad - dry.elevation_rad) < 0.2
    assert wet.azimuth_rad == dry.azimuth_rad


def test_passing_one_metre_from_the_zenith_gives_finite_numbers(cbers: Elements) -> None:
    """A site put right below the satellite: azimuth rate is huge but a number, elevation stays below 90 deg."""
    t_s, origin = 1151384680.0, Site.from_degrees(0.0, 0.0, 0.0)
    options = {"refraction": None, "light_time": "none"}
    looks = TopocentricTrack(cbers, origin, **options).target_at(t_s)
    enu = unit_vector_from_azel(looks.azimuth_rad, looks.elevation_rad) * looks.range_m
    x, y, z = np.array(origin.position_m) + np.array(origin.axes).T @ enu
    latitude, longitude = math.atan2(z, math.hypot(x, y)), math.atan2(y, x)
    for _ in range(20):
        below = Site(latitude_rad=latitude, longitude_rad=longitude, altitude_m=0.0)
        seen = TopocentricTrack(cbers, below, **options).target_at(t_s)
        off = math.cos(seen.elevation_rad) * seen.range_m / (6.371e6 + 780e3)
        latitude += off * math.cos(seen.azimuth_rad)
        longitude += off * math.sin(seen.azimuth_rad) / math.cos(latitude)
    assert seen.elevation_rad > math.radians(89.999)
    assert math.isfinite(seen.azimuth_rate_rad_s)


def test_times_too_far_from_the_epoch_are_refused_with_the_age(cbers: Elements, goldstone: Site) -> None:
    track = TopocentricTrack(cbers, goldstone, max_age_s=3.0 * 86400.0)
    for days in (-3.1, 3.1):
        with pytest.raises(ValueError, match=r"is 3\.10 days from the epoch 2006-06-26T18:52:04\.080Z of CBERS 2"):
            track.target_at(cbers.epoch_t_s + days * 86400.0)
        with pytest.raises(ValueError, match=r"max_age_s=259200\.0"):
            track.sample(cbers.epoch_t_s + np.array([0.0, days * 86400.0]))


def test_a_decayed_satellite_is_refused_by_name(goldstone: Site) -> None:
    falling = find_elements(verification_elements(), "28872")
    track = TopocentricTrack(falling, goldstone)
    with pytest.raises(ValueError, match=r"MINOTAUR R/B cannot be propagated: mrt is less than 1\.0"):
        track.target_at(falling.epoch_t_s + 55.0 * 60.0)
    with pytest.raises(ValueError, match="MINOTAUR R/B cannot be propagated"):
        track.sample(falling.epoch_t_s + np.array([0.0, 55.0 * 60.0]))


@pytest.mark.parametrize("t_s", [math.nan, math.inf])
def test_a_time_that_is_no_number_is_refused(track: TopocentricTrack, t_s: float) -> None:
    with pytest.raises(ValueError, match=r"t_s=.* must be finite"):
        track.target_at(t_s)
    with pytest.raises(ValueError, match=r"t_s=.* must be finite"):
        track.sample([t_s])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"light_time": "sometimes"}, "light_time='sometimes' must be one of receive, transmit, none"),
        ({"along_track_offset_s": 1e4}, "along_track_offset_s=10000.0 must be <= 60.0"),
        ({"cross_track_offset_rad": math.nan}, "cross_track_offset_rad=nan must be finite"),
    ],
)
def test_bad_options_are_refused(cbers: Elements, goldstone: Site, options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TopocentricTrack(cbers, goldstone, **options)


def test_the_refraction_of_a_target_is_what_its_elevation_is_lifted_by(cbers: Elements, goldstone: Site) -> None:
    t_s = 1151384330.0
    true = TopocentricTrack(cbers, goldstone, refraction=None)
    lifted = TopocentricTrack(cbers, goldstone).target_at(t_s)
    assert true.target_at(t_s).refraction_rad == 0.0
    assert lifted.refraction_rad == pytest.approx(lifted.elevation_rad - true.target_at(t_s).elevation_rad, abs=1e-12)
    assert lifted.refraction_rad > 1e-3
    looks = TopocentricTrack(cbers, goldstone).sample([t_s])
    assert looks.true_elevation_rad[0] == pytest.approx(true.target_at(t_s).elevation_rad, abs=1e-12)
    assert (looks.t_s[0], lifted.t_s) == (t_s, t_s)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_radio_source_is_aberrated_by_the_turning_of_the_antenna(sense: float) -> None:
    """Eastward at 0.46 km/s on the equator: 1.5 microradians towards the east where it stands high, west to transmit."""
    place = Site.from_degrees(0.0, 0.0, 0.0)
    seen, plain = (
        TopocentricTrack(radio_source("Cygnus A"), place, refraction=None, light_time=light_time)
        for light_time in ("receive" if sense > 0.0 else "transmit", "none")
    )
    (moved, _, _), (still, _, _) = (one.relative_motion_at(1151384680.0) for one in (seen, plain))
    shift = np.subtract(moved.position, still.position) / np.linalg.norm(still.position)
    np.testing.assert_allclose(shift, (sense * 7.292115e-5 * 6378137.0 / 299792458.0, 0.0, 0.0), rtol=0.0, atol=1e-10)


def test_a_satellite_before_its_first_place_says_so_and_one_that_decays_says_when() -> None:
    falling = find_elements(verification_elements(), "28872")
    orbit = Sgp4Orbit(falling, AssumedOrientation(), max_age_s=86400.0)
    ((first_s, last_s),) = orbit.spans_t_s
    late = f"MINOTAUR R/B decays: its elements give no place after {utc_text(last_s)}"
    assert orbit.warnings(first_s) == (late,)
    before = f"MINOTAUR R/B has no place before {utc_text(first_s)} by its elements"
    assert orbit.warnings(first_s - 1.0) == (late, before)


def test_elements_that_sgp4_refuses_at_once_are_refused_by_name(cbers: Elements) -> None:
    with pytest.raises(ValueError, match="elements of CBERS 2: mrt is less than 1.0"):
        Sgp4Orbit(
            dataclasses.replace(cbers, eccentricity=0.9, mean_anomaly_rad=0.0), AssumedOrientation(), max_age_s=86400.0
        )
    for age_s in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="max_age_s=.* must be > 0"):
            Sgp4Orbit(cbers, AssumedOrientation(), max_age_s=age_s)
