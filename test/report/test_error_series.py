"""The Gaussian beam and the statistics of single sets of errors."""

import math

import numpy as np
import pytest

from rf_pointing.geometry import MDEG
from rf_pointing.report.error_series import gaussian_loss_db, statistics_of


@pytest.mark.parametrize("beamwidth_mdeg", [17.0, 65.0, 264.0])
def test_half_a_beamwidth_costs_half_the_power(beamwidth_mdeg: float) -> None:
    loss = gaussian_loss_db(np.array([0.5 * beamwidth_mdeg]), np.array([beamwidth_mdeg]))
    assert loss[0] == pytest.approx(10.0 * math.log10(2.0), rel=1e-14)


def test_loss_is_that_of_the_exponential_beam(rng_errors: np.ndarray) -> None:
    gain = np.exp(-4.0 * math.log(2.0) * np.square(rng_errors / 65.0))
    assert np.allclose(gaussian_loss_db(rng_errors, np.full(200, 65.0)), -10.0 * np.log10(gain), rtol=1e-12, atol=1e-12)


@pytest.fixture
def rng_errors() -> np.ndarray:
    return np.random.default_rng(7).uniform(0.0, 120.0, 200)


def test_statistics_of_a_known_set() -> None:
    error = np.array([[3.0, 4.0], [-3.0, 4.0], [0.0, 0.0], [6.0, -8.0]]) * MDEG
    found = statistics_of(error, np.full(4, 10.0) * MDEG)
    assert found.cross_elevation.rms_mdeg == pytest.approx(math.sqrt(54.0 / 4.0))
    assert found.elevation.max_mdeg == pytest.approx(8.0)
    assert found.radial.p95_mdeg == pytest.approx(np.percentile([5.0, 5.0, 0.0, 10.0], 95.0))
    assert found.mean_loss_db == pytest.approx(40.0 * math.log10(2.0) * (0.25 + 0.25 + 0.0 + 1.0) / 4.0)
    assert found.inside_half_power_percent == pytest.approx(75.0)


def test_no_samples_give_nulls() -> None:
    found = statistics_of(np.zeros((0, 2)), np.zeros(0))
    assert found.samples == 0
    assert (found.radial.rms_mdeg, found.mean_loss_db, found.inside_half_power_percent) == (None, None, None)


def test_unknown_beam_gives_errors_but_no_loss() -> None:
    found = statistics_of(np.ones((3, 2)) * MDEG, np.full(3, np.nan))
    assert found.radial.rms_mdeg == pytest.approx(math.sqrt(2.0))
    assert (found.mean_loss_db, found.inside_half_power_percent) == (None, None)
