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
from rf_pointing.ephemeris.celestial import PLANETS, CelestialTarget, RadioSource, moon_phase_rad, own_place, planet
from rf_pointing.ephemeris.sites import SITES
from rf_pointing.ephemeris.source import SourceParams, body_of, load_track
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


def apart_on(utc: str, one: CelestialTarget, other: CelestialTarget) -> float:
    """Return the angle between two bodies over Goldstone, in deg."""
    looks = [
        TopocentricTrack(body, site("Goldstone DSS-13"), refraction=None).target_at(from_utc_text(utc))
        for body in (one, other)
    ]
    angles = [angle for look in looks for angle in (look.azimuth_rad, look.elevation_rad)]
    return math.degrees(angular_distance_rad(*angles))


def test_planets_meet_when_and_as_near_as_was_seen() -> None:
    """The great conjunction of 2020 (0.102 deg), the transit of Venus of 2012 (554 arcsec)."""
    largest = (PLANETS["Jupiter"] + PLANETS["Saturn"]) / 3600.0
    assert apart_on("2020-12-21T18:22:00", planet("Jupiter"), planet("Saturn")) == pytest.approx(0.1017, abs=largest)
    # Seen from Goldstone Venus is up to its parallax against the Sun, 23 arcsec, off the value of the geocentre.
    assert apart_on("2012-06-06T01:29:28", planet("Venus"), sun()) == pytest.approx(554 / 3600, abs=(5 + 23) / 3600)


def test_a_place_of_ones_own_is_that_of_the_catalogue_and_moves_with_its_proper_motion() -> None:
    t_s = from_utc_text("2026-11-26T18:00:00")
    crab, own = RADIO_SOURCES["Taurus A"], own_place("radec 83.6330833333 22.0145")
    assert apart_on("2026-11-26T18:00:00", own.target(), crab.target()) < 1e-6
    # Barnard's star: 10.393 arcsec a year, against SOFA's own propagation without parallax.
    star = "radec 269.452075 4.693391 -801.551 10362.394 2000.0"
    moved = erfa.starpm(
        math.radians(269.452075), math.radians(4.693391),
        math.radians(-801.551 / 3.6e6) / math.cos(math.radians(4.693391)), math.radians(10362.394 / 3.6e6),
        0.547, 0.0, 2451545.0, 0.0, *utc_date(t_s),
    )  # fmt: skip
    there = RadioSource("there", moved[0] % math.tau, moved[1])
    assert apart_on("2026-11-26T18:00:00", own_place(star).target(), there.target()) < 1e-4
    assert apart_on("2026-11-26T18:00:00", own_place(star.replace("10362.394", "0")).target(), there.target()) > 0.07


@pytest.mark.parametrize("own", SITES.values(), ids=SITES)
def test_a_point_stands_over_every_site_and_refraction_lifts_it(own: Site) -> None:
    track = load_track(SourceParams(satellite="azel 200 45", site=own))
    looks = track.sample([0.0, 1.8e9])
    true_rad, azimuth_rad = looks.true_elevation_rad, looks.azimuth_rad
    assert np.degrees([azimuth_rad, true_rad]) == pytest.approx(np.array([[200.0] * 2, [45.0] * 2]))
    assert (looks.elevation_rad > true_rad).all()
    assert not looks.azimuth_rate_rad_s.any()


@pytest.mark.parametrize(
    ("text", "words"),
    [("radec 10", "must be radec RA DEC"), ("azel 10 north", "'north' must be"), ("azel 1 91", "elevation_rad")],
)
def test_a_place_that_cannot_be_read_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        body_of(text)


def test_the_phase_of_the_moon_is_zero_in_a_lunar_eclipse_and_half_a_turn_in_one_of_the_sun() -> None:
    """Greatest eclipses of 2025-03-14 and 2024-04-08, which are within 0.5 h of the opposition."""
    assert math.degrees(moon_phase_rad(from_utc_text("2025-03-14T06:59:00"))) == pytest.approx(0.0, abs=0.3)
    assert abs(math.degrees(moon_phase_rad(from_utc_text("2024-04-08T18:17:00")))) == pytest.approx(180.0, abs=0.3)
    assert math.degrees(moon_phase_rad(from_utc_text("2025-03-15T06:59:00"))) == pytest.approx(12.0, abs=2.0)
