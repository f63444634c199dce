import math

import pytest
from scipy.special import erf

from rf_pointing.papers.interferometer_design import (
    Requirements,
    carrier_count_row,
    lane_sigma,
    largest_phase_bias_rad,
    minimum_difference_hz,
    required_ratio,
    step_error_probability,
)


def test_step_probability_is_the_error_function_of_half_a_lane() -> None:
    sigma = math.sqrt((36 - 6 + 1) / (2 * math.pi**2 * 50.0))
    assert lane_sigma(6.0, 50.0) == pytest.approx(sigma)
    assert step_error_probability(6.0, 50.0) == pytest.approx(1.0 - erf(1 / (2 * math.sqrt(2) * sigma)), abs=1e-15)


def test_required_ratio_returns_the_probability() -> None:
    for nu in (2.0, 6.0, 40.0):
        for p in (1e-9, 1e-4, 0.3):
            assert step_error_probability(nu, required_ratio(nu, p)) == pytest.approx(p, rel=1e-9)


def test_the_step_to_the_carrier_itself_is_1_37_db_worse() -> None:
    gain = (lane_sigma(6.0, 10.0, "carrier") / lane_sigma(6.0, 10.0)) ** 2
    assert 10.0 * math.log10(gain) == pytest.approx(1.37, abs=0.005)


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match=r"range_m=0.0"):
        minimum_difference_hz(0.0, 6.0)
    with pytest.raises(ValueError, match=r"ratio=0.5"):
        largest_phase_bias_rad(0.5)
    with pytest.raises(ValueError, match=r"direction_sigma_rad=0.0"):
        Requirements(direction_sigma_rad=0.0)


def test_too_few_carriers_and_unknown_systems_are_refused() -> None:
    with pytest.raises(ValueError, match="carriers=2 must be >= 3"):
        carrier_count_row(2, "DFT")
    with pytest.raises(ValueError, match="system='PN'"):
        carrier_count_row(5, "PN")
