import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.frames import (
    attitude_from_euler,
    frame_rotation,
    rep103_from_spacecraft,
)
from rf_pointing.array_sensors.arrays.interferometer.motion import RelativeMotion, moved
from rf_pointing.array_sensors.arrays.interferometer.rep103 import rep103_pose
from rf_pointing.array_sensors.arrays.interferometer.tracker import PoseEstimate


@pytest.fixture
def estimate(rng) -> PoseEstimate:
    motion = RelativeMotion(
        position_m=np.array([50.0, 4.0, -7.0]),
        velocity_m_s=np.array([-0.3, 0.1, 0.2]),
        attitude=attitude_from_euler(0.4, -0.3, 1.1),
        rate_rad_s=np.array([0.02, -0.01, 0.03]),
    )
    root = rng.normal(size=(12, 12)) * 1e-4
    return PoseEstimate(t_s=1.0, motion=motion, covariance=root @ root.T, excitation=np.ones(2))


def test_pose_covariance_is_that_of_drawn_poses_about_the_fixed_axes(estimate, rng) -> None:
    sent = rep103_pose(estimate)
    drawn = rng.multivariate_normal(np.zeros(12), estimate.covariance, 20_000)
    position, orientation = rep103_from_spacecraft(
        estimate.motion.position_m + drawn[:, :3], frame_rotation(drawn[:, 6:9]) @ estimate.motion.attitude
    )
    turn = orientation @ sent.orientation.T
    rotation = np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]])
    measured = np.cov(np.concatenate([(position - sent.position_m).T, 0.5 * rotation]))
    scale = np.sqrt(np.diag(sent.pose_covariance))
    np.testing.assert_allclose(
        measured / np.outer(scale, scale), sent.pose_covariance / np.outer(scale, scale), atol=0.04
    )


def test_velocities_are_the_change_of_the_sent_pose(estimate) -> None:
    sent, step = rep103_pose(estimate), 1e-5
    later = moved(estimate.motion, step)
    position, orientation = rep103_from_spacecraft(later.position_m, later.attitude)
    np.testing.assert_allclose((position - sent.position_m) / step, sent.velocity_m_s, atol=1e-7)
    turn = (orientation - sent.orientation) @ sent.orientation.T / step
    np.testing.assert_allclose([turn[2, 1], turn[0, 2], turn[1, 0]], sent.angular_velocity_rad_s, atol=1e-6)


def test_covariances_stay_covariances(estimate) -> None:
    sent = rep103_pose(estimate)
    for covariance in (sent.pose_covariance, sent.twist_covariance):
        np.testing.assert_allclose(covariance, covariance.T)
        assert np.all(np.linalg.eigvalsh(covariance) > 0.0)
    assert np.trace(sent.twist_covariance[:3, :3]) == pytest.approx(np.trace(estimate.covariance[3:6, 3:6]))
