import itertools

import numpy as np
import pytest

from rf_pointing.calibration import (
    TERM_NAMES,
    CandidatePass,
    FitOptions,
    Observations,
    PassPriors,
    Slew,
    fit_bias_model,
    next_best_passes,
    uninformed_covariance,
)

ORBIT = PassPriors(along_track_m=180.0, cross_track_m=70.0, radial_m=50.0)


@pytest.fixture
def candidates(track, random):
    found = []
    for number in range(8):
        miss = (-1) ** number * (2e5 + 2.5e5 * number)
        start = 2e9 + 6000.0 * number
        found.append(
            CandidatePass(
                name=f"pass {number}",
                track=track(10.0, miss, random.uniform(0.0, 6.0), start),
                sigma_azimuth_rad=1e-4,
                sigma_elevation_rad=1e-4,
            )
        )
    return found


def test_promised_sigma_is_the_sigma_of_the_fit_with_that_pass(campaign, table_1, candidates):
    data = campaign(table_1)
    options = FitOptions(edit_sigma=0.0)
    before = fit_bias_model(data, pass_priors=ORBIT, options=options)
    advice = next_best_passes(
        TERM_NAMES, before.covariance, candidates, chosen=("collimation",), count=1, pass_priors=ORBIT
    )[0]
    best = next(c for c in candidates if c.name == advice.name)
    more = Observations.concatenate([data, best.observations("gs1", "S", 100)])
    after = fit_bias_model(more, pass_priors=ORBIT, options=options)
    assert advice.sigma == pytest.approx(after.sigma, rel=1e-6)
    assert advice.factor == pytest.approx(after.sigma_of("collimation") / before.sigma_of("collimation"), rel=1e-6)


def test_the_best_pass_beats_every_other_one(campaign, table_1, candidates):
    before = fit_bias_model(campaign(table_1, passes=6))
    chosen = ("collimation", "non_orthogonality")
    best = next_best_passes(TERM_NAMES, before.covariance, candidates, chosen=chosen, count=1)[0]
    each = [next_best_passes(TERM_NAMES, before.covariance, [c], chosen=chosen, count=1)[0].factor for c in candidates]
    assert best.factor == pytest.approx(min(each))


def test_a_high_pass_is_advised_for_collimation(candidates):
    start = uninformed_covariance(TERM_NAMES)
    advice = next_best_passes(TERM_NAMES, start, candidates, chosen=("collimation",), count=8)
    assert advice[0].name in ("pass 0", "pass 1")
    assert len(advice) == 8
    assert all(item.factor <= 1.0 for item in advice)


def test_no_advised_pass_overlaps_another_or_begins_before_the_antenna_is_there(track, random):
    slew = Slew(rate_rad_s=0.03, settle_s=60.0)
    crowd = [
        CandidatePass(
            name=f"pass {number}",
            track=track(10.0, random.uniform(2e5, 2e6), random.uniform(0.0, 6.0), 2e9 + 350.0 * number),
            sigma_azimuth_rad=1e-4,
            sigma_elevation_rad=1e-4,
        )
        for number in range(12)
    ]
    start = uninformed_covariance(TERM_NAMES)
    advice = next_best_passes(TERM_NAMES, start, crowd, chosen=("collimation",), count=12, slew=slew)
    assert 2 <= len(advice) < 12
    chosen = sorted((c for c in crowd if c.name in {a.name for a in advice}), key=lambda c: c.start_t_s)
    for first, then in itertools.pairwise(chosen):
        way = abs(np.angle(np.exp(1j * (then.track.azimuth_rad[0] - first.track.azimuth_rad[-1]))))
        assert then.start_t_s - first.end_t_s >= 60.0 + way / 0.03


def test_planned_passes_say_nothing_about_thermal_terms(candidates):
    terms = ("azimuth_offset", "azimuth_temperature")
    start = uninformed_covariance(terms)
    advice = next_best_passes(terms, start, candidates, chosen=terms, count=1)[0]
    assert advice.sigma[1] == pytest.approx(np.sqrt(start[1, 1]))
    assert advice.sigma[0] < 0.1 * np.sqrt(start[0, 0])


def test_terms_that_are_not_fitted_cannot_be_chosen(candidates):
    with pytest.raises(ValueError, match="chosen=squint must name terms"):
        next_best_passes(TERM_NAMES, np.eye(14), candidates, chosen=("squint",), count=1)
