"""The size of the orbit's errors is found from the passes themselves, and a sigma that ignores them is doubted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rf_pointing.calibration import (
    FitOptions,
    PassPriors,
    fit_bias_model,
    held_at_zero,
    measured_pass_priors,
    warnings_of,
)
from rf_pointing.calibration.outlying_passes import free_errors, pass_correlation
from rf_pointing.calibration.pass_errors import pass_partials

TERMS = ("azimuth_offset", "azimuth_velocity_lag", "mislevel_east", "elevation_offset", "elevation_velocity_lag")
NAMES = ("along_track_m", "cross_track_m", "radial_m")
PASSES = 24


def shifted(data, metres):
    """Return the data with the orbit of each pass wrong by its row of `metres`."""
    azimuth, elevation = pass_partials(data, NAMES)
    own = metres[data.pass_id]
    return replace(
        data,
        observed_azimuth_rad=data.observed_azimuth_rad + np.sum(azimuth * own, axis=1),
        observed_elevation_rad=data.observed_elevation_rad + np.sum(elevation * own, axis=1),
    )


def fit_with(data, priors):
    return fit_bias_model(data, terms=TERMS, held=held_at_zero(TERMS), pass_priors=priors)


@pytest.fixture
def planted(table_1):
    return table_1.replace(**held_at_zero(TERMS))


@pytest.mark.parametrize("along_m", [200.0, 1000.0])
def test_sizes_are_measured_and_sigma_holds_where_a_white_one_is_far_too_small(campaign, planted, random, along_m):
    clean = campaign(planted, passes=PASSES)
    metres = random.normal(size=(PASSES, 3)) * [along_m, 60.0, 30.0]
    data = shifted(clean, metres)
    sizes = measured_pass_priors(lambda priors, _: fit_with(data, priors))[0]
    actual = np.sqrt(np.mean(metres**2, axis=0))
    # The size of a normal distribution from 24 passes is known to 15 %; what is left of it is the settling.
    assert sizes.along_track_m == pytest.approx(actual[0], rel=0.2)
    assert sizes.cross_track_m == pytest.approx(actual[1], rel=0.4)
    truth = np.array([planted.coefficients[name] for name in TERMS])
    honest, white = fit_with(data, sizes), fit_with(data, None)
    assert np.max(np.abs(honest.values - truth) / honest.sigma) < 3.5
    assert np.max(np.abs(white.values - truth) / white.sigma) > 6.0


@pytest.mark.parametrize(("noise_rad", "largest_m"), [(1e-4, 40.0), (4e-6, 2.0)])
def test_a_perfect_orbit_costs_next_to_nothing(campaign, planted, noise_rad, largest_m):
    """Also where a metre shows."""
    data = campaign(planted, passes=PASSES, sigma_rad=noise_rad)
    sizes = measured_pass_priors(lambda priors, _: fit_with(data, priors))[0]
    assert max(sizes.sigma) < largest_m
    assert fit_with(data, sizes).sigma == pytest.approx(fit_with(data, None).sigma, rel=0.5)


def test_a_white_sigma_is_doubted_when_the_orbit_is_off_and_only_then(campaign, planted, random):
    clean = campaign(planted, passes=PASSES)
    data = shifted(clean, random.normal(size=(PASSES, 3)) * [300.0, 0.0, 0.0])
    assert warnings_of(fit_with(clean, None), clean) == ()
    assert pass_correlation(fit_with(clean, None), clean) == pytest.approx(1.0, abs=0.2)
    assert "the orbit of each pass is off" in warnings_of(fit_with(data, None), data)[0]


def test_priors_that_are_too_narrow_are_doubted_by_name(campaign, planted, random):
    data = shifted(campaign(planted, passes=PASSES), random.normal(size=(PASSES, 3)) * [300.0, 0.0, 0.0])
    priors = PassPriors(along_track_m=60.0, cross_track_m=60.0, radial_m=60.0)
    (doubt,) = warnings_of(fit_with(data, priors), data)
    assert doubt.startswith("along_track_m of the passes is ")
    assert warnings_of(fit_with(data, priors.replace(along_track_m=300.0)), data) == ()


def test_a_pass_that_was_edited_out_whole_is_named(campaign, planted):
    data = campaign(planted, passes=PASSES)
    observed = data.observed_azimuth_rad.copy()
    observed[data.pass_id == 5] += 0.03
    late = replace(data, observed_azimuth_rad=observed)
    assert "pass 5 was edited out whole" in warnings_of(fit_with(late, None), late)[0]


def test_the_search_is_bounded(campaign, planted):
    data, rounds = campaign(planted, passes=4), []

    def counted(priors, _):
        rounds.append(priors)
        return fit_bias_model(
            data, terms=TERMS, held=held_at_zero(TERMS), pass_priors=priors, options=FitOptions(edit_sigma=0.0)
        )

    start = PassPriors(along_track_m=500.0)
    assert 0.5 <= measured_pass_priors(counted, start)[0].along_track_m <= 500.0
    assert len(rounds) <= 6


def test_the_correlation_of_residuals_is_the_size_of_their_sums_over_that_of_independent_ones(random):
    pass_id = np.repeat([3, 7, 8], [5, 20, 40])
    used = random.random(65) < 0.8
    azimuth, elevation = random.normal(size=(2, 65)) + np.where(pass_id == 7, 1.5, 0.0)
    sigma = random.uniform(0.5, 2.0, (2, 65))
    fit = SimpleNamespace(residual_azimuth_rad=azimuth, residual_elevation_rad=elevation, used=used)
    points = SimpleNamespace(sigma_azimuth_rad=sigma[0], sigma_elevation_rad=sigma[1], pass_id=pass_id)
    squares = []
    for residual, spread in ((azimuth, sigma[0]), (elevation, sigma[1])):
        scale = np.sqrt(np.mean((residual / spread)[used] ** 2))
        for number in (3, 7, 8):
            own = (residual / spread / scale)[used & (pass_id == number)]
            squares.append(np.sum(own) ** 2 / len(own))
    assert pass_correlation(fit, points) == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-12)


def test_errors_that_nothing_holds_differ_as_those_planted_do_within_their_covariance(campaign, planted, random):
    """An error that is common to all passes is a lag: only their differences are known."""
    metres = random.normal(size=(8, 3)) * [4000.0, 0.0, 0.0]
    data, start = shifted(campaign(planted, passes=8), metres), PassPriors(along_track_m=200.0)
    along, covariance = free_errors(fit_with(data, start), start, "along_track_m")
    apart = np.eye(8) - 1.0 / 8.0
    left, spread = apart @ (along - metres[:, 0]), apart @ covariance @ apart.T
    assert np.max(np.abs(left) / np.sqrt(np.diag(spread))) < 3.5
    assert np.sqrt(np.max(np.diag(spread))) < 100.0


@pytest.mark.parametrize("start", [PassPriors.of_orbit(1000.0), PassPriors(along_track_m=50.0, clock_s=0.001)])
def test_the_sizes_found_are_those_that_a_fit_with_them_shows(campaign, planted, random, start):
    """The fixed point s^2 = sum v^2 / sum (1 - p^2 / s^2), over an error and its drift.

    What the angles hardly show, as a clock next to errors along the track, keeps its size.
    """
    data = shifted(campaign(planted, passes=PASSES), random.normal(size=(PASSES, 3)) * [300.0, 120.0, 200.0])
    sizes = measured_pass_priors(lambda priors, _: fit_with(data, priors), start)[0]
    assert sizes.names == start.names
    assert sizes.clock_s == start.clock_s
    fit = fit_with(data, sizes)
    values, sigma = (
        np.array([[getattr(one, kind)[name] for name in sizes.names] for one in fit.pass_errors])
        for kind in ("values", "sigma")
    )
    shown = np.sum(1.0 - (sigma / sizes.sigma) ** 2, axis=0)
    square = np.sum((values / sizes.sigma) ** 2, axis=0)
    for group in set(sizes.groups):
        own = np.array(sizes.groups) == group
        if np.sum(shown[own]) < 1.0:
            assert np.array_equal(sizes.sigma[own], start.sigma[own])
            continue
        assert np.sum(shown[own]) > 3.0
        assert np.sum(square[own]) == pytest.approx(np.sum(shown[own]), rel=0.06)
        np.testing.assert_allclose((sizes.sigma / start.sigma)[own], (sizes.sigma / start.sigma)[group], rtol=1e-9)
