import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import (
    ArrayParams,
    element_positions,
    path_lengths,
    path_rates_m_s,
    two_way_gradients,
    two_way_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.frames import frame_rotation

UNEQUAL = ArrayParams(radius_active_m=0.7, radius_passive_m=1.3, transponder_delay_m=4.0)


def test_elements_sum_to_zero_120_degrees_apart_in_the_plane_across_boresight() -> None:
    elements = element_positions(0.5)
    np.testing.assert_allclose(elements.sum(axis=0), 0.0, atol=1e-16)
    np.testing.assert_array_equal(elements[:, 0], 0.0)
    np.testing.assert_allclose(np.linalg.norm(elements[1:], axis=1), 0.5)
    np.testing.assert_allclose(elements[1] @ elements[2], 0.25 * np.cos(np.radians(120.0)))
    np.testing.assert_allclose(elements[1], [0.0, 0.0, -0.5])
    assert elements[2, 1] < 0.0


def test_far_away_a_path_is_shorter_by_the_elements_projection(poses) -> None:
    directions, attitudes = poses
    distance = 1e6
    lengths = path_lengths(distance * directions, attitudes, UNEQUAL)
    active, passive = element_positions(0.7), element_positions(1.3)
    towards = np.einsum("nk,ik->ni", directions, active)[:, :, None]
    back = np.einsum("nkl,nl,jk->nj", attitudes, -directions, passive)[:, None, :]
    np.testing.assert_allclose(lengths, distance - towards - back, atol=3e-6)


def test_two_way_range_is_out_through_the_centres_and_back_by_the_elements(worked_example) -> None:
    xi, attitude = worked_example
    lengths = path_lengths(20.0 * xi, attitude, UNEQUAL)
    ranges = two_way_ranges(20.0 * xi, attitude, UNEQUAL)
    assert lengths[0, 0] == pytest.approx(20.0)
    np.testing.assert_allclose(ranges, lengths[1:, 1:] + 20.0 + 4.0)


def test_gradients_agree_with_differences_at_short_range(worked_example) -> None:
    xi, attitude = worked_example
    position, step = 3.0 * xi, 1e-6
    by_position, by_attitude = two_way_gradients(position, attitude, UNEQUAL)
    for axis in range(3):
        move = step * np.eye(3)[axis]
        change = two_way_ranges(position + move, attitude, UNEQUAL) - two_way_ranges(position - move, attitude, UNEQUAL)
        np.testing.assert_allclose(by_position[..., axis], change / (2 * step), atol=1e-8)
        turned = [two_way_ranges(position, frame_rotation(s * move) @ attitude, UNEQUAL) for s in (1, -1)]
        np.testing.assert_allclose(by_attitude[..., axis], (turned[0] - turned[1]) / (2 * step), atol=1e-8)


def test_path_rates_are_the_derivative_of_the_lengths(worked_example) -> None:
    xi, attitude = worked_example
    position, velocity, rate, step = 5.0 * xi, np.array([-0.3, 0.2, 0.1]), np.array([0.2, -0.1, 0.3]), 1e-5
    later, earlier = (
        path_lengths(position + s * step * velocity, frame_rotation(s * step * rate) @ attitude, UNEQUAL)
        for s in (1, -1)
    )
    rates = path_rates_m_s(position, velocity, attitude, rate, UNEQUAL)
    np.testing.assert_allclose(rates, (later - earlier) / (2 * step), atol=1e-9)


def test_a_vanishing_array_is_refused() -> None:
    with pytest.raises(ValueError, match=r"radius_active_m=0.0 must be >= 0.001"):
        ArrayParams(radius_active_m=0.0)
