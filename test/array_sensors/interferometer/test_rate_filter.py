import numpy as np
import pytest
from scipy.stats import chi2

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler
from rf_pointing.array_sensors.interferometer.measurement_model import TrackedMotion, local_difference
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
    phase_rad=0.0, phase_rate_rad_s=0.0, amplitude=0.0, path_acceleration_m_s2=0.0, first_path_acceleration_m_s2=0.0
)
STEADY = FilterParams(
    acceleration_density_m_s2=1e-9, angular_acceleration_density_rad_s2=1e-12,
    first_velocity_m_s=0.5, first_rate_rad_s=2e-3,
)  # fmt: skip
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
