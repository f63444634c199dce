import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import direction_from_angles, roll_rotation
from rf_pointing.array_sensors.interferometer.initializer import range_from_sum
from rf_pointing.array_sensors.interferometer.sequence import direction_step
from rf_pointing.array_sensors.interferometer.system import ArrayParams, two_way_ranges
from rf_pointing.papers.interferometer_accuracy import (
    chord_variance,
    direction_variance,
    direction_variance_from_gradients,
    range_variance_from_gradients,
    roll_variance,
    roll_variance_from_gradients,
    sum_range_bias_m,
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
