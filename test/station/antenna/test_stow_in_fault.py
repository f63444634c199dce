"""In a storm: the elevation is stowed in spite of a fault that an operator names, with the azimuth braked."""

import math

import numpy as np
import pytest

from rf_pointing.core import MDEG
from rf_pointing.station.antenna.safety import SafetyParams
from test.station.stepped_antenna import Clock, enabled, ramp

STOW_RAD = SafetyParams().stow_elevation_rad


@pytest.fixture
def broken(request: pytest.FixtureRequest) -> Clock:
    """An antenna whose azimuth has a fault that is still there; the brakes are set."""
    clock = enabled()
    clock.antenna.accept(ramp(clock.t_s), clock.t_s, "test")
    clock.run(0.5)
    clock.antenna.injected.inject(*request.param)
    clock.run(2.0)
    assert clock.antenna.mode == "fault"
    return clock


@pytest.mark.parametrize(
    "broken",
    [("encoder_nan", 0.0), ("encoder_lie", math.radians(1.0)), ("runaway", math.radians(1.9))],
    indirect=True,
    ids=lambda given: given[0],
)
def test_the_elevation_is_stowed_and_the_azimuth_keeps_its_brake(broken: Clock) -> None:
    antenna = broken.antenna
    fault = antenna.safety.latch.text
    assert fault.startswith("azimuth")
    azimuth = antenna.hardware.true_joint_rad[0]
    assert antenna.stow() == f"fault latched ({fault}); reset it first"
    assert antenna.stow_in_fault(fault) == ""
    assert antenna.mode == "stowing"
    broken.run(60.0)
    assert antenna.mode == "stowed"
    assert antenna.safety.latch.text == fault, "it stays latched"
    at = antenna.hardware.true_joint_rad
    assert at[1] == pytest.approx(STOW_RAD, abs=math.radians(0.05))
    assert abs(at[0] - azimuth) < 1.0 * MDEG


@pytest.mark.parametrize("broken", [("encoder_nan", 0.0)], indirect=True)
def test_only_the_fault_by_its_name_opens_it(broken: Clock) -> None:
    antenna, fault = broken.antenna, broken.antenna.safety.latch.text
    before = antenna.hardware.true_joint_rad.copy()
    assert antenna.stow_in_fault("storm") == f"the latched fault is {fault!r}, the request names 'storm'"
    assert antenna.mode == "fault"
    broken.run(1.0)
    assert np.max(np.abs(antenna.hardware.true_joint_rad - before)) < 5.0 * MDEG, "it swings out on its brakes"
    assert antenna.stow_in_fault(fault) == ""
    broken.run(3.0)
    antenna.stop("stop was requested")
    broken.run(10.0)
    assert antenna.mode == "fault"
    again = antenna.safety.latch.text
    assert again == f"{fault}; stop was requested"
    assert antenna.stow_in_fault(again) == "", "after a stop on the way it goes on"


def test_without_a_fault_and_with_one_of_the_elevation_it_is_refused() -> None:
    clock = enabled()
    antenna = clock.antenna
    clock.run(1.0)
    assert antenna.stow_in_fault("") == "no fault is latched; request stow"
    antenna.trip("elevation encoder jumped by 3.000 deg")
    clock.run(0.1)
    refused = antenna.stow_in_fault("elevation encoder jumped by 3.000 deg")
    assert refused == "the elevation cannot be trusted: elevation encoder jumped by 3.000 deg"
    assert antenna.mode == "fault"
