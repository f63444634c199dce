"""Sun, Moon and radio sources: published almanac values, SOFA's own observer chain, astropy, and derivatives."""

import json
import math
from pathlib import Path

import erfa
import numpy as np
import pytest

from rf_pointing.core import MDEG, angular_distance_rad
from rf_pointing.core.dates import DAY_S, from_utc_text
from rf_pointing.ephemeris import (
    RADIO_SOURCES,
    IersEarthOrientation,
    Site,
    TopocentricTrack,
    moon,
    radio_source,
    site,
    sun,
)
from rf_pointing.ephemeris.celestial import CelestialTarget, RadioSource
from rf_pointing.ephemeris.time_scales import POSIX_EPOCH_JD, TT_MINUS_TAI_S, utc_from_tai_s

ASTROPY = json.loads((Path(__file__).parent / "data" / "astropy.json").read_text())
ASTROPY_MDEG = {"Sun": 0.03, "Moon": 0.001, "Cassiopeia A": 0.001, "3C 273": 0.001}
"""The Sun stands alone: astropy takes its light time and aberration in another order."""
SOFA_MDEG = 1e-4
RATE_MDEG_S = 1e-4


def utc_date(t_s: float) -> tuple[float, float]:
    """Return the Julian date in UTC as whole and fraction."""
    days, seconds = divmod(t_s, DAY_S)
    return POSIX_EPOCH_JD + days, seconds / DAY_S


def utc_of_tt(julian_date: float) -> float:
    return utc_from_tai_s((julian_date - POSIX_EPOCH_JD) * DAY_S - TT_MINUS_TAI_S)


def target_of(name: str) -> CelestialTarget:
    return {"Sun": sun, "Moon": moon}[name]() if name in ("Sun", "Moon") else radio_source(name)


def test_bodies_agree_with_astropy() -> None:
    for name, station, t_s, azimuth, elevation in ASTROPY["bodies"]:
        seen = TopocentricTrack(target_of(name), site(station), refraction=None).target_at(t_s)
        apart = angular_distance_rad(azimuth, elevation, seen.azimuth_rad, seen.elevation_rad)
        assert apart < ASTROPY_MDEG[name] * MDEG, (name, station, t_s)


@pytest.mark.parametrize("name", RADIO_SOURCES)
def test_sources_agree_with_sofas_observer_chain(name: str) -> None:
    place, source, t_s = site("Canberra DSS-43"), RADIO_SOURCES[name], 1151384680.25
    utc, earth = utc_date(t_s), IersEarthOrientation().at(t_s)
    azimuth, zenith, *_ = erfa.atco13(
        source.right_ascension_rad, source.declination_rad, 0.0, 0.0, 0.0, 0.0, utc[0], utc[1],
        earth.ut1_minus_utc_s, place.longitude_rad, place.latitude_rad, place.altitude_m,
        earth.pole_x_rad, earth.pole_y_rad, 0.0, 0.0, 0.0, 1e5,
    )  # fmt: skip
    seen = TopocentricTrack(source.target(), place, refraction=None).target_at(t_s)
    apart = angular_distance_rad(azimuth, 0.5 * np.pi - zenith, seen.azimuth_rad, seen.elevation_rad)
    assert apart < SOFA_MDEG * MDEG


def test_the_sun_of_meeus_example_25b() -> None:
    """1992 October 13, 0h TD: apparent right ascension 13h 13m 30.749s, declination -7 deg 47' 01.74"."""
    t_s = utc_of_tt(2448908.5)
    track = TopocentricTrack(sun(), Site.from_degrees(0.0, 0.0, 0.0), refraction=None)
    motion = track.target.motion_at(t_s)
    delay_s = 499.0 * 0.99766
    earth_fixed = np.array(motion.position) - delay_s * np.array(motion.velocity)
    earth, utc = IersEarthOrientation().at(t_s), utc_date(t_s)
    matrix = erfa.c2t06a(2448908.5, 0.0, utc[0], utc[1] + earth.ut1_minus_utc_s / 86400.0,
                         earth.pole_x_rad, earth.pole_y_rad)  # fmt: skip
    right_ascension, declination = erfa.c2s(erfa.pnm06a(2448908.5, 0.0) @ matrix.T @ earth_fixed)
    assert math.degrees(right_ascension) % 360.0 / 15.0 == pytest.approx(13 + 13 / 60 + 30.749 / 3600, abs=0.1 / 3600)
    assert math.degrees(declination) == pytest.approx(-(7 + 47 / 60 + 1.74 / 3600), abs=1.0 / 3600)


