"""A drive in front of a control unit, with a device that reads and states just what a test says."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.controllers import CommandPreprocessorParams
from rf_pointing.core import Kinematics, Motion
from rf_pointing.drives import Capabilities, Drive, DriveParams, DriveReading
from rf_pointing.station.antenna.drive_antenna import DriveAntenna, DriveHardware, suited_safety, wait_for_drive
from rf_pointing.station.antenna.loops import BY_DRIVE, LoopParams
from rf_pointing.station.antenna.mount import MountParams, RateAverage
from rf_pointing.station.antenna.safety import SafetyParams
from rf_pointing.station.antenna.simulated_antenna import AntennaParams, SimulationParams
from test.station.driven_antenna import UNWATCHED

DEG = math.pi / 180.0
TICK_S = 0.02
POSITIONS = Capabilities(
    set_points="position", resolution_rad=(0.1 * DEG, 0.2 * DEG), rate_rad_s=(6.0 * DEG, 3.0 * DEG), period_s=0.2
)
RATES = dataclasses.replace(POSITIONS, set_points="rate", resolution_rad=(1e-6, 2e-6), period_s=TICK_S)
TRAVEL = DriveParams().rotator.replace(travel_min_rad=(-200.0 * DEG, 0.0), travel_max_rad=(200.0 * DEG, 90.0 * DEG))
MOTION = CommandPreprocessorParams(
    rate_limit_rad_s=(5.0 * DEG, 2.0 * DEG), acceleration_limit_rad_s2=(3.0 * DEG, 2.0 * DEG),
    travel_min_rad=(-180.0 * DEG, 5.0 * DEG), travel_max_rad=(190.0 * DEG, 85.0 * DEG),
)  # fmt: skip


class Told(Drive):
    """Reads what it is told, and writes down what it is sent."""

    def __init__(self, can: Capabilities = POSITIONS, place_deg: tuple[float, float] = (20.0, 40.0)) -> None:
        self.capabilities, self.problem = can, ""
        self.next: DriveReading | None = None
        self.sent: list[Any] = []
        self.read(0.0, place_deg)

    def read(self, t_s: float, place_deg: tuple[float, float], **changes: Any) -> None:
        self.next = DriveReading(t_s=t_s, position_rad=(place_deg[0] * DEG, place_deg[1] * DEG), **changes)

    def step(self, _t_s: float) -> DriveReading | None:
        return self.next

    def go_to(self, position_rad: tuple[float, float]) -> None:
        self.sent.append(position_rad)

    def turn(self, rate_rad_s: tuple[float, float]) -> None:
        self.sent.append(rate_rad_s)

    def stop(self) -> None:
        self.sent.append("stop")

    def enable(self) -> None:
        self.sent.append("enable")

    def close(self) -> None:
        self.sent.append("close")


def parts(can: Capabilities = POSITIONS, **rotator: Any) -> tuple[Told, DriveHardware]:
    drive = Told(can)
    return drive, DriveHardware(drive, DriveParams(type="own", rotator=TRAVEL.replace(**rotator)))


def antenna(
    can: Capabilities = POSITIONS, loops: LoopParams | None = None, **changes: Any
) -> tuple[Told, DriveAntenna]:
    drive = Told(can)
    rotator = changes.pop("rotator", TRAVEL)
    given = {"safety": UNWATCHED, "loops": loops or LoopParams(preprocessor=MOTION), **changes}
    return drive, DriveAntenna(AntennaParams(drive=DriveParams(type="own", rotator=rotator), **given), drive, 0.0)


# What it reads


def test_a_device_is_lost_when_its_reading_is_older_than_the_link_or_two_periods_allow() -> None:
    lost_s = DriveParams().link.lost_s
    for can, longest_s in ((POSITIONS, lost_s), (dataclasses.replace(POSITIONS, period_s=3.0 * lost_s), 6.0 * lost_s)):
        _, hardware = parts(can)
        for t_s in np.arange(0.0, longest_s - 0.01, TICK_S):
            hardware.look(float(t_s))
            assert hardware.current
            assert hardware.fault == ""
        hardware.look(longest_s - 0.005)
        # A look that came late is no silence of the device: its time does not count, now or later.
        hardware.look(longest_s + 0.01)
        assert hardware.current
        hardware.look(longest_s + 0.02)
        assert (
            hardware.fault
            == f"drive lost: no position from the drive for {longest_s + 0.01:.2f} s, at most {longest_s:.2f} s"
        )
        assert not hardware.current
        hardware.look(longest_s + 5.02)
        hardware.look(longest_s + 5.04)
        assert (
            hardware.fault
            == f"drive lost: no position from the drive for {longest_s + 0.04:.2f} s, at most {longest_s:.2f} s"
        )


def test_without_a_reading_nothing_is_known() -> None:
    drive, hardware = parts()
    drive.next = None
    hardware.look(0.0)
    assert not hardware.current
    assert hardware.fault == "drive lost: the drive has given no position yet"
    assert hardware.at_stop == (False, False)
    drive.problem = "no such port"
    hardware.look(0.02)
    assert hardware.fault == "drive lost: no such port"


@pytest.mark.parametrize(
    ("moved_deg", "one_turn", "lost", "doubted"),
    [(11.0, True, True, True), (-11.0, True, True, True), (9.0, True, True, False), (11.0, False, True, False),
     (11.0, True, False, False)],
)  # fmt: skip
def test_a_device_of_one_turn_that_moved_while_it_was_lost_may_have_lost_its_turn(
    moved_deg: float, one_turn: bool, lost: bool, doubted: bool
) -> None:
    drive, hardware = parts(dataclasses.replace(RATES, one_turn=one_turn))
    hardware.look(0.0)
    drive.problem = "gone" if lost else ""
    hardware.look(0.02)
    drive.problem = ""
    drive.read(0.04, (20.0 + moved_deg, 40.0))
    hardware.look(0.04)
    assert hardware.fault == (
        f"azimuth moved by {moved_deg:.1f} deg while the drive was lost, at most 10.0 deg: look at the cables, then reset"
        if doubted
        else ""
    )
    # What is doubted is not taken until it is reset.
    expected_deg = 20.0 if doubted else 20.0 + moved_deg
    assert hardware.encoders()[0] == pytest.approx(expected_deg * DEG)
    hardware.release_brake()
    assert hardware.fault == ""


def test_between_two_readings_a_powered_device_is_on_its_way_to_its_set_point() -> None:
    drive, hardware = parts(latency_s=0.0, minimum_interval_s=0.0)
    hardware.look(0.0)
    hardware.release_brake()
    goal = Motion(np.array([30.0, 40.0]) * DEG, np.zeros(2), np.zeros(2))
    hardware.move(np.zeros(2), (goal, goal))
    assert drive.sent[0] == "enable"
    assert drive.sent[1] == pytest.approx((30.0 * DEG, 40.0 * DEG))
    hardware.look(0.1)
    assert hardware.encoders() == pytest.approx((20.6 * DEG, 40.0 * DEG))
    # Under its brakes it is where it was read.
    hardware.brake()
    assert drive.sent[-1] == "stop"
    assert hardware.encoders() == pytest.approx((20.0 * DEG, 40.0 * DEG))
    # An unpowered device gets no set point, and none without a motion.
    sent = len(drive.sent)
    hardware.move(np.ones(2), (goal, goal))
    hardware.release_brake()
    hardware.move(np.ones(2), None)
    assert drive.sent[sent:] == ["enable"]


# Its antenna


def test_a_turn_from_outside_is_taken_at_rest() -> None:
    drive, made = antenna(
        dataclasses.replace(POSITIONS, one_turn=True),
        LoopParams(preprocessor=MOTION.replace(travel_max_rad=(400.0 * DEG, 85.0 * DEG))),
        rotator=TRAVEL.replace(travel_max_rad=(450.0 * DEG, 90.0 * DEG)),
    )
    made.place(375.0 * DEG)
    for found in (made.axes.encoder_rad, made.status(0.0).commanded_rad, made.hardware.switch_rad):
        assert found == pytest.approx([380.0 * DEG, 40.0 * DEG])
    # Also by its watch: what is read next is no jump.
    for t_s in (0.2, 0.4):
        drive.read(t_s, (20.1, 40.0))
        made.step(t_s)
    assert made.hardware.fault == ""
    assert made.axes.encoder_rad[0] == pytest.approx(380.1 * DEG)


def test_where_the_beam_points_is_told_of_a_device_that_knows_its_truth() -> None:
    """Its zero and the mount's lags are in it; the rate is that since the tick before, none at the first."""
    lag_s, averaging_s, rate_deg_s = 0.1, 0.5, (2.0, -1.0)
    mount = MountParams(azimuth_velocity_lag_s=lag_s, elevation_velocity_lag_s=-lag_s)
    drive, made = antenna(
        mount=mount, antenna=SimulationParams(lag_averaging_s=averaging_s), rotator=TRAVEL.replace(zero_rad=(0.1, 0.05))
    )
    _, boresight = made.step(0.02)
    assert boresight is None
    mean = RateAverage(averaging_s)
    for tick in range(2, 80):
        t_s = round(TICK_S * tick, 6)
        truth = np.radians([20.0, 40.0]) + np.radians(rate_deg_s) * (t_s - 0.04)
        drive.truth_rad = (float(truth[0]), float(truth[1]))
        _, boresight = made.step(t_s)
        assert boresight is not None
        if tick == 2:
            assert boresight.azimuth_rad == pytest.approx(20.0 * DEG + 0.1, abs=1e-12)
        # Of the rates of the axes; the beam's own differ by what the lags change in it.
        mean.update(TICK_S, np.radians(rate_deg_s) if tick > 2 else np.zeros(2))
    lag = np.array([lag_s, -lag_s]) * mean.rate_rad_s
    found = np.array([boresight.azimuth_rad, boresight.elevation_rad]) - truth - [0.1, 0.05]
    assert np.all(np.abs(lag) > 0.1 * DEG)
    np.testing.assert_allclose(found, -lag, rtol=0.2)


