"""The fit gives planted terms back within its stated sigma, and refuses by name what the data cannot determine."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import (
    TERM_NAMES,
    CandidatePass,
    FitOptions,
    Observations,
    PassPriors,
    Prior,
    fit_bias_model,
    held_at_zero,
)
from rf_pointing.calibration.fit import huber_weights, normalised_size, sandwich_covariance, within_limit
from rf_pointing.calibration.noise import noise_scale, share_after_editing


def values(model, names):
    return np.array([model.coefficients[name] for name in names])


def test_noiseless_exact_data_need_the_rotation_form(campaign, table_1):
    data = campaign(table_1, sigma_rad=0.0, form="rotation")
    exact = fit_bias_model(data, options=FitOptions(edit_sigma=0.0, form="rotation"))
    printed = fit_bias_model(data, options=FitOptions(edit_sigma=0.0))
    assert np.max(np.abs(exact.values - values(table_1, exact.names))) < 1e-10
    assert max(printed.rms_rad()) > 100.0 * max(exact.rms_rad())


def test_parameters_agree_with_numpy_least_squares(campaign, table_1, partials):
    data = campaign(table_1)
    a_az, a_el = partials(data.motion(), TERM_NAMES)
    matrix = np.vstack([a_az, a_el]) / 1e-4
    right = np.concatenate([data.residual_azimuth_rad, data.residual_elevation_rad]) / 1e-4
    expected = np.linalg.lstsq(matrix, right, rcond=None)[0]
    result = fit_bias_model(data, options=FitOptions(edit_sigma=0.0))
    assert result.values == pytest.approx(expected, rel=1e-7, abs=1e-12)
    assert np.allclose(result.covariance, np.linalg.inv(matrix.T @ matrix), rtol=1e-5)


def test_all_data_at_one_elevation_are_refused_by_the_terms_names(campaign, table_1):
    data = campaign(table_1)
    fixed = data.true_elevation_rad * 0.0 + 0.6
    data = replace(data, true_elevation_rad=fixed, observed_elevation_rad=fixed + 0.001)
    with pytest.raises(ValueError, match=r"cannot separate .*azimuth_offset.*low and at high elevation"):
        fit_bias_model(data)


def test_a_prior_makes_inseparable_terms_solvable_and_is_returned_where_data_are_silent(campaign, table_1):
    data = campaign(table_1)
    names = (*TERM_NAMES, "elevation_temperature")
    data = replace(data, temperature_k=np.full(len(data), 288.15))
    with pytest.raises(ValueError, match="elevation_temperature"):
        fit_bias_model(data, terms=names)
    result = fit_bias_model(data, terms=names, priors={"elevation_temperature": Prior(2e-5, 1e-5)})
    assert result.coefficients["elevation_temperature"] == pytest.approx(2e-5)
    assert result.sigma_of("elevation_temperature") == pytest.approx(1e-5)


def test_a_pure_delay_appears_as_velocity_and_half_its_square_as_acceleration_lag(track, random):
    delay_s, parts = 0.5, []
    for number in range(12):
        miss_m, start = (-1) ** number * random.uniform(4e5, 2e6), 1e9 + 6000.0 * number
        whole = track(1.0, miss_m, random.uniform(0.0, 6.3), start)
        times = whole.t_s[10:-10:10]
        candidate = CandidatePass(name="", track=whole.at(times), sigma_rad=1e-4)
        late = whole.at(times + delay_s)
        parts.append(
            replace(
                candidate.observations("gs1", "S", number),
                observed_azimuth_rad=late.azimuth_rad,
                observed_elevation_rad=late.elevation_rad,
            )
        )
    result = fit_bias_model(Observations.concatenate(parts), options=FitOptions(edit_sigma=0.0))
    for axis in ("azimuth", "elevation"):
        assert result.coefficients[f"{axis}_velocity_lag"] == pytest.approx(delay_s, rel=1e-3)
        assert result.coefficients[f"{axis}_acceleration_lag"] == pytest.approx(delay_s**2 / 2.0, rel=0.02)


def test_poorly_separated_pairs_come_with_the_data_that_would_separate_them(campaign, table_1):
    data = campaign(table_1)
    low = data.select(data.true_elevation_rad < np.radians(40.0))
    advice = fit_bias_model(low).separation_advice()
    assert any("collimation" in line and "above 60 deg" in line for line in advice)


def test_huber_weights_bound_the_harm_of_outliers_that_editing_may_not_remove(campaign, table_1, random):
    data = campaign(table_1, passes=20)
    spoiled = data.observed_elevation_rad + np.where(random.random(len(data)) < 0.05, 3e-3, 0.0)
    bad = replace(data, observed_elevation_rad=spoiled)
    plain = fit_bias_model(bad, options=FitOptions(edit_sigma=0.0))
    robust = fit_bias_model(bad, options=FitOptions(edit_sigma=0.0, huber_sigma=1.5))
    truth = table_1.coefficients["elevation_offset"] + table_1.coefficients["droop"]
    miss = [abs(r.coefficients["elevation_offset"] + r.coefficients["droop"] - truth) for r in (plain, robust)]
    assert miss[1] < 0.5 * miss[0]


def test_data_that_contradict_each_other_are_refused_instead_of_edited_down_to_those_that_agree(campaign, table_1):
    data = campaign(table_1, passes=10, sigma_rad=1e-4)
    observed = data.observed_elevation_rad.copy()
    for number, shift in ((6, 0.08), (7, 0.03), (8, 0.01), (9, 0.003)):
        observed[data.pass_id == number] += shift
    broken = replace(data, observed_elevation_rad=observed)
    terms = ("azimuth_offset", "elevation_offset")
    held = {name: value for name, value in table_1.coefficients.items() if name not in terms}
    with pytest.raises(ValueError, match=r"observations were edited out \(\d+ %\), most of them of pass"):
        fit_bias_model(broken, terms=terms, held=held)
    all_in = fit_bias_model(broken, terms=terms, held=held, options=FitOptions(edit_sigma=0.0))
    assert len(all_in.rejected) == 0


def test_passes_that_editing_has_left_out_do_not_count(campaign, table_1):
    data = campaign(table_1, passes=3, sigma_rad=1e-4)
    keep = data.pass_id == 0
    for number in (1, 2):
        keep[np.flatnonzero(data.pass_id == number)[:8]] = True
    observed = data.observed_elevation_rad.copy()
    observed[data.pass_id == 1] += 0.02
    observed[data.pass_id == 2] -= 0.02
    few = replace(data, observed_elevation_rad=observed).select(keep)
    terms = ("azimuth_offset", "elevation_offset")
    held = {name: value for name, value in table_1.coefficients.items() if name not in terms}
    with pytest.raises(ValueError, match="passes=1 are left after editing, must be >= fewest_passes=3"):
        fit_bias_model(few, terms=terms, held=held)


@pytest.mark.parametrize("form", ["printed", "rotation"])
def test_data_in_a_narrow_band_of_elevation_are_refused_by_the_terms_they_hardly_separate(campaign, table_1, form):
    # Nothing is singular here; the exact model's fit came out at 2.5 deg with level terms 29 sigma off.
    data = campaign(table_1, passes=30, sigma_rad=4e-5, form=form)
    narrow = data.select(np.abs(np.degrees(data.true_elevation_rad) - 13.0) < 1.0)
    with pytest.raises(
        ValueError, match=r"hardly separate .*azimuth_offset \+ .*\(sigma up to .* deg, must be <= 0.29 deg\)"
    ):
        fit_bias_model(narrow, options=FitOptions(form=form))
    known = {name: Prior(value, 2e-3) for name, value in table_1.coefficients.items() if "lag" not in name}
    fit_bias_model(narrow, priors=known, options=FitOptions(form=form))


TERMS = ("azimuth_offset", "elevation_offset", "mislevel_east", "mislevel_north", "droop")
SANDWICH = FitOptions(covariance="sandwich", edit_sigma=0.0)


def test_sandwich_sigma_is_honest_where_white_sigma_is_not(campaign, table_1, random):
    clean = campaign(table_1, passes=40)
    held = {name: table_1.coefficients[name] for name in held_at_zero(TERMS)}
    values, white, sandwich = [], [], []
    for _ in range(60):
        common = 3e-4 * random.standard_normal((2, 40))[:, clean.pass_id]
        noise = 1e-4 * random.standard_normal((2, len(clean)))
        offset = table_1.offset_rad(*clean.motion())
        data = replace(
            clean,
            observed_azimuth_rad=clean.true_azimuth_rad + offset[0] + common[0] + noise[0],
            observed_elevation_rad=clean.true_elevation_rad + offset[1] + common[1] + noise[1],
        )
        fit = fit_bias_model(data, terms=TERMS, held=held, options=SANDWICH)
        values.append(fit.values)
        sandwich.append(fit.sigma)
        white.append(fit_bias_model(data, terms=TERMS, held=held, options=FitOptions(edit_sigma=0.0)).sigma)
    spread = np.std(values, axis=0)
    assert np.all(spread > 3.0 * np.mean(white, axis=0))
    assert np.mean(spread / np.mean(sandwich, axis=0)) == pytest.approx(1.0, abs=0.15)


def test_editing_before_a_sandwich_is_refused():
    with pytest.raises(ValueError, match=r"edit_sigma=3\.0 must be 0"):
        FitOptions(covariance="sandwich")


def test_editing_does_not_make_the_noise_smaller(campaign, table_1):
    """Without the tails beyond 3 sigma normal residuals have 97.3 % of their variance, and hold the fit so much less."""
    data = campaign(table_1)
    every, edited = (
        fit_bias_model(data, options=FitOptions(edit_sigma=limit, scale_covariance=True)) for limit in (0.0, 3.0)
    )
    assert 0.001 < len(edited.rejected) / len(data) < 0.02
    for whole, rest in zip(every.noise, edited.noise, strict=True):
        # The tails of this sample are 1.7 % of its variance, give or take.
        assert rest.factor == pytest.approx(whole.factor / share_after_editing(3.0), rel=0.025)


@pytest.mark.parametrize("limit", [2.0, 2.5, 3.0])
def test_a_mean_without_its_tails_scatters_as_its_share_says(limit, random):
    """The limit follows the mean, as the editing of a fit does: the variance is that over P and over the share."""
    values = random.standard_normal((4000, 200))
    mean, kept = np.zeros(4000), np.ones_like(values, dtype=bool)
    for _ in range(20):
        kept = np.abs(values - mean[:, np.newaxis]) < limit
        mean = np.sum(values * kept, axis=1) / np.sum(kept, axis=1)
    inside, share = np.mean(kept), share_after_editing(limit)
    assert np.var((values - mean[:, np.newaxis])[kept]) == pytest.approx(share, rel=0.01)
    assert np.var(mean) * 200.0 == pytest.approx(1.0 / (inside * share), rel=0.08)


@pytest.mark.parametrize(("size", "terms"), [(12, 6), (40, 14), (200, 14)])
def test_the_noise_is_that_of_the_degrees_of_freedom_left(size, terms, random):
    """Residuals of a fit of many terms to few data scatter less than the data do; F^2 must not."""
    factors = []
    for _ in range(1500):
        columns, _ = np.linalg.qr(random.standard_normal((size, terms)))
        data = 1.7 * random.standard_normal(size)
        residuals = data - columns @ (columns.T @ data)
        # Every point a pass of its own: nothing is correlated.
        factors.append(noise_scale(residuals, columns, np.arange(size)).factor)
    expected_spread = 1.7**2 * np.sqrt(2.0 / (size - terms) / len(factors))
    assert np.mean(factors) == pytest.approx(1.7**2, abs=4.0 * expected_spread)


def test_the_sandwich_is_the_scatter_of_the_fits_that_leave_one_pass_out(random):
    """Bell and McCaffrey's third correction is the delete-one-pass jackknife, exactly."""
    passes = [(number, random.normal(size=(8, 3)), random.normal(size=8)) for number in range(7)]
    matrix, right = (np.concatenate([one[place] for one in passes]) for place in (1, 2))
    fitted = np.linalg.lstsq(matrix, right, rcond=None)[0]
    expected = np.zeros((3, 3))
    for left_out in range(7):
        rows = np.concatenate([one[1] for one in passes if one[0] != left_out])
        values = np.linalg.lstsq(rows, np.concatenate([one[2] for one in passes if one[0] != left_out]), rcond=None)[0]
        expected += np.outer(values - fitted, values - fitted)
    residuals = [(number, rows, own - rows @ fitted) for number, rows, own in passes]
    found = sandwich_covariance(("a", "b", "c"), np.linalg.inv(matrix.T @ matrix), residuals)
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    with pytest.raises(ValueError, match="passes=4 must be >= 5 for a sandwich covariance"):
        sandwich_covariance(("a", "b", "c"), np.linalg.inv(matrix.T @ matrix), residuals[:4])
    assert np.all(np.isfinite(sandwich_covariance(("a", "b", "c"), np.linalg.inv(matrix.T @ matrix), residuals[:5])))


