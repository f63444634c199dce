from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import erf, ndtr

from rf_pointing.calibration import (
    EXTENSION_TERMS,
    TERM_NAMES,
    FitOptions,
    PassPriors,
    fit_bias_model,
    held_at_zero,
    held_out_passes,
    select_terms,
    term_selection,
)
from rf_pointing.calibration.normal_equations import Triangle
from rf_pointing.calibration.term_selection import _least, _Mixture, _Search
from rf_pointing.calibration.terms import terms_by_name
from rf_pointing.core import MDEG

EXTENSIONS = tuple(term.name for term in EXTENSION_TERMS if term.unit != "rad/K" and "beyond" not in term.name)


def test_only_planted_terms_are_chosen(campaign, table_1):
    planted = {"azimuth_offset", "mislevel_east", "elevation_offset", "elevation_velocity_lag", "azimuth_second_sine"}
    values = {name: (table_1.coefficients[name] if name in planted else 0.0) for name in TERM_NAMES}
    model = type(table_1)({**values, "azimuth_second_sine": 1e-3})
    found = select_terms(campaign(model, passes=20), (*TERM_NAMES, *EXTENSIONS))
    assert set(found.names) - set(found.kept) == planted


def test_a_perfect_antenna_needs_no_term(campaign, table_1):
    assert select_terms(campaign(table_1.zero(), passes=10), TERM_NAMES).names == ()


@pytest.mark.parametrize(("orbit_m", "kept"), [(3000.0, ("elevation_velocity_lag",)), (1.0, ())])
def test_a_lag_too_small_to_be_seen_is_kept_where_the_other_axis_depends_on_it(campaign, table_1, orbit_m, kept):
    """An orbit error looks as equal lags do: only their difference is known to better than it."""
    model = table_1.zero().replace(azimuth_velocity_lag=0.5)
    names = ("azimuth_offset", "azimuth_velocity_lag", "elevation_offset", "elevation_velocity_lag")
    orbit = PassPriors.of_orbit(orbit_m)
    found = select_terms(campaign(model, passes=8), names, pass_priors=orbit)
    assert set(found.names) == {"azimuth_velocity_lag", *kept}
    assert found.kept == kept


LAGS = ("azimuth_velocity_lag", "elevation_velocity_lag")
SIZE_S = terms_by_name(LAGS)[0].size


def matrix_of(narrowed, other_sigma):
    """Return equations by which the first lag is `narrowed` times as certain without the second one.

    The second one is known to `other_sigma` of its usual size, the first to 0.004 or better without it.
    """
    other = 1.0 / (other_sigma * SIZE_S)
    first = 250.0 * narrowed / SIZE_S
    return np.array([[first, other * np.sqrt(narrowed**2 - 1.0)], [0.0, other]])


def search_of(matrix, right):
    triangle = Triangle(LAGS)
    triangle.add_triangle(np.column_stack([matrix, right]), 2000)
    return _Search(triangle, 1.0)


@pytest.mark.parametrize("seen_sigma", [-2.0, -0.5, 0.0, 1.0, 2.2])
def test_what_is_kept_is_decided_by_the_geometry_whatever_noise_makes_of_it(seen_sigma):
    """Kept for its value, a term of zero would be kept only where noise has made it large."""
    for narrowed, kept in ((7.0, ()), (9.0, LAGS[1:])):
        matrix = matrix_of(narrowed, 0.1)
        found = search_of(matrix, matrix @ [SIZE_S, 0.1 * seen_sigma * SIZE_S]).selection(LAGS[:1])
        assert found.names == LAGS[: 1 + len(kept)]
        assert found.kept == kept


def test_what_would_be_a_guess_is_not_kept():
    """Its data tell the second lag to no better than what lags usually are."""
    matrix = matrix_of(20.0, 1.2)
    assert search_of(matrix, matrix @ [SIZE_S, 0.0]).selection(LAGS[:1]).kept == ()


