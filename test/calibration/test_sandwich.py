from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.calibration import FitOptions, fit_bias_model, held_at_zero
from rf_pointing.calibration.sandwich import sandwich_covariance

TERMS = ("azimuth_offset", "elevation_offset", "mislevel_east", "mislevel_north", "droop")
SANDWICH = FitOptions(covariance="sandwich", edit_sigma=0.0)


def test_sandwich_is_the_spread_of_fits_without_one_pass(campaign, table_1):
    data = campaign(table_1, passes=15)
    held = {name: table_1.coefficients[name] for name in held_at_zero(TERMS)}
    plain = FitOptions(edit_sigma=0.0)
    full = fit_bias_model(data, terms=TERMS, held=held, options=SANDWICH)
    left_out = [
        fit_bias_model(data.select(data.pass_id != p), terms=TERMS, held=held, options=plain).values for p in range(15)
    ]
    jackknife = (np.array(left_out) - full.values).T @ (np.array(left_out) - full.values)
    assert np.allclose(full.covariance, jackknife, rtol=1e-6)


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


def test_too_few_passes_are_refused(campaign, table_1):
    with pytest.raises(ValueError, match="passes=4 must be >= 5"):
        fit_bias_model(campaign(table_1, passes=4), options=SANDWICH)


def test_a_pass_that_alone_determines_a_term_is_named():
    rows = [(k, np.array([[1.0, 1.0 if k == 3 else 0.0], [1.0, 0.0]]), np.array([0.1, -0.1])) for k in range(6)]
    matrix = np.concatenate([r for _, r, _ in rows])
    with pytest.raises(ValueError, match="pass 3 alone determines tilt"):
        sandwich_covariance(("offset", "tilt"), np.linalg.inv(matrix.T @ matrix), rows)