@pytest.mark.parametrize("name", ["Sun", "Moon", "Cygnus A"])
def test_rates_are_derivatives_and_one_time_equals_many(name: str) -> None:
    track, step_s = TopocentricTrack(target_of(name), site("Madrid DSS-63")), 5.0
    t_s = 1151384680.0 + np.arange(0.0, 86400.0, 1777.0)
    looks = track.sample(t_s)
    before, after = track.sample(t_s - step_s), track.sample(t_s + step_s)
    high = (looks.elevation_rad > 0.1) & (looks.elevation_rad < 1.4)
    assert high.any()
    for axis in ("azimuth", "elevation"):
        difference = getattr(after, f"{axis}_rad") - getattr(before, f"{axis}_rad")
        difference = (difference + np.pi) % (2.0 * np.pi) - np.pi
        error = np.abs(difference / (2.0 * step_s) - getattr(looks, f"{axis}_rate_rad_s"))
        assert error[high].max() < RATE_MDEG_S * MDEG
    one = track.target_at(float(t_s[7]))
    assert one.elevation_rad == pytest.approx(looks.elevation_rad[7], abs=1e-12)
    assert one.range_m == pytest.approx(looks.range_m[7], rel=1e-12)


def test_the_moon_is_near_enough_for_parallax() -> None:
    """A degree between two stations half a world apart; a radio source has none."""
    t_s = 1151384680.0
    positions = {}
    for name in ("Moon", "Cygnus A"):
        directions = []
        for place in (site("Goldstone DSS-13"), site("Canberra DSS-43")):
            motion, _, _ = TopocentricTrack(target_of(name), place, refraction=None).relative_motion_at(t_s)
            directions.append(np.array(motion.position) @ np.array(place.axes) / np.linalg.norm(motion.position))
        positions[name] = math.degrees(math.acos(min(1.0, float(directions[0] @ directions[1]))))
    assert 0.5 < positions["Moon"] < 2.0
    assert positions["Cygnus A"] < 2e-4


def test_unknown_sources_and_impossible_places_are_refused() -> None:
    with pytest.raises(ValueError, match="radio_source='Sagittarius Z' must be one of Cassiopeia A, "):
        radio_source("Sagittarius Z")
    with pytest.raises(ValueError, match=r"declination_rad=2\.0 must be <="):
        RadioSource("nowhere", 1.0, 2.0)


@pytest.mark.parametrize("declination_rad", [-0.5 * math.pi, -1.2, 1.2, 0.5 * math.pi])
def test_places_up_to_both_poles_are_taken(declination_rad: float) -> None:
    assert RadioSource("there", 2.0 * math.pi, declination_rad).declination_rad == declination_rad
    with pytest.raises(ValueError, match="declination_rad="):
        RadioSource("beyond", 1.0, declination_rad + math.copysign(2.0, declination_rad))
    with pytest.raises(ValueError, match="right_ascension_rad="):
        RadioSource("a turn on", 6.3, declination_rad)


@pytest.mark.parametrize("name", ["Cygnus A", "Moon"])
def test_no_times_give_no_directions(name: str) -> None:
    looks = TopocentricTrack(target_of(name), site("Madrid DSS-63")).sample(np.zeros(0))
    assert looks.azimuth_rad.shape == looks.elevation_rate_rad_s.shape == looks.range_m.shape == (0,)


def test_the_sun_is_a_little_more_than_its_mean_distance_away_in_june_and_a_little_less_in_january() -> None:
    """Perihelion 0.98329 au on 2006-01-04, aphelion 1.01670 au on 2006-07-03 (Astronomical Almanac)."""
    place = site("Madrid DSS-63")
    track = TopocentricTrack(sun(), place, refraction=None)
    for text, distance_au in (("2006-01-04T15:00:00", 0.98329), ("2006-07-03T23:00:00", 1.01670)):
        # Seen from the surface: up to 4.3e-5 au nearer.
        seen = track.target_at(from_utc_text(text))
        assert seen.range_m / 149597870700.0 == pytest.approx(distance_au, abs=6e-5)
        # The antenna turns with 0.35 km/s, the Earth nears the Sun by less than 0.5.
        assert abs(seen.range_rate_m_s) < 900.0


