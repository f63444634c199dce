"""Start of the filter: alignment, the bank of turns, and convergence from any attitude at the first hand-off."""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import stations_along_track, view_stations
from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    AttitudeState,
    DirectionObservation,
    GateParams,
    ProcessNoiseParams,
    attitude_error,
    predict,
    start_state,
    update,
)
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams, orbit_point
from rf_pointing.array_sensors.attitude.quaternion import (
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    rotation_angle_between_rad,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams, propagate, rigid_inertia
from rf_pointing.array_sensors.doa.attitude_start import StartParams, aligned_start, best_of_bank, remaining, start_bank

GATE, START = GateParams(), StartParams()
SIGMA = 0.005


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(31)


def unit(stream: np.random.Generator, *shape: int) -> np.ndarray:
    v = stream.standard_normal(shape)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def seen(measured: np.ndarray, reference: np.ndarray) -> DirectionObservation:
    return DirectionObservation(measured, SIGMA**2 * (np.eye(3) - np.outer(measured, measured)), reference)


def test_aligned_start_puts_the_first_direction_where_it_belongs(stream: np.random.Generator) -> None:
    measured, reference = unit(stream, 3), unit(stream, 3)
    state = aligned_start(START, GATE, unit(stream, 4), np.zeros(3), seen(measured, reference))
    assert quaternion_to_matrix(state.quaternion) @ measured == pytest.approx(reference, abs=1e-12)


def test_bank_holds_a_member_within_15_degrees_of_any_attitude(stream: np.random.Generator) -> None:
    for _ in range(50):
        truth, reference = unit(stream, 4), unit(stream, 3)
        measured = quaternion_to_matrix(truth).T @ reference
        bank = start_bank(START, GATE, unit(stream, 4), np.zeros(3), seen(measured, reference))
        assert np.degrees(rotation_angle_between_rad(bank.quaternion, truth)).min() <= 15.0 + 1e-6


@pytest.mark.parametrize("seed", [1])
def test_bank_converges_from_any_attitude_within_30_seconds_of_the_first_hand_off(seed: int) -> None:
    orbit, stream, dt_s = SunSynchronousOrbitParams(), np.random.default_rng(seed), 0.5
    t_s = np.arange(250.0, 655.0, dt_s)
    view = view_stations(orbit, stations_along_track(orbit, 0.0), t_s)
    reference = view.reference[np.arange(len(t_s)), np.argmax(view.elevation_rad, axis=1)]
    frame_rate = orbit_point(orbit, t_s).frame_rate_rad_s
    inertia = rigid_inertia(SatelliteParams())
    known = KnownTorque(control_n_m=np.zeros(3), wheel_momentum_n_m_s=np.zeros(3), wheel_momentum_rate_n_m=np.zeros(3))
    quaternion = quaternion_from_rotation_vector(0.05 * stream.standard_normal(3))
    rate = quaternion_to_matrix(quaternion).T @ frame_rate[0]
    guess = rate + np.radians(0.5) * stream.standard_normal(3)
    first = quaternion_to_matrix(quaternion).T @ reference[0]
    bank = start_bank(START, GATE, unit(stream, 4), guess, seen(first, reference[0]))
    for k in range(1, len(t_s)):
        quaternion, rate = propagate(inertia, quaternion, rate, known, frame_rate[k - 1], dt_s)
        bank = predict(inertia, ProcessNoiseParams(), bank, known, frame_rate[k - 1], dt_s)
        measured = quaternion_to_matrix(quaternion).T @ reference[k] + SIGMA * stream.standard_normal(3)
        bank = update(bank, seen(measured / np.linalg.norm(measured), reference[k]), GATE)
    best = best_of_bank(bank)
    error = attitude_error(best, quaternion[None], rate[None])[0]
    assert np.degrees(np.linalg.norm(error[:3])) < 1.0
    assert np.degrees(np.linalg.norm(error[3:])) < 0.01


def members(turns_rad: list[float], misfits: list[float]) -> AttitudeState:
    """Return a bank turned about x, with sigmas of 0.1 rad and 0.01 rad/s."""
    quaternions = quaternion_from_rotation_vector(np.outer(turns_rad, [1.0, 0.0, 0.0]))
    bank = start_state(quaternions, np.zeros((len(turns_rad), 3)), 0.1, 0.01, GATE)
    return replace(bank, misfit=np.array(misfits))


def test_hypotheses_that_agree_with_the_best_or_fit_far_worse_are_given_up() -> None:
    """They agree while the squared difference over the covariance is at most 6: 0.2449 rad of 0.1 rad."""
    params = StartParams(decisive=20.0)
    bank = members([0.0, 0.24, 0.25, 1.0, 1.2, -0.25], [5.0, 5.5, 6.0, 25.0, 25.1, 24.9])
    kept = remaining(params, bank)
    assert kept.misfit.tolist() == [5.0, 6.0, 25.0, 24.9]
    # The best stays, wherever it is in the bank, and alone where all agree with it.
    assert remaining(params, members([0.1, 0.0, 0.2], [3.0, 2.0, 4.0])).misfit.tolist() == [2.0]


def test_a_difference_of_the_rates_counts_as_one_of_the_attitudes_does() -> None:
    bank = members([0.0, 0.0, 0.0], [1.0, 2.0, 3.0])
    bank = replace(bank, rate_rad_s=np.array([[0.0, 0.0, 0.0], [0.0, 0.024, 0.0], [0.0, 0.0, -0.025]]))
    assert remaining(StartParams(), bank).misfit.tolist() == [1.0, 3.0]
