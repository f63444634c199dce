import math

import numpy as np
import pytest

from rf_pointing.calibration.coverage import SectorRule, select_by_sector

RULE = SectorRule()


def test_there_are_36_sectors_with_the_papers_bounds():
    assert RULE.count == 36
    assert RULE.name(0) == "az 0-30 el 10-30 deg"
    assert RULE.name(35) == "az 330-360 el 60-80 deg"


@pytest.mark.parametrize(
    ("azimuth_deg", "elevation_deg", "sector"),
    [
        (0, 10, 0),
        (29.99, 29.99, 0),
        (30, 10, 1),
        (-1, 20, 11),
        (370, 45, 12),
        (-270, 79.9, 27),
        # Over the top: az + 180 deg, 180 deg - el.
        (180, 165, 0),
        (270, 100.1, 27),
        (0, 9.9, -1),
        (0, 80, -1),
    ],
)
def test_sectors_include_their_lower_edges_and_azimuth_is_cyclic(azimuth_deg, elevation_deg, sector):
    assert int(RULE.sector_of(math.radians(azimuth_deg), math.radians(elevation_deg))) == sector


def test_empty_sectors_are_refused_by_name():
    coverage = RULE.coverage(np.zeros(30), np.full(30, 0.3))
    assert len(coverage.thin) == 35
    with pytest.raises(ValueError, match=r"35 of 36 sectors have < 25: az 30-60 el 10-30 deg has 0;"):
        coverage.require_full()


def test_contradictory_rules_are_refused():
    with pytest.raises(ValueError, match=r"fewest=31 must be <= most=30"):
        SectorRule(fewest=31)
    with pytest.raises(ValueError, match="must increase"):
        SectorRule(elevation_edges_rad=(0.5, 0.2))


def test_points_over_the_top_count_where_they_are_on_the_sky():
    elevation = np.radians([175.0, 160.0, 95.0, 5.0, 85.0])
    chosen, dropped = select_by_sector(np.zeros(5), elevation, np.zeros(5, dtype=int), RULE)
    assert chosen.tolist() == [False, True, False, False, False]
    assert dropped == {"below 10 deg": 2, "above 80 deg": 2, "sector has 30 already": 0}


def test_each_sector_shares_its_points_out_by_itself():
    """One from each pass in turn: a pass of few points gives them all."""
    azimuth = np.repeat([0.2, 1.2], [70, 20])
    pass_id = np.concatenate([np.repeat([3, 8, 9], [4, 40, 26]), np.zeros(20, dtype=int)])
    order = np.random.default_rng(5).permutation(90)
    chosen, dropped = select_by_sector(azimuth[order], np.full(90, 0.4), pass_id[order], RULE)
    assert np.bincount(pass_id[order][chosen]).tolist() == [20, 0, 0, 4, 0, 0, 0, 0, 13, 13]
    assert dropped["sector has 30 already"] == 40
