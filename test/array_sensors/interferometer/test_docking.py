"""

The pose tracker with a clock: it tracks the simulated approach, coasts through silence, and refuses what is late.
"""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.quaternion import quaternion_from_matrix, quaternion_to_rotation_vector
from rf_pointing.array_sensors.interferometer.docking import (
    DockingMoment,
    RelativePoseTracker,
    SimulatedDocking,
    rep103_pose,
    true_pose,
)
from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler, frame_rotation, rep103_from_spacecraft
from rf_pointing.array_sensors.interferometer.motion import DockingApproach, RelativeMotion, moved
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from rf_pointing.array_sensors.interferometer.tracker import InterferometerTracker, PoseEstimate

START_S = 1_767_225_600.0
SYSTEM = InterferometerSystem()
SIGMAS = 4.5


@pytest.fixture
def estimate(rng) -> PoseEstimate:
    motion = RelativeMotion(
        position_m=np.array([50.0, 4.0, -7.0]), velocity_m_s=np.array([-0.3, 0.1, 0.2]),
        attitude=attitude_from_euler(0.4, -0.3, 1.1), rate_rad_s=np.array([0.02, -0.01, 0.03]),
    )  # fmt: skip
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


def lived(count: int) -> list[DockingMoment]:
    simulated = SimulatedDocking(
        SYSTEM, RadioParams(hardware_phase_rad=0.002), LinkParams(), DockingApproach(), start_s=START_S, seed=1
    )
    return [simulated.step(START_S + 2.0 * k) for k in range(1, count + 1)]


def tracker() -> RelativePoseTracker:
    return RelativePoseTracker(InterferometerTracker(system=SYSTEM), silence_s=5.0)


def test_pose_agrees_with_the_truth_from_the_first_sequence_on() -> None:
    running = tracker()
    for moment in lived(20):
        output = running.take(moment.measurement, START_S + 60.0)
        assert output.status == "tracking"
        found, truth = rep103_pose(output.estimate), true_pose(moment.motion)
        sigma = np.sqrt(np.diag(found.pose_covariance))
        assert np.all(np.abs(found.position_m - truth.position_m) < SIGMAS * sigma[:3])
        turn = quaternion_to_rotation_vector(quaternion_from_matrix(found.orientation @ truth.orientation.T))
        assert np.all(np.abs(turn) < SIGMAS * sigma[3:])


def test_sequence_is_stamped_in_its_middle_with_the_truth_of_that_instant() -> None:
    moment = lived(3)[-1]
    middle_s = START_S + 6.0 - 0.5 * SYSTEM.schedule.duration_s(SYSTEM.plan)
    assert moment.measurement.t_s == pytest.approx(middle_s, abs=1e-6)
    expected = DockingApproach().motion_at(middle_s - START_S)
    # A microsecond at a few metres per second, and the rounding of the time.
    np.testing.assert_allclose(moment.motion.position_m, expected.position_m, atol=1e-5)


def test_true_pose_is_the_motion_in_rep103_axes() -> None:
    moment = lived(1)[0]
    truth = true_pose(moment.motion)
    position, orientation = rep103_from_spacecraft(moment.motion.position_m, moment.motion.attitude)
    np.testing.assert_allclose(truth.position_m, position)
    np.testing.assert_allclose(truth.orientation, orientation)
    assert not truth.pose_covariance.any()


def test_silence_makes_the_pose_coast_and_at_last_drops_it() -> None:
    running, moments = tracker(), lived(5)
    for moment in moments:
        running.take(moment.measurement, START_S + 60.0)
    last_s = moments[-1].measurement.t_s
    assert running.watch(last_s + 5.0) is None
    output = running.watch(last_s + 5.5)
    assert output.status == "coasting"
    assert output.reason == "no measurement for 5.5 s, must be <= 5.0 s"
    assert output.estimate is not None
    assert running.watch(last_s + 40.0).status == "acquiring"


def test_measurement_that_was_only_delayed_still_counts_after_the_silence_was_noticed() -> None:
    running, prompt, moments = tracker(), tracker(), lived(6)
    for moment in moments[:2]:
        running.take(moment.measurement, START_S + 60.0)
        prompt.take(moment.measurement, START_S + 60.0)
    for ahead_s in (5.5, 8.0, 10.5, 13.0, 15.5, 18.0):
        assert running.watch(moments[1].measurement.t_s + ahead_s).status == "coasting"
    for moment in moments[2:]:
        late = running.take(moment.measurement, START_S + 60.0)
        assert late.status == "tracking"
        np.testing.assert_array_equal(
            late.estimate.covariance, prompt.take(moment.measurement, START_S + 60.0).estimate.covariance
        )


def test_nothing_is_said_before_the_first_measurement() -> None:
    assert tracker().watch(START_S) is None


def test_late_repeated_and_future_measurements_are_refused_and_change_nothing() -> None:
    running, moments = tracker(), lived(4)
    for moment in moments[:3]:
        running.take(moment.measurement, START_S + 8.0)
    state = running.state
    for measurement in (moments[1].measurement, moments[2].measurement):
        with pytest.raises(ValueError, match="is late"):
            running.take(measurement, START_S + 8.0)
    with pytest.raises(ValueError, match="ahead of the clock"):
        running.take(replace(moments[3].measurement, t_s=START_S + 100.0), START_S + 8.0)
    assert running.state is state
    assert running.take(moments[3].measurement, START_S + 8.0).status == "tracking"


def test_sequences_are_stamped_in_whole_microseconds() -> None:
    simulated = SimulatedDocking(SYSTEM, RadioParams(), LinkParams(), DockingApproach(), start_s=0.0, seed=1)
    # Half of 1.8 s before the end of the sequence.
    moment = simulated.step(3.1234564)
    assert moment.measurement.t_s == pytest.approx(2.223456, abs=1e-9)
    np.testing.assert_allclose(moment.motion.position_m, DockingApproach().pose_at(2.223456)[0], atol=1e-8)


def test_the_pose_is_dropped_for_good_only_once_it_is_too_old() -> None:
    running, moments = tracker(), lived(3)
    for moment in moments[:2]:
        running.take(moment.measurement, START_S + 60.0)
    last_s, state = moments[1].measurement.t_s, running.state
    limit_s = running.tracker.params.coast_limit_s
    assert running.watch(last_s + limit_s - 0.1).status == "coasting"
    assert running.state is state
    assert running.watch(last_s + limit_s + 0.1).status == "acquiring"
    assert running.state.filter is None
    assert running.take(moments[2].measurement, START_S + 60.0).status == "tracking"
