"""From wrapped phases to ranges and path rates: lanes, their sigmas, accelerations, and the covariance of it all."""

import dataclasses

import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import attitude_from_euler
from rf_pointing.array_sensors.interferometer.measurement_model import (
    TrackedMotion,
    expected_path_accelerations_m_s2,
    expected_path_rates_m_s,
    expected_reading,
)
from rf_pointing.array_sensors.interferometer.motion import RelativeMotion
from rf_pointing.array_sensors.interferometer.radio import LinkParams, RadioParams
from rf_pointing.array_sensors.interferometer.reading import (
    RANGES,
    RATES,
    ErrorFloor,
    PathMotion,
    rate_weights,
    read_ranges,
    resolve_ranges,
)
from rf_pointing.array_sensors.interferometer.source import InterferometerSource
from rf_pointing.array_sensors.interferometer.system import (
    ArrayParams,
    CarrierPlan,
    InterferometerSystem,
    Schedule,
    path_lengths,
    two_way_ranges,
)
from rf_pointing.papers.interferometer_design import largest_phase_bias_rad
from rf_pointing.papers.interferometer_simulation import carrier_phases, sharpened_ranges

PLAN = CarrierPlan(speed_of_light_m_s=3.0e8)
ARRAYS = ArrayParams()
NO_FLOOR = ErrorFloor(
    phase_rad=0.0, phase_rate_rad_s=0.0, amplitude=0.0, path_acceleration_m_s2=0.0, first_path_acceleration_m_s2=0.0
)
TRIALS = 300


def phases_of(out, back):
    return np.mod(carrier_phases(out, back, PLAN), 2.0 * np.pi)


def test_ranges_return_over_the_whole_unambiguous_interval(rng) -> None:
    out = rng.uniform(0.5, 1e5, 500)
    back = out[:, None, None] + rng.uniform(-1.0, 1.0, (500, 3, 3))
    resolved = resolve_ranges(phases_of(out, back), PLAN)
    np.testing.assert_allclose(resolved.ranges_m, out[:, None, None] + back, atol=2e-9)
    assert np.max(resolved.worst_lane_residual) < 1e-4


def test_lane_numbers_count_whole_lanes(worked_example) -> None:
    xi, attitude = worked_example
    lengths = path_lengths(5e4 * xi, attitude, ARRAYS)
    resolved = resolve_ranges(phases_of(lengths[0, 0], lengths[1:, 1:]), PLAN)
    expected = np.floor(resolved.ranges_m / PLAN.ambiguities_m[-1])
    np.testing.assert_array_equal(resolved.lanes[-1], expected)


def test_noise_at_zero_range_wraps_to_240_km_as_published_and_stays_as_corrected() -> None:
    phases = np.zeros((9, 1, 1))
    phases[1] = -1e-3
    published, corrected = (resolve_ranges(phases, PLAN, variant) for variant in ("published", "corrected"))
    assert published.ranges_m[0, 0] > 230e3
    assert corrected.ranges_m[0, 0] == pytest.approx(0.0, abs=1e-9)


def test_a_phase_error_of_half_a_lane_shows_as_residual_and_then_as_a_wrong_lane(worked_example) -> None:
    xi, attitude = worked_example
    lengths = path_lengths(2e3 * xi, attitude, ARRAYS)
    truth = two_way_ranges(2e3 * xi, attitude, ARRAYS)
    for lanes, wrong in ((0.4, False), (0.6, True)):
        phases = carrier_phases(lengths[0, 0], lengths[1:, 1:], PLAN)
        # Carriers up to the eighth see a range longer by part of the finest lane, the ninth does not.
        phases[1:-1, 0, 0] += 2.0 * np.pi * lanes * PLAN.ambiguities_m[-1] / PLAN.ambiguities_m[:-1]
        resolved = resolve_ranges(phases, PLAN)
        off = resolved.ranges_m - truth
        assert resolved.worst_lane_residual == pytest.approx(0.4, abs=1e-3)
        assert off[0, 0] == pytest.approx(PLAN.ambiguities_m[-1] if wrong else 0.0, abs=1e-6)
        np.testing.assert_allclose(off[1:], 0.0, atol=1e-6)


@pytest.mark.parametrize(("share", "right"), [(0.98, True), (1.02, False)])
def test_hardware_phase_up_to_half_a_turn_over_nu_plus_one_resolves(share: float, right: bool) -> None:
    bias = share * largest_phase_bias_rad(PLAN.ratio)
    assert np.degrees(largest_phase_bias_rad(6.0)) == pytest.approx(25.71, abs=0.01)
    two_way = 12345.6
    phases = phases_of(two_way / 2, np.full((1, 1), two_way / 2))
    phases[2] += bias
    phases[3] -= bias
    found = resolve_ranges(phases, PLAN)
    wrong = abs(float(found.ranges_m[0, 0]) - two_way) > 0.5 * PLAN.ambiguities_m[-1]
    assert wrong is not right


def test_differences_from_the_return_carriers_are_exact_and_keep_the_mean(worked_example, rng) -> None:
    xi, attitude = worked_example
    lengths = path_lengths(1e4 * xi, attitude, ARRAYS)
    truth = two_way_ranges(1e4 * xi, attitude, ARRAYS)
    noisy = truth + 0.01 * rng.normal(size=(3, 3))
    sharp, residual = sharpened_ranges(phases_of(lengths[0, 0], lengths[1:, 1:]), noisy, PLAN)
    assert np.mean(sharp) == pytest.approx(np.mean(noisy))
    np.testing.assert_allclose(sharp - np.mean(sharp), truth - np.mean(truth), atol=1e-8)
    assert np.max(np.abs(residual)) < 1e-6


