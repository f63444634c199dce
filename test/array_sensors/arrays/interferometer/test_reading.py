import dataclasses

import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.array_geometry import two_way_ranges
from rf_pointing.array_sensors.arrays.interferometer.frames import attitude_from_euler
from rf_pointing.array_sensors.arrays.interferometer.link import LinkParams
from rf_pointing.array_sensors.arrays.interferometer.local_coordinates import TrackedMotion
from rf_pointing.array_sensors.arrays.interferometer.measurement_model import expected_path_rates_m_s, expected_reading
from rf_pointing.array_sensors.arrays.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.arrays.interferometer.reading import RANGES, RATES, ErrorFloor, rate_weights, read_ranges
from rf_pointing.array_sensors.arrays.interferometer.rf_simulation import RadioParams
from rf_pointing.array_sensors.arrays.interferometer.schedule import Schedule
from rf_pointing.array_sensors.arrays.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.arrays.interferometer.system import InterferometerSystem

NO_FLOOR = ErrorFloor(phase_rad=0.0, phase_rate_rad_s=0.0, amplitude=0.0, path_acceleration_m_s2=0.0)
TRIALS = 300


@pytest.fixture
def far() -> TrackedMotion:
    motion = RelativeMotion(
        position_m=np.array([6e4, 4e3, -3e3]),
        velocity_m_s=np.array([-0.5, 0.2, 0.1]),
        attitude=attitude_from_euler(0.2, -0.1, 0.4),
        rate_rad_s=np.array([1e-3, -2e-3, 1e-3]),
    )
    return TrackedMotion(motion=motion, excitation=np.ones(2))


@pytest.mark.parametrize("order", ["simultaneous", "ascending", "nested"])
def test_scatter_of_ranges_rates_and_couplings_is_the_stated_covariance(far, order: str) -> None:
    system = InterferometerSystem(schedule=Schedule(order=order))
    source = InterferometerSource(system, RadioParams(), LinkParams(), 5)
    hint = expected_path_rates_m_s(far, system)
    readings = [read_ranges(source.measure(0.0, far.motion), system, NO_FLOOR, hint) for _ in range(TRIALS)]
    off = np.array([r.vector - expected_reading(far, r, system) for r in readings])
    whitened = np.linalg.solve(np.linalg.cholesky(readings[0].covariance), off.T)
    # Mean square of a unit normal, four standard errors; neither element may be far off.
    assert np.mean(whitened**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (22 * TRIALS)))
    assert np.all(np.abs(np.mean(whitened**2, axis=1) - 1.0) < 5.0 * np.sqrt(2.0 / TRIALS))


def test_ascending_order_makes_standalone_ranges_an_order_of_magnitude_worse(far) -> None:
    sigmas = {}
    for order in ("ascending", "nested"):
        system = InterferometerSystem(schedule=Schedule(order=order))
        source = InterferometerSource(system, RadioParams(), LinkParams(), 5)
        ranges, covariance = read_ranges(source.measure(0.0, far.motion), system, NO_FLOOR).standalone_ranges()
        sigmas[order] = np.sqrt(covariance[0, 0])
        truth = two_way_ranges(far.motion.position_m, far.motion.attitude, system.arrays)
        assert np.max(np.abs(ranges - truth)) < 5.0 * sigmas[order]
    assert sigmas["ascending"] > 8.0 * sigmas["nested"]


def test_floors_are_added_to_each_part(far) -> None:
    system = InterferometerSystem()
    measured = InterferometerSource(system, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    bare = read_ranges(measured, system, NO_FLOOR).covariance
    floor = NO_FLOOR.replace(phase_rad=0.01, amplitude=0.03, path_acceleration_m_s2=0.1, phase_rate_rad_s=0.5)
    added = read_ranges(measured, system, floor).covariance - bare
    lane = system.plan.ambiguities_m[-1] / (2.0 * np.pi)
    assert added[0, 0] - added[0, 1] == pytest.approx(2.0 * (0.01 * lane) ** 2)
    assert np.sqrt(added[0, 1]) == pytest.approx(0.006, abs=1e-4)
    assert added[20, 20] == pytest.approx(0.03**2)
    assert np.sqrt(added[9, 9]) == pytest.approx(0.5 * 0.018, rel=0.05)


def test_repeated_phases_that_disagree_show_in_the_resultant(far) -> None:
    system = InterferometerSystem()
    measured = InterferometerSource(system, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    assert read_ranges(measured, system, NO_FLOOR).visit_agreement > 0.99
    disturbed = measured.phase_rad.copy()
    disturbed[0, 0, 0] += 2.0
    other = dataclasses.replace(measured, phase_rad=disturbed)
    assert read_ranges(other, system, NO_FLOOR).visit_agreement == pytest.approx(np.cos(1.0), abs=0.05)


def test_weights_of_the_two_links_sum_to_two() -> None:
    forward, back = rate_weights(InterferometerSystem())
    assert forward + back == pytest.approx(2.0)
    assert forward > 1.1 > back


def test_a_measurement_of_another_schedule_is_refused(far) -> None:
    ascending = InterferometerSystem(schedule=Schedule(order="ascending"))
    measured = InterferometerSource(ascending, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    with pytest.raises(ValueError, match="phase_rad has 9 slots, the schedule has 18"):
        read_ranges(measured, InterferometerSystem(), NO_FLOOR)
    assert (RANGES.stop, RATES.stop) == (9, 18)
