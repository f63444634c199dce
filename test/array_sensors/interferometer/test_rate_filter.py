import numpy as np
import pytest
from scipy.stats import chi2

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler
from rf_pointing.array_sensors.interferometer.measurement_model import (
    TrackedMotion,
    displaced,
    local_difference,
    local_gradient,
)
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion, moved
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.rate_filter import FilterParams, FilterState, predict, start, update
from rf_pointing.array_sensors.interferometer.reading import ErrorFloor, read_ranges
from rf_pointing.array_sensors.interferometer.sequence import SequenceParams
from rf_pointing.array_sensors.interferometer.snapshot import coarse_geometry, refine
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem, Schedule
from rf_pointing.core import random_stream

NO_FLOOR = ErrorFloor(
    phase_rad=0.0,
    phase_rate_rad_s=0.0,
    amplitude=0.0,
    path_acceleration_m_s2=0.0,
    first_path_acceleration_m_s2=0.0,
)
STEADY = FilterParams(
    acceleration_density_m_s2=1e-9,
    angular_acceleration_density_rad_s2=1e-12,
    first_velocity_m_s=0.5,
    first_rate_rad_s=2e-3,
)
STEP_S = 2.0


def drawn_truth(rng: np.random.Generator) -> RelativeMotion:
    return RelativeMotion(
        position_m=np.array([6e4, 4e3, -3e3]) + rng.normal(size=3),
        velocity_m_s=rng.normal(0.0, STEADY.first_velocity_m_s, 3),
        attitude=attitude_from_euler(*rng.uniform(-0.3, 0.3, 3)),
        rate_rad_s=rng.normal(0.0, STEADY.first_rate_rad_s, 3),
    )


def run(system: InterferometerSystem, seed: int, steps: int, params: FilterParams = STEADY):
    """Return truth and filter after `steps` readings, and the innovations' chi-squares."""
    truth = drawn_truth(random_stream(seed, "truth"))
    source = InterferometerSource(system, RadioParams(), LinkParams(), seed)
    state, squares = None, []
    for step in range(steps):
        t_s = STEP_S * step
        reading = read_ranges(source.measure(t_s, moved(truth, t_s)), system, NO_FLOOR)
        if state is None:
            geometry, factors = coarse_geometry(reading, None, system, SequenceParams(iterations=8))
            state = update(
                start(t_s, refine(geometry, factors, reading, system, False), reading, params), reading, system
            ).state
            continue
        result = update(predict(state, t_s, params), reading, system)
        state = result.state
        squares.append(result.chi_square)
    return moved(truth, STEP_S * (steps - 1)), state, squares


@pytest.mark.parametrize("order", ["nested", "ascending"])
def test_error_of_pose_and_rates_is_consistent_with_the_covariance(order: str) -> None:
    system, runs = InterferometerSystem(schedule=Schedule(order=order)), 24
    squares, innovations = [], []
    for seed in range(runs):
        truth, state, chi_squares = run(system, seed, 4)
        off = local_difference(TrackedMotion(motion=truth, excitation=np.ones(2)), state.tracked)[:12]
        squares.append(off @ np.linalg.solve(state.covariance[:12, :12], off))
        innovations += chi_squares
    low, high = chi2.ppf([0.001, 0.999], 12 * runs) / runs
    assert low < np.mean(squares) < high
    low, high = chi2.ppf([0.001, 0.999], 22 * len(innovations)) / len(innovations)
    assert low < np.mean(innovations) < high


def test_filter_knows_velocity_and_attitude_rate_far_better_than_differences() -> None:
    _, state, _ = run(InterferometerSystem(), 1, 8)
    sigma = np.sqrt(np.diag(state.covariance))
    _, first, _ = run(InterferometerSystem(), 1, 1)
    pose = np.sqrt(np.diag(first.covariance))
    assert np.all(sigma[3:6] < 0.3 * np.sqrt(2.0) * pose[0:3] / STEP_S)
    assert np.all(sigma[9:12] < 0.3 * np.sqrt(2.0) * pose[6:9] / STEP_S)


