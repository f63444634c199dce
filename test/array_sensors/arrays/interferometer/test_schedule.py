import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.interferometer.carriers import CarrierPlan
from rf_pointing.array_sensors.arrays.interferometer.schedule import (
    Schedule,
    range_acceleration_lever_s2,
    range_rate_lever_s,
)

PLAN = CarrierPlan()


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


def test_unknown_order_is_refused() -> None:
    with pytest.raises(ValueError, match="order='random' must be one of simultaneous, ascending, nested"):
        Schedule(order="random")