@pytest.mark.parametrize("narrowed", [4.0, 12.0])
def test_sigma_covers_what_the_choice_leaves_open(narrowed, random):
    """Half of the second lags are zero, and many of the others are too small to be seen.

    Of 700 mounts 74 and 94 % are within 1 and 2 sigma where the second lag may be left out, 70 and 97 % where it is kept.
    """
    matrix, pulls, narrow = matrix_of(narrowed, 0.15), [], []
    for _ in range(200):
        truth = SIZE_S * np.array([1.0, 0.6 * random.standard_normal() * (random.random() < 0.5)])
        search = search_of(matrix, matrix @ truth + random.standard_normal(2))
        chosen = LAGS if search.bic(LAGS) < search.bic(LAGS[:1]) else LAGS[:1]
        found = search.selection(chosen)
        _, values, covariance = search.solve(found.names)
        pulls.append((values[0] - truth[0]) / np.sqrt(covariance[0, 0]) / found.widening[0])
        _, values, covariance = search.solve(chosen)
        narrow.append((values[0] - truth[0]) / np.sqrt(covariance[0, 0]))
    assert np.mean(np.abs(narrow) < 2.0) < 0.83
    assert np.mean(np.abs(pulls) < 1.0) == pytest.approx(0.72, abs=0.1)
    assert np.mean(np.abs(pulls) < 2.0) > 0.89


def test_held_out_passes_are_predicted_to_the_noise_by_the_right_terms_only(campaign, table_1):
    data = campaign(table_1, passes=12)
    right = held_out_passes(data, TERM_NAMES)
    wrong = held_out_passes(data, ("azimuth_offset", "elevation_offset"))
    assert right.total_rms_rad < 1.6 * 1e-4
    assert wrong.total_rms_rad > 50.0 * MDEG
    assert right.rms_rad.shape == (12,)
    assert np.all(np.isfinite(right.rms_rad))


NAMES = ("azimuth_offset", "mislevel_east", "elevation_offset", "elevation_velocity_lag")
SIZES = np.array([term.size for term in terms_by_name(NAMES)])


def search_with(random, scale=1.0, rows=40):
    """Return a search of random equations of four terms that are each seen to a share of their sizes."""
    matrix = random.normal(size=(rows, 4)) / SIZES * [3.0, 0.4, 1.0, 2.0]
    right = matrix @ (SIZES * [1.0, 0.2, -0.7, 0.0]) + random.normal(size=rows)
    triangle = Triangle(NAMES)
    triangle.add_triangle(np.asfortranarray(np.column_stack([matrix, right])), rows)
    return _Search(triangle, scale), matrix, right


def test_a_subset_is_solved_as_least_squares_of_its_columns(random):
    search, matrix, right = search_with(random)
    for chosen in ((), NAMES[:1], (NAMES[1], NAMES[3]), NAMES):
        columns = matrix[:, [NAMES.index(name) for name in chosen]]
        square, values, covariance = search.solve(chosen)
        expected = np.linalg.lstsq(columns / 1.0, right, rcond=None)[0]
        assert square == pytest.approx(float(np.sum((right - columns @ expected) ** 2)), rel=1e-9)
        np.testing.assert_allclose(values, expected, rtol=1e-9)
        np.testing.assert_allclose(covariance, np.linalg.inv(columns.T @ columns), rtol=1e-9)
        assert search.bic(chosen) == pytest.approx(square + len(chosen) * np.log(40.0))
    scaled, *_ = search_with(random, scale=3.0)
    assert scaled.bic(NAMES[:2]) == pytest.approx(scaled.solve(NAMES[:2])[0] / 3.0 + 2.0 * np.log(40.0))