def test_the_size_of_a_residual_is_over_the_spread_of_those_that_count_where_that_is_larger_than_sigma(random):
    residuals, sigmas = random.normal(size=(2, 400)) * [[3.0], [0.2]], np.full((2, 400), 0.5)
    used = random.random(400) < 0.7
    spread = 1.4826 * np.median(np.abs(residuals[0, used]) / 0.5)
    assert spread > 3.0
    expected = np.maximum(np.abs(residuals[0]) / 0.5 / spread, np.abs(residuals[1]) / 0.5)
    np.testing.assert_allclose(normalised_size(residuals, sigmas, used), expected, rtol=1e-12)


def test_rejected_rows_return_only_where_they_may_and_no_limit_changes_nothing():
    size, used = np.array([0.5, 3.0, 3.001, 9.0]), np.array([False, True, True, False])
    assert within_limit(size, 3.0, used, may_return=True).tolist() == [True, True, False, False]
    assert within_limit(size, 3.0, used, may_return=False).tolist() == [False, True, False, False]
    assert within_limit(size, 0.0, used, may_return=True) is used
    np.testing.assert_allclose(huber_weights(size, 1.5), [1.0, 0.5, 1.5 / 3.001, 1.5 / 9.0])
    np.testing.assert_array_equal(huber_weights(size, 0.0), np.ones(4))


