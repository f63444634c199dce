"""The factor of sigma: its double sum over pairs of a pass, written out."""

import numpy as np
import pytest

from rf_pointing.calibration import FitOptions, PassPriors, fit_bias_model
from rf_pointing.calibration.fit import excess_of
from rf_pointing.calibration.noise import NoiseScale, noise_scale
from rf_pointing.calibration.noise import share_after_editing as share
from rf_pointing.calibration.pass_errors import pass_partials


def written_out(residuals, influence, passes, lags):
    """Return the sum of z z' over the sum of 1 - H, over pairs of a pass at most `lags` apart."""
    hat = influence @ influence.T
    size = len(residuals)
    pairs = [
        (i, k) for i in range(size) for k in range(size) if abs(i - k) <= lags and passes[i] == passes[k]
    ]  # fmt: skip
    total = sum(residuals[i] * residuals[k] for i, k in pairs)
    return total / sum(float(i == k) - hat[i, k] for i, k in pairs)


@pytest.mark.parametrize("correlated", [0, 2, 5])
def test_correlated_noise_is_summed_over_the_pairs_of_one_pass_as_far_as_it_shows(correlated, random):
    """Passes of which each begins with the sign that the one before did not have: across them nothing is summed."""
    size, length = 240, 40
    passes = np.repeat(np.arange(size // length) + 3, length)
    steps = random.normal(size=(size // length, length + correlated))
    noise = np.stack([steps[:, k : k + length] for k in range(correlated + 1)]).sum(axis=0).ravel()
    noise += np.where(passes % 2, 1.0, -1.0) * (1.0 if correlated else 0.0)
    influence, _ = np.linalg.qr(random.normal(size=(size, 6)))
    found = noise_scale(noise, influence, passes)
    lags = round(((found.uncertainty / found.factor) ** 2 * size / 2.0 - 1.0) / 2.0)
    assert found.factor == pytest.approx(written_out(noise, influence, passes, lags), rel=1e-9)
    assert found.uncertainty == pytest.approx(found.factor * np.sqrt(2.0 * (2 * lags + 1) / size), rel=1e-9)
    assert (lags == 0) if not correlated else (correlated <= lags < 40)
    # The first lag beyond is one whose products are noise.
    hat, pairs = influence @ influence.T, [k for k in range(size - lags - 1) if passes[k] == passes[k + lags + 1]]
    white = noise @ noise / (size - np.trace(hat))
    beyond = sum(noise[k] * noise[k + lags + 1] + white * hat[k, k + lags + 1] for k in pairs)
    assert beyond <= 2.0 * white * np.sqrt(len(pairs))


@pytest.mark.parametrize(
    ("factors", "uncertainties", "excess"),
    [
        ((1.5, 2.5), (0.3, 0.4), 2.0),
        ((1.4, 1.7), (0.3, 0.4), 1.55),
        # Two sigma of a mean of two are those of each, added in squares and halved: 0.5.
        ((1.5, 1.4), (0.3, 0.4), 1.0),
        ((1.4, 1.5), (0.3, 0.4), 1.0),
        ((1.56, 1.46), (0.3, 0.4), 1.51),
        ((0.3, 0.5), (0.0, 0.0), 1.0),
    ],
)
def test_sigma_is_raised_by_an_excess_beyond_its_own_two_sigma_only(factors, uncertainties, excess):
    noise = tuple(NoiseScale(*pair) for pair in zip(factors, uncertainties, strict=True))
    assert excess_of(noise) == pytest.approx(excess)


@pytest.mark.parametrize("orbit", [None, PassPriors(along_track_m=200.0, clock_s=0.02)], ids=["none", "own"])
def test_the_noise_of_a_fit_counts_what_terms_and_errors_of_the_passes_take_out(campaign, table_1, partials, orbit):
    """Against the hat matrix of all columns at once, the priors of the passes' errors among the rows."""
    data = campaign(table_1, passes=5).select(np.arange(0, 400, 4))
    terms = ("azimuth_offset", "mislevel_east", "elevation_offset", "droop")
    options = FitOptions(edit_sigma=2.5, scale_covariance=True)
    held = {name: value for name, value in table_1.coefficients.items() if name not in terms}
    fit = fit_bias_model(data, terms=terms, held=held, pass_priors=orbit, options=options)
    assert not np.all(fit.used)
    columns = [np.concatenate(partials(data.motion(), terms)) / 1e-4]
    prior = np.zeros((0, 4))
    if orbit is not None:
        own = np.concatenate(pass_partials(data, orbit.names)) / 1e-4
        of_pass = np.tile(data.pass_id, 2)[:, np.newaxis]
        columns += [np.where(of_pass == number, own, 0.0) for number in data.passes]
        count = len(data.passes)
        prior = np.column_stack([np.zeros((2 * count, 4)), np.diag(np.tile(1.0 / orbit.sigma, count))])
    matrix = np.concatenate(columns, axis=1)
    rows = np.concatenate([matrix[np.tile(fit.used, 2)], prior])
    scale = np.linalg.norm(rows, axis=0)
    root = np.linalg.cholesky(np.linalg.inv((rows / scale).T @ (rows / scale)))
    influence = matrix / scale @ root
    size, order = len(data), np.flatnonzero(fit.used)
    for axis, residual in enumerate((fit.residual_azimuth_rad, fit.residual_elevation_rad)):
        expected = noise_scale(residual[order] / 1e-4 / share(2.5), influence[axis * size + order], data.pass_id[order])
        assert fit.noise[axis].factor == pytest.approx(expected.factor, rel=1e-6)
        assert fit.noise[axis].uncertainty == pytest.approx(expected.uncertainty, rel=1e-6)


@pytest.mark.parametrize(("taken", "factor"), [(1.5, 10.0), (1.9, 25.0)])
def test_half_a_degree_of_freedom_is_used_down_to_a_tenth_of_the_data(taken, factor):
    found = noise_scale(np.array([1.0, 2.0]), np.sqrt(np.array([[0.5 * taken], [0.5 * taken]])), np.array([3, 4]))
    assert found.factor == pytest.approx(factor)
    assert found.uncertainty == pytest.approx(factor)