def test_terms_that_are_the_same_share_what_they_explain(random):
    column = random.normal(size=30)
    triangle = Triangle(NAMES[:2])
    triangle.add_triangle(np.asfortranarray(np.column_stack([column, column, 4.0 * column])), 30)
    square, values, _ = _Search(triangle, 1.0).solve(NAMES[:2])
    np.testing.assert_allclose(values, [2.0, 2.0], rtol=1e-9)
    assert square == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_the_weight_of_a_subset_is_the_likelihood_of_data_whose_terms_are_as_large_as_usual(scale, random):
    """b ~ N(0, v + A T T A'), written out in the space of the data; values and sigma are those of the posterior."""
    search, matrix, right = search_with(random, scale)
    member = np.array([[k >> bit & 1 for bit in range(4)] for k in range(16)], dtype=bool)
    for share in (0.3, 1.2):
        above, values, sigma = search._posteriors(member, share)
        for row, chosen in enumerate(member):
            columns, size = matrix[:, chosen], share * SIZES[chosen]
            spread = scale * np.eye(40) + columns @ np.diag(size**2) @ columns.T
            expected = right @ np.linalg.solve(spread, right) + np.linalg.slogdet(spread / scale)[1]
            assert above[row] == pytest.approx(expected, rel=1e-9)
            covariance = np.linalg.inv(columns.T @ columns / scale + np.diag(size**-2.0))
            np.testing.assert_allclose(values[row, chosen], covariance @ columns.T @ right / scale, rtol=1e-8)
            np.testing.assert_allclose(sigma[row, chosen], np.sqrt(np.diag(covariance)), rtol=1e-8)
            assert not np.any(values[row, ~chosen])
            assert not np.any(sigma[row, ~chosen])


def test_the_widths_of_a_mixture_hold_their_share_of_it(random):
    """By drawing from it: of a million 68.3 % are known to 0.05 %."""
    weights = np.array([0.5, 0.3, 0.2])
    apart, wide = np.array([[0.0, 1.0], [2.0, -1.0], [-0.5, 4.0]]), np.array([[1.0, 0.5], [0.3, 1.0], [2.0, 1e-13]])
    mixture = _Mixture(np.ones((3, 2), dtype=bool), weights, apart, wide)
    which = random.choice(3, size=1_000_000, p=weights)
    for share in (0.3, 0.6827, 0.9545):
        found = mixture.holding(share)
        for term in (0, 1):
            drawn = apart[which, term] + wide[which, term] * random.standard_normal(len(which))
            assert np.mean(np.abs(drawn) < found[term] * (1.0 + 1e-9)) == pytest.approx(share, abs=0.003) or (
                # All of a narrow part is on one side of the width.
                np.mean(np.abs(drawn) < found[term] * 0.999) < share < np.mean(np.abs(drawn) < found[term] * 1.001)
            )


def test_a_term_that_is_needless_leaves_before_another_one_enters(random):
    search, _matrix, _right = search_with(random)
    subsets = {name: search.bic({name}) for name in NAMES}
    best = min(subsets, key=subsets.get)
    assert search.best_move(frozenset(), search.bic(())) == (best, pytest.approx(subsets[best]))
    everything = frozenset(NAMES)
    without = {name: search.bic(everything - {name}) for name in NAMES}
    worst = min(without, key=without.get)
    assert without[worst] < search.bic(everything)
    assert search.best_move(everything, search.bic(everything)) == (worst, pytest.approx(without[worst]))
    chosen = frozenset(select for select in NAMES if select != worst)
    assert search.best_move(chosen, -1e9) is None