def test_pairs_that_are_hard_to_separate_come_with_the_worst_first(campaign, table_1):
    """Whatever the sign of their correlation."""
    fit = fit_bias_model(campaign(table_1), terms=("azimuth_offset", "collimation", "droop"), held=held_at_zero(
        ("azimuth_offset", "collimation", "droop")
    ))  # fmt: skip
    one = np.array([[1.0, 0.5, -0.97], [0.5, 1.0, 0.96], [-0.97, 0.96, 1.0]])
    found = replace(fit, covariance=np.outer(fit.sigma, fit.sigma) * one).inseparable()
    assert [pair[:2] for pair in found] == [("azimuth_offset", "droop"), ("collimation", "droop")]
    assert [pair[2] for pair in found] == pytest.approx([-0.97, 0.96])


def test_what_a_result_states_is_what_its_rows_make_of_it(campaign, table_1):
    """Times, passes, variances over sigma, sizes on the sky and correlations; two rows of interleaved passes are out."""
    data = campaign(table_1, passes=12)
    data = data.select(np.argsort(data.t_s - 6000.0 * data.pass_id, kind="stable"))
    spoilt = data.observed_elevation_rad.copy()
    spoilt[[5, 90]] += 0.02
    data = replace(data, observed_elevation_rad=spoilt, sigma_azimuth_rad=2.0 * data.sigma_azimuth_rad)
    fit = fit_bias_model(data)
    assert {5, 90} <= {one.row for one in fit.rejected} == set(np.flatnonzero(~fit.used).tolist())
    for one in fit.rejected:
        assert one.pass_id == data.pass_id[one.row]
        assert one.reason.startswith("residual of ")
    assert (fit.first_t_s, fit.last_t_s, fit.passes) == (np.min(data.t_s), np.max(data.t_s), 12)
    offset = np.stack(fit.model.offset_rad(*data.motion()))
    left = np.stack([data.residual_azimuth_rad, data.residual_elevation_rad]) - offset
    np.testing.assert_allclose([fit.residual_azimuth_rad, fit.residual_elevation_rad], left, atol=1e-12)
    ratio = (left / np.stack([data.sigma_azimuth_rad, data.sigma_elevation_rad]))[:, fit.used]
    assert (fit.variance_azimuth, fit.variance_elevation) == pytest.approx(np.mean(ratio**2, axis=1))
    assert fit.variance_azimuth == pytest.approx(0.25, rel=0.2)
    across = (left[0] * np.cos(data.true_elevation_rad))[fit.used]
    assert fit.rms_rad() == pytest.approx((np.sqrt(np.mean(across**2)), np.sqrt(np.mean(left[1][fit.used] ** 2))))
    np.testing.assert_allclose(np.diag(fit.correlation), 1.0)
    np.testing.assert_allclose(fit.correlation * np.outer(fit.sigma, fit.sigma), fit.covariance)
    held = {name: value for name, value in table_1.coefficients.items() if name != "droop"}
    alone = fit_bias_model(data, terms=("droop",), held=held)
    assert alone.model == table_1.replace(droop=alone.coefficients["droop"])
    assert fit.sigma_of("droop") == np.sqrt(fit.covariance[fit.names.index("droop"), fit.names.index("droop")])
    assert not np.any(fit.pass_azimuth_rad)
    assert fit.pass_errors == ()


