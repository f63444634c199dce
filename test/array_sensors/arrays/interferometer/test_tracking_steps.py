import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams, two_way_ranges
from rf_pointing.array_sensors.arrays.interferometer.coupling import coupling_amplitudes, coupling_from_two_way
from rf_pointing.array_sensors.arrays.interferometer.direction_finding import range_from_sum
from rf_pointing.array_sensors.arrays.interferometer.frames import attitude_from_euler, direction_from_angles
from rf_pointing.array_sensors.arrays.interferometer.relative_pose import reverse_direction, roll_from_directions
from rf_pointing.array_sensors.arrays.interferometer.tracking_steps import (
    direction_step,
    excitation_step,
    range_step,
    roll_step,
    turned_direction,
)

ARRAYS = ArrayParams(radius_active_m=0.9, radius_passive_m=1.1, transponder_delay_m=2.0)


def test_true_gradients_remove_the_bias_that_the_sum_has_at_short_range(worked_example) -> None:
    xi, attitude = worked_example
    ranges = two_way_ranges(6.0 * xi, attitude, ARRAYS)
    published, _ = range_step(ranges, 6.0, xi, attitude, ARRAYS, "published")
    assert published == pytest.approx(range_from_sum(ranges, ARRAYS))
    assert published - 6.0 > 0.05
    distance = np.array(6.5)
    for _ in range(3):
        distance, variance = range_step(ranges, distance, xi, attitude, ARRAYS)
    assert distance == pytest.approx(6.0, abs=1e-9)
    assert variance == pytest.approx(1.0 / 36.0, rel=0.05)


@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_range_step_forgives_a_factor_of_ten(worked_example, factor: float) -> None:
    xi, attitude = worked_example
    ranges = two_way_ranges(50.0 * xi, attitude, ARRAYS)
    distance = np.array(50.0 * factor)
    for _ in range(4):
        distance, _ = range_step(ranges, distance, xi, attitude, ARRAYS)
    assert distance == pytest.approx(50.0, abs=1e-9)


def test_direction_step_meets_the_truth_at_any_range(worked_example) -> None:
    xi, attitude = worked_example
    for distance in (4.0, 1e4):
        ranges = two_way_ranges(distance * xi, attitude, ARRAYS)
        found = direction_from_angles(0.4, 0.45)
        for _ in range(8):
            found, _ = direction_step(ranges, distance, found, attitude, ARRAYS)
        np.testing.assert_allclose(found, xi, atol=1e-9)


def test_direction_covariance_tells_the_scatter(worked_example, rng) -> None:
    xi, attitude = worked_example
    sigma, distance = 1e-4, 1e4
    ranges = two_way_ranges(distance * xi, attitude, ARRAYS) + sigma * rng.normal(size=(4000, 3, 3))
    directions = np.tile(xi, (4000, 1))
    found, covariance = direction_step(ranges, distance, directions, attitude, ARRAYS, dither_rad=1e-4)
    turns = np.linalg.norm(found - xi, axis=1) ** 2
    moves = np.stack([turned_direction(xi, 1e-6, 0.0) - xi, turned_direction(xi, 0.0, 1e-6) - xi], axis=1) / 1e-6
    expected = 3.0 * sigma**2 * np.trace(moves @ covariance[0] @ moves.T)
    assert np.mean(turns) == pytest.approx(expected, rel=0.06)


def test_turned_direction_is_the_rotation_to_first_order() -> None:
    turned = turned_direction([1.0, 0.0, 0.0], 1e-3, 2e-3)
    np.testing.assert_allclose(turned, direction_from_angles(1e-3, 2e-3), atol=1e-8)


def test_roll_step_wraps_at_half_a_turn() -> None:
    forward, reverse = direction_from_angles(0.2, 0.1), direction_from_angles(3.0, -0.2)
    truth = np.pi - 0.01
    amplitudes = coupling_from_two_way(forward, reverse, truth)
    roll = np.array(-np.pi + 0.05)
    for _ in range(4):
        roll, _ = roll_step(amplitudes, forward, reverse, roll, dither_rad=1e-4)
    assert roll == pytest.approx(truth, abs=1e-9)


def test_excitation_factors_return_from_one_step(worked_example) -> None:
    xi, attitude = worked_example
    reverse = reverse_direction(xi, attitude)
    roll = roll_from_directions(xi, reverse, attitude)
    amplitudes = coupling_amplitudes(xi, attitude) * [0.7, 1.2]
    factors, covariance = excitation_step(amplitudes, xi, reverse, roll)
    np.testing.assert_allclose(factors, [0.7, 1.2], atol=1e-13)
    columns = coupling_amplitudes(xi, attitude)
    np.testing.assert_allclose(np.diag(covariance), 1.0 / np.sum(columns**2, axis=0))


def test_excitation_of_a_dipole_along_the_path_is_refused() -> None:
    attitude = attitude_from_euler(np.pi / 2.0, 0.0, 0.0)
    xi = np.array([1.0, 0.0, 0.0])
    assert np.allclose(coupling_amplitudes(xi, attitude)[:, 0], 0.0)
    with pytest.raises(ValueError, match="points along the path"):
        excitation_step(np.zeros((2, 2)), xi, reverse_direction(xi, attitude), 0.0)
