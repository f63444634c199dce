"""Process noise: the paper's Q per step and ours per second are the same random walk.

Multiplicative filter: transition and update against differences, consistency, gate, start from half a turn.
"""

from dataclasses import replace

import numpy as np
import pytest

from rf_pointing.array_sensors.attitude.ground_stations import stations_along_track, view_stations
from rf_pointing.array_sensors.attitude.multiplicative_filter import (
    TABLE_Q,
    AttitudeState,
    DirectionObservation,
    GateParams,
    ProcessNoiseParams,
    attitude_error,
    carried_back,
    innovation,
    predict,
    process_noise_from_q,
    rotation_between,
    start_state,
    update,
)
from rf_pointing.array_sensors.attitude.orbits import SunSynchronousOrbitParams, orbit_point
from rf_pointing.array_sensors.attitude.quaternion import (
    multiply,
    quaternion_from_rotation_vector,
    quaternion_to_matrix,
    rotation_angle_between_rad,
)
from rf_pointing.array_sensors.attitude.rigid_body import KnownTorque, SatelliteParams, propagate, rigid_inertia
from rf_pointing.array_sensors.attitude.rotations import cosine_slopes, cross_matrix, tangent_rows
from rf_pointing.array_sensors.doa.simulated_satellite import NadirHoldParams, SimulatedSatellite
from rf_pointing.papers.doa_study.future_work import nees, nees_band

INERTIA = rigid_inertia(SatelliteParams())
ORBIT_RATE = np.array([0.0, -1.038e-3, 0.0])
KNOWN = KnownTorque(
    control_n_m=np.array([1e-4, 2e-4, -1e-4]),
    wheel_momentum_n_m_s=np.array([0.3, -0.2, 0.4]),
    wheel_momentum_rate_n_m=np.zeros(3),
)
SILENT = ProcessNoiseParams(attitude_rad2_s=0.0, rate_rad2_s3=0.0, torque_n_m=0.0)
GATE = GateParams()


def test_table_value_is_the_default() -> None:
    assert process_noise_from_q(TABLE_Q) == ProcessNoiseParams(torque_n_m=0.0)


def test_q_on_the_vector_part_is_four_q_on_the_rotation() -> None:
    noise = process_noise_from_q(3e-10, dt_s=0.5)
    assert noise.attitude_rad2_s * 0.5 == pytest.approx(4 * 3e-10)
    assert noise.rate_rad2_s3 * 0.5 == pytest.approx(3e-10)


@pytest.fixture
def stream() -> np.random.Generator:
    return np.random.default_rng(614)


def unit(stream: np.random.Generator, *shape: int) -> np.ndarray:
    v = stream.standard_normal(shape)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def across(direction: np.ndarray, sigma: float) -> np.ndarray:
    return sigma**2 * (np.eye(3) - direction[..., :, None] * direction[..., None, :])


def test_transition_is_the_derivative_of_the_motion(stream: np.random.Generator) -> None:
    q, w, h = unit(stream, 4), 0.02 * stream.standard_normal(3), 1e-6
    state = AttitudeState(q, w, np.eye(6), np.array(0), np.array(0.0))
    moved = predict(INERTIA, SILENT, state, KNOWN, ORBIT_RATE, 0.25)

    def shifted(e: np.ndarray) -> np.ndarray:
        start = multiply(quaternion_from_rotation_vector(e[:3]), q)
        end = propagate(INERTIA, start, w + e[3:], KNOWN, ORBIT_RATE, 0.25)
        return attitude_error(moved, *end)

    transition = np.array([(shifted(h * e) - shifted(-h * e)) / (2 * h) for e in np.eye(6)]).T
    assert moved.covariance == pytest.approx(transition @ transition.T, abs=2e-4)


def test_one_exact_direction_aligns_the_estimate_whatever_the_start(stream: np.random.Generator) -> None:
    truth, start, reference = unit(stream, 200, 4), unit(stream, 200, 4), unit(stream, 200, 3)
    measured = np.einsum("nji,nj->ni", quaternion_to_matrix(truth), reference)
    state = start_state(start, np.zeros((200, 3)), 1.0, 1e-3, GATE)
    after = update(state, DirectionObservation(measured, across(measured, 1e-6), reference), GATE)
    turned = np.einsum("nij,nj->ni", quaternion_to_matrix(after.quaternion), measured)
    assert np.linalg.norm(turned - reference, axis=1).max() < 1e-9