@pytest.mark.parametrize("unit", [1.0, 100.0, 0.01])
def test_a_pass_that_alone_determines_a_direction_is_named_by_the_term_that_is_most_of_it_in_sigma(unit):
    """Whatever the units of the terms."""
    seen, alone = 0.1 * np.array([1.0, 2.0]), 10.0 * np.array([2.0, -1.0])
    rows = [np.array([seen, alone if number == 3 else 2.0 * seen]) * [unit, 1.0] for number in range(6)]
    matrix = np.concatenate(rows)
    passes = [(number, own, np.zeros(2)) for number, own in enumerate(rows)]
    with pytest.raises(ValueError, match="pass 3 alone determines offset"):
        sandwich_covariance(("offset", "tilt"), np.linalg.inv(matrix.T @ matrix), passes)


@pytest.mark.parametrize(
    ("value", "sigma", "words"),
    [
        (0.1, 0.0, r"prior sigma=0\.0 must be > 0"),
        (0.1, -1e-9, "prior sigma=.* must be > 0"),
        (0.1, np.inf, "prior sigma=inf must be finite"),
        (np.nan, 0.1, "prior value=nan must be finite"),
    ],
)
def test_a_prior_has_a_value_and_a_sigma(value, sigma, words):
    with pytest.raises(ValueError, match=words):
        Prior(value, sigma)
    assert Prior(-0.1, 1e-12).sigma == 1e-12


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"terms": ()}, "terms is empty, must name at least one term"),
        ({"terms": ("droop",), "held": dict.fromkeys(TERM_NAMES, 0.0)}, "term droop is both fitted and held"),
        ({"priors": {"azimuth_second_sine": Prior(0.0, 1e-3)}}, "prior of azimuth_second_sine: not a fitted term"),
        ({"terms": (*TERM_NAMES, "squint")}, "no term squint"),
        ({"terms": ("azimuth_offset", "droop", "azimuth_offset")}, "term azimuth_offset is given more than once"),
        ({"terms": TERM_NAMES[:-1]}, f"{TERM_NAMES[-1]} is neither fitted nor held"),
        (
            {"pass_priors": PassPriors(clock_s=0.1), "options": FitOptions(covariance="sandwich", edit_sigma=0.0)},
            "twice",
        ),
    ],
)
def test_terms_that_do_not_go_together_are_refused(campaign, table_1, given, words):
    with pytest.raises(ValueError, match=words):
        fit_bias_model(campaign(table_1, passes=4), **given)


def test_passes_are_too_few_unless_every_term_has_a_prior(campaign, table_1):
    """As many as asked are enough."""
    data, terms = campaign(table_1, passes=2), ("azimuth_offset", "elevation_offset")
    held = {name: value for name, value in table_1.coefficients.items() if name not in terms}
    one, both = {terms[0]: Prior(0.0, 0.01)}, {name: Prior(0.0, 0.01) for name in terms}
    with pytest.raises(ValueError, match="passes=2 must be >= fewest_passes=3"):
        fit_bias_model(data, terms=terms, held=held, priors=one)
    assert fit_bias_model(data, terms=terms, held=held, priors=both).passes == 2
    assert fit_bias_model(data, terms=terms, held=held, options=FitOptions(fewest_passes=2)).passes == 2
