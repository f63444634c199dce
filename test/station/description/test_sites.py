"""Passes over a described site anywhere on the Earth agree with skyfield: events to 1 s, directions to 1 mdeg."""

import math
from pathlib import Path

import astropy_iers_data
import numpy as np
import pytest
import sgp4
from skyfield.api import EarthSatellite, load, wgs84
from skyfield.data import iers

from rf_pointing.core import MDEG, angular_distance_rad
from rf_pointing.ephemeris import TopocentricTrack, find_elements, find_passes, verification_elements
from rf_pointing.station.description import station_from

CBERS = "28057"
DAY_S = 86400.0
MASK_DEG = 5.0
TT_MINUS_UTC_S = 65.184
"""In 2006."""
EVENT_S, DIRECTION_MDEG = 1.0, 1.0
TEXT = """\
version: 1
name: Anywhere
site: {{latitude_deg: {0}, longitude_deg: {1}, height_m: {2}}}
dish: {{diameter_m: 3.7}}
mount:
  azimuth: {{travel_deg: [-270, 270], rate_deg_s: 6}}
  elevation: {{travel_deg: [0, 90], rate_deg_s: 6}}
bands: {{S: {{frequency_mhz: 2250}}}}
"""
# Latitude, longitude, height.
SITES = {
    "Svalbard": (78.229, 15.408, 450.0), "beyond the northern circle": (66.9, -53.7, 5.0),
    "Troll": (-72.011, 2.535, 1298.0), "south pole": (-90.0, 0.0, 2835.0),
    "equator": (0.0, -78.0, 10.0), "5 km high": (-23.019, -67.753, 5058.0),
    "longitude 180": (-16.8, 180.0, 0.0), "longitude -180": (-16.8, -180.0, 0.0),
}  # fmt: skip


@pytest.mark.parametrize("name", SITES)
def test_passes_over_a_site_anywhere_agree_with_skyfield(name: str) -> None:
    place = SITES[name]
    site = station_from(Path("anywhere.yaml"), TEXT.format(*place)).site
    scale = load.timescale(builtin=True)
    with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
        iers.install_polar_motion_table(scale, iers.parse_x_y_dut1_from_finals_all(file))
    lines = (Path(sgp4.__file__).parent / "SGP4-VER.TLE").read_text().splitlines()
    line1, line2 = [line[:69] for line in lines if line[0] in "12" and line[2:7] == CBERS][:2]
    satellite, observer = EarthSatellite(line1, line2, CBERS, scale), wgs84.latlon(*place)
    elements = find_elements(verification_elements(), CBERS)
    begin_s = elements.epoch_t_s
    ends = [scale.utc(1970, 1, 1 + t_s // DAY_S, 0, 0, t_s % DAY_S) for t_s in (begin_s, begin_s + DAY_S)]
    times, kinds = satellite.find_events(observer, *ends, altitude_degrees=MASK_DEG)
    posix = (times.whole - 2440587.5 + times.tt_fraction) * DAY_S - TT_MINUS_UTC_S

    track = TopocentricTrack(elements, site, refraction=None, light_time="none")
    passes = find_passes(track, begin_s, DAY_S, math.radians(MASK_DEG))
    assert len(passes) >= 2
    rises = [one.aos_t_s for one in passes if not one.rises_before]
    sets = [one.los_t_s for one in passes if not one.sets_after]
    np.testing.assert_allclose(rises, posix[kinds == 0], rtol=0.0, atol=EVENT_S)
    np.testing.assert_allclose(sets, posix[kinds == 2], rtol=0.0, atol=EVENT_S)
    for one in passes:
        t_s = np.linspace(one.aos_t_s, one.los_t_s, 41)
        looks = track.sample(t_s)
        at = scale.utc(1970, 1, 1 + t_s // DAY_S, 0, 0, t_s % DAY_S)
        elevation, azimuth, _ = (satellite - observer).at(at).altaz()
        apart = angular_distance_rad(azimuth.radians, elevation.radians, looks.azimuth_rad, looks.elevation_rad)
        assert float(np.max(apart)) < DIRECTION_MDEG * MDEG