def test_the_beam_of_another_mount_is_on_the_sky_and_what_is_refused_has_the_names_of_its_axes() -> None:
    mount = Kinematics(type="x_y")
    safety = UNWATCHED.replace(kinematics=mount)
    drive, made = antenna(safety=safety)
    drive.truth_rad = (0.3, 0.2)
    _, boresight = made.step(TICK_S)
    assert boresight is not None
    assert (boresight.azimuth_rad, boresight.elevation_rad) == pytest.approx(mount.sky_at(0.3, 0.2), abs=1e-12)
    assert made.safety.watch.step((math.nan, 0.0), (0.0, 0.0))[1].startswith("x ")
    assert made.safety.drive.step((math.nan, 0.0), (0.0, 0.0)).startswith("x ")
    with pytest.raises(ValueError, match="y travel .* must be within that of the drive"):
        antenna(safety=safety, rotator=TRAVEL.replace(travel_max_rad=(TRAVEL.travel_max_rad[0], 0.3)))


# Its laws and limits


def test_a_device_that_takes_rates_keeps_the_laws_that_are_given() -> None:
    loops = LoopParams(preprocessor=MOTION)
    _, made = antenna(RATES, loops)
    assert made.axes.loops.params == loops
    with pytest.raises(ValueError, match="loops.law=drive needs a drive that takes positions, this one takes rates"):
        made.retune(AntennaParams().plant, loops.replace(law=BY_DRIVE))


