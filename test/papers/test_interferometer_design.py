""" """

import math

import numpy as np
import pytest
from scipy.special import erf

from rf_pointing.array_sensors.interferometer.radio import LinkParams
from rf_pointing.papers.interferometer_design import (
    Requirements,
    amplitude_ripple_db,
    carrier_count_row,
    carrier_tracking_design,
    difference_tracking_design,
    direction_requirement_m,
    lane_sigma,
    largest_phase_bias_rad,
    link_powers_w,
    minimum_difference_hz,
    phase_sigma_rad,
    range_requirement_m,
    required_ratio,
    roll_requirement_snr,
    step_error_probability,
)

PRINTED = 3e-6
REPORT = Requirements()
DB, RATIO = 0.1, 5.1e-4


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


def db(ratio: float) -> float:
    return 10.0 * math.log10(ratio)


def test_lowest_frequency_resolves_200_km_and_f0_leaves_room_for_noise() -> None:
    assert minimum_difference_hz(1e5, 6.0) == pytest.approx((1500.0, 1250.0))


def test_range_requirement_is_20_mm_not_the_printed_109_5() -> None:
    assert range_requirement_m(REPORT) == pytest.approx(0.0200, abs=1e-6)
    assert range_requirement_m(REPORT, "published") == pytest.approx(0.1095, abs=5e-5)


def test_direction_requirement_is_3_53_mm_and_the_printed_0_0333_rad_would_give_ten_times_that() -> None:
    assert direction_requirement_m(REPORT, "published") == pytest.approx(3.53e-3, abs=5e-6)
    assert direction_requirement_m(REPORT) == pytest.approx(3.5355e-3, abs=1e-6)
    misprint = REPORT.replace(direction_sigma_rad=0.0333)
    assert direction_requirement_m(misprint, "published") == pytest.approx(35.3e-3, abs=5e-5)


def test_a_one_metre_diameter_halves_the_direction_requirement() -> None:
    half = REPORT.replace(radius_m=0.5)
    assert direction_requirement_m(half) == pytest.approx(1.768e-3, abs=1e-6)
    ratio = carrier_tracking_design(half).snr_direction / carrier_tracking_design(REPORT).snr_direction
    assert db(ratio) == pytest.approx(6.02, abs=0.01)


def test_carrier_tracking_chain_of_the_report() -> None:
    design = carrier_tracking_design(REPORT, variant="published")
    assert design.wavelength_m == pytest.approx(0.120)
    assert design.phase_sigma_rad == pytest.approx(0.185, abs=5e-4)
    assert math.degrees(design.phase_sigma_rad) == pytest.approx(10.6, abs=0.05)
    assert design.snr_direction == pytest.approx(29.22, abs=0.05)
    assert db(design.snr_direction) == pytest.approx(14.7, abs=0.05)
    assert db(design.snr_ambiguity) == pytest.approx(19.7, abs=0.05)
    assert math.degrees(design.phase_bias_rad) == pytest.approx(25.71, abs=0.01)


def test_printed_ratio_of_the_carrier_chain_follows_from_the_rounded_phase() -> None:
    for phases, rounded_rad, printed in ((1.0, 0.185, 29.22), (2.0, 0.00739, 36621.9)):
        assert phases / rounded_rad**2 == pytest.approx(printed, rel=2e-4)


def test_difference_tracking_chain_of_the_report() -> None:
    design = difference_tracking_design(REPORT, variant="published")
    assert design.wavelength_m == pytest.approx(3.0)
    assert design.phase_sigma_rad == pytest.approx(0.00739, abs=2e-5)
    assert math.degrees(design.phase_sigma_rad) == pytest.approx(0.423, abs=1.5e-3)
    assert db(design.snr_direction) == pytest.approx(45.6, abs=0.05)


def test_roll_requirement_and_ripple() -> None:
    assert roll_requirement_snr(REPORT) == pytest.approx(1e4)
    assert amplitude_ripple_db(REPORT) == pytest.approx(0.061, abs=5e-4)
    assert phase_sigma_rad(0.06, 0.12) == pytest.approx(math.pi)


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match=r"range_m=0.0"):
        minimum_difference_hz(0.0, 6.0)
    with pytest.raises(ValueError, match=r"ratio=0.5"):
        largest_phase_bias_rad(0.5)
    with pytest.raises(ValueError, match=r"direction_sigma_rad=0.0"):
        Requirements(direction_sigma_rad=0.0)


@pytest.mark.parametrize(
    ("system", "carriers", "ratio", "snr_db"),
    [
        ("CFT", 2, 1666666.667, 110.0),
        ("CFT", 4, 118.563, 45.6),
        ("CFT", 9, 5.994, 19.7),
        ("CFT", 22, 1.978, 10.0),
        ("DFT", 2, 66666.667, 102.9),
        ("DFT", 8, 4.888, 20.7),
        ("DFT", 14, 2.350, 14.2),
        ("DFT", 25, 1.589, 13.0),
    ],
)
def test_published_rows_of_table_8_1(system: str, carriers: int, ratio: float, snr_db: float) -> None:
    row = carrier_count_row(carriers, system, variant="published")
    assert row.ratio == pytest.approx(ratio, abs=RATIO)
    assert row.snr_db == pytest.approx(snr_db, abs=DB)
    assert row.step_probability == pytest.approx(0.001 / (carriers - 1))


def test_without_the_solvers_limit_two_carriers_need_127_85_db() -> None:
    assert carrier_count_row(2, "CFT").snr_db == pytest.approx(127.85, abs=0.01)


def test_difference_tracking_has_one_step_less_than_the_table_counts() -> None:
    corrected, above = carrier_count_row(8, "DFT"), carrier_count_row(7, "DFT", variant="published")
    assert corrected.ratio == pytest.approx(6.368, abs=RATIO)
    assert corrected.ratio == above.ratio
    assert corrected.snr_db == pytest.approx(23.06, abs=0.01)


def test_powers_of_both_designs() -> None:
    assert link_powers_w(40.0, 1e5, 3.42e9, 2.42e9, LinkParams()) == pytest.approx((2.1342, 1.0686), rel=1e-4)
    assert link_powers_w(46.0, 1e5, 2.5e9, 1.7e9, LinkParams()) == pytest.approx((4.5400, 2.0993), rel=1e-4)


def test_too_few_carriers_and_unknown_systems_are_refused() -> None:
    with pytest.raises(ValueError, match="carriers=2 must be >= 3"):
        carrier_count_row(2, "DFT")
    with pytest.raises(ValueError, match="system='PN'"):
        carrier_count_row(5, "PN")
