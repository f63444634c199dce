"""The filter as printed: what agrees with a multiplicative error, what does not, and where it equals ours.

The batch of filters: converges as promised, says what it ran, and refuses a mixture it cannot run.
"""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    PRINTED_Q,
    DirectionObservation,
    GateParams,
    start_state,
    update,
)
from rf_pointing.array_sensors.attitude.quaternion import (
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    rotation_angle_between_rad,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams, rigid_inertia
from rf_pointing.array_sensors.attitude.rotations import cross_matrix
from rf_pointing.papers.doa_study.attitude_runs import PublishedState, RunTask, published_predict, published_update, run
from rf_pointing.papers.doa_study.directions import DirectionCase

INERTIA = rigid_inertia(SatelliteParams())
NONE = KnownTorque(control_n_m=np.zeros(3), wheel_momentum_n_m_s=np.zeros(3), wheel_momentum_rate_n_m=np.zeros(3))
REFERENCE = np.array([0.48, -0.36, 0.8])
CLEAR = DirectionCase(snapshots=100, snr_db=0.0)
GRID = DirectionCase(snapshots=100, snr_db=0.0, refined=False)


def test_transition_is_unit_plus_slope_times_step() -> None:
    rate, dt_s = np.array([0.01, -0.02, 0.03]), 0.25
    state = PublishedState(rate, np.array([0.0, 0.0, 0.0, 1.0]), np.eye(6))
    moved = published_predict(INERTIA, 1e-9 * np.eye(6), state, NONE, np.zeros(3), dt_s)
    momentum = INERTIA.matrix @ rate
    upper = np.linalg.inv(INERTIA.matrix) @ (cross_matrix(momentum) - cross_matrix(rate) @ INERTIA.matrix)
    phi = np.eye(6) + dt_s * np.block([[upper, np.zeros((3, 3))], [0.5 * np.eye(3), -cross_matrix(rate)]])
    assert moved.covariance == pytest.approx(phi @ phi.T + 1e-9 * np.eye(6), abs=1e-12)


def test_published_and_multiplicative_updates_agree_near_the_identity() -> None:
    sigma, spread = 0.005, 0.02
    truth = quaternion_from_rotation_vector([1e-3, -2e-3, 1.5e-3])
    measured = quaternion_to_matrix(truth).T @ REFERENCE
    ours = update(
        start_state(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), spread, 1e-3, GateParams()),
        DirectionObservation(measured, sigma**2 * (np.eye(3) - np.outer(measured, measured)), REFERENCE),
        GateParams(),
    )
    start = np.diag([1e-6] * 3 + [spread**2 / 4] * 3)
    printed = published_update(
        PublishedState(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), start), measured, sigma**2 * np.eye(3), REFERENCE
    )
    assert float(rotation_angle_between_rad(ours.quaternion, printed.quaternion)) < 2e-5


def test_update_beyond_half_a_turn_is_clamped_to_a_unit_quaternion() -> None:
    q = quaternion_from_rotation_vector([3.0, 0.2, -0.1])
    state = PublishedState(np.zeros(3), q, np.diag([1e-6] * 3 + [4.0] * 3))
    after = published_update(state, -REFERENCE, 1e-6 * np.eye(3), REFERENCE)
    assert np.linalg.norm(after.quaternion) == pytest.approx(1.0, abs=1e-12)
    assert after.quaternion[3] >= 0.0


def test_negative_scalar_part_does_not_turn_the_update_around() -> None:
    q = quaternion_from_rotation_vector([0.02, 0.01, 0.0])
    covariance = np.diag([1e-6] * 3 + [1e-4] * 3)
    measured = quaternion_to_matrix(quaternion_from_rotation_vector([0.03, 0.0, 0.01])).T @ REFERENCE
    positive, negative = (
        published_update(PublishedState(np.zeros(3), sign * q, covariance), measured, 1e-5 * np.eye(3), REFERENCE)
        for sign in (1.0, -1.0)
    )
    assert float(rotation_angle_between_rad(positive.quaternion, negative.quaternion)) < 1e-12


def test_filters_converge_from_50_degrees_at_the_first_hand_off() -> None:
    task = RunTask(cases=(CLEAR, GRID), trials=2, seed=3, duration_s=680.0, settled_s=660.0, pool=2000)
    inside = replace(task, cases=(CLEAR,), music_inside=True)
    results = [*run(task), *run(inside)]
    assert [result.case for result in results] == [CLEAR, GRID, CLEAR]
    for result in results:
        assert result.history_deg.shape == (680, 2)
        assert result.history_deg[1].min() > 30.0
        assert result.history_deg[660:].max() < 1.0
        assert result.rate_history_deg_s[660:].max() < 0.05
        assert result.sigma_deg < 1.0
    assert results[0].theta_deg == pytest.approx(results[2].theta_deg, rel=0.15)


def test_printed_filter_with_the_printed_noise_predicts_degrees() -> None:
    case = DirectionCase(snapshots=100, snr_db=0.0, q=PRINTED_Q)
    (result,) = run(
        RunTask(cases=(case,), trials=1, seed=1, published=True, duration_s=400.0, settled_s=300.0, pool=1000)
    )
    assert result.sigma_deg > 1.0
    assert np.all(np.isfinite(result.history_deg))


def test_two_process_noises_in_one_task_are_refused() -> None:
    other = DirectionCase(snapshots=100, snr_db=0.0, q=PRINTED_Q)
    with pytest.raises(ValueError, match="cases differ in q"):
        run(RunTask(cases=(CLEAR, other), trials=1, seed=1, duration_s=10.0, settled_s=1.0, pool=1000))


def test_average_that_would_begin_after_the_end_is_refused() -> None:
    with pytest.raises(ValueError, match="settled_s="):
        run(RunTask(cases=(CLEAR,), trials=1, seed=1, duration_s=10.0, settled_s=10.0, pool=1000))


def test_no_trial_is_refused_and_averages_may_begin_at_once() -> None:
    task = RunTask(cases=(CLEAR,), trials=1, seed=1, duration_s=1.0, settled_s=0.0, pool=4)
    (result,) = run(task)
    assert result.history_deg.shape == (1, 1)
    assert result.theta_deg > 0.0
    (later,) = run(replace(task, settled_s=0.75))
    assert later.history_deg == pytest.approx(result.history_deg)
    for trials, settled_s, name in ((0, 0.0, "trials=0 must be >= 1"), (1, -0.1, "settled_s=-0.1 must be >= 0")):
        with pytest.raises(ValueError, match=name):
            run(replace(task, trials=trials, settled_s=settled_s))