def test_rotation_about_the_line_of_sight_stays_unknown(stream: np.random.Generator) -> None:
    reference = unit(stream, 3)
    state = start_state(unit(stream, 4), np.zeros(3), 0.8, 1e-3, GATE)
    measured = quaternion_to_matrix(unit(stream, 4)).T @ reference
    for _ in range(50):
        state = update(state, DirectionObservation(measured, across(measured, 0.005), reference), GATE)
    assert np.sqrt(reference @ state.covariance[:3, :3] @ reference) == pytest.approx(0.8, rel=1e-6)
    rest = np.eye(3) - np.outer(reference, reference)
    assert np.sqrt(np.trace(rest @ state.covariance[:3, :3] @ rest) / 2) == pytest.approx(0.005 / np.sqrt(50), rel=0.01)


def test_opposite_directions_do_not_stop_the_filter() -> None:
    state = start_state(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 1.0, 1e-3, GATE)
    measured, reference = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])
    after = update(state, DirectionObservation(measured, across(measured, 1e-6), reference), GATE)
    assert quaternion_to_matrix(after.quaternion) @ measured == pytest.approx(reference, abs=1e-6)
    assert np.all(np.isfinite(after.covariance))


def test_innovation_covariance_is_that_of_the_innovations(stream: np.random.Generator) -> None:
    count, sigma = 20_000, 0.01
    truth, reference = unit(stream, 4), unit(stream, 3)
    direction = quaternion_to_matrix(truth).T @ reference
    error = 0.02 * stream.standard_normal((count, 3))
    estimate = multiply(quaternion_from_rotation_vector(-error), np.broadcast_to(truth, (count, 4)))
    noise = sigma * stream.standard_normal((count, 3))
    measured = direction + noise - np.outer(noise @ direction, direction)
    measured /= np.linalg.norm(measured, axis=1, keepdims=True)
    state = start_state(estimate, np.zeros((count, 3)), 0.02, 1e-3, GATE)
    z, spread, _ = innovation(
        state, DirectionObservation(measured, across(measured, sigma), np.tile(reference, (count, 1)))
    )
    assert np.mean(z[:, :, None] * z[:, None, :], axis=0) == pytest.approx(spread.mean(axis=0), abs=2e-5)


def test_outlier_is_refused_and_counted_and_leaves_the_state(stream: np.random.Generator) -> None:
    state = start_state(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 0.01, 1e-4, GATE)
    fresh = replace(state, refused=np.array(0))
    measured = unit(stream, 3)
    wrong = DirectionObservation(measured, across(measured, 0.005), cross_matrix(measured)[0] / np.hypot(*measured[1:]))
    after = update(fresh, wrong, GATE)
    assert int(after.refused) == 1
    assert after.quaternion == pytest.approx(fresh.quaternion)
    assert after.covariance == pytest.approx(fresh.covariance)


def test_filter_that_is_wrong_listens_after_enough_refusals() -> None:
    truth, reference = quaternion_from_rotation_vector([0.5, 0.0, 0.0]), np.array([0.0, 0.6, 0.8])
    measured = quaternion_to_matrix(truth).T @ reference
    start = start_state(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 0.003, 1e-5, GATE)
    state = replace(start, refused=np.array(0))
    counts = []
    for _ in range(200):
        state = update(state, DirectionObservation(measured, across(measured, 0.005), reference), GATE)
        counts.append(int(state.refused))
    assert max(counts) > GATE.doubt_after
    assert counts[-1] == 0
    assert np.linalg.norm(quaternion_to_matrix(state.quaternion) @ measured - reference) < 0.03


def test_errors_of_the_references_are_estimated_and_those_of_later_ones_join(stream: np.random.Generator) -> None:
    truth, sure = unit(stream, 4), 1e-7
    state = start_state(truth, np.zeros(3), sure, sure, GATE)
    planted = np.array([0.7, -1.2, 0.4])
    for count in (1, 1, 3, 3):
        reference = unit(stream, 3)
        by_bias = (np.eye(3) - np.outer(reference, reference)) @ (0.01 * stream.standard_normal((3, count)))
        shifted = reference + by_bias @ planted[:count]
        measured = quaternion_to_matrix(truth).T @ shifted / np.linalg.norm(shifted)
        seen = DirectionObservation(measured, across(measured, 1e-5), reference, reference_bias_rad=by_bias)
        state = update(state, seen, GATE)
    assert state.biases is not None
    assert state.biases.estimate[5:] == pytest.approx(planted, abs=0.05)
    assert np.sqrt(np.diag(state.biases.covariance))[5:].max() < 0.05
    # Nothing was seen of the sensor's own biases and of the torque.
    assert state.biases.estimate[:5] == pytest.approx(np.zeros(5), abs=1e-6)


