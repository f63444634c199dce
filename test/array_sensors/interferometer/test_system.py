"""Geometry of the sixteen paths, the carrier plan and its schedule: derivatives, stacks and printed numbers."""

import numpy as np
import pytest

from rf_pointing.array_sensors.interferometer.frames import frame_rotation
from rf_pointing.array_sensors.interferometer.system import (
    ArrayParams,
    CarrierPlan,
    Schedule,
    element_positions,
    path_accelerations_m_s2,
    path_lengths,
    path_rates_m_s,
    range_acceleration_lever_s2,
    range_rate_lever_s,
    two_way_gradients,
    two_way_ranges,
)
from rf_pointing.papers.interferometer_design import frequency_ratio
from rf_pointing.papers.interferometer_simulation import carrier_phases

UNEQUAL = ArrayParams(radius_active_m=0.7, radius_passive_m=1.3, transponder_delay_m=4.0)
REPORT = CarrierPlan(speed_of_light_m_s=3.0e8)
PLAN = CarrierPlan()


def test_elements_sum_to_zero_120_degrees_apart_in_the_plane_across_boresight() -> None:
    elements = element_positions(0.5)
    np.testing.assert_allclose(elements.sum(axis=0), 0.0, atol=1e-16)
    np.testing.assert_array_equal(elements[:, 0], 0.0)
    np.testing.assert_allclose(np.linalg.norm(elements[1:], axis=1), 0.5)
    np.testing.assert_allclose(elements[1] @ elements[2], 0.25 * np.cos(np.radians(120.0)))
    np.testing.assert_allclose(elements[1], [0.0, 0.0, -0.5])
    assert elements[2, 1] < 0.0


def test_far_away_a_path_is_shorter_by_the_elements_projection(poses) -> None:
    directions, attitudes = poses
    distance = 1e6
    lengths = path_lengths(distance * directions, attitudes, UNEQUAL)
    active, passive = element_positions(0.7), element_positions(1.3)
    towards = np.einsum("nk,ik->ni", directions, active)[:, :, None]
    back = np.einsum("nkl,nl,jk->nj", attitudes, -directions, passive)[:, None, :]
    np.testing.assert_allclose(lengths, distance - towards - back, atol=3e-6)


def test_two_way_range_is_out_through_the_centres_and_back_by_the_elements(worked_example) -> None:
    xi, attitude = worked_example
    lengths = path_lengths(20.0 * xi, attitude, UNEQUAL)
    ranges = two_way_ranges(20.0 * xi, attitude, UNEQUAL)
    assert lengths[0, 0] == pytest.approx(20.0)
    np.testing.assert_allclose(ranges, lengths[1:, 1:] + 20.0 + 4.0)


def test_gradients_agree_with_differences_at_short_range(worked_example) -> None:
    xi, attitude = worked_example
    position, step = 3.0 * xi, 1e-6
    by_position, by_attitude = two_way_gradients(position, attitude, UNEQUAL)
    for axis in range(3):
        move = step * np.eye(3)[axis]
        change = two_way_ranges(position + move, attitude, UNEQUAL) - two_way_ranges(position - move, attitude, UNEQUAL)
        np.testing.assert_allclose(by_position[..., axis], change / (2 * step), atol=1e-8)
        turned = [two_way_ranges(position, frame_rotation(s * move) @ attitude, UNEQUAL) for s in (1, -1)]
        np.testing.assert_allclose(by_attitude[..., axis], (turned[0] - turned[1]) / (2 * step), atol=1e-8)


def test_path_rates_are_the_derivative_of_the_lengths(worked_example) -> None:
    xi, attitude = worked_example
    position, velocity, rate, step = 5.0 * xi, np.array([-0.3, 0.2, 0.1]), np.array([0.2, -0.1, 0.3]), 1e-5
    later, earlier = (
        path_lengths(position + s * step * velocity, frame_rotation(s * step * rate) @ attitude, UNEQUAL)
        for s in (1, -1)
    )
    rates = path_rates_m_s(position, velocity, attitude, rate, UNEQUAL)
    np.testing.assert_allclose(rates, (later - earlier) / (2 * step), atol=1e-9)


def test_the_listings_plan_spans_408_megahertz_with_a_finest_lane_of_0_7359_metres() -> None:
    assert REPORT.offsets_hz[-1] == pytest.approx(407.684e6, rel=1e-6)
    assert REPORT.ambiguities_m[-1] == pytest.approx(0.7359, abs=5e-5)
    assert REPORT.ambiguities_m[0] == pytest.approx(240e3)
    np.testing.assert_allclose(REPORT.offsets_hz[2:] / REPORT.offsets_hz[1:-1], 6.1324)


