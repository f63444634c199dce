"""Conscan and step-track from the streams of a station: powers wait until the beam is known, estimates refer to the centre."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rf_pointing.core import MDEG, MU, CarrierPower, JointReading, PointingError
from rf_pointing.tracking import StepTrackParams
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.power_tracker import PowerTracker, PowerTrackerParams

CENTRE = np.array([1.0, 0.8])


def reading(t_s: float, away: tuple[float, float]) -> JointReading:
    return JointReading(t_s=t_s, position_rad=CENTRE + np.array(away), velocity_rad_s=np.zeros(2))


def power(t_s: float) -> CarrierPower:
    return CarrierPower(t_s=t_s, integration_s=0.1, power_w=1e-15, sigma_w=1e-17, carrier_to_noise_db_hz=55.0)


NO_OFFSET = np.zeros(2)


def tracker(**changes: Any) -> PowerTracker:
    scan = ConscanParams(**{"window_samples": 8, "fewest_samples": 8, **changes})
    return PowerTracker(PowerTrackerParams(conscan=scan))


def status(t_s: float, mode: str = "conscan", sensor: str = "conscan") -> tuple[Any, ...]:
    return t_s, CENTRE, NO_OFFSET, mode, sensor


def test_outside_a_scan_powers_only_carry_their_level() -> None:
    scan = tracker()
    errors = [error for k in range(10) for error in scan.take_power(power(0.1 * k))]
    # Every second one, at the middle of its integration.
    assert [error.t_s for error in errors] == pytest.approx([0.05, 0.25, 0.45, 0.65, 0.85])
    assert {(error.valid, error.reason, error.carrier_to_noise_db_hz) for error in errors} == {
        (False, "nothing is scanned", 55.0)
    }
    assert {(error.cross_elevation_rad, error.elevation_rad) for error in errors} == {(0.0, 0.0)}


def test_the_delay_of_the_receiving_chain_is_taken_into_account() -> None:
    scan = tracker(delay_s=0.5)
    scan.take_status(*status(0.0))
    for k in range(21):
        scan.take_status(*status(0.1 * k))
        scan.take_joints(reading(0.1 * k, (0.0, 1e-5 * k)))
    (error,) = scan.take_power(power(1.55))
    assert error.reason.startswith("window holds 1")
    assert scan.conscan.state.window.rows[0, 0] == pytest.approx(1.0)
    assert scan.conscan.state.window.rows[0, 4] == pytest.approx(1e-4)


def test_powers_from_before_the_scan_do_not_hold_up_those_of_the_scan() -> None:
    scan = tracker()
    scan.take_status(*status(10.0))
    scan.take_joints(reading(10.0, (0.0, 0.0)))
    assert scan.take_power(power(10.0)) == []
    scan.take_status(*status(10.1))
    scan.take_joints(reading(10.1, (0.0, 0.0)))
    assert [error.reason for error in scan.take_power(power(10.1))] == ["window holds 1 of 8 samples"]


@pytest.mark.parametrize("mode", ["conscan", "steptrack"])
def test_a_new_scan_starts_with_an_empty_window(mode: str) -> None:
    scan = tracker()
    at = (0.0, 0.0) if mode == "conscan" else (0.0, scan.steptrack.params.step_rad)
    for start_s, now in ((0.0, mode), (1.0, "coast"), (2.0, mode)):
        for k in range(4):
            scan.take_status(*status(start_s + 0.1 * k, now))
            scan.take_joints(reading(start_s + 0.1 * k, at))
        if now == mode:
            scan.take_power(power(start_s + 0.2))
            scan.take_power(power(start_s + 0.3))
            held = scan.conscan.state.window if mode == "conscan" else scan.steptrack.state.window
            assert len(held) == 2
            assert scan.rejections[0] == 0


# Bad input: rejected with a reason, counted, and the loop carries on


PLANTED = np.radians([3e-3, -2e-3])
SCAN = ConscanParams(period_s=4.0, window_samples=40, fewest_samples=40, updates="sample")


def circling(
    scan: PowerTracker, spoil: Callable[[int, CarrierPower], list[CarrierPower]], start_s: float = 0.0
) -> list[PointingError]:
    """Run the circle about a target at rest without noise; `spoil` replaces each power by what really arrives."""
    found, beamwidth = [], SCAN.half_power_beamwidth_rad
    for k in range(1, 90):
        t_s, angle = start_s + 0.1 * k, 2.0 * math.pi * 0.1 * k / SCAN.period_s
        away = SCAN.radius_rad * np.array([math.cos(angle), math.sin(angle)])
        scan.take_status(*status(t_s))
        scan.take_joints(reading(t_s, (away[0] / math.cos(CENTRE[1] + away[1]), away[1])))
        half = math.pi * 0.1 / SCAN.period_s
        beam = SCAN.radius_rad * np.array([math.cos(angle - half), math.sin(angle - half)]) * math.cos(half)
        loss = math.exp(-4.0 * math.log(2.0) * float(np.sum((PLANTED - beam) ** 2)) / beamwidth**2)
        good = CarrierPower(
            t_s=t_s, integration_s=0.1, power_w=1e-15 * loss, sigma_w=1e-19, carrier_to_noise_db_hz=60.0
        )
        found += [error for arrived in spoil(k, good) for error in scan.take_power(arrived)]
    return found


BAD = {
    "negative power": ({"power_w": -1e-15}, "power_w=-1e-15 must be > 0"),
    "power is not a number": ({"power_w": math.nan}, "must be finite"),
    "negative deviation": ({"sigma_w": -1e-17}, "sigma_w=-1e-17 must be > 0"),
    "level is not a number": ({"carrier_to_noise_db_hz": math.nan}, "must be finite"),
    "no integration": ({"integration_s": 0.0}, "integration_s=0.0 must be > 0"),
    "infinite time": ({"t_s": math.inf}, "must be finite"),
    "time of tomorrow": ({"t_s": 86400.0}, "after the newest status"),
    "time twice": ({"t_s": 4.9}, "must be later than that of the power before"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_power_is_rejected_with_its_reason_and_nothing_else_changes(name: str) -> None:
    changes, reason = BAD[name]
    scan = PowerTracker(PowerTrackerParams(conscan=SCAN))
    found = circling(scan, lambda k, good: [dataclasses.replace(good, **changes)] if k == 50 else [good])
    count, said = scan.rejections
    assert count == 1
    assert reason in said
    wanted = circling(PowerTracker(PowerTrackerParams(conscan=SCAN)), lambda k, good: [] if k == 50 else [good])
    assert found[-1].valid, found[-1].reason
    assert found[-1].t_s == wanted[-1].t_s
    assert found[-1].cross_elevation_rad == wanted[-1].cross_elevation_rad
    assert found[-1].elevation_rad == pytest.approx(PLANTED[1], abs=2e-6)


def test_time_set_back_by_minutes_starts_anew_instead_of_rejecting_for_ever() -> None:
    scan = PowerTracker(PowerTrackerParams(conscan=SCAN))
    scan.take_power(power(1000.0))
    assert circling(scan, lambda _k, good: [good])[-1].valid
    assert scan.rejections[0] == 0


def test_a_beam_that_rests_names_the_missing_positions_and_the_next_scan_works() -> None:
    scan = PowerTracker(PowerTrackerParams(conscan=SCAN))
    found = []
    for k in range(1, 60):
        scan.take_status(*status(0.1 * k))
        scan.take_joints(reading(0.1 * k, (0.0, 0.0)))
        found += scan.take_power(power(0.1 * k))
    assert found[-1].reason == "1 distinct beam positions, must be at least 3"
    assert not found[-1].valid
    scan.take_status(*status(100.0, "coast"))
    assert circling(scan, lambda _k, good: [good], 101.0)[-1].valid


@pytest.mark.parametrize("name", ["negative power", "power is not a number", "time of tomorrow"])
def test_step_track_carries_on_after_a_bad_power(name: str) -> None:
    changes, reason = BAD[name]
    steps = StepTrackParams(dwell_s=1.0, move_s=0.5)
    scan, found = PowerTracker(PowerTrackerParams(conscan=SCAN, steptrack=steps)), []
    for k in range(1, 80):
        t_s, at = 0.1 * k, scan.steptrack.offset(0.1 * k - 0.05)
        here = scan.steptrack.offset(t_s)
        scan.take_status(*status(t_s, "steptrack", "steptrack"))
        scan.take_joints(
            reading(t_s, (here.cross_elevation_rad / math.cos(CENTRE[1] + here.elevation_rad), here.elevation_rad))
        )
        beam = np.array([at.cross_elevation_rad, at.elevation_rad])
        loss = math.exp(-4.0 * math.log(2.0) * float(np.sum((PLANTED - beam) ** 2)) / steps.half_power_beamwidth_rad**2)
        good = CarrierPower(
            t_s=t_s, integration_s=0.1, power_w=1e-15 * loss, sigma_w=1e-19, carrier_to_noise_db_hz=60.0
        )
        arrived = dataclasses.replace(good, **changes) if k == 12 else good
        found += [error for error in scan.take_power(arrived) if error.estimated]
        if k == 13:
            assert reason in scan.rejections[1]
    assert found[0].valid, found[0].reason
    np.testing.assert_allclose([found[0].cross_elevation_rad, found[0].elevation_rad], PLANTED, atol=2e-5)


@pytest.mark.parametrize("mode", ["conscan", "steptrack"])
def test_what_the_tracker_of_the_mode_refuses_is_reported_with_its_reason(mode: str) -> None:
    scan = tracker()
    for t_s in (0.0, 1.0, 2.0):
        scan.take_status(*status(t_s, mode, mode))
        scan.take_joints(reading(t_s, (0.0, scan.steptrack.params.step_rad)))
    weak = dataclasses.replace(power(1.0), carrier_to_noise_db_hz=3.0)
    (error,) = scan.take_power(weak)
    assert not error.valid
    assert error.sensor == mode
    lock = {"conscan": "15.0", "steptrack": "10.0"}[mode]
    assert scan.rejections == (1, f"no lock: C/N0 3.0 dB-Hz is below {lock} dB-Hz")
    (error,) = scan.take_power(dataclasses.replace(power(1.5), power_w=-1.0))
    assert scan.rejections == (2, "power_w=-1.0 must be > 0")


@pytest.mark.parametrize("late", ["encoders", "status"])
def test_a_power_waits_for_the_later_of_encoders_and_status(late: str) -> None:
    scan = tracker()

    def know(t_s: float, *streams: str) -> None:
        if "status" in streams:
            scan.take_status(*status(t_s))
        if "encoders" in streams:
            scan.take_joints(reading(t_s, (0.0, 0.0)))

    know(0.0, "status", "encoders")
    know(0.3, "status" if late == "encoders" else "encoders")
    assert scan.take_power(power(0.2)) == []
    know(0.3, late)
    assert [error.reason for error in scan.take_power(power(0.25))] == [
        "window holds 1 of 8 samples", "window holds 2 of 8 samples",
    ]  # fmt: skip


@pytest.mark.parametrize("late_s", [-0.2, 0.0, 0.3])
def test_a_delay_that_nobody_stated_is_learned_from_how_the_scan_is_moved(late_s: float) -> None:
    """The centre goes to and fro by 2 mdeg; powers are those of where the beam was `late_s` before."""
    params = ConscanParams(window_samples=40, fewest_samples=40, sample_s=0.1, period_s=4.0, updates="sample")
    scan, target = PowerTracker(PowerTrackerParams(conscan=params)), np.array([1.0, -2.0]) * MDEG

    def centre(t_s: float) -> np.ndarray:
        return np.array([2.0, 1.0]) * MDEG * (int(t_s // 8.0) % 2)

    def beam(t_s: float) -> np.ndarray:
        angle = 2.0 * math.pi * t_s / params.period_s
        return centre(t_s) + params.radius_rad * np.array([math.cos(angle), math.sin(angle)])

    for k in range(1200):
        t_s, here = 0.1 * k, beam(0.1 * k)
        scan.take_status(t_s, CENTRE + centre(t_s) / [math.cos(CENTRE[1]), 1.0], centre(t_s), "conscan", "conscan")
        scan.take_joints(reading(t_s, (here[0] / math.cos(CENTRE[1] + here[1]), here[1])))
        away = target - beam(t_s - 0.05 - late_s)
        watts = 1e-15 * math.exp(-MU * float(away @ away) / params.half_power_beamwidth_rad**2)
        scan.take_power(dataclasses.replace(power(t_s), power_w=watts, sigma_w=1e-3 * watts))
    assert scan.delay_s == pytest.approx(late_s, abs=0.05)