def test_bias_of_the_cosines_is_taken_off_on_the_sphere(stream: np.random.Generator) -> None:
    """Three sigmas of 0.0113 at a cosine of 0.4 leave 0.35 deg along the slope, and nothing here."""
    bias, sigma = np.array([0.031, 0.022]), 0.0113
    attitude = unit(stream, 4)
    state = start_state(attitude, np.zeros(3), 0.01, 1e-4, GATE)
    for true in ([0.766, 0.503], [-0.35, -0.42], [0.8, -0.25]):
        expected, measured = raised(np.array(true)), raised(np.array(true) + bias)
        # A second seen without the bias: the same spread belongs to it.
        seen, exact = (
            DirectionObservation(
                each, 1e-6 * cosine_slopes(each) @ cosine_slopes(each).T,
                quaternion_to_matrix(attitude) @ expected, bias_rad=sigma * cosine_slopes(each),
            )
            for each in (measured, expected)
        )  # fmt: skip
        biases = update(state, seen, GATE).biases
        assert biases is not None
        estimate = np.concatenate([bias / sigma, np.zeros(3)])
        z, spread, _ = innovation(replace(state, biases=replace(biases, estimate=estimate)), seen)
        assert np.linalg.norm(z) < 1e-12
        _, right, _ = innovation(replace(state, biases=replace(biases, estimate=np.zeros(5))), exact)
        np.testing.assert_allclose(spread, right, rtol=1e-9)


def raised(cosines: np.ndarray) -> np.ndarray:
    """Return the direction above the array of two cosines."""
    return np.append(cosines, np.sqrt(1.0 - np.sum(cosines**2)))


def test_bias_larger_than_a_direction_allows_leaves_it_above_the_array() -> None:
    measured = raised(np.array([0.6, 0.7]))
    seen = DirectionObservation(measured, across(measured, 1e-3), measured, bias_rad=0.1 * cosine_slopes(measured))
    state = update(start_state(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 0.1, 1e-4, GATE), seen, GATE)
    assert state.biases is not None
    far = replace(state, biases=replace(state.biases, estimate=np.array([-3.0, -3.0, 0.0, 0.0, 0.0])))
    # The direction is that of (0.9, 1.0) in the plane of the array.
    z, spread, _ = innovation(far, seen)
    assert np.linalg.norm(z) == pytest.approx(np.arccos(measured @ [0.669, 0.743, 0.0]), abs=2e-3)
    assert np.all(np.linalg.eigvalsh(spread) > 0.0)


def test_carrying_back_undoes_the_motion(stream: np.random.Generator) -> None:
    noise = ProcessNoiseParams(torque_n_m=2e-4)
    first = start_state(unit(stream, 4), 0.01 * stream.standard_normal(3), 0.01, 1e-4, GATE)
    state = predict(INERTIA, noise, first, KNOWN, ORBIT_RATE, 0.25)
    assert state.biases is not None
    # An unknown torque that is estimated by now acted all the time.
    torque = np.array([0.0, 0.0, 1.5, -0.7, 0.4])
    begun = state = replace(state, biases=replace(state.biases, estimate=torque))
    for _ in range(40):
        state = predict(INERTIA, noise, state, KNOWN, ORBIT_RATE, 0.25)
    moved = float(rotation_angle_between_rad(state.quaternion, begun.quaternion))
    for _ in range(40):
        state = carried_back(INERTIA, noise, state, KNOWN, ORBIT_RATE, 0.25)
    assert moved > 0.03
    assert float(rotation_angle_between_rad(state.quaternion, begun.quaternion)) < 1e-4 * moved
    np.testing.assert_allclose(state.rate_rad_s, begun.rate_rad_s, atol=1e-7)