def test_what_a_pass_left_out_is_predicted_to_is_the_miss_of_the_fit_of_the_others(campaign, table_1):
    data, terms = campaign(table_1, passes=6), ("azimuth_offset", "elevation_offset", "elevation_velocity_lag")
    found = held_out_passes(data, terms)
    squares = []
    for number in range(6):
        out = data.pass_id == number
        model = fit_bias_model(data.select(~out), terms=terms, held=held_at_zero(terms)).model
        rows = data.select(out)
        azimuth, elevation = model.offset_rad(*rows.motion())
        across = (rows.residual_azimuth_rad - azimuth) * np.cos(rows.true_elevation_rad)
        squares.append(across**2 + (rows.residual_elevation_rad - elevation) ** 2)
    np.testing.assert_allclose(found.rms_rad, [np.sqrt(np.mean(square)) for square in squares], rtol=1e-9)
    assert found.total_rms_rad == pytest.approx(np.sqrt(np.mean(np.concatenate(squares))), rel=1e-9)
    assert found.pass_ids.tolist() == list(range(6))


@pytest.mark.parametrize(("stated", "scale"), [(1.0, 1.0), (3.0, 1.0), (0.5, 4.0)])
def test_the_data_of_a_selection_are_at_best_as_good_as_stated(campaign, table_1, stated, scale):
    """Chi-square of the fit of all candidates over its degrees of freedom, or 1."""
    data = campaign(table_1, passes=20)
    data = replace(
        data, sigma_azimuth_rad=stated * data.sigma_azimuth_rad, sigma_elevation_rad=stated * data.sigma_elevation_rad
    )
    search = _Search.of(data, TERM_NAMES, {}, None, None)
    freedom = 2 * len(data) - len(TERM_NAMES)
    assert search.scale == pytest.approx(scale, rel=4.0 * np.sqrt(2.0 / freedom))
    assert search.scale == max(1.0, search.solve(TERM_NAMES)[0] / freedom)


SIX = ("azimuth_offset", "mislevel_east", "elevation_offset", "elevation_velocity_lag", "droop", "azimuth_velocity_lag")


def widening_by_hand(search, matrix, right, fitted, kept):
    """Return the widening of `fitted` by the mixture over subsets, in the space of the data."""
    sizes = np.array([term.size for term in terms_by_name(search.triangle.names)])
    of_fit = np.array([name in fitted for name in search.triangle.names])
    free = np.array([name not in kept for name in search.triangle.names])
    rows, count = [], len(sizes)
    for bits in range(2**count):
        chosen = np.array([bits >> bit & 1 for bit in range(count)], dtype=bool)
        changed = chosen != of_fit
        if np.sum(changed) > 4 or np.any(changed & ~free):
            continue
        for share in (0.3, 0.6, 1.2):
            columns, size = matrix[:, chosen], share * sizes[chosen]
            spread = search.scale * np.eye(len(right)) + columns @ np.diag(size**2) @ columns.T
            above = right @ np.linalg.solve(spread, right) + np.linalg.slogdet(spread)[1]
            covariance = np.linalg.inv(columns.T @ columns / search.scale + np.diag(size**-2.0))
            values, sigma = np.zeros(count), np.full(count, 1e-9 * sizes)
            values[chosen] = covariance @ columns.T @ right / search.scale
            sigma[chosen] = np.sqrt(np.diag(covariance))
            rows.append((above, values, sigma))
    least = min(row[0] for row in rows)
    # Subsets of less than exp(-7) of the best have no weight.
    likely = [row for row in rows if row[0] - least < 14.0]
    weights = np.exp(-0.5 * np.array([row[0] - least for row in likely]))
    weights /= np.sum(weights)
    own = matrix[:, of_fit]
    center = np.linalg.lstsq(own, right, rcond=None)[0]
    one_sigma = np.sqrt(search.scale * np.diag(np.linalg.inv(own.T @ own)))
    found = []
    for place, term in enumerate(np.flatnonzero(of_fit)):
        middle = np.array([row[1][term] for row in likely]) - center[place]
        wide = np.array([row[2][term] for row in likely])
        widths = []
        for times in (1.0, 2.0):
            share = erf(times / np.sqrt(2.0))

            def lacking(half, middle=middle, wide=wide, share=share):
                return weights @ (ndtr((half - middle) / wide) - ndtr((-half - middle) / wide)) - share

            unit = one_sigma[place]
            widths.append(brentq(lacking, 0.0, 100.0 * unit, xtol=1e-12 * unit, rtol=1e-12) / times)
        found.append(max(0.5 * sum(widths) / one_sigma[place], 1.0))
    return found


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_the_widening_is_that_of_the_mixture_over_subsets_near_the_chosen_one(scale, random):
    """Six terms: subsets that differ in five or six of them have no weight."""
    sizes = np.array([term.size for term in terms_by_name(SIX)])
    matrix = random.normal(size=(40, 6)) / sizes * [3.0, 0.4, 1.0, 2.0, 0.3, 0.5]
    matrix[:, 4] += 0.2 * matrix[:, 2]
    right = matrix @ (sizes * [1.0, 0.2, -0.7, 0.0, 0.9, -0.5]) + random.normal(size=40)
    triangle = Triangle(SIX)
    triangle.add_triangle(np.asfortranarray(np.column_stack([matrix, right])), 40)
    search = _Search(triangle, scale)
    for fitted in (SIX[:1], (SIX[0], SIX[2], SIX[4]), SIX):
        found = search.selection(fitted)
        assert (found.names, found.kept) == (fitted, ())
        np.testing.assert_allclose(found.widening, widening_by_hand(search, matrix, right, fitted, ()), rtol=1e-5)