def test_first_update_gives_the_pose_of_the_snapshot_and_not_twice_its_information() -> None:
    system = InterferometerSystem()
    truth = drawn_truth(random_stream(3, "truth"))
    reading = read_ranges(
        InterferometerSource(system, RadioParams(), LinkParams(), 3).measure(0.0, truth), system, NO_FLOOR
    )
    geometry, factors = coarse_geometry(reading, None, system, SequenceParams(iterations=8))
    snapshot = refine(geometry, factors, reading, system, False)
    first = start(0.0, snapshot, reading, STEADY)
    state = update(first, reading, system).state
    pose = [0, 1, 2, 6, 7, 8]
    sigma = np.sqrt(np.diag(first.covariance))
    np.testing.assert_allclose(sigma[pose], 100.0 * np.sqrt(np.diag(snapshot.covariance)[:6]))
    np.testing.assert_allclose(sigma[3:6], STEADY.first_velocity_m_s)
    np.testing.assert_allclose(sigma[9:12], STEADY.first_rate_rad_s)
    np.testing.assert_allclose(
        np.sqrt(np.diag(state.covariance)[pose]), np.sqrt(np.diag(snapshot.covariance)), rtol=1e-3
    )


def test_prediction_moves_and_grows() -> None:
    _, state, _ = run(InterferometerSystem(), 2, 2)
    params = STEADY.replace(acceleration_density_m_s2=0.1, angular_acceleration_density_rad_s2=1e-3)
    later = predict(state, state.t_s + 5.0, params)
    np.testing.assert_allclose(later.tracked.motion.position_m, moved(state.tracked.motion, 5.0).position_m)
    growth = np.diag(later.covariance) - np.diag(predict(state, state.t_s + 5.0, STEADY).covariance)
    np.testing.assert_allclose(growth[:3], 0.01 * 125.0 / 3.0, rtol=1e-6)
    np.testing.assert_allclose(growth[9:12], 1e-6 * 5.0, rtol=1e-6)
    assert np.all(np.linalg.eigvalsh(later.covariance[:12, :12]) > 0.0)


def test_linearising_at_a_given_motion_corrects_a_prediction_that_is_degrees_off() -> None:
    system = InterferometerSystem()
    truth = drawn_truth(random_stream(4, "truth"))
    source = InterferometerSource(system, RadioParams(), LinkParams(), 4)
    reading = read_ranges(source.measure(0.0, truth), system, NO_FLOOR)
    geometry, factors = coarse_geometry(reading, None, system, SequenceParams(iterations=8))
    snapshot = refine(geometry, factors, reading, system, False)
    turned = RelativeMotion(
        position_m=truth.position_m,
        velocity_m_s=truth.velocity_m_s,
        attitude=attitude_from_euler(0.08, -0.06, 0.1) @ truth.attitude,
        rate_rad_s=truth.rate_rad_s,
    )
    covariance = np.diag(np.r_[[1.0, 500.0, 500.0], [0.5] * 3, [0.2] * 3, [2e-3] * 3, np.zeros(24)] ** 2)
    prior = FilterState(
        t_s=0.0,
        tracked=TrackedMotion(motion=turned, excitation=np.ones(2)),
        hardware=np.zeros(22),
        covariance=covariance,
    )
    around = TrackedMotion(
        motion=RelativeMotion(
            position_m=snapshot.tracked.motion.position_m,
            velocity_m_s=turned.velocity_m_s,
            attitude=snapshot.tracked.motion.attitude,
            rate_rad_s=turned.rate_rad_s,
        ),
        excitation=np.ones(2),
    )
    errors = []
    for linearised in (None, around):
        state = update(prior, reading, system, linearised).state
        off = local_difference(TrackedMotion(motion=truth, excitation=np.ones(2)), state.tracked)[:12]
        errors.append(off @ np.linalg.solve(state.covariance[:12, :12], off))
    assert errors[1] < 40.0 < errors[0]


def test_prediction_back_in_time_is_refused() -> None:
    _, state, _ = run(InterferometerSystem(), 2, 1)
    with pytest.raises(ValueError, match=r"t_s=-1.0 must be >= the state's t_s=0.0"):
        predict(state, -1.0, STEADY)


