import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import direction_from_angles, roll_rotation
from rf_pointing.array_sensors.interferometer.initializer import range_from_sum
from rf_pointing.array_sensors.interferometer.sequence import direction_step
from rf_pointing.array_sensors.interferometer.system import ArrayParams, CarrierPlan, two_way_ranges
from rf_pointing.papers.interferometer_accuracy import (
    chord_variance,
    direction_variance,
    direction_variance_from_gradients,
    range_covariance,
    range_noise,
    range_variance_from_gradients,
    range_variance_from_nine,
    roll_variance,
    roll_variance_from_gradients,
    sum_range_bias_m,
    two_way_phase_variance,
    two_way_range_sigma,
)

ARRAYS = ArrayParams()
SAME = np.eye(3)


@pytest.mark.parametrize("off_deg", [0.0, 15.0, 30.0, 45.0, 60.0])
def test_direction_variance_of_the_gradients_is_the_closed_form_and_the_printed_one_to_one_percent(off_deg) -> None:
    off = np.radians(off_deg)
    measured = direction_variance_from_gradients(1e4, direction_from_angles(off, 0.0), SAME, ARRAYS, dither_rad=1e-5)
    assert measured == pytest.approx(direction_variance(off), rel=2e-4)
    assert measured == pytest.approx(direction_variance(off, variant="published"), rel=0.01)


def test_the_printed_coefficient_is_the_listings_dither() -> None:
    # Around the boresight and up to 60 deg off, the dither of 0.01 rad moves 4/9 by up to one percent.
    values = []
    for off in np.radians([0.0, 20.0, 40.0, 60.0]):
        for roll in np.radians([0.0, 50.0, 130.0, 230.0, 310.0]):
            direction = roll_rotation(roll) @ direction_from_angles(off, 0.0)
            coefficient = direction_variance_from_gradients(1e4, direction, SAME, ARRAYS) * np.cos(off) ** 2
            values.append(coefficient)
    assert min(values) == pytest.approx(0.4409, abs=0.002)
    assert max(values) == pytest.approx(0.4484, abs=0.002)


def test_radius_not_diameter_is_one_metre() -> None:
    half = direction_variance_from_gradients(1e4, [1.0, 0.0, 0.0], SAME, ArrayParams(radius_active_m=0.5))
    assert half == pytest.approx(1.778, rel=2e-3)
    assert direction_variance(0.0, 0.5) == pytest.approx(16.0 / 9.0)
    assert direction_variance(0.0, 0.5, "published") == 0.4448


@pytest.mark.parametrize(("off_deg", "expected"), [(0.0, 0.4444), (45.0, 0.6667)])
def test_scatter_of_the_direction_is_the_chord_variance(rng, off_deg: float, expected: float) -> None:
    off = np.radians(off_deg)
    xi, sigma, trials = direction_from_angles(off, 0.0), 1e-4, 4000
    ranges = two_way_ranges(1e4 * xi, SAME, ARRAYS) + sigma * rng.normal(size=(trials, 3, 3))
    found, _ = direction_step(ranges, range_from_sum(ranges, ARRAYS), np.tile(xi, (trials, 1)), SAME, ARRAYS, 1e-4)
    scatter = np.mean(np.sum((found - xi) ** 2, axis=1)) / sigma**2
    assert chord_variance(off) == pytest.approx(expected, abs=1e-4)
    assert scatter == pytest.approx(expected, rel=4.0 / np.sqrt(trials))


def test_range_variance_is_one_36th_far_away_and_more_at_one_metre() -> None:
    ahead = [1.0, 0.0, 0.0]
    assert range_variance_from_gradients(1e4, ahead, SAME, ARRAYS) == pytest.approx(1.0 / 36.0, rel=1e-6)
    assert range_variance_from_gradients(1.0, ahead, SAME, ARRAYS) == pytest.approx(0.0392, abs=5e-5)


@pytest.mark.parametrize(
    ("active", "passive", "expected"),
    [(0, 0, 0.5), (45, 0, 0.667), (45, 45, 1.0), (60, 60, 2.0), (75, 45, 1.764), (75, 75, 7.464)],
)
def test_roll_variance_of_the_gradients_is_the_closed_form(active: float, passive: float, expected: float) -> None:
    offsets = np.radians([active, passive])
    assert roll_variance(*offsets) == pytest.approx(expected, abs=1e-3)
    assert roll_variance_from_gradients(*offsets) == pytest.approx(roll_variance(*offsets), rel=1e-4)