@pytest.mark.parametrize(("torque_n_m", "clock_s"), [(0.0, 0.0), (2e-5, 0.5)])
def test_mean_nees_of_100_runs_lies_in_its_95_percent_band(torque_n_m: float, clock_s: float) -> None:
    """A pass and a hand-off, truth driven by the filter's process noise, a torque it does not know and an error of the
    clock.
    """
    runs, steps, sigma, dt_s = 100, 800, 0.005, 0.5
    orbit, stream = SunSynchronousOrbitParams(), np.random.default_rng(3)
    t_s = 400.0 + dt_s * np.arange(steps)
    view = view_stations(orbit, stations_along_track(orbit, 0.0), t_s)
    reference = view.reference[np.arange(steps), np.argmax(view.elevation_rad, axis=1)]
    rate = orbit_point(orbit, t_s).frame_rate_rad_s
    by_clock = clock_s * np.gradient(reference, dt_s, axis=0)
    # The difference over the hand-off is no motion.
    by_clock[1:][np.linalg.norm(np.diff(reference, axis=0), axis=1) > 0.1] = 0.0
    by_clock[:-1][np.linalg.norm(np.diff(reference, axis=0), axis=1) > 0.1] = 0.0
    late = stream.standard_normal((runs, 1)) if clock_s else np.zeros((runs, 1))
    noise = ProcessNoiseParams(torque_n_m=torque_n_m)
    planted = torque_n_m * stream.standard_normal((runs, 3))
    satellite = SimulatedSatellite(
        SatelliteParams(), NadirHoldParams(), noise, t_s=t_s[0],
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (runs, 1)), rate_rad_s=np.tile(rate[0], (runs, 1)),
        seed=4,
    )  # fmt: skip
    truth = satellite.state
    start = multiply(quaternion_from_rotation_vector(0.01 * stream.standard_normal((runs, 3))), truth.quaternion)
    state = start_state(start, truth.rate_rad_s + 1e-4 * stream.standard_normal((runs, 3)), 0.01, 1e-4, GATE)
    scores = []
    for k in range(steps):
        if k:
            known = satellite.hold_torque(rate[k - 1])
            satellite.step(dt_s, replace(known, control_n_m=known.control_n_m + planted), rate[k - 1])
            state = predict(INERTIA, noise, state, known, rate[k - 1], dt_s)
        truth = satellite.state
        true_reference = reference[k] + late * by_clock[k]
        true_reference /= np.linalg.norm(true_reference, axis=1, keepdims=True)
        expected = np.einsum("nji,nj->ni", quaternion_to_matrix(truth.quaternion), true_reference)
        error = sigma * stream.standard_normal((runs, 3))
        measured = expected + error - np.sum(error * expected, axis=1, keepdims=True) * expected
        measured /= np.linalg.norm(measured, axis=1, keepdims=True)
        seen = DirectionObservation(
            measured, across(measured, sigma), np.broadcast_to(reference[k], (runs, 3)),
            reference_bias_rad=by_clock[k][:, None] if clock_s else None,
        )  # fmt: skip
        state = update(state, seen, GATE)
        if k % 40 == 39:
            scores.append(np.mean(nees(attitude_error(state, truth.quaternion, truth.rate_rad_s), state.covariance)))
    low, high = nees_band(6, runs)
    inside = np.mean([(low <= score <= high) for score in scores])
    assert inside >= 0.9
    assert np.mean(scores) == pytest.approx(6.0, abs=0.3)


def test_certainty_on_both_sides_is_refused_and_not_divided_by() -> None:
    state = start_state(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 0.01, 1e-4, GATE)
    sure = replace(state, covariance=np.zeros((6, 6)))
    seen = DirectionObservation(np.array([0.0, 0.0, 1.0]), np.zeros((3, 3)), np.array([0.0, 0.0, 1.0]))
    with pytest.raises(ValueError, match="innovation covariance has determinant 0.0, must be > 0: singular"):
        update(sure, seen, GATE)


def test_noise_of_a_step_is_refused_outside_its_range() -> None:
    assert process_noise_from_q(1e-3, dt_s=10.0).rate_rad2_s3 == pytest.approx(1e-4)
    assert process_noise_from_q(0.0, dt_s=1e-6).attitude_rad2_s == 0.0
    for q, dt_s, words in ((1.1e-3, 0.25, "q="), (-1e-12, 0.25, "q="), (1e-9, 11.0, "dt_s="), (1e-9, 0.9e-6, "dt_s=")):
        with pytest.raises(ValueError, match=words):
            process_noise_from_q(q, dt_s)


def test_a_torque_that_is_known_to_be_none_needs_no_constants(stream: np.random.Generator) -> None:
    state = start_state(unit(stream, 3, 4), np.zeros((3, 3)), 0.1, 1e-3, GATE)
    assert predict(INERTIA, SILENT, state, KNOWN, ORBIT_RATE, 0.25).biases is None
    unknown = predict(INERTIA, replace(SILENT, torque_n_m=1e-5), state, KNOWN, ORBIT_RATE, 0.25).biases
    assert unknown is not None
    assert unknown.estimate.shape == (3, 5)
    np.testing.assert_array_equal(unknown.estimate, 0.0)
    np.testing.assert_allclose(unknown.covariance, np.broadcast_to(np.eye(5), (3, 5, 5)))


def test_the_shortest_turn_is_found_beside_half_a_turn_and_between_equal_directions(
    stream: np.random.Generator,
) -> None:
    first = unit(stream, 3)
    side = tangent_rows(first)[0]
    for angle in (0.0, 1e-9, 1e-3, 3.0, np.pi - 1e-6):
        second = np.cos(angle) * first + np.sin(angle) * side
        turn = rotation_between(first, second)
        # Rounding of the directions turns the axis where they are nearly opposite.
        np.testing.assert_allclose(turn, angle * np.cross(first, side), atol=1e-9)
    mixed = rotation_between(np.stack([first, first, first]), np.stack([first, -first, side]))
    assert np.linalg.norm(mixed, axis=1) == pytest.approx([0.0, np.pi, np.pi / 2.0])
    assert mixed[1] @ first == pytest.approx(0.0, abs=1e-12)