def test_the_widening_of_terms_that_depend_on_a_kept_one_is_over_subsets_with_it():
    matrix = matrix_of(9.0, 0.15)
    right = matrix @ (SIZE_S * np.array([0.006, 0.3])) + [0.4, -0.3]
    search = search_of(matrix, right)
    found = search.selection(LAGS[:1])
    assert (found.names, found.kept) == (LAGS, LAGS[1:])
    np.testing.assert_allclose(found.widening, widening_by_hand(search, matrix, right, LAGS, LAGS[1:]), rtol=1e-5)
    assert np.max(found.widening) > 1.02


@pytest.mark.parametrize("orbit", [None, PassPriors.of_orbit(100.0)], ids=["white", "orbit"])
@pytest.mark.parametrize("form", ["printed", "rotation"])
def test_all_candidates_about_their_fit_are_that_fit_with_what_is_held(campaign, table_1, form, orbit):
    names = ("azimuth_offset", "azimuth_velocity_lag", "mislevel_east", "elevation_offset", "elevation_velocity_lag")
    held = {name: value for name, value in table_1.coefficients.items() if name not in names}
    data = campaign(table_1, passes=8, form=form)
    fit = fit_bias_model(data, terms=names, held=held, pass_priors=orbit, options=FitOptions(form=form, edit_sigma=0.0))
    search = _Search.of(data, names, held, orbit, fit)
    assert search.triangle.rows == 2 * len(data)
    square, values, covariance = search.solve(names)
    assert np.max(np.abs(values - fit.values) / fit.sigma) < 0.01
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), fit.sigma, rtol=1e-3)
    # With the terms that are held the data are as good as stated.
    assert square == pytest.approx(2.0 * len(data), rel=0.2)


def test_terms_that_are_held_are_taken_off_before_others_are_chosen(campaign, table_1):
    """What one misses the others would take in."""
    model = table_1.zero().replace(azimuth_offset=2e-3, elevation_offset=-1e-3)
    data = campaign(model, passes=8)
    names = ("collimation", "droop", "mislevel_east")
    held = {name: value for name, value in model.coefficients.items() if name not in names}
    assert select_terms(data, names, held=held).names == ()
    assert {"collimation", "droop"} <= set(select_terms(data, names).names)
    assert held_out_passes(data, names, held=held).total_rms_rad < 1.6e-4
    assert held_out_passes(data, names).total_rms_rad > 2e-4