def test_process_noise_is_white_acceleration_integrated_once_and_twice() -> None:
    """From certainty: density^2 (t^3/3, t^2/2, t) on each axis, and a random walk of the excitation factors if tracked."""
    _, state, _ = run(InterferometerSystem(), 2, 1)
    sure = FilterState(
        t_s=0.0, tracked=state.tracked, hardware=state.hardware, covariance=np.zeros_like(state.covariance)
    )
    params = STEADY.replace(
        acceleration_density_m_s2=0.3, angular_acceleration_density_rad_s2=2e-3, excitation_drift=0.04
    )
    for tracked, dt_s in ((False, 3.0), (True, 3.0), (True, 0.25)):
        added = predict(sure, dt_s, params.replace(track_excitation=tracked)).covariance
        expected = np.zeros((36, 36))
        for first, density in ((0, 0.3), (6, 2e-3)):
            for axis in range(first, first + 3):
                expected[axis, axis] = density**2 * dt_s**3 / 3.0
                expected[axis, axis + 3] = expected[axis + 3, axis] = density**2 * dt_s**2 / 2.0
                expected[axis + 3, axis + 3] = density**2 * dt_s
        if tracked:
            expected[12, 12] = expected[13, 13] = 0.04**2 * dt_s
        np.testing.assert_allclose(added, expected, rtol=1e-12, atol=1e-15)


def test_excitation_factors_start_unknown_only_where_they_are_tracked() -> None:
    system = InterferometerSystem()
    truth = drawn_truth(random_stream(3, "truth"))
    reading = read_ranges(
        InterferometerSource(system, RadioParams(), LinkParams(), 3).measure(0.0, truth), system, ErrorFloor()
    )
    geometry, factors = coarse_geometry(reading, None, system, SequenceParams(iterations=8))
    for tracked in (False, True):
        snapshot = refine(geometry, factors, reading, system, tracked)
        params = STEADY.replace(first_excitation=0.7, track_excitation=tracked)
        first = start(1.5, snapshot, reading, params)
        pose = np.diag(first.covariance)
        np.testing.assert_allclose(pose[12:14], 0.49 if tracked else 0.0)
        np.testing.assert_allclose(pose[14:], reading.hardware)
        np.testing.assert_array_equal(first.covariance, np.diag(pose))
        assert first.t_s == 1.5
        assert not np.any(first.hardware)


def test_an_update_is_that_of_the_joint_linear_problem_of_motion_and_hardware() -> None:
    """Prior and reading as one weighted least-squares problem of 36 unknowns, solved by its normal equations."""
    system = InterferometerSystem()
    _, state, _ = run(system, 5, 2)
    source = InterferometerSource(system, RadioParams(hardware_phase_rad=0.002), LinkParams(), 5)
    later = predict(state, state.t_s + 2.0, STEADY)
    spread = np.diag(np.r_[np.full(14, 1e-12), np.full(22, 1e-8)])
    prior = FilterState(
        t_s=later.t_s,
        tracked=later.tracked,
        hardware=1e-4 * np.arange(22.0),
        covariance=later.covariance + spread,
    )
    reading = read_ranges(
        source.measure(later.t_s, moved(drawn_truth(random_stream(5, "truth")), 4.0)), system, NO_FLOOR
    )
    around = displaced(later.tracked, 1e-3 * np.ones(14))
    change = local_difference(around, later.tracked)
    found = update(prior, reading, system, around)
    expected, gradient = local_gradient(later.tracked, change, reading, system)
    whole = np.hstack([gradient, np.eye(22)])
    gap = reading.vector - expected + gradient @ change - prior.hardware
    information = np.linalg.inv(prior.covariance) + whole.T @ np.linalg.solve(reading.noise, whole)
    step = np.linalg.solve(information, whole.T @ np.linalg.solve(reading.noise, gap))
    sigma = np.sqrt(np.diag(np.linalg.inv(information)))
    moved_by = local_difference(found.state.tracked, prior.tracked)
    assert np.max(np.abs((moved_by - step[:14]) / sigma[:14])) < 1e-3
    assert np.max(np.abs((found.state.hardware - prior.hardware - step[14:]) / sigma[14:])) < 1e-3
    np.testing.assert_allclose(np.sqrt(np.diag(found.state.covariance)), sigma, rtol=1e-3)
    spread_of_gap = whole @ prior.covariance @ whole.T + reading.noise
    assert found.chi_square == pytest.approx(gap @ np.linalg.inv(spread_of_gap) @ gap, rel=1e-5)
    assert found.degrees_of_freedom == 22
    assert found.state.t_s == later.t_s
