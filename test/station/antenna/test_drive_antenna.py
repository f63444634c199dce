"""The control unit on real protocols: passes, faults of commands and devices, limits, and the lost device."""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rf_pointing.core.types import Pair
from rf_pointing.planning import HorizonMask, WindWatchParams
from rf_pointing.station.antenna.control_unit import JOG_S
from rf_pointing.station.antenna.loops import LoopParams
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams
from test.drives.benches import TICK_S
from test.drives.simulators import Easycomm, Gs232
from test.station.driven_antenna import MOTION, UNWATCHED, Driven

SERIAL = ["gs232", "easycomm 2", "spid rot2"]


@pytest.fixture
def driven() -> Iterator[Callable[..., Driven]]:
    with ExitStack() as until_the_end:
        yield lambda *args, **changes: until_the_end.enter_context(closing(Driven(*args, **changes))).enabled()


# Slews


@pytest.mark.parametrize("name", SERIAL)
def test_a_detour_over_a_hill_passes_its_corners_wherever_the_device_comes_to_rest(driven, name: str) -> None:
    """A controller of whole degrees stops 0.45 deg from the corner behind the hill."""
    hill = HorizonMask(
        azimuth_rad=tuple(np.radians([0.0, 20.0, 24.6, 35.4, 40.0])),
        elevation_rad=tuple(np.radians([0.0, 0.0, 52.37, 52.37, 0.0])),
    )
    subject = driven(name, safety=UNWATCHED.replace(mask=hill))
    subject.go(5.3, 10.4)
    subject.run(60.0)
    subject.go(60.45, 10.4)
    above = []
    for _ in range(round(60.0 / TICK_S)):
        subject.tick()
        azimuth, elevation = subject.true_deg.tolist()
        above.append(elevation - math.degrees(hill.lowest_rad(math.radians(azimuth))))
    assert subject.fault == subject.refused == ""
    step_deg = math.degrees(max(subject.antenna.hardware.rotator.smallest_rad))
    assert np.max(np.abs(subject.true_deg - [60.45, 10.4])) <= step_deg
    assert min(above) > 0.0


# Passes


def test_a_slew_is_one_motion_and_parks_where_it_should(driven) -> None:
    safety = UNWATCHED.replace(park_azimuth_rad=math.radians(100.0), park_elevation_rad=math.radians(80.0))
    subject = driven("gs232", safety=safety)
    assert subject.antenna.park() == ""
    assert subject.run(60.0, lambda: subject.mode == "parked") < 40.0
    assert subject.true_deg == pytest.approx([100.0, 80.0], abs=1.0)
    assert max(subject.device.model.starts) <= 3
    assert subject.device.model.reversals == [0, 0]
    before = len(subject.device.set_points)
    subject.run(5.0)
    assert len(subject.device.set_points) == before, "brakes set: no set points"


# A device that is lost


def test_five_seconds_of_silence_stop_the_device_when_it_answers_again(driven) -> None:
    subject = driven("gs232")
    subject.move((3.0, 0.0))
    subject.run(3.0)
    subject.device.silent = True
    subject.run(5.0)
    subject.device.silent = False
    assert subject.wait(20.0, lambda: subject.reading is not None)
    assert subject.device.received.count(b"S") >= 2
    assert subject.mode == "fault"


@pytest.mark.parametrize(
    ("name", "within_s"), [("hamlib", 1.0), ("easycomm 2", 1.0), ("spid rot2", 1.0), ("gs232", 1.2)]
)
def test_a_controller_that_restarts_in_the_middle_of_a_motion_is_found(driven, name: str, within_s: float) -> None:
    """It forgets its set point: the axes stand still; or it forgets where it is: a jump."""
    subject = driven(name)
    subject.move((3.0, 0.0))
    subject.run(3.0)
    subject.device.reset()
    subject.device.deaf = True
    took_s = subject.run(10.0, lambda: subject.mode == "fault")
    assert "stands still" in subject.fault
    print(f"{name}: a standstill is found after {took_s:.2f} s")
    assert took_s <= within_s
    subject = driven(name)
    subject.move((3.0, 0.0))
    subject.run(3.0)
    subject.device.reset((0.0, 0.0))
    took_s = subject.run(10.0, lambda: subject.mode == "fault")
    assert "encoder jumped" in subject.fault
    assert took_s <= 0.2 * 2 + 0.1