@pytest.mark.parametrize(("gain", "moves"), [(-5e-5, False), (5e-5, False), (2e-4, True)])
def test_a_term_enters_that_lowers_the_criterion_by_more_than_rounding(gain, moves):
    triangle = Triangle(NAMES[:1])
    triangle.add_triangle(np.array([[1.0, np.sqrt(np.log(40.0) + gain)], [0.0, 1.0]]), 40)
    search = _Search(triangle, 1.0)
    without, having = search.bic(()), search.bic(NAMES[:1])
    assert without - having == pytest.approx(gain, abs=1e-9)
    assert search.best_move(frozenset(), without) == ((NAMES[0], having) if moves else None)


def test_of_equal_moves_the_first_by_name_is_taken():
    assert _least([(1.0, "b"), (1.00009, "a"), (1.00011, "A"), (2.0, "c")]) == ("a", 1.00009)


def test_a_selection_that_goes_on_and_on_is_refused(campaign, table_1, monkeypatch):
    monkeypatch.setattr(term_selection, "_MOST_STEPS", 2)
    model = table_1.zero().replace(azimuth_offset=2e-3, elevation_offset=-1e-3)
    data = campaign(model, passes=6)
    assert select_terms(data, ("azimuth_offset",)).names == ("azimuth_offset",)
    with pytest.raises(ValueError, match="term selection has not settled after 2 steps"):
        select_terms(data, ("azimuth_offset", "elevation_offset"))
    with pytest.raises(ValueError, match="no term squint"):
        select_terms(data, ("azimuth_offset", "squint"))


@pytest.mark.parametrize(("apart", "separate"), [(1.05, True), (0.95, False)])
def test_terms_are_separate_from_a_ratio_of_singular_values_of_a_billionth_on(apart, separate):
    """Of columns 2e-9 apart: what they differ by explains the data, or nothing does."""
    triangle = Triangle(NAMES[:2])
    triangle.factor = np.array([[1.0, 1.0, 0.0], [0.0, 2e-9 * apart, 1.0]])
    square, values, _ = _Search(triangle, 1.0).solve(NAMES[:2])
    assert square == pytest.approx(0.0 if separate else 1.0, abs=1e-6)
    assert bool(np.max(np.abs(values)) > 1.0) is separate


@pytest.mark.parametrize(("length", "counts"), [(1.05e-13, True), (0.95e-13, False)])
def test_a_column_of_rounding_explains_nothing(length, counts):
    triangle = Triangle(NAMES[:2])
    triangle.factor = np.array([[1.0, 0.0, 0.0], [0.0, length, 1.0]])
    square, values, covariance = _Search(triangle, 1.0).solve(NAMES[:2])
    assert square == pytest.approx(0.0 if counts else 1.0, abs=1e-9)
    assert bool(values[1] != 0.0) is counts
    assert covariance[0, 0] == pytest.approx(1.0)


def test_data_of_no_degree_of_freedom_are_judged_by_one(campaign, table_1):
    """Two points against four terms of the azimuth, which leave the elevations as they are."""
    data = campaign(table_1, passes=1).select([0, 40])
    names = ("azimuth_offset", "collimation", "azimuth_encoder_sine", "azimuth_second_sine")
    held = {name: 0.0 for name in TERM_NAMES if name not in names}
    search = _Search.of(data, names, held, None, None)
    left = np.sum((data.residual_elevation_rad / data.sigma_elevation_rad) ** 2)
    assert left > 100.0
    assert search.scale == pytest.approx(left, rel=1e-6)


@pytest.mark.parametrize(("scale", "kept"), [(1.0, LAGS[1:]), (3.6, LAGS[1:]), (4.4, ())])
def test_what_would_be_a_guess_is_told_by_the_noise_of_the_data(scale, kept):
    """The second lag is known to half of its usual size, times the root of the noise."""
    matrix = matrix_of(20.0, 0.5)
    search = replace(search_of(matrix, matrix @ [SIZE_S, 0.0]), scale=scale)
    assert search.selection(LAGS[:1]).kept == kept
