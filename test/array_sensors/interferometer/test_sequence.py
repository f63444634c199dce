import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.coupling import coupling_amplitudes, coupling_from_two_way
from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, direction_from_angles, rotation_vector
from rf_pointing.array_sensors.interferometer.initializer import (
    Geometry,
    geometry_from_pose,
    initialize,
    range_from_sum,
)
from rf_pointing.array_sensors.interferometer.relative_pose import reverse_direction, roll_from_directions
from rf_pointing.array_sensors.interferometer.sequence import (
    SequenceParams,
    direction_step,
    excitation_step,
    minimum_variance_step,
    range_step,
    roll_step,
    track,
    track_once,
    turned_direction,
)
from rf_pointing.array_sensors.interferometer.system import ArrayParams, two_way_ranges

UNEQUAL_ARRAYS = ArrayParams(radius_active_m=0.9, radius_passive_m=1.1, transponder_delay_m=2.0)
ARRAYS = ArrayParams()


def test_planted_parameters_return_from_correlated_measurements(rng) -> None:
    gradient, truth = rng.normal(size=(9, 4)), rng.normal(size=4)
    root = rng.normal(size=(9, 9))
    step, covariance = minimum_variance_step(gradient, gradient @ truth, root @ root.T)
    np.testing.assert_allclose(step, truth, atol=1e-9)
    np.testing.assert_allclose(covariance, np.linalg.inv(gradient.T @ np.linalg.inv(root @ root.T) @ gradient))


def test_stacks_are_solved_one_by_one(rng) -> None:
    gradient, innovation = rng.normal(size=(6, 5, 2)), rng.normal(size=(6, 5))
    stacked, _ = minimum_variance_step(gradient, innovation)
    np.testing.assert_allclose(stacked[3], minimum_variance_step(gradient[3], innovation[3])[0])


