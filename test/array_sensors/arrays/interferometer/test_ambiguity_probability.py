import math

import numpy as np
import pytest
from scipy.special import erf

from rf_pointing.array_sensors.arrays.interferometer.ambiguity_probability import (
    chain_error_rate,
    lane_sigma,
    required_ratio,
    step_error_probability,
    total_error_probability,
)

PRINTED = 3e-6


def ratio(db: float) -> float:
    return 10.0 ** (0.1 * db)


@pytest.mark.parametrize(
    ("nu", "db", "printed"),
    [(6, 10, 0.2070590), (5, 10, 0.1252906), (3, 10, 0.0079278), (4, 15, 0.0005309), (10, 22, 0.0033716)],
)
def test_step_probability_is_table_7_1(nu: float, db: float, printed: float) -> None:
    assert step_error_probability(nu, ratio(db)) == pytest.approx(printed, abs=PRINTED)


def test_step_probability_is_the_error_function_of_half_a_lane() -> None:
    sigma = math.sqrt((36 - 6 + 1) / (2 * math.pi**2 * 50.0))
    assert lane_sigma(6.0, 50.0) == pytest.approx(sigma)
    assert step_error_probability(6.0, 50.0) == pytest.approx(1.0 - erf(1 / (2 * math.sqrt(2) * sigma)), abs=1e-15)


def test_required_ratio_returns_the_probability() -> None:
    for nu in (2.0, 6.0, 40.0):
        for p in (1e-9, 1e-4, 0.3):
            assert step_error_probability(nu, required_ratio(nu, p)) == pytest.approx(p, rel=1e-9)


def test_scatter_of_the_unrounded_lane_is_lane_sigma(rng) -> None:
    phases = rng.normal(0.0, 1.0 / math.sqrt(30.0), (200_000, 3))
    unrounded = (-5.0 * phases[:, 0] + 6.0 * phases[:, 1] - phases[:, 2]) / (2.0 * math.pi)
    assert np.std(unrounded) == pytest.approx(lane_sigma(6.0, 30.0), rel=0.01)


def test_the_step_to_the_carrier_itself_is_1_37_db_worse() -> None:
    gain = (lane_sigma(6.0, 10.0, "carrier") / lane_sigma(6.0, 10.0)) ** 2
    assert 10.0 * math.log10(gain) == pytest.approx(1.37, abs=0.005)


def test_union_bound_overstates_the_chain_of_seven_steps_at_low_ratio(rng) -> None:
    rate, spread = chain_error_rate(6.1324, ratio(18.0), 9, 200_000, rng)
    assert rate == pytest.approx(0.0133, abs=5.0 * spread)
    bound = total_error_probability(6.1324, ratio(18.0), 7)
    assert bound == pytest.approx(0.0137, abs=1e-4)
    rate, _ = chain_error_rate(6.1324, ratio(14.0), 9, 100_000, rng)
    assert rate == pytest.approx(0.26, abs=0.01)
    assert total_error_probability(6.1324, ratio(14.0), 7) == pytest.approx(0.355, abs=0.002)


def test_total_is_capped_at_one_and_bad_input_is_refused() -> None:
    assert total_error_probability(10.0, 1.0, 8) == 1.0
    with pytest.raises(ValueError, match=r"snr=0.0"):
        lane_sigma(6.0, 0.0)
    with pytest.raises(ValueError, match="step='both' must be one of difference, carrier"):
        lane_sigma(6.0, 1.0, "both")
    with pytest.raises(ValueError, match=r"probability=0.0"):
        required_ratio(6.0, 0.0)
