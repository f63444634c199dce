import math

import pytest

from rf_pointing.array_sensors.arrays.interferometer.design import (
    Requirements,
    amplitude_ripple_db,
    carrier_tracking_design,
    difference_tracking_design,
    direction_requirement_m,
    largest_phase_bias_rad,
    minimum_difference_hz,
    phase_sigma_rad,
    range_requirement_m,
    roll_requirement_snr,
)

REPORT = Requirements()


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
    assert db(design.snr_required) == pytest.approx(40.0)
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
    assert design.snr_required == design.snr_direction


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