@pytest.mark.parametrize(
    ("can", "rotator", "expected_deg"),
    [
        # The travel of the laws, where the device reaches further.
        ({}, {}, ((-180.0, 190.0), (5.0, 85.0))),
        # What the device states, from its zero; each end by itself.
        ({"travel_rad": ((-190.0 * DEG, -15.0 * DEG), (160.0 * DEG, 150.0 * DEG))}, {"zero_rad": (30.0 * DEG, 20.0 * DEG)},
            ((-160.0, 190.0), (5.0, 85.0))),
        ({"travel_rad": ((-260.0 * DEG, -14.92 * DEG), (159.95 * DEG, 64.95 * DEG))}, {"zero_rad": (30.0 * DEG, 20.0 * DEG)},
            ((-180.0, 189.95), (5.08, 84.95))),
        # Of a folded azimuth it states nothing.
        ({"travel_rad": ((0.0, 0.0), (360.0 * DEG, 84.93 * DEG)), "one_turn": True}, {}, ((-180.0, 190.0), (5.0, 84.93))),
        ({"travel_rad": ((0.0, 0.0), (360.0 * DEG, 84.93 * DEG))}, {"takes_one_turn": True}, ((-180.0, 190.0), (5.0, 84.93))),
        # An elevation that the device does not have is anywhere.
        ({"has_elevation": False}, {"travel_min_rad": (-200.0 * DEG, 10.0 * DEG), "travel_max_rad": (200.0 * DEG, 20.0 * DEG)},
            ((-180.0, 190.0), (5.0, 85.0))),
    ],
)  # fmt: skip
def test_the_travel_is_what_laws_and_device_have_in_common(
    can: dict[str, Any], rotator: dict[str, Any], expected_deg: tuple[tuple[float, float], ...]
) -> None:
    if expected_deg[0][0] == -160.0:
        with pytest.raises(
            ValueError, match="azimuth travel -180.0 to 190.0 deg .* that of the drive, -160.0 to 190.0"
        ):
            antenna(dataclasses.replace(POSITIONS, **can), rotator=TRAVEL.replace(**rotator))
        return
    _, made = antenna(dataclasses.replace(POSITIONS, **can), rotator=TRAVEL.replace(**rotator))
    np.testing.assert_allclose(np.degrees(made.axes.travel_rad), expected_deg, atol=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_laws_are_no_faster_than_the_device(axis: int) -> None:
    for rate_deg_s, taken in (((6.0, 3.0)[axis], True), ((6.0, 3.0)[axis] + 0.001, False)):
        rates = list(MOTION.rate_limit_rad_s)
        rates[axis] = rate_deg_s * DEG
        loops = LoopParams(preprocessor=MOTION.replace(rate_limit_rad_s=tuple(rates)))
        _, made = antenna()
        if taken:
            made.check(AntennaParams().plant, loops)
            made.retune(AntennaParams().plant, loops)
            assert made.axes.limits.rate_limit_rad_s[axis] == pytest.approx(rate_deg_s * DEG)
        else:
            for request in (made.check, made.retune):
                with pytest.raises(ValueError, match=r"deg/s of the drive"):
                    request(AntennaParams().plant, loops)
            assert made.axes.limits.rate_limit_rad_s == MOTION.rate_limit_rad_s


# Thresholds


def test_thresholds_are_above_the_steps_and_delays_of_a_drive() -> None:
    """Steps of 1 and 2 deg, 3 deg/s; between two readings of 0.5 s the tachometer goes on for 1.5 deg."""
    can = dataclasses.replace(
        RATES, resolution_rad=(1.0 * DEG, 2.0 * DEG), rate_rad_s=(3.0 * DEG, 1.0 * DEG), period_s=0.5, latency_s=0.7
    )
    found = suited_safety(SafetyParams(), can, TICK_S)
    assert found.gate.hard_rad == pytest.approx(3.0 * DEG)
    for name in ("jump_rad", "drift_rad", "frozen_rad"):
        assert getattr(found.watch, name) == pytest.approx(7.0 * DEG), name
    assert found.drive.delay_s == 0.7
    # Read in every tick, only the step counts.
    every = suited_safety(SafetyParams(), dataclasses.replace(can, period_s=TICK_S), TICK_S)
    assert every.watch.jump_rad == every.watch.drift_rad == every.watch.frozen_rad == pytest.approx(4.0 * DEG)
    rest = found.replace(gate=SafetyParams().gate, watch=SafetyParams().watch, drive=SafetyParams().drive)
    assert rest == SafetyParams()


def test_a_device_is_waited_for_until_it_has_read_or_patience_ends() -> None:
    drive = Told()
    first, asked = drive.next, iter(np.arange(0.0, 100.0))
    drive.next = None
    answers = iter([None, None, first])
    drive.step = lambda _t_s: next(answers)  # type: ignore[method-assign]
    wait_for_drive(drive, lambda: float(next(asked)), 60.0)
    assert next(answers, "all asked") == "all asked"
    drive.step = lambda _t_s: None  # type: ignore[method-assign]
    with pytest.raises(ValueError, match="drive: no position, waited 0 s"):
        wait_for_drive(drive, lambda: 0.0, 0.0)