@pytest.fixture
def far() -> TrackedMotion:
    motion = RelativeMotion(
        position_m=np.array([6e4, 4e3, -3e3]), velocity_m_s=np.array([-0.5, 0.2, 0.1]),
        attitude=attitude_from_euler(0.2, -0.1, 0.4), rate_rad_s=np.array([1e-3, -2e-3, 1e-3]),
    )  # fmt: skip
    return TrackedMotion(motion=motion, excitation=np.ones(2))


@pytest.mark.parametrize("order", ["simultaneous", "ascending", "nested"])
def test_scatter_of_ranges_rates_and_couplings_is_the_stated_covariance(far, order: str) -> None:
    system = InterferometerSystem(schedule=Schedule(order=order))
    source = InterferometerSource(system, RadioParams(), LinkParams(), 5)
    hint = PathMotion(
        rates_m_s=expected_path_rates_m_s(far, system), accelerations_m_s2=expected_path_accelerations_m_s2(far, system)
    )
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
    bare = read_ranges(measured, system, NO_FLOOR)
    floor = NO_FLOOR.replace(phase_rad=0.01, amplitude=0.03, phase_rate_rad_s=0.5)
    added = np.diag(read_ranges(measured, system, floor).covariance - bare.covariance)
    lane = system.plan.ambiguities_m[-1] / (2.0 * np.pi)
    np.testing.assert_allclose(added[:9], 2.0 * (0.01 * lane) ** 2)
    np.testing.assert_allclose(np.sqrt(added[9:18]), 0.5 * 0.018, rtol=0.05)
    np.testing.assert_allclose(added[18:], 0.03**2)


def test_an_acceleration_of_the_path_is_measured_and_only_what_is_left_is_in_the_covariance(far) -> None:
    """5 m/s across at 2 km: 0.025 m/s^2 of two-way path, 8 mm of range that no rate removes."""
    system = InterferometerSystem()
    near = RelativeMotion(
        position_m=far.motion.position_m / 30.0, velocity_m_s=np.array([0.0, 5.0, 0.0]),
        attitude=far.motion.attitude, rate_rad_s=far.motion.rate_rad_s,
    )  # fmt: skip
    tracked = TrackedMotion(motion=near, excitation=np.ones(2))
    measured = InterferometerSource(system, RadioParams(), LinkParams(), 5).measure(0.0, near)
    sigmas = {}
    for floor in (NO_FLOOR, NO_FLOOR.replace(path_acceleration_m_s2=0.005, first_path_acceleration_m_s2=0.3)):
        reading = read_ranges(measured, system, floor)
        off = reading.vector[:9] - expected_reading(tracked, reading, system)[:9]
        spread = np.sqrt(np.diag(reading.covariance)[:9])
        sigmas[floor.first_path_acceleration_m_s2] = spread[0]
        bent = np.max(np.abs(off))
        if floor is NO_FLOOR:
            assert bent > 20.0 * spread[0]
            assert reading.lane_deviation > 20.0
        else:
            assert bent < 4.0 * spread[0]
            assert reading.lane_deviation < 4.0
    assert sigmas[0.3] < 1.5 * sigmas[0.0]


def test_repeated_phases_that_disagree_show_in_the_resultant(far) -> None:
    system = InterferometerSystem()
    measured = InterferometerSource(system, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    assert read_ranges(measured, system, NO_FLOOR).visit_agreement > 0.99
    disturbed = measured.phase_rad.copy()
    disturbed[0, 0, 0] += 2.0
    other = dataclasses.replace(measured, phase_rad=disturbed)
    assert read_ranges(other, system, NO_FLOOR).visit_agreement == pytest.approx(np.cos(1.0), abs=0.05)


def test_a_measurement_of_another_schedule_is_refused(far) -> None:
    ascending = InterferometerSystem(schedule=Schedule(order="ascending"))
    measured = InterferometerSource(ascending, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    with pytest.raises(ValueError, match="phase_rad has 9 slots, the schedule has 18"):
        read_ranges(measured, InterferometerSystem(), NO_FLOOR)
    assert (RANGES.stop, RATES.stop) == (9, 18)


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_ranges_below_zero_are_told_from_the_longest_down_to_half_a_lane_of_the_first_step(share: float) -> None:
    two_way = -share * PLAN.ambiguities_m[0] / (2.0 * PLAN.ratio)
    found = resolve_ranges(phases_of(two_way / 2, np.full((1, 1), two_way / 2)), PLAN).ranges_m[0, 0]
    if share < 1.0:
        assert found == pytest.approx(two_way, abs=1e-6)
    else:
        assert found > 0.8 * PLAN.ambiguities_m[0]


def test_weights_of_the_links_are_those_of_their_frequencies() -> None:
    """3 and 2 GHz against their mean, all offsets small beside them."""
    plan = CarrierPlan(count=3, ratio=2.0, forward_hz=3e9, return_hz=2e9)
    forward, back = rate_weights(InterferometerSystem(plan=plan, schedule=Schedule(order="ascending")))
    assert (forward, back) == (pytest.approx(1.2, abs=1e-6), pytest.approx(0.8, abs=1e-6))
