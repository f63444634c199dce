"""The modes of the antenna: every end of a motion is a controlled stop, and a fault stays until it is reset."""

import itertools
import re

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import MDEG
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.modes import MODES, AntennaMode, AntennaModes, MotionSnapshot, Request
from rf_pointing.station.antenna.safety import SafetyParams
from test.station.stepped_antenna import SETTLING_S, STANDING, START_S, TICK_S, enabled, ramp


def test_deactivation_stops_the_axes_under_control_before_it_sets_the_brakes() -> None:
    clock = enabled()
    clock.antenna.accept(ramp(START_S, 3.0), START_S)
    clock.run(2.0)
    clock.antenna.deactivate()
    clock.run(0.2)
    braked = clock.antenna.reading(clock.t_s)
    assert np.max(np.abs(braked.velocity_rad_s)) < 1e-12
    clock.run(5.0)
    # The drives stand; the structure above them swings out.
    assert np.max(np.abs(np.array(clock.position[-250:]) - braked.position_rad)) < 20.0 * MDEG
    assert clock.antenna.mode == "inactive"
    assert clock.antenna.status(clock.t_s).command_lead_s == 0.0


def test_commands_that_stop_in_motion_end_in_a_controlled_stop_until_the_next_one() -> None:
    limits = CommandPreprocessorParams()
    clock = enabled()
    clock.antenna.accept(ramp(START_S, 1.0), START_S)
    clock.run(8.0)
    order = list(dict.fromkeys(clock.modes))
    assert order == ["tracking", "stopping", "holding"]
    last_tracking_s = TICK_S * (len(clock.modes) - clock.modes[::-1].index("tracking"))
    assert last_tracking_s == pytest.approx(1.0 + LoopParams().table.extrapolation_s, abs=2 * TICK_S)
    status = clock.antenna.status(clock.t_s)
    assert status.fault == ""
    assert status.warning.startswith("commands ran dry 1.0 s ago while moving: stopped until the next one")
    rates = clock.rates()
    assert np.max(np.abs(np.diff(rates, axis=0))) / TICK_S <= limits.acceleration_limit_rad_s2[0] * (1.0 + 1e-6)
    clock.run(SETTLING_S)
    np.testing.assert_allclose(clock.position[-1], clock.commanded[-1], atol=1.0 * MDEG)
    np.testing.assert_array_equal(clock.commanded[-1], clock.commanded[round(7.0 / TICK_S)])
    assert clock.antenna.accept(ramp(clock.t_s, 1.0), clock.t_s) == ""
    clock.run(0.1)
    status = clock.antenna.status(clock.t_s)
    assert (status.mode, status.warning) == ("tracking", "")


def test_a_latched_fault_refuses_commands_until_it_is_reset_at_rest() -> None:
    clock = enabled()
    clock.antenna.accept(ramp(START_S, 2.0), START_S)
    clock.run(1.0)
    clock.antenna.stop("stop was requested")
    assert clock.antenna.reset_fault() == "the axes are still moving"
    assert clock.antenna.accept(ramp(clock.t_s), clock.t_s) == "fault latched (stop was requested); reset it first"
    clock.run(5.0)
    assert clock.antenna.mode == "fault"
    assert clock.antenna.reset_fault() == ""
    assert clock.antenna.mode == "holding"
    assert clock.antenna.accept(ramp(clock.t_s), clock.t_s) == ""


def test_a_fault_that_cut_the_drives_is_not_reset_while_the_axes_still_turn() -> None:
    clock = enabled()
    clock.antenna.accept(ramp(START_S, 2.0), START_S)
    clock.run(1.0)
    clock.antenna.trip("an encoder is silent")
    assert clock.antenna.mode == "fault"
    assert clock.antenna.reset_fault() == "the axes are still moving"
    clock.run(3.0)
    assert clock.antenna.reset_fault() == ""


def test_a_refusal_says_in_words_how_the_antenna_is() -> None:
    """No refusal puts a noun after "is", and a latched fault is named with its way out."""
    machine, found = AntennaModes(), set[str]()
    for machine.mode, request, fault in itertools.product(MODES, Request, ("", "drives cut")):
        now = MotionSnapshot(fault=fault, high_wind="", moving=False, arrived=True)
        found.add(machine.reason_against(request, now))
    assert not [text for text in found if re.search("is (fault|manual_rate|drives cut)", text)]
    assert {"nothing to pause, the antenna is in fault", "fault latched (drives cut); reset it first"} <= found


@pytest.mark.parametrize("mode", [mode for mode, traits in MODES.items() if traits.ends_in or traits.at_rest])
def test_an_antenna_at_rest_or_on_its_way_there_takes_no_command(mode: AntennaMode) -> None:
    clock = enabled()
    clock.antenna.modes.mode = mode
    refused = clock.antenna.accept(ramp(START_S, 2.0), START_S)
    assert refused == f"the antenna is {mode}; resume it first"
    assert clock.antenna.mode == mode


def test_a_parked_antenna_is_stowed_in_high_wind_and_a_disabled_one_says_that_it_is_not() -> None:
    near = SafetyParams(park_azimuth_rad=STANDING[0], park_elevation_rad=STANDING[1] + 0.03, stow_elevation_rad=1.15)
    clock = enabled(safety=near)
    assert clock.antenna.park() == ""
    clock.run(8.0)
    assert clock.antenna.mode == "parked"
    clock.antenna.injected.inject("gust", 40.0)
    clock.run(12.0)
    assert clock.antenna.mode == "stowed"
    assert clock.antenna.reading(clock.t_s).position_rad[1] == pytest.approx(1.15, abs=1e-3)
    assert clock.antenna.status(clock.t_s).warning == ""
    assert "gust 40.0 m/s, limit 25.0 m/s" in clock.antenna.resume()

    other = enabled()
    assert other.antenna.disable() == ""
    other.run(1.0)
    other.antenna.injected.inject("gust", 40.0)
    other.run(5.0)
    assert other.antenna.mode == "disabled"
    assert (
        other.antenna.status(other.t_s).warning == "gust 40.0 m/s, limit 25.0 m/s: the antenna is not stowed (disabled)"
    )


@pytest.mark.parametrize(("kind", "value"), [("encoder_nan", 0.0), ("encoder_lie", 0.03)])
def test_a_fault_is_reset_only_when_its_cause_is_gone(kind: str, value: float) -> None:
    clock = enabled()
    clock.run(0.5)
    clock.antenna.injected.inject(kind, value)
    clock.run(0.5)
    assert clock.antenna.mode == "fault"
    assert clock.antenna.reset_fault().startswith("the cause is still there: azimuth encoder")
    assert (clock.antenna.mode, clock.antenna.axes.hardware.powered) == ("fault", False)
    clock.antenna.injected.inject("none", 0.0)
    clock.run(0.5)
    assert clock.antenna.reset_fault() == ""
    assert (clock.antenna.mode, clock.antenna.safety.latch.text) == ("holding", "")
