import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import direction_from_angles, roll_rotation
from rf_pointing.array_sensors.interferometer.system import ArrayParams
from rf_pointing.papers.interferometer_accuracy import direction_variance, direction_variance_from_gradients

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
