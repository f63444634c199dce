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
    _Slots,
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
    phase_rad=0.0,
    phase_rate_rad_s=0.0,
    amplitude=0.0,
    path_acceleration_m_s2=0.0,
    first_path_acceleration_m_s2=0.0,
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
    hint = PathMotion(
        rates_m_s=expected_path_rates_m_s(far, system),
        accelerations_m_s2=expected_path_accelerations_m_s2(far, system),
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
        position_m=far.motion.position_m / 30.0,
        velocity_m_s=np.array([0.0, 5.0, 0.0]),
        attitude=far.motion.attitude,
        rate_rad_s=far.motion.rate_rad_s,
    )
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


@pytest.fixture(params=["ascending", "nested"])
def slots(request, far, rng):
    """Return the slots of a measurement whose power ratios differ in all slots and paths, and the system."""
    system = InterferometerSystem(schedule=Schedule(order=request.param))
    measured = InterferometerSource(system, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    uneven = dataclasses.replace(
        measured,
        snr_forward=rng.uniform(50.0, 500.0, measured.snr_forward.shape),
        snr_return=rng.uniform(50.0, 500.0, measured.snr_return.shape),
    )
    return _Slots(uneven, system, 0.03), uneven, system


def lanes_per_phase(plan: CarrierPlan) -> np.ndarray:
    """Return by how many lanes an unrounded lane moves per radian of each carrier's phase, (K - 2, K), from moved phases."""
    far_from_a_step = phases_of(2000.0, np.full((1, 1), 2000.0))
    step = 1e-5
    moved = [
        resolve_ranges(far_from_a_step + sign * step * np.eye(plan.count)[:, :, None, None], PLAN).lane_residuals
        for sign in (-1.0, 1.0)
    ]
    return ((moved[1] - moved[0])[..., 0, 0] / (2.0 * step)).T


def test_sigma_of_a_lane_is_that_of_all_phases_and_of_the_motion_that_moved_them(slots, rng) -> None:
    """Every slot's noise, every carrier's hardware phase, one rate and one acceleration of a path: summed one by one."""
    taken, measured, system = slots
    rate, acceleration = rng.uniform(1e-4, 1e-3, 9), rng.uniform(1e-5, 1e-4, 9)
    found = taken.lane_sigma(0.02, rate, acceleration)
    plan, times = system.plan, system.schedule.offsets_s(system.plan)
    carriers = system.schedule.carriers(plan)
    slope = lanes_per_phase(plan)
    visits = np.array([np.sum(carriers == carrier) for carrier in range(plan.count)])
    by_slot = slope[:, carriers] / visits[carriers]
    radians_per_metre = np.pi * (plan.forward_carriers_hz + plan.return_carriers_hz)[carriers] / plan.speed_of_light_m_s
    expected = np.zeros((plan.count - 2, 3, 3))
    for i in range(3):
        for j in range(3):
            noise = 0.5 / measured.snr_forward + 0.5 / measured.snr_return[:, i, j] + 0.03**2
            expected[:, i, j] = (
                by_slot**2 @ noise
                + 0.02**2 * np.sum(slope**2, axis=1)
                + rate[3 * i + j] * (by_slot @ (radians_per_metre * times)) ** 2
                + acceleration[3 * i + j] * (by_slot @ (radians_per_metre * times**2 / 2.0)) ** 2
            )
    np.testing.assert_allclose(found, np.sqrt(expected), rtol=1e-6)


def test_noise_of_the_fine_ranges_is_that_of_the_first_and_the_last_carrier(slots) -> None:
    taken, measured, system = slots
    carriers = system.schedule.carriers(system.plan)
    metres = system.plan.speed_of_light_m_s / (2.0 * np.pi * system.plan.offsets_hz[-1])
    expected = np.zeros((9, 9))
    for carrier in (0, system.plan.count - 1):
        these = carriers == carrier
        back = np.mean((0.5 / measured.snr_return + 0.03**2)[these], axis=0) / np.sum(these)
        expected += np.diag(back.ravel()) + np.mean(0.5 / measured.snr_forward[these]) / np.sum(these)
    np.testing.assert_allclose(taken.range_noise(), metres**2 * expected, rtol=1e-9)


def test_rate_and_acceleration_are_a_straight_line_through_the_phase_rates_with_its_covariance(slots) -> None:
    taken, measured, system = slots
    times, plan = system.schedule.offsets_s(system.plan), system.plan
    carriers = system.schedule.carriers(plan)
    metres = plan.speed_of_light_m_s / np.pi / (plan.forward_carriers_hz + plan.return_carriers_hz)[carriers]
    shown = metres[:, None] * measured.phase_rate_rad_s.reshape(len(times), 9)
    line = np.linalg.pinv(np.stack([np.ones_like(times), times], axis=1))
    rates, rate_noise, slopes, slope_noise = taken.path_motion()
    np.testing.assert_allclose([rates.ravel(), slopes.ravel()], line @ shown, rtol=1e-9, atol=1e-12)
    per_slot = (metres * np.sqrt(12.0) / system.schedule.dwell_s) ** 2
    back = 0.5 / measured.snr_return.reshape(len(times), 9) + 0.03**2
    for found, weights in ((rate_noise, line[0]), (slope_noise, line[1])):
        scaled = weights**2 * per_slot
        np.testing.assert_allclose(found, np.diag(scaled @ back) + scaled @ (0.5 / measured.snr_forward), rtol=1e-9)


def test_the_bend_of_all_paths_is_where_the_phases_fit_whole_lanes_best(far, rng) -> None:
    """Residuals of the lanes, weighed by their covariance, and the prior: least on a fine grid of accelerations."""
    system = InterferometerSystem()
    plan = system.plan
    measured = InterferometerSource(system, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    taken = _Slots(measured, system, 0.3)
    rates = expected_path_rates_m_s(far, system)
    phases, _ = taken.at_epoch(rates, expected_path_accelerations_m_s2(far, system) - 0.021)
    # Nearly the same on all paths: they change their lanes together, as far away.
    phases = phases[:, :1, :1] + 0.0001 * rng.normal(size=phases.shape)
    prior = 0.05**2 * np.ones((9, 9)) + np.diag(np.linspace(0.004, 0.009, 9) ** 2)
    best, after, margin = taken.bend(phases, prior)

    carriers, times = system.schedule.carriers(plan), system.schedule.offsets_s(plan)
    mean_square_s2 = np.array([np.mean(times[carriers == carrier] ** 2) for carrier in range(plan.count)])
    turned = (
        0.5 * mean_square_s2 * np.pi * (plan.forward_carriers_hz + plan.return_carriers_hz) / plan.speed_of_light_m_s
    )
    slope = lanes_per_phase(plan)
    noise = np.zeros(plan.count)
    for carrier in range(plan.count):
        these = carriers == carrier
        back = np.mean(0.5 / measured.snr_return[these] + 0.3**2) / 9.0
        noise[carrier] = (np.mean(0.5 / measured.snr_forward[these]) + back) / np.sum(these)
    weight = np.linalg.inv(slope * noise @ slope.T)
    variance = np.mean(prior)
    tried = np.linspace(-4.0, 4.0, 2001) * np.sqrt(variance)
    resolved = resolve_ranges(phases - (tried[:, None] * turned)[..., None, None], plan)
    off = np.mean(resolved.lane_residuals, axis=(2, 3))
    cost = np.einsum("nk,kl,nl->n", off, weight, off) + tried**2 / variance
    # With the same lanes the cost is a parabola: three points give where its least is, and how much.
    same = np.all(resolved.lanes[1:] == resolved.lanes[:-1], axis=(1, 2, 3))
    rising, bending = 0.5 * (cost[2:] - cost[:-2]), cost[2:] - 2.0 * cost[1:-1] + cost[:-2]
    least = np.r_[np.inf, np.where(same[1:] & same[:-1], cost[1:-1] - 0.5 * rising**2 / bending, np.inf), np.inf]
    least[np.r_[True, np.abs(rising) > bending, True]] = np.inf
    first = int(np.argmin(least))
    vertex = tried[first] - (tried[1] - tried[0]) * rising[first - 1] / bending[first - 1]
    assert best == pytest.approx(vertex, rel=1e-6)
    assert best == pytest.approx(0.021, abs=0.01)
    # Of the sets of lanes in which most ranges are others.
    others = np.mean(np.abs(resolved.ranges_m - resolved.ranges_m[first]) > 0.5 * plan.ambiguities_m[-1], axis=(1, 2))
    assert margin == pytest.approx(np.min(least[others > 0.5]) - least[first], rel=1e-6)
    assert margin < 100.0
    # What is left: the prior, and a measurement of the mean of all paths.
    information = (lambda s: s @ weight @ s)(slope @ turned)
    expected = np.linalg.inv(np.linalg.inv(prior) + information / 81.0 * np.ones((9, 9)))
    np.testing.assert_allclose(after, expected, rtol=1e-6, atol=1e-12)


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


def test_standalone_ranges_are_corrected_by_the_measured_rates_and_know_their_errors(far) -> None:
    system = InterferometerSystem(schedule=Schedule(order="ascending"))
    measured = InterferometerSource(system, RadioParams(), LinkParams(), 5).measure(0.0, far.motion)
    hint = PathMotion(
        rates_m_s=expected_path_rates_m_s(far, system) + 0.01,
        accelerations_m_s2=expected_path_accelerations_m_s2(far, system),
    )
    reading = read_ranges(measured, system, ErrorFloor(), hint)
    ranges, spread = reading.standalone_ranges()
    moved = reading.vector[RATES] - hint.rates_m_s.ravel()
    np.testing.assert_allclose(ranges.ravel(), reading.vector[RANGES] - reading.lever_s * moved, rtol=1e-12)
    total = reading.noise + np.diag(reading.hardware)
    np.testing.assert_allclose(spread, total[RANGES, RANGES] + reading.lever_s**2 * total[RATES, RATES], rtol=1e-12)
    assert reading.lever_s > 5.0
