import numpy as np
import pytest
from scipy.stats import chi2

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler
from rf_pointing.array_sensors.interferometer.initializer import aperture_excess
from rf_pointing.array_sensors.interferometer.measurement_model import TrackedMotion, local_difference
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.reading import ErrorFloor, read_ranges
from rf_pointing.array_sensors.interferometer.sequence import SequenceParams
from rf_pointing.array_sensors.interferometer.snapshot import chi_square_limit, coarse_geometry, refine
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import InterferometerSystem
from test.array_sensors.interferometer.test_tracker import with_wrong_lane

SYSTEM = InterferometerSystem()
NO_FLOOR = ErrorFloor(phase_rad=0.0, phase_rate_rad_s=0.0, amplitude=0.0, path_acceleration_m_s2=0.0)
POSE = [0, 1, 2, 6, 7, 8]
TRIALS = 100


def far(roll: float = 0.4, excitation=(1.0, 1.0)) -> TrackedMotion:
    motion = RelativeMotion(
        position_m=np.array([6e4, 4e3, -3e3]), velocity_m_s=np.array([-0.5, 0.2, 0.1]),
        attitude=attitude_from_euler(0.2, -0.1, roll), rate_rad_s=np.array([1e-3, -2e-3, 1e-3]),
    )  # fmt: skip
    return TrackedMotion(motion=motion, excitation=np.array(excitation))


def source(truth: TrackedMotion) -> InterferometerSource:
    return InterferometerSource(SYSTEM, RadioParams(), LinkParams(), 11, excitation=tuple(truth.excitation))


def snapshot(measurement, fit_excitation: bool = False):
    reading = read_ranges(measurement, SYSTEM, NO_FLOOR)
    sequence = SequenceParams(iterations=8, estimate_excitation=fit_excitation)
    geometry, factors = coarse_geometry(reading, None, SYSTEM, sequence)
    return refine(geometry, factors, reading, SYSTEM, fit_excitation)


@pytest.mark.parametrize(("excitation", "columns"), [((1.0, 1.0), POSE), ((0.8, 1.3), [*POSE, 12, 13])])
def test_pose_without_prior_is_consistent_with_its_covariance_and_residual(excitation, columns) -> None:
    truth = far(excitation=excitation)
    maker = source(truth)
    errors, residuals = [], []
    for _ in range(TRIALS):
        found = snapshot(maker.measure(0.0, truth.motion), len(columns) == 8)
        off = local_difference(truth, found.tracked)[columns]
        errors.append(off @ np.linalg.solve(found.covariance, off))
        residuals.append(found.chi_square)
    assert found.degrees_of_freedom == 13 - len(columns)
    for squares, freedom in ((errors, len(columns)), (residuals, 13 - len(columns))):
        low, high = chi2.ppf([0.0005, 0.9995], freedom * TRIALS) / TRIALS
        assert low < np.mean(squares) < high


def test_a_wrong_lane_of_one_path_is_seen_in_the_residual_alone() -> None:
    truth = far()
    for path in np.ndindex(3, 3):
        measurement = with_wrong_lane(source(truth).measure(0.0, truth.motion), path)
        reading = read_ranges(measurement, SYSTEM, NO_FLOOR)
        assert reading.worst_lane < 0.15
        assert snapshot(measurement).chi_square > 100.0 * chi_square_limit(7, 5.0)


@pytest.mark.parametrize("element", [0, 1, 2])
def test_wrong_lanes_of_a_whole_element_contradict_the_polarisation_or_have_no_direction(element: int) -> None:
    truth = far()
    measurement = with_wrong_lane(source(truth).measure(0.0, truth.motion), (element,))
    ranges, covariance = read_ranges(measurement, SYSTEM, NO_FLOOR).standalone_ranges()
    allowed = 10.0 * np.sqrt(covariance[0, 0] - covariance[0, 1])
    if aperture_excess(ranges, SYSTEM.arrays)[0] > allowed:
        with pytest.raises(ValueError, match="no direction at the active array"):
            snapshot(measurement)
    else:
        assert snapshot(measurement).chi_square > chi_square_limit(7, 5.0)


def test_limit_is_the_chi_square_quantile() -> None:
    for freedom in (5, 7, 22):
        for sigma, factor in ((2.0, 1.1), (3.0, 1.1), (5.0, 3.0)):
            tail = chi2.sf(chi_square_limit(freedom, sigma), freedom)
            normal = 0.5 * chi2.sf(sigma**2, 1)
            assert 1.0 / factor < tail / normal < factor
