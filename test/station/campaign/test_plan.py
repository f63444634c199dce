"""The simulated sky is dense enough for a campaign within the hour, and its pieces become passes that can be tracked."""

import math

import numpy as np
import pytest

from rf_pointing.ephemeris import TopocentricTrack, site, verification_elements
from rf_pointing.station.campaign.plan import ArcRules, beacons, candidate_arcs, window_of

START_S = 1.15e9
STATION = site("Goldstone DSS-13")
RULES = ArcRules(arcs_s=(60.0, 120.0), every_s=30.0, spacing_s=5.0)


@pytest.fixture(scope="module")
def sky():
    return beacons(START_S)


@pytest.fixture(scope="module")
def candidates(sky):
    return candidate_arcs(sky[::3], STATION, START_S, 1200.0, RULES)[0]


def test_pieces_lie_within_the_elevations_asked_for(candidates):
    assert len(candidates) > 100
    for one in candidates:
        assert np.all(one.track.elevation_rad > RULES.lowest_rad - 1e-9)
        assert np.all(one.track.elevation_rad < RULES.highest_rad + 1e-9)
        assert one.end_t_s - one.start_t_s in (60.0, 120.0)


def test_no_piece_nor_the_way_into_it_is_faster_than_the_antenna(sky):
    some, wanted = sky[::9], math.radians(0.6)
    rules = RULES.replace(fastest_rad_s=wanted, lead_s=60.0)
    slow = candidate_arcs(some, STATION, START_S, 1200.0, rules)[0]
    whole = candidate_arcs(some, STATION, START_S, 1200.0, RULES)[0]
    assert 0 < len(slow) < len(whole)
    by_name = {one.name: TopocentricTrack(one, STATION) for one in some}
    for one in slow:
        times = np.arange(one.start_t_s - 60.0, one.end_t_s + 0.5, 5.0)
        assert np.max(np.abs(by_name[one.name].sample(times).azimuth_rate_rad_s)) <= wanted
    assert max(float(np.max(np.abs(one.track.azimuth_rate_rad_s))) for one in whole) > wanted


def test_a_piece_becomes_a_pass_that_begins_in_time_for_the_acquisition(sky, candidates):
    one = candidates[17]
    elements = next(e for e in sky if e.name == one.name)
    window = window_of(one, elements, STATION, 20.0)
    assert window.name == one.name
    assert window.aos_t_s == pytest.approx(one.start_t_s - 20.0, abs=1e-3)
    assert window.los_t_s == pytest.approx(one.end_t_s, abs=1e-3)


def test_what_cannot_be_propagated_is_left_out_and_named():
    decayed = [e for e in verification_elements() if e.catalogue_number in (28350, 28057)]
    found, refused = candidate_arcs(decayed, STATION, 1_151_280_000.0, 6.0 * 3600.0, ArcRules(spacing_s=10.0))
    assert all(one.name != "COSMOS 2405" for one in found)
    assert [reason.split(":")[0] for reason in refused] == ["COSMOS 2405 cannot be propagated"]


def test_the_made_up_sky_has_450_satellites_on_30_planes_at_two_heights(sky):
    """Of 600 km a turn takes 96.7 min, of 3000 km 150.6; planes are staggered by a third of the spacing."""
    assert [one.name for one in sky[:2]] == ["BEACON 001", "BEACON 002"]
    assert (sky[-1].name, sky[-1].catalogue_number, len(sky)) == ("BEACON 450", 90450, 450)
    minutes = [2.0 * math.pi / one.mean_motion_rad_s / 60.0 for one in sky]
    assert minutes[:225] == pytest.approx([96.69] * 225, abs=0.01)
    assert minutes[225:] == pytest.approx([150.64] * 225, abs=0.02)
    for number, one in enumerate(sky):
        plane, place = number // 15 % 15, number % 15
        assert one.ascending_node_rad == pytest.approx(math.radians(24.0 * plane))
        assert one.mean_anomaly_rad == pytest.approx(math.radians((24.0 * place + 8.0 * plane) % 360.0))
        assert (one.inclination_rad, one.eccentricity) == (math.radians(50.0), 0.001)
        assert (one.epoch_t_s, one.argument_of_perigee_rad, one.drag_per_earth_radius) == (START_S, 0.0, 0.0)
