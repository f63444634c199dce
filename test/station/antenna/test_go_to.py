"""The request `go_to`: a motion of the antenna's own that holds at its end, through the safety gate."""

import math

import numpy as np
import pytest

from rf_pointing.simulation import StationSetup
from rf_pointing.station.antenna.modes import AntennaMode
from rf_pointing.station.antenna.simulated_antenna import SimulatedAntenna


@pytest.fixture
def antenna() -> SimulatedAntenna:
    made = StationSetup("leo_3m7").antenna()
    made.enable()
    return made


def run(antenna: SimulatedAntenna, seconds: float, begin_s: float = 0.0) -> None:
    for k in range(1, round(seconds / 0.02) + 1):
        antenna.step(round(begin_s + 0.02 * k, 6))


def test_it_turns_there_by_the_turn_of_the_cables_and_holds(antenna: SimulatedAntenna) -> None:
    for begin_s, goal_deg in ((0.0, (200.0, 30.0)), (90.0, (-160.0, 57.0))):
        assert antenna.go_to(tuple(np.radians(goal_deg))) == ""
        run(antenna, 90.0, begin_s)
        assert antenna.mode == AntennaMode.HOLDING
        assert np.degrees(antenna.axes.encoder_rad) == pytest.approx(goal_deg, abs=0.01)


def test_what_is_out_of_reach_or_not_allowed_is_refused_and_nothing_moves(antenna: SimulatedAntenna) -> None:
    before = antenna.axes.encoder_rad.copy()
    assert "past the limit 270.100 deg" in antenna.go_to((math.radians(300.0), 0.5))
    # The horizon mask is 3 deg high in the south-west.
    assert antenna.go_to((math.radians(60.0), math.radians(0.5))) != ""
    assert "finite" in refused(antenna, (math.nan, 0.5))
    antenna.stop("a fault")
    assert "fault latched" in antenna.go_to((0.0, 1.0))
    run(antenna, 5.0)
    assert antenna.axes.encoder_rad == pytest.approx(before, abs=math.radians(0.01))


def refused(antenna: SimulatedAntenna, goal: tuple[float, float]) -> str:
    try:
        return antenna.go_to(goal)
    except ValueError as error:
        return str(error)


def test_parked_antenna_does_not_go_before_it_is_released(antenna: SimulatedAntenna) -> None:
    antenna.park()
    run(antenna, 60.0)
    assert antenna.mode == AntennaMode.PARKED
    assert antenna.go_to((0.5, 1.0)) == "the antenna is parked"
    assert antenna.resume() == ""
    assert antenna.go_to((0.5, 1.0)) == ""