def test_the_alarm_of_a_controller_is_a_fault(driven) -> None:
    device = Easycomm(version=3)
    subject = driven("easycomm 3", device)
    device.errors = 2
    subject.run(3.0, lambda: subject.mode == "fault")
    assert subject.fault == "drive: jam"


@pytest.mark.parametrize("name", ["hamlib", "easycomm 2", "spid rot2"])
@given(
    moved_deg=st.tuples(st.floats(-30.0, 30.0), st.floats(-20.0, 20.0)), after_s=st.floats(0.0, 1.0), lost=st.booleans()
)
@settings(max_examples=12)
def test_a_device_that_is_elsewhere_is_not_moved_back_whenever_the_fault_is_reset(
    name: str, moved_deg: Pair, after_s: float, lost: bool
) -> None:
    """Lost and then elsewhere, or turned by somebody under its brakes: a reset holds where it is."""
    subject = Driven(name).enabled()
    try:
        subject.go(20.0, 40.0)
        subject.run(20.0)
        subject.path = None
        subject.antenna.trip("somebody has stopped it")
        subject.run(2.0)
        subject.device.silent = lost
        subject.run(3.0)
        there = 20.0 + moved_deg[0], 40.0 + moved_deg[1]
        zero = np.degrees(subject.bench.params.rotator.zero_rad)
        subject.device.reset((there[0] - zero[0], there[1] - zero[1]))
        subject.device.silent = False
        # A device that has answered all the time is known as well as its last reading.
        subject.run(after_s if lost else max(after_s, 0.3))
        assert subject.wait(3.0, lambda: subject.antenna.reset_fault() == "")
        subject.run(3.0)
        near_deg = math.degrees(subject.antenna.hardware.settled_rad)
        assert subject.true_deg == pytest.approx(there, abs=1.5 * near_deg)
    finally:
        subject.close()


@pytest.mark.parametrize("name", [*SERIAL, "hamlib"])
def test_a_jog_that_is_not_refreshed_leaves_the_device_at_rest_without_a_fault(
    driven: Callable[..., Driven], name: str
) -> None:
    subject = driven(name)
    antenna, rate = subject.antenna, math.radians(3.0)
    begin = float(antenna.axes.encoder_rad[0])
    for _ in range(20):
        assert antenna.jog((rate, 0.0)) == ""
        subject.run(0.2)
    moved = float(antenna.axes.encoder_rad[0]) - begin
    # It starts late, in steps.
    assert 2.0 * rate < moved < 4.5 * rate
    subject.run(JOG_S + 3.0)
    rest = antenna.axes.encoder_rad.copy()
    assert rest[0] - begin < moved + rate * (JOG_S + 1.0)
    subject.run(5.0)
    assert antenna.axes.encoder_rad == pytest.approx(rest, abs=1e-9)
    assert (subject.mode, subject.fault) == ("holding", "")


# Sensors and drives


@pytest.mark.parametrize("name", ["gs232", "hamlib"])
def test_a_frozen_read_back_is_found_while_the_device_moves(driven, name: str) -> None:
    subject = driven(name)
    subject.move()
    subject.run(3.0)
    subject.device.freeze()
    took_s = subject.run(10.0, lambda: subject.mode == "fault")
    assert "stands still" in subject.fault
    assert took_s < 3.0 * subject.device.resolution_deg + 4.0


@pytest.mark.parametrize("name", ["gs232", "hamlib"])
def test_a_single_wrong_reading_is_bridged_and_a_jump_is_not(driven, name: str) -> None:
    subject = driven(name)
    subject.move()
    subject.run(3.0)
    subject.device.lie_deg = 20.0
    subject.run(0.2)
    subject.device.lie_deg = 0.0
    subject.run(2.0)
    assert subject.mode == "tracking", subject.fault
    subject.device.lie_deg = 20.0
    took_s = subject.run(2.0, lambda: subject.mode == "fault")
    assert re.search("azimuth encoder jumped by (19|20|21)", subject.fault)
    assert took_s <= 2.0 * 0.2 + 0.1, "two poll periods"
    subject.run(1.0)
    subject.path = None
    assert subject.antenna.reset_fault() == ""


