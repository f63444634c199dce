"""Campaigns fill the sky in the least time; advised passes shrink the sigma by what is promised."""

import itertools

import numpy as np
import pytest

from rf_pointing.calibration import (
    TERM_NAMES,
    CandidatePass,
    FitOptions,
    Observations,
    PassPriors,
    SectorRule,
    Slew,
    fit_bias_model,
    next_best_passes,
    plan_campaign,
    uninformed_covariance,
)
from rf_pointing.calibration.reference import ReferenceTrack
from rf_pointing.calibration.terms import terms_by_name

SLEW = Slew(rate_rad_s=1.0, settle_s=60.0)
SMALL = SectorRule(azimuth_sectors=4, elevation_edges_rad=(0.17, 0.5, 1.2), fewest=5, most=8)


def offered(track, random, count, every_s, start_s=0.0):
    """Return passes that begin so many seconds apart, to either side, far and near."""
    return [
        CandidatePass(
            name=f"pass {number}",
            track=track(
                10.0, random.choice([-1, 1]) * random.uniform(2e5, 2e6), random.uniform(0, 6.3),
                start_s + every_s * number,
            ),
            sigma_rad=1e-4,
        )
        for number in range(count)
    ]  # fmt: skip


@pytest.fixture
def candidates(track, random):
    return offered(track, random, 40, 6000.0)


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


def test_of_overlapping_passes_no_two_fill_the_sky_earlier(track):
    """Every pair is tried; exchanging passes in order of their end comes 20 min later."""
    overlapping = offered(track, np.random.default_rng(52), 16, 250.0)
    counts = [filled([one], SMALL).counts for one in overlapping]
    ends = []
    for one, other in itertools.combinations(range(16), 2):
        full = np.all(counts[one] + counts[other] >= SMALL.fewest)
        if full and SLEW.allows(overlapping[one], overlapping[other]):
            ends.append(overlapping[other].end_t_s)
    assert plan_campaign(overlapping, SMALL, SLEW).full_at_t_s == min(ends)


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


def test_the_way_between_two_directions_does_not_lead_through_the_ends_of_the_travel():
    a, b = np.radians([[170.0, 40.0], [-170.0, 40.0]])
    assert Slew(rate_rad_s=1.0, settle_s=0.0).time_s(a, b) == pytest.approx(np.radians(20.0))
    limited = Slew(rate_rad_s=1.0, settle_s=0.0, travel_rad=(np.radians(-220.0), np.radians(220.0)))
    assert limited.time_s(a, b) == pytest.approx(np.radians(340.0))
    # An axis of less than a turn has one way between any two of its angles.
    short = Slew(rate_rad_s=1.0, settle_s=0.0, travel_rad=(np.radians(-87.0), np.radians(87.0)))
    assert short.time_s(*np.radians([[80.0, 40.0], [-80.0, 40.0]])) == pytest.approx(np.radians(160.0))
    with pytest.raises(ValueError, match="the lower one first"):
        Slew(travel_rad=(1.0, -1.0))


ORBIT = PassPriors(along_track_m=180.0, cross_track_m=70.0, radial_m=50.0)


@pytest.fixture
def on_offer(track, random):
    found = []
    for number in range(8):
        miss = (-1) ** number * (2e5 + 2.5e5 * number)
        start = 2e9 + 6000.0 * number
        found.append(
            CandidatePass(
                name=f"pass {number}", track=track(10.0, miss, random.uniform(0.0, 6.0), start), sigma_rad=1e-4
            )
        )
    return found


def test_promised_sigma_is_the_sigma_of_the_fit_with_that_pass(campaign, table_1, on_offer):
    data = campaign(table_1)
    options = FitOptions(edit_sigma=0.0)
    before = fit_bias_model(data, pass_priors=ORBIT, options=options)
    advice = next_best_passes(
        TERM_NAMES, before.covariance, on_offer, chosen=("collimation",), count=1, pass_priors=ORBIT
    )[0]
    best = next(c for c in on_offer if c.name == advice.name)
    more = Observations.concatenate([data, best.observations("gs1", "S", 100)])
    after = fit_bias_model(more, pass_priors=ORBIT, options=options)
    assert advice.sigma == pytest.approx(after.sigma, rel=1e-6)
    assert advice.factor == pytest.approx(after.sigma_of("collimation") / before.sigma_of("collimation"), rel=1e-6)


def test_a_high_pass_is_advised_for_collimation(on_offer):
    start = uninformed_covariance(TERM_NAMES)
    advice = next_best_passes(TERM_NAMES, start, on_offer, chosen=("collimation",), count=8)
    assert advice[0].name in ("pass 0", "pass 1")
    assert len(advice) == 8
    assert all(item.factor <= 1.0 for item in advice)


def test_no_advised_pass_overlaps_another_or_begins_before_the_antenna_is_there(track, random):
    slew = Slew(rate_rad_s=0.03, settle_s=60.0)
    crowd = offered(track, random, 12, 350.0, 2e9)
    start = uninformed_covariance(TERM_NAMES)
    advice = next_best_passes(TERM_NAMES, start, crowd, chosen=("collimation",), count=12, slew=slew)
    assert 2 <= len(advice) < 12
    chosen = sorted((c for c in crowd if c.name in {a.name for a in advice}), key=lambda c: c.start_t_s)
    for first, then in itertools.pairwise(chosen):
        way = abs(np.angle(np.exp(1j * (then.track.azimuth_rad[0] - first.track.azimuth_rad[-1]))))
        assert then.start_t_s - first.end_t_s >= 60.0 + way / 0.03


