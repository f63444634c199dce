import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams, two_way_ranges
from rf_pointing.array_sensors.arrays.interferometer.coupling import coupling_amplitudes
from rf_pointing.array_sensors.arrays.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
    rotation_vector,
)
from rf_pointing.array_sensors.arrays.interferometer.initializer import Geometry, geometry_from_pose, initialize
from rf_pointing.array_sensors.arrays.interferometer.tracking_filter import SequenceParams, track, track_once

ARRAYS = ArrayParams()
AHEAD = np.array([1.0, 0.0, 0.0])


def off_by(angle_deg: float) -> Geometry:
    angle = np.radians(angle_deg)
    return Geometry(
        range_m=np.array(1e4),
        forward=direction_from_angles(angle, 0.0),
        reverse=direction_from_angles(np.pi + angle, 0.0),
        roll_rad=np.array(angle),
    )


def errors_after(passes: int, angle_deg: float) -> tuple[float, float]:
    ranges = two_way_ranges(1e4 * AHEAD, np.eye(3), ARRAYS)
    params = SequenceParams(iterations=passes)
    found = track(off_by(angle_deg), ranges, coupling_amplitudes(AHEAD, np.eye(3)), ARRAYS, params).geometry
    return float(np.degrees(np.linalg.norm(found.forward - AHEAD))), float(np.degrees(abs(found.roll_rad)))


@pytest.mark.parametrize(
    ("angle", "passes", "direction", "roll"),
    [(45.0, 1, 0.145, 4.57), (45.0, 2, 5.4e-6, 5.79e-3), (80.0, 2, 7.15e-6, 0.704), (80.0, 3, 1e-9, 4.52e-5)],
)
def test_errors_shrink_as_published_from_45_and_80_degrees(
    angle: float, passes: int, direction: float, roll: float
) -> None:
    found_direction, found_roll = errors_after(passes, angle)
    assert found_direction == pytest.approx(direction, rel=0.01, abs=1e-8)
    assert found_roll == pytest.approx(roll, rel=0.01)


def test_two_passes_from_45_and_three_from_80_degrees_leave_less_than_a_hundredth_of_a_degree() -> None:
    assert max(errors_after(2, 45.0)) < 0.01
    assert max(errors_after(3, 80.0)) < 0.01


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


def test_stopped_and_resumed_sequence_gives_the_identical_result(worked_example) -> None:
    xi, attitude = worked_example
    ranges, amplitudes = two_way_ranges(70.0 * xi, attitude, ARRAYS), coupling_amplitudes(xi, attitude)
    whole = track(off_by(20.0), ranges, amplitudes, ARRAYS, SequenceParams(iterations=3))
    half = track(off_by(20.0), ranges, amplitudes, ARRAYS, SequenceParams(iterations=2))
    rest = track_once(half.geometry, ranges, amplitudes, ARRAYS, SequenceParams(iterations=3), half.excitation)
    np.testing.assert_array_equal(rest.geometry.forward, whole.geometry.forward)
    assert rest.geometry.roll_rad == whole.geometry.roll_rad


def test_measurements_of_no_distance_are_refused() -> None:
    with pytest.raises(ValueError, match=r"after the range step must be > 0"):
        track_once(off_by(0.0), -1e5 * np.ones((3, 3)), np.eye(2), ARRAYS, SequenceParams())