@pytest.mark.parametrize(
    ("gradient", "message"), [(np.zeros((3, 1)), "zero or undefined column"), (np.ones((3, 2)), "rank deficient")]
)
def test_undetermined_parameters_are_refused(gradient, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        minimum_variance_step(gradient, np.ones(3))


def test_a_covariance_that_is_singular_if_but_for_rounding_is_refused(rng) -> None:
    """A Cholesky factor exists or not by the last bits."""
    rounded = [root @ root.T for root in rng.normal(size=(50, 3, 2))]
    for covariance in (*rounded, np.diag([1.0, -1.0, 1.0]), np.diag([1.0, 0.0, 1.0])):
        with pytest.raises(ValueError, match="covariance is singular or not positive definite"):
            minimum_variance_step(np.array([[1.0], [2.0], [3.0]]), np.ones(3), covariance)


def test_true_gradients_remove_the_bias_that_the_sum_has_at_short_range(worked_example) -> None:
    xi, attitude = worked_example
    ranges = two_way_ranges(6.0 * xi, attitude, UNEQUAL_ARRAYS)
    published, _ = range_step(ranges, 6.0, xi, attitude, UNEQUAL_ARRAYS, "published")
    assert published == pytest.approx(range_from_sum(ranges, UNEQUAL_ARRAYS))
    assert published - 6.0 > 0.05
    distance = np.array(6.5)
    for _ in range(3):
        distance, variance = range_step(ranges, distance, xi, attitude, UNEQUAL_ARRAYS)
    assert distance == pytest.approx(6.0, abs=1e-9)
    assert variance == pytest.approx(1.0 / 36.0, rel=0.05)


def test_direction_step_meets_the_truth_at_any_range(worked_example) -> None:
    xi, attitude = worked_example
    for distance in (4.0, 1e4):
        ranges = two_way_ranges(distance * xi, attitude, UNEQUAL_ARRAYS)
        found = direction_from_angles(0.4, 0.45)
        for _ in range(8):
            found, _ = direction_step(ranges, distance, found, attitude, UNEQUAL_ARRAYS)
        np.testing.assert_allclose(found, xi, atol=1e-9)


def test_direction_covariance_tells_the_scatter(worked_example, rng) -> None:
    xi, attitude = worked_example
    sigma, distance = 1e-4, 1e4
    ranges = two_way_ranges(distance * xi, attitude, UNEQUAL_ARRAYS) + sigma * rng.normal(size=(4000, 3, 3))
    directions = np.tile(xi, (4000, 1))
    found, covariance = direction_step(ranges, distance, directions, attitude, UNEQUAL_ARRAYS, dither_rad=1e-4)
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


def off_by(angle_deg: float) -> Geometry:
    angle = np.radians(angle_deg)
    return Geometry(
        range_m=np.array(1e4), forward=direction_from_angles(angle, 0.0),
        reverse=direction_from_angles(np.pi + angle, 0.0), roll_rad=np.array(angle),
    )  # fmt: skip


@pytest.mark.parametrize("distance", [5.0, 300.0, 1e5])
def test_initialiser_and_sequence_meet_the_truth_on_random_poses(poses, distance: float) -> None:
    directions, attitudes = poses
    seen = geometry_from_pose(distance * directions, attitudes)
    ok = (directions[:, 0] > 0.7) & (seen.reverse[:, 0] < -0.7)
    directions, attitudes = directions[ok], attitudes[ok]
    ranges = two_way_ranges(distance * directions, attitudes, ARRAYS)
    amplitudes = coupling_amplitudes(directions, attitudes)
    first = initialize(ranges, amplitudes, ARRAYS)
    found = track(first, ranges, amplitudes, ARRAYS, SequenceParams(iterations=12)).geometry
    np.testing.assert_allclose(found.position_m, distance * directions, rtol=1e-7, atol=1e-7)
    turns = rotation_vector(found.attitude @ attitudes.transpose(0, 2, 1))
    assert np.max(np.abs(turns)) < 1e-7


def test_excitation_and_roll_are_tracked_together(worked_example) -> None:
    xi, attitude = worked_example
    ranges = two_way_ranges(200.0 * xi, attitude, ARRAYS)
    amplitudes = coupling_amplitudes(xi, attitude) * [0.6, 1.3]
    first = initialize(ranges, amplitudes, ARRAYS)
    params = SequenceParams(iterations=25, estimate_excitation=True)
    result = track(first, ranges, amplitudes, ARRAYS, params)
    np.testing.assert_allclose(result.excitation, [0.6, 1.3], atol=1e-6)
    expected = geometry_from_pose(200.0 * xi, attitude).roll_rad
    assert result.geometry.roll_rad == pytest.approx(expected, abs=1e-6)


def reverse_error(variant: str, distance: float, range_estimator: str = "corrected") -> float:
    xi = direction_from_angles(*np.radians([20.0, 10.0]))
    attitude = attitude_from_euler(*np.radians([30.0, 20.0, 40.0]))
    truth = geometry_from_pose(distance * xi, attitude)
    ranges = two_way_ranges(distance * xi, attitude, ARRAYS)
    params = SequenceParams(iterations=2, reverse_attitude=variant, range_estimator=range_estimator)
    found = track(truth, ranges, coupling_amplitudes(xi, attitude), ARRAYS, params).geometry
    return float(np.linalg.norm(found.reverse - truth.reverse))


def test_the_listings_reverse_attitude_costs_milliradians_at_ten_metres_and_nothing_far_away() -> None:
    assert reverse_error("published", 10.0, "published") == pytest.approx(9.56e-3, rel=0.005)
    assert reverse_error("corrected", 10.0, "published") == pytest.approx(1.57e-3, rel=0.005)
    assert reverse_error("published", 10.0) == pytest.approx(3.18e-3, rel=0.005)
    assert reverse_error("corrected", 10.0) < 1e-12
    assert reverse_error("published", 1e4) < 5e-6


def test_measurements_of_no_distance_are_refused() -> None:
    with pytest.raises(ValueError, match=r"after the range step must be > 0"):
        track_once(off_by(0.0), -1e5 * np.ones((3, 3)), np.eye(2), ARRAYS, SequenceParams())