def test_a_radio_source_has_a_range_of_one_light_year_that_does_not_change() -> None:
    seen = TopocentricTrack(radio_source("Cygnus A"), site("Madrid DSS-63")).target_at(1151384680.0)
    assert seen.range_m == pytest.approx(9.4607304725808e15, rel=1e-9)
    assert seen.range_rate_m_s == 0.0


@pytest.mark.parametrize("name", ["Sun", "Moon", "Cygnus A"])
def test_bodies_of_the_sky_are_known_at_any_time_and_warn_of_the_earths_orientation(name: str) -> None:
    target = target_of(name)
    assert target.name == name
    assert target.spans_t_s == ((-math.inf, math.inf),)
    assert target.at_infinity is (name == "Cygnus A")
    assert target.warnings(1151384680.0) == ()
    late_s = from_utc_text("2040-01-01T00:00:00")
    assert target.warnings(late_s) == IersEarthOrientation().warnings(late_s) != ()


@pytest.mark.parametrize("name", ["Sun", "Moon", "Cygnus A"])
def test_a_body_ahead_of_its_time_is_where_it_will_be_while_the_earth_waits(name: str) -> None:
    """Two hours: the Sun moves by 82 mdeg among the stars, the Moon by a degree, a radio source not at all."""
    target, t_s, ahead_s = target_of(name), 1151384680.0, 7200.0
    waiting = np.array(target.motion_at(t_s, ahead_s).position)
    later = np.array(target.motion_at(t_s + ahead_s).position)
    turn = 7.2921151467e-5 * ahead_s
    c, s = math.cos(turn), math.sin(turn)
    back = np.array([c * later[0] - s * later[1], s * later[0] + c * later[1], later[2]])
    # The pole moves by less than a microradian in two hours.
    np.testing.assert_allclose(back / np.linalg.norm(later), waiting / np.linalg.norm(waiting), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("name", ["Sun", "Moon", "Cygnus A"])
def test_the_derivatives_of_a_body_are_those_of_its_place_among_the_stars(name: str) -> None:
    """Inertial ones, in axes of the Earth at one instant: differences of places ahead of that instant."""
    target, t_s, step_s = target_of(name), 1151384680.0, 3000.0
    offsets = np.arange(-3, 4)
    places = np.array([target.motion_at(t_s, float(k) * step_s).position for k in offsets])
    motion = target.motion_at(t_s)
    first = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) @ places / (60.0 * step_s)
    second = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) @ places / (180.0 * step_s**2)
    third = np.array([1.0, -8.0, 13.0, 0.0, -13.0, 8.0, -1.0]) @ places / (8.0 * step_s**3)
    assert np.linalg.norm(np.subtract(motion.velocity, first)) < 1e-4 * np.linalg.norm(first)
    assert np.linalg.norm(np.subtract(motion.acceleration, second)) < 2e-3 * np.linalg.norm(second)
    # What is farther away has a jerk below the rounding of its place.
    if name == "Moon":
        assert np.linalg.norm(np.subtract(motion.jerk, third)) < 0.05 * np.linalg.norm(third)


def test_places_of_the_sky_reach_once_around_and_no_further() -> None:
    for turn_rad in (0.0, 2.0 * math.pi):
        assert RadioSource("there", turn_rad, 0.1).right_ascension_rad == turn_rad
    for outside_rad in (-1e-9, 2.0 * math.pi + 1e-9):
        with pytest.raises(ValueError, match="right_ascension_rad="):
            RadioSource("there", outside_rad, 0.1)
    for outside_rad in (-0.5 * math.pi - 1e-9, 0.5 * math.pi + 1e-9):
        with pytest.raises(ValueError, match="declination_rad="):
            RadioSource("there", 1.0, outside_rad)