def test_roll_variance_with_roll_follows_the_closed_form(rng) -> None:
    for active, passive, roll in rng.uniform(-1.2, 1.2, (20, 3)):
        closed = roll_variance(active, passive, roll)
        assert roll_variance_from_gradients(active, passive, roll) == pytest.approx(closed, rel=1e-3)


def test_roll_variance_stays_below_two_while_one_offset_is_within_45_degrees() -> None:
    worst = max(
        roll_variance(np.radians(a), np.radians(b), roll)
        for a in np.linspace(0.0, 45.0, 10)
        for b in np.linspace(0.0, 89.9, 30)
        for roll in np.linspace(0.0, np.pi, 13)
    )
    assert 1.99 < worst < 2.0


@pytest.mark.parametrize("off_deg", [0.0, 45.0])
def test_bias_of_the_sum_at_short_range_is_the_closed_form(off_deg: float) -> None:
    xi = direction_from_angles(np.radians(off_deg), 0.0)
    measured = range_from_sum(two_way_ranges(30.0 * xi, SAME, ARRAYS), ARRAYS) - 30.0
    closed = sum_range_bias_m(30.0, np.radians(off_deg), np.radians(off_deg), ARRAYS)
    assert measured == pytest.approx(float(closed), rel=2e-3)


def test_off_boresight_beyond_the_horizon_is_refused() -> None:
    with pytest.raises(ValueError, match="off_boresight_rad"):
        direction_variance(np.pi / 2.0)
    with pytest.raises(ValueError, match="off_boresight_rad"):
        chord_variance(-0.1)


def test_noise_of_ranges_is_that_of_the_first_and_last_carrier_over_the_finest_lane() -> None:
    plan = CarrierPlan()
    forward = 100.0 + 50.0 * np.arange(plan.count)
    back = np.full((plan.count, 3, 3), 400.0)
    back[0], back[-1] = np.arange(1.0, 10.0).reshape(3, 3) * 100.0, 250.0
    noise = range_noise(forward, back, plan)
    lane = (plan.ambiguities_m[-1] / (2.0 * np.pi)) ** 2
    assert noise.common_m2 == pytest.approx(lane * (0.5 / forward[0] + 0.5 / forward[-1]))
    assert noise.path_m2 == pytest.approx(lane * (0.5 / back[0] + 0.5 / 250.0))
    covariance = range_covariance(noise)
    for i in range(9):
        for j in range(9):
            own = noise.path_m2.ravel()[i] if i == j else 0.0
            assert covariance[i, j] == pytest.approx(noise.common_m2 + own)


def test_a_distance_from_nine_ranges_keeps_what_they_have_in_common() -> None:
    # Half of the mean of nine: a quarter of its variance.
    assert range_variance_from_nine(8.0, 0.0) == pytest.approx(2.0)
    assert range_variance_from_nine(0.0, 36.0) == pytest.approx(1.0)
    assert range_variance_from_nine(1.0, 2.0, "published") == pytest.approx(0.834)


def test_phase_noise_of_both_links_adds_and_is_a_length_by_the_wavelength() -> None:
    assert two_way_phase_variance(50.0, 12.5) == pytest.approx(0.05)
    assert two_way_range_sigma(1e9, 0.04, 3e8) == pytest.approx(0.3 / (2.0 * np.pi) * 0.2)
    assert two_way_range_sigma(1e-3, 1.0, 1.0) == pytest.approx(1e3 / (2.0 * np.pi))
    with pytest.raises(ValueError, match="frequency_hz=0.0009"):
        two_way_range_sigma(9e-4, 1.0, 1.0)


def test_variances_scale_with_the_radius_and_end_just_below_the_horizon() -> None:
    off = np.radians(89.9)
    assert chord_variance(np.radians(60.0), 2.0) == pytest.approx(2.0 / 9.0 * 5.0 / 4.0)
    for variance in (direction_variance, chord_variance):
        assert variance(off) > 1e4
        with pytest.raises(ValueError, match="off_boresight_rad"):
            variance(off + 1e-6)


def test_bias_of_the_sum_has_a_part_of_either_array() -> None:
    arrays = ArrayParams(radius_active_m=2.0, radius_passive_m=3.0)
    assert sum_range_bias_m(10.0, 0.0, np.pi / 3.0, arrays) == pytest.approx((8.0 + 11.25) / 80.0)
