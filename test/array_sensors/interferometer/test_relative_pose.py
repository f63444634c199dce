import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import (
    attitude_from_euler,
    direction_from_angles,
    euler_from_attitude,
    forward_angles,
)
from rf_pointing.array_sensors.interferometer.relative_pose import (
    RelativePose,
    TwoWayPose,
    attitude_from_two_way,
    pose_from_two_way,
    reverse_direction,
    two_way_from_attitude,
    two_way_from_pose,
)

MICRODEGREE = 1e-6


def test_worked_example_of_the_two_way_conversion(worked_example) -> None:
    xi, attitude = worked_example
    np.testing.assert_allclose(
        attitude,
        [[0.951251, 0.167731, 0.258819], [-0.265099, 0.873545, 0.408218], [-0.157619, -0.456930, 0.875426]],
        atol=5e-7,
    )
    np.testing.assert_allclose(reverse_direction(xi, attitude), [-0.764413, -0.055077, 0.642371], atol=5e-7)
    seen = np.degrees(two_way_from_attitude(*np.radians([30.0, 20.0]), attitude))
    np.testing.assert_allclose(seen, [-175.878915, -39.968811, 24.424864], atol=MICRODEGREE)


def test_two_way_set_returns_the_attitude_on_random_poses(poses) -> None:
    directions, attitudes = poses
    azimuth, elevation = forward_angles(directions)
    seen = two_way_from_attitude(azimuth, elevation, attitudes)
    np.testing.assert_allclose(attitude_from_two_way(azimuth, elevation, *seen), attitudes, atol=1e-14)


def test_zero_attitude_sees_the_opposite_direction_without_roll() -> None:
    azimuth, elevation, roll = two_way_from_attitude(0.3, -0.2, np.eye(3))
    np.testing.assert_allclose([azimuth, elevation, roll], [0.3 - np.pi, 0.2, 0.0], atol=1e-15)


@pytest.mark.parametrize("roll", [np.pi, -np.pi, np.pi - 1e-9])
def test_half_a_turn_of_roll_returns(roll: float) -> None:
    pose = pose_from_two_way(
        TwoWayPose(
            range_m=50.0, azimuth1_rad=0.1, elevation1_rad=0.2, azimuth2_rad=np.pi, elevation2_rad=-0.1, roll_rad=roll
        )
    )
    seen = two_way_from_pose(pose)
    assert abs(np.angle(np.exp(1j * (seen.roll_rad - roll)))) < 1e-13
    assert seen.range_m == pytest.approx(50.0)
    np.testing.assert_allclose(pose_from_two_way(seen).attitude, pose.attitude, atol=1e-13)
    np.testing.assert_allclose(np.degrees(euler_from_attitude(pose.attitude))[2] % 360.0, 180.0, atol=20.0)


def test_roll_is_refused_where_the_passive_array_sees_the_pole() -> None:
    attitude = attitude_from_euler(0.0, np.pi / 2.0, 0.0)
    with pytest.raises(ValueError, match=r"elevation2 is \+-90 deg"):
        two_way_from_attitude(0.0, 0.0, attitude)


@pytest.mark.parametrize(
    ("attitude", "message"),
    [
        (np.diag([1.0, 1.0, -1.0]), "reflection"),
        (1.01 * np.eye(3), "misses orthonormality by 0.0201"),
        (np.full((3, 3), np.nan), "must be finite"),
    ],
)
def test_an_attitude_that_is_no_rotation_is_refused(attitude, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        RelativePose(position_m=np.array([1.0, 0.0, 0.0]), attitude=attitude)


def test_a_pose_without_distance_is_refused() -> None:
    with pytest.raises(ValueError, match="away from the active array"):
        RelativePose(position_m=np.zeros(3), attitude=np.eye(3))
    with pytest.raises(ValueError, match=r"range_m=0.0 must be > 0"):
        TwoWayPose(range_m=0.0, azimuth1_rad=0, elevation1_rad=0, azimuth2_rad=0, elevation2_rad=0, roll_rad=0)
    with pytest.raises(ValueError, match=r"elevation1_rad=1.6"):
        TwoWayPose(range_m=1.0, azimuth1_rad=0, elevation1_rad=1.6, azimuth2_rad=0, elevation2_rad=0, roll_rad=0)


def test_pose_knows_its_range_and_direction() -> None:
    pose = RelativePose(position_m=40.0 * direction_from_angles(0.2, 0.1), attitude=np.eye(3))
    assert pose.range_m == pytest.approx(40.0)
    np.testing.assert_allclose(pose.direction, direction_from_angles(0.2, 0.1))
