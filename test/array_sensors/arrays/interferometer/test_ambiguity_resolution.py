import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.ambiguity_resolution import (
    carrier_range,
    resolve_ranges,
    sharpened_ranges,
)
from rf_pointing.array_sensors.arrays.interferometer.array_geometry import ArrayParams, path_lengths, two_way_ranges
from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan, carrier_phases
from rf_pointing.array_sensors.arrays.interferometer.design import largest_phase_bias_rad

PLAN = CarrierPlan(speed_of_light_m_s=3.0e8)
ARRAYS = ArrayParams()


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


def test_range_from_the_carrier_itself_is_biased_by_unequal_ways(worked_example) -> None:
    xi, attitude = worked_example
    lengths = path_lengths(1e3 * xi, attitude, ARRAYS)
    out, back = lengths[0, 0], lengths[1:, 1:]
    assert np.max(np.abs(out - back)) > 0.3
    # The bias exceeds half the 12 cm lane, so compare modulo the lane: explicit tracking of two-way range fails.
    found, _ = carrier_range(phases_of(out, back), out + back, PLAN)
    expected = out + back + 0.2 * (out - back)
    lane = 2.0 * 3.0e8 / 5.0e9
    off = (found - expected + 0.5 * lane) % lane - 0.5 * lane
    np.testing.assert_allclose(off, 0.0, atol=1e-6)
    assert np.max(np.abs(found - out - back)) > 0.02


def test_equal_ways_give_the_carrier_range_exactly() -> None:
    found, residual = carrier_range(phases_of(500.0, np.full((2, 2), 500.0)), np.full((2, 2), 1000.003), PLAN)
    np.testing.assert_allclose(found, 1000.0, atol=1e-7)
    np.testing.assert_allclose(residual, 0.003 / 0.12, atol=1e-5)


def test_differences_from_the_return_carriers_are_exact_and_keep_the_mean(worked_example, rng) -> None:
    xi, attitude = worked_example
    lengths = path_lengths(1e4 * xi, attitude, ARRAYS)
    truth = two_way_ranges(1e4 * xi, attitude, ARRAYS)
    noisy = truth + 0.01 * rng.normal(size=(3, 3))
    sharp, residual = sharpened_ranges(phases_of(lengths[0, 0], lengths[1:, 1:]), noisy, PLAN)
    assert np.mean(sharp) == pytest.approx(np.mean(noisy))
    np.testing.assert_allclose(sharp - np.mean(sharp), truth - np.mean(truth), atol=1e-8)
    assert np.max(np.abs(residual)) < 1e-6
