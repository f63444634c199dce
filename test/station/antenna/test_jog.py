"""The jog: rates while a key is held, and rest 0.5 s after it was last heard of."""

import math

import numpy as np
import pytest

from rf_pointing.simulation import StationSetup
from rf_pointing.station.antenna.control_unit import JOG_S
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna
from test.station.antenna.test_go_to import run

RATE_RAD_S = (math.radians(2.0), math.radians(-0.5))


@pytest.fixture
def antenna() -> SimulatedAntenna:
    made = StationSetup("leo_3m7").antenna()
    made.enable()
    run(made, 0.2)
    return made


def hold_key(antenna: SimulatedAntenna, seconds: float, rate: tuple[float, float]) -> list[str]:
    """Call every 0.2 s, as a page does while a button is pressed."""
    answers = []
    for _ in range(round(seconds / 0.2)):
        answers.append(antenna.jog(rate))
        run(antenna, 0.2, antenna.t_s)
    return answers


def test_it_moves_at_the_rates_while_it_is_called_and_rests_without_a_fault_when_it_is_not(
    antenna: SimulatedAntenna,
) -> None:
    hold_key(antenna, 2.0, RATE_RAD_S)
    assert antenna.mode == AntennaMode.JOGGING
    before = antenna.axes.encoder_rad.copy()
    hold_key(antenna, 2.0, RATE_RAD_S)
    moved = (antenna.axes.encoder_rad - before) / 2.0
    assert moved == pytest.approx(RATE_RAD_S, abs=math.radians(0.02))
    # The last call was 0.2 s ago.
    run(antenna, JOG_S - 0.2, antenna.t_s)
    assert antenna.mode == AntennaMode.JOGGING
    run(antenna, 0.04, antenna.t_s)
    assert antenna.mode == AntennaMode.STOPPING
    run(antenna, 3.0, antenna.t_s)
    assert (antenna.mode, antenna.safety.latch.text) == (AntennaMode.HOLDING, "")
    rest = antenna.axes.encoder_rad.copy()
    run(antenna, 5.0, antenna.t_s)
    assert antenna.axes.encoder_rad == pytest.approx(rest, abs=math.radians(0.02))


def test_a_jog_ends_at_the_limits_without_a_fault_and_turns_back(antenna: SimulatedAntenna) -> None:
    fast = antenna.axes.limits.rate_limit_rad_s
    hold_key(antenna, 60.0, (0.0, -fast[1]))
    lowest = antenna.axes.limits.travel_min_rad[1]
    assert antenna.axes.encoder_rad[1] > lowest - math.radians(0.05)
    assert antenna.axes.encoder_rad[1] < lowest + math.radians(8.0)
    assert antenna.safety.latch.text == ""
    before = float(antenna.axes.encoder_rad[1])
    assert set(hold_key(antenna, 2.0, (0.0, fast[1]))) == {""}
    assert antenna.axes.encoder_rad[1] > before + math.radians(1.0)


def test_what_is_too_fast_no_number_or_at_the_wrong_time_moves_nothing(antenna: SimulatedAntenna) -> None:
    here = antenna.axes.encoder_rad.copy()
    assert "azimuth rate 57.296 deg/s must be within 5.400 deg/s" in antenna.jog((1.0, 0.0))
    assert "rate nan" in antenna.jog((math.nan, 0.0))
    antenna.rest(AntennaMode.PARKED)
    assert antenna.jog(RATE_RAD_S) == "the antenna is parked, must be holding"
    antenna.enable()
    antenna.stop("a fault")
    assert "fault latched" in antenna.jog(RATE_RAD_S)
    run(antenna, 1.0, antenna.t_s)
    assert antenna.axes.encoder_rad == pytest.approx(here, abs=math.radians(0.05))


def test_other_requests_end_a_jog_and_a_jog_keeps_commanders_out(antenna: SimulatedAntenna) -> None:
    hold_key(antenna, 1.0, RATE_RAD_S)
    assert antenna.jog((0.0, 0.0)) == ""
    assert antenna.mode == AntennaMode.STOPPING, "zero rates stop at once"
    hold_key(antenna, 1.0, RATE_RAD_S)
    here = np.array(antenna.axes.encoder_rad)
    assert antenna.go_to((float(here[0]), float(here[1]) + 0.1)) == ""
    assert antenna.mode == AntennaMode.HOLDING
    assert antenna.park() == ""
    assert "must be holding" in antenna.jog(RATE_RAD_S)
