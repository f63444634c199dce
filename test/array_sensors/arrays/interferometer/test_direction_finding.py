import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams, two_way_ranges
from rf_pointing.array_sensors.arrays.interferometer.direction_finding import (
    direction_cosines,
    forward_direction,
    range_from_sum,
    reverse_direction_from_ranges,
    two_element_angle,
    two_element_phase,
)
from rf_pointing.array_sensors.arrays.interferometer.relative_pose import reverse_direction

ARRAYS = ArrayParams(radius_active_m=0.8, radius_passive_m=1.2, transponder_delay_m=7.0)


def test_range_and_both_directions_of_far_poses(poses) -> None:
    directions, attitudes = poses
    facing = reverse_direction(directions, attitudes)[:, 0] < -0.2
    directions, attitudes, distance = directions[facing], attitudes[facing], 5e4
    ranges = two_way_ranges(distance * directions, attitudes, ARRAYS)
    found = range_from_sum(ranges, ARRAYS)
    np.testing.assert_allclose(found, distance, atol=1e-4)
    bias = 5.0 * 1.2 / distance
    np.testing.assert_allclose(forward_direction(ranges, found, ARRAYS), directions, atol=bias)
    expected = reverse_direction(directions, attitudes)
    np.testing.assert_allclose(reverse_direction_from_ranges(ranges, found, ARRAYS), expected, atol=bias)


def test_two_elements_return_the_angle_of_their_phase(rng) -> None:
    angles = rng.uniform(-1.5, 1.5, 50)
    phase = two_element_phase(angles, 0.4, 0.12)
    np.testing.assert_allclose(two_element_angle(phase, 0.4, 0.12), angles, atol=1e-12)


def test_a_phase_beyond_the_baseline_is_refused() -> None:
    with pytest.raises(ValueError, match="must be <= 1: wrong cycle"):
        two_element_angle(2.0 * np.pi * 0.41 / 0.12, 0.4, 0.12)


def test_ranges_that_belong_to_no_direction_show_a_negative_square() -> None:
    *_, square = direction_cosines([1.5, -0.5, -1.0], 1.0)
    assert square < 0.0
    assert direction_cosines([0.1, 0.0, 0.2], 1.0)[2] > 0.9
