"""Range, directions and roll from one set of ranges and couplings, with nothing known before."""

import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.interferometer.frames import forward_angles, reverse_angles
from rf_pointing.array_sensors.interferometer.initializer import (
    aperture_excess,
    direction_cosines,
    forward_direction,
    initialize,
    range_from_sum,
    reverse_direction_from_ranges,
)
from rf_pointing.array_sensors.interferometer.relative_pose import reverse_direction
from rf_pointing.array_sensors.interferometer.system import ArrayParams, two_way_ranges

UNEQUAL_ARRAYS = ArrayParams(radius_active_m=0.8, radius_passive_m=1.2, transponder_delay_m=7.0)
ARRAYS = ArrayParams()
TOLERANCE = 1e-5


def test_range_and_both_directions_of_far_poses(poses) -> None:
    directions, attitudes = poses
    facing = reverse_direction(directions, attitudes)[:, 0] < -0.2
    directions, attitudes, distance = directions[facing], attitudes[facing], 5e4
    ranges = two_way_ranges(distance * directions, attitudes, UNEQUAL_ARRAYS)
    found = range_from_sum(ranges, UNEQUAL_ARRAYS)
    np.testing.assert_allclose(found, distance, atol=1e-4)
    bias = 5.0 * 1.2 / distance
    np.testing.assert_allclose(forward_direction(ranges, found, UNEQUAL_ARRAYS), directions, atol=bias)
    expected = reverse_direction(directions, attitudes)
    np.testing.assert_allclose(reverse_direction_from_ranges(ranges, found, UNEQUAL_ARRAYS), expected, atol=bias)


def test_ranges_that_belong_to_no_direction_show_a_negative_square() -> None:
    *_, square = direction_cosines([1.5, -0.5, -1.0], 1.0)
    assert square < 0.0
    assert direction_cosines([0.1, 0.0, 0.2], 1.0)[2] > 0.9


def degrees(geometry) -> list[float]:
    angles = (*forward_angles(geometry.forward), *reverse_angles(geometry.reverse), geometry.roll_rad)
    return [float(np.degrees(angle)) for angle in angles]


def estimate(range_m: float, example):
    xi, attitude = example
    ranges = two_way_ranges(range_m * xi, attitude, ARRAYS)
    return initialize(ranges, coupling_amplitudes(xi, attitude), ARRAYS)


def test_worked_example_at_ten_metres_shows_the_parallel_path_bias(worked_example) -> None:
    found = estimate(10.0, worked_example)
    assert found.range_m == pytest.approx(10.0407844, abs=1e-7)
    expected = [29.07029, 19.56861, -175.94747, -38.76870, 23.80774]
    np.testing.assert_allclose(degrees(found), expected, atol=TOLERANCE)


@pytest.mark.parametrize(
    ("range_m", "azimuth", "elevation", "roll"),
    [(1e4, 29.999401, 19.999842, 24.424504), (1e5, 29.999940, 19.999984, 24.424828)],
)
def test_worked_example_far_away_holds_to_the_fifth_digit(
    worked_example, range_m: float, azimuth: float, elevation: float, roll: float
) -> None:
    found = degrees(estimate(range_m, worked_example))
    np.testing.assert_allclose([found[0], found[1], found[4]], [azimuth, elevation, roll], atol=TOLERANCE)


def test_a_wrong_lane_of_one_element_lies_outside_the_unit_circle(worked_example) -> None:
    xi, attitude = worked_example
    ranges = two_way_ranges(1e4 * xi, attitude, ARRAYS)
    assert max(aperture_excess(ranges, ARRAYS)) < 0.0
    ranges[0] += 3 * 0.7359
    expected = (xi[2] + 2.0 * 0.7359) ** 2 + xi[1] ** 2 - 1.0
    assert expected > 0.4
    assert aperture_excess(ranges, ARRAYS)[0] == pytest.approx(expected, abs=1e-3)


def test_negative_distance_is_refused(worked_example) -> None:
    xi, attitude = worked_example
    with pytest.raises(ValueError, match=r"from the nine ranges must be > 0"):
        initialize(-np.ones((3, 3)), coupling_amplitudes(xi, attitude), ARRAYS)


def test_arrays_half_a_metre_apart_are_told_where_they_are() -> None:
    small = ArrayParams(radius_active_m=0.01, radius_passive_m=0.01, transponder_delay_m=7.0)
    ranges = two_way_ranges([0.5, 0.0, 0.0], np.eye(3), small)
    found = initialize(ranges, np.eye(2), small)
    assert found.range_m == pytest.approx(0.5, abs=1e-3)
    np.testing.assert_allclose(found.position_m, [0.5, 0.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(found.reverse, [-1.0, 0.0, 0.0], atol=1e-3)


def test_directions_outside_the_unit_circle_are_put_on_its_edge() -> None:
    arrays = ArrayParams(radius_active_m=2.0, radius_passive_m=1.0)
    # s = (0, 1.2): the paths to element 1 are 2.4 m longer, those to 2 and 3 are 1.2 m shorter.
    ranges = 200.0 + np.array([[2.4], [-1.2], [-1.2]]) + np.zeros((3, 3))
    np.testing.assert_allclose(forward_direction(ranges, 100.0, arrays), [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(reverse_direction_from_ranges(ranges, 100.0, arrays), [-1.0, 0.0, 0.0], atol=1e-12)
    forward, reverse = aperture_excess(ranges, arrays)
    assert (forward, reverse) == (pytest.approx(0.44), pytest.approx(-1.0))
    # s = (0.5, -0.1) of the other array, element by element.
    root3 = np.sqrt(3.0)
    to_elements = np.array([-0.1, 0.5 * root3 / 2.0 + 0.05, -0.5 * root3 / 2.0 + 0.05])
    np.testing.assert_allclose(direction_cosines(3.0 * to_elements, 3.0), [0.5, -0.1, 0.74], atol=1e-12)
