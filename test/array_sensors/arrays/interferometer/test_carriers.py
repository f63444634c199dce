import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan, carrier_phases, frequency_ratio

REPORT = CarrierPlan(speed_of_light_m_s=3.0e8)


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


def test_nonsense_plans_are_refused() -> None:
    with pytest.raises(ValueError, match=r"ratio=1.0 must be >= 1.01"):
        CarrierPlan(ratio=1.0)
    with pytest.raises(ValueError, match="count=2 must be >= 3"):
        CarrierPlan(count=2)
    with pytest.raises(ValueError, match="lowest_hz"):
        frequency_ratio(1.0, 2.0, 3)
