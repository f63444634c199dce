"""Watches that scale: a few of the dishes of `benchmarks/random_dishes.py`, which flies 100 passes of 20."""

from typing import Any

import pytest

from test.scripts import script_module

DISHES = 3


@pytest.fixture(scope="module")
def random_dishes() -> Any:
    return script_module("benchmarks/random_dishes.py")


def test_random_dishes_fly_a_pass_without_a_false_fault(random_dishes: Any) -> None:
    random_dishes.SECONDS = 25.0
    for index, station in enumerate(random_dishes.dishes(DISHES, seed=2)):
        (window,) = random_dishes.windows(station, 1)
        assert random_dishes.Flight(station, window, index).fault() == "", station.name


def test_every_injected_fault_is_found_in_its_time(random_dishes: Any) -> None:
    for index, station in enumerate(random_dishes.dishes(2 * DISHES, seed=3)):
        for kind in random_dishes.FAULTS:
            found_s, bound_s = random_dishes.time_to_find_s(station, kind, index)
            assert found_s <= bound_s, (station.name, kind)


def test_thresholds_of_the_34_m_antenna_would_trip_on_a_coarse_encoder(random_dishes: Any) -> None:
    station = next(one for one in random_dishes.dishes(40, seed=4)
        if one.parameters("antenna_servo")["plant.azimuth.encoder_bits"] == 14)  # fmt: skip
    before = {"safety.watch.jump_deg": 0.03, "safety.watch.drift_deg": 0.03, "safety.watch.frozen_deg": 0.008}
    assert all(station.parameters("antenna_servo")[name] > value for name, value in before.items())
    with pytest.raises(ValueError, match="azimuth encoder"):
        random_dishes.time_to_find_s(station, "encoder_nan", 1, before)
