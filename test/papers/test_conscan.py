"""The formulas of the sigma against each other: eqs. (20), (21), (23) and (25)."""

import math

import pytest

from rf_pointing.core import MDEG
from rf_pointing.papers.conscan import conscan_sigma_eq20_rad, conscan_sigma_eq21_rad
from rf_pointing.tracking.conscan_design import conscan_loss, conscan_sigma_eq25_rad, conscan_slope

H, R = 17.0 * MDEG, 1.55 * MDEG


def test_equation_20_is_21_with_the_power_received() -> None:
    loss = conscan_loss(H, R) * conscan_loss(H, 5.0 * MDEG)
    direct = conscan_sigma_eq20_rad(H, R, 20, 0.01 / loss, 3.0 * MDEG)
    assert conscan_sigma_eq21_rad(H, R, 20, 0.01, 3.0 * MDEG, 5.0 * MDEG) == pytest.approx(direct, rel=1e-12)


def test_equation_25_is_23_with_the_block_v_receiver() -> None:
    direct = conscan_sigma_eq21_rad(H, R, 32, math.sqrt(2.0 / 1000.0), 0.0, 0.0)
    assert conscan_sigma_eq25_rad(H, R, 32, 30.0) == pytest.approx(direct, rel=1e-12)
    written_out = H / conscan_slope(H, R) * 2.0 / conscan_loss(H, R) / math.sqrt(32.0 * 1000.0)
    assert direct == pytest.approx(written_out, rel=1e-12)


def test_two_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="samples=2 must be >= 3"):
        conscan_sigma_eq20_rad(H, R, 2, 0.01, 0.0)
