"""Complex response of a sensor to a motion of the beam."""

import math

import numpy as np
import pytest

from rf_pointing.core import random_stream
from rf_pointing.tracking.response import ResponseSums


@pytest.mark.parametrize("response", [1.0, -1.0, 2.5 * np.exp(0.7j)])
def test_planted_response_is_recovered_within_its_stated_spread(response: complex) -> None:
    deviations = []
    for run in range(200):
        rng = random_stream(run, "response")
        sums = ResponseSums()
        for _ in range(20):
            moved = complex(*rng.standard_normal(2))
            change = -response * moved + 0.3 * complex(*rng.standard_normal(2))
            sums = sums.with_pair(moved, change, 0.09)
        found = sums.estimate()
        assert found is not None
        deviations += [(found.value - response).real / found.sigma, (found.value - response).imag / found.sigma]
    # 400 normalised deviations: mean known to 0.05, spread to 3.5 %.
    assert np.mean(deviations) == pytest.approx(0.0, abs=0.2)
    assert np.std(deviations) == pytest.approx(1.0, abs=0.14)


def test_faded_past_counts_less() -> None:
    sums = ResponseSums().with_pair(1.0, -1.0, 1.0).faded(0.25).with_pair(1.0, 1.0, 1.0)
    found = sums.estimate()
    assert found is not None
    assert found.value == pytest.approx((0.25 - 1.0) / 1.25)
    assert found.sigma == pytest.approx(1.0 / math.sqrt(1.25))


def test_beam_that_did_not_move_has_no_response() -> None:
    assert ResponseSums().with_pair(0j, 1.0, 1.0).estimate() is None


def test_change_without_variance_is_refused() -> None:
    with pytest.raises(ValueError, match=r"variance_rad2=0.0 must be > 0"):
        ResponseSums().with_pair(1.0, 1.0, 0.0)