@pytest.mark.parametrize(("ratio", "first_hz", "span_mhz"), [(5.99427, 1500.0, 417.1), (6.0, 1500.0, 419.9)])
def test_spans_of_the_text_plans(ratio: float, first_hz: float, span_mhz: float) -> None:
    plan = CarrierPlan(ratio=ratio, minimum_difference_hz=first_hz)
    assert ratio == pytest.approx(frequency_ratio(2.5e9, 1500.0, 8), abs=0.007)
    assert plan.offsets_hz[-1] / 1e6 == pytest.approx(span_mhz, abs=0.1)


def test_published_exponents_start_one_step_higher() -> None:
    published = CarrierPlan(exponents="published")
    np.testing.assert_allclose(published.offsets_hz[1:], 6.1324 * CarrierPlan().offsets_hz[1:])
    assert published.offsets_hz[1] == pytest.approx(1250.0 * 6.1324)


def test_the_listings_ratio_is_the_eighth_root() -> None:
    assert frequency_ratio(2.5e9, 1250.0, 8) == pytest.approx(6.1324, abs=5e-5)


def test_phase_differences_depend_on_the_two_way_length_alone(rng) -> None:
    out, back = rng.uniform(10.0, 1e5, 20), rng.uniform(10.0, 1e5, (20, 3, 3))
    phases = carrier_phases(out, back, REPORT)
    assert phases.shape == (20, 9, 3, 3)
    two_way = out[:, None, None, None] + back[:, None]
    expected = 2.0 * np.pi * REPORT.offsets_hz[1:, None, None] / 3.0e8 * two_way
    np.testing.assert_allclose(phases[:, 1:] - phases[:, :1], expected, atol=2e-8)


def test_a_ratio_of_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="lowest_hz"):
        frequency_ratio(1.0, 2.0, 3)


def test_nested_order_sends_the_range_makers_innermost_and_everything_twice() -> None:
    carriers = Schedule().carriers(PLAN)
    np.testing.assert_array_equal(carriers, [1, 2, 3, 4, 5, 6, 7, 0, 8, 8, 0, 7, 6, 5, 4, 3, 2, 1])
    np.testing.assert_allclose(Schedule().mean_offset_powers(PLAN, 1), 0.0, atol=1e-15)
    assert Schedule().duration_s(PLAN) == pytest.approx(1.8)


def test_offsets_are_centred_and_a_simultaneous_schedule_has_none() -> None:
    ascending = Schedule(order="ascending", dwell_s=0.2)
    np.testing.assert_allclose(ascending.offsets_s(PLAN), np.linspace(-0.8, 0.8, 9))
    assert ascending.duration_s(PLAN) == pytest.approx(1.8)
    simultaneous = Schedule(order="simultaneous")
    np.testing.assert_array_equal(simultaneous.offsets_s(PLAN), 0.0)
    assert simultaneous.duration_s(PLAN) == pytest.approx(0.1)


def test_levers_of_rate_and_acceleration() -> None:
    assert range_rate_lever_s(Schedule(order="ascending"), PLAN) == pytest.approx(5.306, abs=1e-3)
    assert abs(range_rate_lever_s(Schedule(), PLAN)) < 1e-14
    assert range_acceleration_lever_s2(Schedule(), PLAN) == pytest.approx(-0.060, abs=1e-3)
    assert range_rate_lever_s(Schedule(order="simultaneous"), PLAN) == 0.0


def test_path_accelerations_are_the_second_derivative_of_the_lengths(worked_example) -> None:
    xi, attitude = worked_example
    position, velocity, rate, step = 5.0 * xi, np.array([-0.3, 0.2, 0.1]), np.array([0.2, -0.1, 0.3]), 1e-3
    before, now, after = (
        path_lengths(position + s * step * velocity, frame_rotation(s * step * rate) @ attitude, UNEQUAL)
        for s in (-1, 0, 1)
    )
    found = path_accelerations_m_s2(position, velocity, attitude, rate, UNEQUAL)
    np.testing.assert_allclose(found, (after - 2.0 * now + before) / step**2, atol=1e-7)


def test_the_reverse_direction_has_the_arrays_exchanged_and_the_same_delay() -> None:
    swapped = UNEQUAL.swapped()
    assert (swapped.radius_active_m, swapped.radius_passive_m, swapped.transponder_delay_m) == (1.3, 0.7, 4.0)


def test_waves_are_whole_turns_over_their_wavelengths() -> None:
    plan = CarrierPlan(count=4, forward_hz=3e9, return_hz=2e9, speed_of_light_m_s=3e8, ratio=10.0)
    offsets = np.array([0.0, 1250.0, 12500.0, 125000.0])
    np.testing.assert_allclose(plan.offsets_hz, offsets)
    np.testing.assert_allclose(plan.forward_wave_rad_m, 2.0 * np.pi * (3e9 + offsets) / 3e8, rtol=1e-12)
    np.testing.assert_allclose(plan.return_wave_rad_m, 2.0 * np.pi * (2e9 + offsets) / 3e8, rtol=1e-12)
    np.testing.assert_allclose(plan.ambiguities_m, [240e3, 24e3, 2.4e3], rtol=1e-12)
