"""The Gaussian beam: half the power at half the half-power beamwidth, and decibels that are those of the gain."""

import math

import numpy as np
import pytest

from rf_pointing.core import gaussian_gain, gaussian_loss_db


@pytest.mark.parametrize("beamwidth_mdeg", [17.0, 65.0, 264.0])
def test_half_a_beamwidth_costs_half_the_power(beamwidth_mdeg: float) -> None:
    assert gaussian_gain(0.5 * beamwidth_mdeg, beamwidth_mdeg) == pytest.approx(0.5, rel=1e-14)
    loss = gaussian_loss_db(np.array([0.5 * beamwidth_mdeg]), np.array([beamwidth_mdeg]))
    assert loss[0] == pytest.approx(10.0 * math.log10(2.0), rel=1e-14)


def test_loss_is_that_of_the_exponential_beam(random: np.random.Generator) -> None:
    errors = random.uniform(0.0, 120.0, 200)
    gain = np.exp(-4.0 * math.log(2.0) * np.square(errors / 65.0))
    np.testing.assert_allclose(gaussian_gain(errors, 65.0), gain, rtol=1e-12)
    assert np.allclose(gaussian_loss_db(errors, np.full(200, 65.0)), -10.0 * np.log10(gain), rtol=1e-12, atol=1e-12)
