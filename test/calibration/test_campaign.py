import numpy as np
import pytest

from rf_pointing.calibration import CandidatePass, SectorRule, Slew, plan_campaign

SLEW = Slew(rate_rad_s=1.0, settle_s=60.0)
SMALL = SectorRule(azimuth_sectors=4, elevation_edges_rad=(0.17, 0.5, 1.2), fewest=5, most=8)


@pytest.fixture
def candidates(track, random):
    return [
        CandidatePass(
            name=f"pass {number}",
            track=track(
                10.0, random.choice([-1, 1]) * random.uniform(2e5, 2e6), random.uniform(0, 6.3), 6000.0 * number
            ),
            sigma_azimuth_rad=1e-4,
            sigma_elevation_rad=1e-4,
        )
        for number in range(40)
    ]


def filled(passes, rule):
    azimuth = np.concatenate([c.track.azimuth_rad for c in passes])
    elevation = np.concatenate([c.track.elevation_rad for c in passes])
    return rule.coverage(azimuth, elevation)


def test_campaign_fills_every_sector_and_no_pass_is_needless(candidates):
    campaign = plan_campaign(candidates, SMALL, SLEW)
    assert campaign.coverage.thin == ()
    assert np.array_equal(filled(campaign.passes, SMALL).counts, campaign.coverage.counts)
    for left_out in campaign.passes:
        rest = [c for c in campaign.passes if c is not left_out]
        assert filled(rest, SMALL).thin != ()


def test_no_earlier_end_is_possible(candidates):
    campaign = plan_campaign(candidates, SMALL, SLEW)
    before = [c for c in candidates if c.end_t_s < campaign.full_at_t_s]
    assert filled(before, SMALL).thin != ()


def test_overlapping_passes_are_never_both_taken(track):
    both = [
        CandidatePass(
            name=name,
            track=track(10.0, miss, 0.3, start),
            sigma_azimuth_rad=1e-4,
            sigma_elevation_rad=1e-4,
        )
        for name, miss, start in (("poor", 4.3e6, 0.0), ("rich", 4e5, 300.0), ("later", 4e5, 1300.0))
    ]
    campaign = plan_campaign(both, SectorRule(), SLEW)
    assert [c.name for c in campaign.passes] == ["rich", "later"]
    assert campaign.full_at_t_s is None
    assert len(campaign.coverage.thin) > 0


def test_a_campaign_goes_on_where_an_interrupted_one_left_the_sky_thin(candidates):
    whole = plan_campaign(candidates, SMALL, SLEW)
    done = whole.passes[: len(whole.passes) // 2]
    already = filled(done, SMALL).counts
    later = [c for c in candidates if c.start_t_s > done[-1].end_t_s]
    rest = plan_campaign(later, SMALL, SLEW, already)
    assert 0 < len(rest.passes) < len(whole.passes)
    assert rest.coverage.thin == ()
    assert np.array_equal(rest.coverage.counts, already + filled(rest.passes, SMALL).counts)
    nothing = plan_campaign(later, SMALL, SLEW, whole.coverage.counts)
    assert nothing.passes == ()
    assert nothing.coverage.thin == ()


@pytest.mark.parametrize(
    ("azimuth_deg", "ends_deg"),
    [
        ((10.0, 60.0), (10.0, 60.0)),
        ((350.0, 300.0), (-10.0, -60.0)),
        ((150.0, 179.0, -150.0, -100.0), (-210.0, -100.0)),
        ((190.0, 150.0), (-170.0, -210.0)),
        ((170.0, 200.0), (170.0, 200.0)),
    ],
)
def test_a_pass_lies_on_the_turn_that_the_cables_allow(azimuth_deg, ends_deg):
    slew = Slew(travel_rad=(np.radians(-220.0), np.radians(220.0)))
    assert np.degrees(slew.ends_rad(np.radians(azimuth_deg))) == pytest.approx(ends_deg, abs=1e-9)


def test_the_way_between_two_directions_does_not_lead_through_the_ends_of_the_travel():
    a, b = np.radians([[170.0, 40.0], [-170.0, 40.0]])
    assert Slew(rate_rad_s=1.0, settle_s=0.0).time_s(a, b) == pytest.approx(np.radians(20.0))
    limited = Slew(rate_rad_s=1.0, settle_s=0.0, travel_rad=(np.radians(-220.0), np.radians(220.0)))
    assert limited.time_s(a, b) == pytest.approx(np.radians(340.0))
    with pytest.raises(ValueError, match="at least a turn apart"):
        Slew(travel_rad=(-1.0, 1.0))