@pytest.mark.parametrize("rate_deg_s", [6.0, -6.0])
def test_a_device_that_moves_without_a_command_is_stopped(driven, rate_deg_s: float) -> None:
    subject = driven("gs232")
    subject.run(1.0)
    far = math.radians(300.0 if rate_deg_s > 0.0 else 5.0), math.radians(45.0)
    subject.device.model.command(subject.t_s, far)
    subject.device.deaf = True
    took_s = subject.run(5.0, lambda: subject.mode == "fault")
    assert "moves without a command" in subject.fault
    assert took_s < 2.0
    subject.device.deaf = False
    subject.run(2.0)
    assert not subject.device.model.moving, "a later stop reached it"


# Commands, as on the simulated antenna


def test_commands_that_stop_are_carried_on_for_a_second_and_end_in_a_stop(driven) -> None:
    subject = driven("hamlib")
    subject.move()
    subject.run(3.0)
    subject.silent = True
    begun_s = subject.t_s
    subject.run(5.0, lambda: subject.mode == "holding")
    assert "commands ran dry" in subject.antenna.status(subject.t_s).warning
    assert subject.t_s - begun_s < 4.0
    subject.run(1.0)
    stopped_at = subject.true_deg
    subject.run(2.0)
    assert subject.true_deg == pytest.approx(stopped_at, abs=0.05)
    assert subject.device.model.reversals == [0, 0], "a stop does not turn back"


def test_the_hard_limit_stops_the_device(driven) -> None:
    subject = driven("hamlib")
    subject.run(1.0)
    here = subject.true_deg[0]
    subject.antenna.retune(
        AntennaParams().plant,
        LoopParams(preprocessor=MOTION.replace(travel_max_rad=(math.radians(here + 1.0), math.pi))),
    )
    subject.device.model.command(subject.t_s, (math.radians(here + 180.0 + 30.0), math.radians(45.0)))
    subject.device.deaf = True
    subject.run(3.0, lambda: subject.mode == "fault")
    assert "past the hard limit" in subject.fault
    subject.device.deaf = False
    subject.run(2.0)
    assert subject.true_deg[0] < here + 20.0
    assert not subject.device.model.moving


def test_wind_of_a_topic_stows_and_its_silence_is_high_wind(driven) -> None:
    windy = SafetyParams(wind=WindWatchParams(gust_limit_m_s=20.0, silence_s=2.0, release_s=0.5))
    subject = driven("gs232", safety=windy)
    subject.go(10.0, 45.0)
    for _ in range(10):
        subject.antenna.hardware.note_wind(5.0)
        subject.run(1.0)
    assert subject.mode in ("holding", "tracking")
    for _ in range(5):
        subject.antenna.hardware.note_wind(30.0)
        subject.run(1.0)
    assert subject.mode == "stowing"
    assert "gust" in subject.antenna.safety.wind.reason

    other = driven("gs232", safety=windy)
    assert other.run(5.0, lambda: other.mode == "stowing") == pytest.approx(2.0 - 0.5, abs=0.3), "since the enabling"
    assert other.antenna.safety.wind.reason == "anemometer has not been received: taken for high wind"


# Start


def test_a_one_turn_azimuth_goes_on_with_the_turn_that_it_is_given(driven) -> None:
    """The device is at 370 deg and reads 10 deg."""
    motion = MOTION.replace(travel_min_rad=(0.0, 0.0), travel_max_rad=(math.radians(450.0), math.pi))
    device = Gs232(start_deg=(370.0, 45.0))
    device.one_turn = True
    subject = driven("gs232", device, motion=motion, zero_rad=(0.0, 0.0), reads_one_turn=True)

    def azimuth_deg() -> float:
        return math.degrees(subject.antenna.reading(0.0).position_rad[0])

    assert azimuth_deg() == pytest.approx(10.0)
    subject.antenna.place(math.radians(370.0))
    assert azimuth_deg() == pytest.approx(370.0)
    subject.go(400.0, 45.0)
    subject.run(20.0)
    assert subject.fault == ""
    assert azimuth_deg() == pytest.approx(400.0)
    assert subject.device.set_points[-1][1][0] == 400.0
