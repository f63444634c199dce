import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import direction_from_angles, forward_angles, reverse_angles
from rf_pointing.array_sensors.interferometer.relative_pose import (
    RelativePose,
    attitude_from_two_way,
    reverse_direction,
    roll_from_directions,
)


def test_worked_example_of_the_two_way_conversion(worked_example) -> None:
    xi, attitude = worked_example
    np.testing.assert_allclose(
        attitude,
        [[0.951251, 0.167731, 0.258819], [-0.265099, 0.873545, 0.408218], [-0.157619, -0.456930, 0.875426]],
        atol=5e-7,
    )
    np.testing.assert_allclose(reverse_direction(xi, attitude), [-0.764413, -0.055077, 0.642371], atol=5e-7)


def test_two_way_set_returns_the_attitude_on_random_poses(poses) -> None:
    directions, attitudes = poses
    azimuth, elevation = forward_angles(directions)
    back = reverse_direction(directions, attitudes)
    seen = *reverse_angles(back), roll_from_directions(directions, back, attitudes)
    np.testing.assert_allclose(attitude_from_two_way(azimuth, elevation, *seen), attitudes, atol=1e-14)


def test_a_pose_without_distance_or_rotation_is_refused() -> None:
    with pytest.raises(ValueError, match="misses orthonormality by 0.0201"):
        RelativePose(position_m=np.array([1.0, 0.0, 0.0]), attitude=1.01 * np.eye(3))
    with pytest.raises(ValueError, match="away from the active array"):
        RelativePose(position_m=np.zeros(3), attitude=np.eye(3))


def test_pose_knows_its_range_and_direction() -> None:
    pose = RelativePose(position_m=40.0 * direction_from_angles(0.2, 0.1), attitude=np.eye(3))
    assert pose.range_m == pytest.approx(40.0)
    np.testing.assert_allclose(pose.direction, direction_from_angles(0.2, 0.1))