def test_planned_passes_say_nothing_about_thermal_terms(on_offer):
    terms = ("azimuth_offset", "azimuth_temperature")
    start = uninformed_covariance(terms)
    advice = next_best_passes(terms, start, on_offer, chosen=terms, count=1)[0]
    assert advice.sigma[1] == pytest.approx(np.sqrt(start[1, 1]))
    assert advice.sigma[0] < 0.1 * np.sqrt(start[0, 0])


def test_the_turn_of_a_pass_is_the_one_least_outside_the_travel_and_of_those_the_nearest_to_the_middle(random):
    """Against every turn from -6 to 6 tried by itself."""
    turn = 2.0 * np.pi
    for _ in range(300):
        low = random.uniform(-7.0, -2.0)
        high = low + turn + random.uniform(0.0, 5.0)
        path = random.uniform(0.0, turn) + np.linspace(0.0, random.uniform(-5.0, 5.0), 30)
        tried = []
        for k in range(-6, 7):
            moved = path + k * turn
            outside = max(low - moved.min(), 0.0) + max(moved.max() - high, 0.0)
            tried.append((round(outside, 9), abs(moved[0]), moved[0], moved[-1]))
        # Given folded into one turn, or on any turn whatever.
        for given in (np.mod(path, turn), path + turn * random.integers(-4, 5)):
            ends = Slew(travel_rad=(low, high)).ends_rad(given)
            assert ends == pytest.approx(min(tried)[2:], abs=1e-9)


EAST, WEST = (1.0, 0.7), (4.0, 0.5)
HALVES = SectorRule(azimuth_sectors=2, elevation_edges_rad=(0.2, 1.2), fewest=3, most=5)
# From west to east 3 rad, the shorter way: 60 s and 15 s.
SLOW = Slew(rate_rad_s=0.05, settle_s=15.0)


def resting(name, start_t_s, end_t_s, *places):
    """Return a candidate whose points are at these directions, evenly in time."""
    azimuth, elevation = np.array(places).T
    none, t_s = np.zeros(len(places)), np.linspace(start_t_s, end_t_s, len(places))
    track = ReferenceTrack(
        t_s=t_s, azimuth_rad=azimuth, elevation_rad=elevation, azimuth_rate_rad_s=none, elevation_rate_rad_s=none,
        azimuth_acceleration_rad_s2=none, elevation_acceleration_rad_s2=none, range_m=none + 1e6, range_rate_m_s=none,
    )  # fmt: skip
    return CandidatePass(name=name, track=track, sigma_rad=2e-4)


def test_of_plans_that_do_not_fill_the_sky_the_one_that_brings_more_of_what_is_missing_is_taken():
    """Exchanging finds a rich pass behind a poor one, and misses two around a rich one."""
    poor, rich = resting("poor", 0.0, 10.0, EAST, (1.0, 0.1)), resting("rich", 5.0, 100.0, EAST, EAST, EAST)
    found = plan_campaign([rich, poor], HALVES, SLOW)
    assert ([one.name for one in found.passes], found.full_at_t_s) == (["rich"], None)
    waiting = [
        resting("a", 0.0, 100.0, EAST, EAST), resting("b", 90.0, 200.0, WEST, WEST, WEST),
        resting("c", 195.0, 300.0, WEST, WEST),
    ]  # fmt: skip
    for begun in (None, np.array([1, 0])):
        found = plan_campaign(waiting, HALVES, SLOW, begun)
        assert [one.name for one in found.passes] == ["a", "c"]
        assert found.coverage.counts.tolist() == [2 if begun is None else 3, 2]
    assert plan_campaign([], HALVES, SLOW, np.array([1, 0])).coverage.counts.tolist() == [1, 0]


def test_as_many_passes_are_advised_as_asked_each_given_those_before(on_offer):
    """The factor is the mean of those of the chosen terms' sigma."""
    start, chosen = uninformed_covariance(TERM_NAMES), ("collimation", "droop")
    np.testing.assert_allclose(np.sqrt(np.diag(start)), [term.limit for term in terms_by_name(TERM_NAMES)])
    advice = next_best_passes(TERM_NAMES, start, on_offer, chosen=chosen, count=3)
    assert len(advice) == len({one.name for one in advice}) == 3
    places = [TERM_NAMES.index(name) for name in chosen]
    before = np.sqrt(np.diag(start))
    for one in advice:
        assert one.factor == pytest.approx(np.mean((one.sigma / before)[places]))
        assert one.start_t_s == next(c.start_t_s for c in on_offer if c.name == one.name)
        before = one.sigma
    with pytest.raises(ValueError, match="count=0 must be"):
        next_best_passes(TERM_NAMES, start, on_offer, chosen=chosen, count=0)
    with pytest.raises(ValueError, match="chosen=nothing must name terms"):
        next_best_passes(TERM_NAMES, start, on_offer, chosen=(), count=1)
