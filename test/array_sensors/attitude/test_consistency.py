"""Consistency: planted covariances give the chi-square mean, and NaN is refused."""

import numpy as np
import pytest
from scipy.stats import chi2

from rf_pointing.array_sensors.attitude.consistency import nees, nees_band


def test_errors_of_the_stated_covariance_score_their_dimension() -> None:
    stream = np.random.default_rng(9)
    root = stream.standard_normal((4, 4))
    errors = stream.standard_normal((50_000, 4)) @ root.T
    assert np.mean(nees(errors, root @ root.T)) == pytest.approx(4.0, abs=0.06)


def test_band_is_the_chi_square_interval() -> None:
    assert nees_band(6, 200) == pytest.approx((chi2.ppf(0.025, 1200) / 200, chi2.ppf(0.975, 1200) / 200), rel=1e-9)


def test_error_that_is_not_a_number_is_refused() -> None:
    with pytest.raises(ValueError, match=r"error=.* must be finite"):
        nees(np.array([[np.nan, 0.0]]), np.eye(2))
