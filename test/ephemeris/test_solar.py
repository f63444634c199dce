"""The Sun over a station: renewed often enough, and unknown with a reason."""

import math

import pytest

from rf_pointing.core import MDEG, angular_distance_rad
from rf_pointing.ephemeris import TopocentricTrack, site, sun
from rf_pointing.ephemeris.solar import RENEWAL_S, SolarDirection, SunParams

NOON_T_S = 1151438400.0


def test_the_sun_is_where_its_track_is_and_at_most_ten_seconds_old() -> None:
    place = site("Madrid DSS-63")
    solar, track = SolarDirection(SunParams(site=place)), TopocentricTrack(sun(), place)
    assert solar.site == place
    for t_s, renewed_s in ((0.0, 0.0), (0.5, 0.0), (9.9, 0.0), (10.1, 10.1), (20.0, 10.1), (20.2, 20.2), (15.0, 15.0)):
        found, wanted = solar.at(NOON_T_S + t_s), track.target_at(NOON_T_S + renewed_s)
        assert found == (wanted.azimuth_rad, wanted.elevation_rad)
        assert solar.unknown == ""
    assert RENEWAL_S == 10.0
    apart = angular_distance_rad(*solar.at(NOON_T_S + 15.0), *solar.at(NOON_T_S + 25.0))
    assert apart == pytest.approx(42.0 * MDEG, rel=0.1)


def test_a_sun_that_is_not_watched_is_unknown() -> None:
    solar = SolarDirection(SunParams(watched=False))
    assert solar.at(NOON_T_S) is None
    assert solar.unknown == "it is not watched"


def test_a_time_beyond_the_tables_leaves_the_sun_unknown_until_one_that_is_known() -> None:
    solar = SolarDirection(SunParams())
    assert solar.at(NOON_T_S) is not None
    assert solar.at(4e9) is None
    assert "renew astropy-iers-data" in solar.unknown
    assert solar.at(4e9 + 1.0) is None
    found = solar.at(NOON_T_S)
    assert found is not None
    assert all(map(math.isfinite, found))
    assert solar.unknown == ""
