"""Conscan and step-track from the streams of a station: powers wait until the beam is known, estimates refer to the centre."""

import math
from typing import Any

import numpy as np
import pytest

from rf_pointing.geometry import CarrierPower, JointReading
from rf_pointing.station.power_tracker import PowerTracker
from rf_pointing.tracking import ConscanParams, StepTrackParams

CENTRE = np.array([1.0, 0.8])


def reading(t_s: float, away: tuple[float, float]) -> JointReading:
    return JointReading(t_s=t_s, position_rad=CENTRE + np.array(away), velocity_rad_s=np.zeros(2))


def power(t_s: float) -> CarrierPower:
    return CarrierPower(t_s=t_s, integration_s=0.1, power_w=1e-15, sigma_w=1e-17, carrier_to_noise_db_hz=55.0)


NO_OFFSET = np.zeros(2)


def tracker(**changes: Any) -> PowerTracker:
    return PowerTracker(ConscanParams(**{"window_samples": 8, "fewest_samples": 8, **changes}), StepTrackParams())


def status(t_s: float, mode: str = "conscan", sensor: str = "conscan") -> tuple[Any, ...]:
    return t_s, CENTRE, NO_OFFSET, mode, sensor


def test_outside_a_scan_powers_only_carry_their_level() -> None:
    scan = tracker()
    errors = [error for k in range(10) for error in scan.take_power(power(0.1 * k))]
    assert len(errors) == 5
    assert {(error.valid, error.reason, error.carrier_to_noise_db_hz) for error in errors} == {
        (False, "nothing is scanned", 55.0)
    }


def test_a_power_waits_until_the_beam_is_known_at_the_middle_of_its_integration() -> None:
    scan = tracker()
    scan.take_status(*status(0.0))
    scan.take_joints(reading(0.0, (0.0, 0.0)))
    assert scan.take_power(power(0.2)) == []
    scan.take_joints(reading(0.3, (0.0, 0.0)))
    scan.take_status(*status(0.3))
    errors = scan.take_power(power(0.3))
    assert [error.reason for error in errors] == ["window holds 1 of 8 samples", "window holds 2 of 8 samples"]


def test_a_full_window_gives_the_planted_error(random: np.random.Generator) -> None:
    """A target 3 mdeg right of and 2 mdeg below the scan centre, heard through the beam without noise."""
    params = ConscanParams(window_samples=40)
    scan, beamwidth = PowerTracker(params, StepTrackParams()), params.half_power_beamwidth_rad
    planted = np.radians([3e-3, -2e-3])
    found = []
    for k in range(1, 43):
        t_s, angle = 0.1 * k, 2.0 * math.pi * 0.1 * k / 4.0
        away = params.radius_rad * np.array([math.cos(angle), math.sin(angle)])
        scan.take_status(*status(t_s))
        scan.take_joints(reading(t_s, (away[0] / math.cos(CENTRE[1] + away[1]), away[1])))
        middle = 2.0 * math.pi * (0.1 * k - 0.05) / 4.0
        beam = params.radius_rad * np.array([math.cos(middle), math.sin(middle)]) * math.cos(math.pi / 80.0)
        loss = math.exp(-4.0 * math.log(2.0) * float(np.sum((planted - beam) ** 2)) / beamwidth**2)
        sample = CarrierPower(
            t_s=t_s, integration_s=0.1, power_w=1e-15 * loss, sigma_w=1e-19, carrier_to_noise_db_hz=60.0
        )
        found += [error for error in scan.take_power(sample) if not error.reason.startswith("window holds")]
    (error,) = found
    assert error.valid, error.reason
    assert error.cross_elevation_rad == pytest.approx(planted[0], abs=2e-6)
    assert error.elevation_rad == pytest.approx(planted[1], abs=2e-6)


def test_the_delay_of_the_receiving_chain_is_taken_into_account() -> None:
    scan = tracker(delay_s=0.5)
    scan.take_status(*status(0.0))
    for k in range(21):
        scan.take_status(*status(0.1 * k))
        scan.take_joints(reading(0.1 * k, (0.0, 1e-5 * k)))
    (error,) = scan.take_power(power(1.55))
    assert error.reason.startswith("window holds 1")
    assert scan.conscan.state.samples[0, 0] == pytest.approx(1.0)
    assert scan.conscan.state.samples[0, 4] == pytest.approx(1e-4)


def test_powers_from_before_the_scan_do_not_hold_up_those_of_the_scan() -> None:
    scan = tracker()
    scan.take_status(*status(10.0))
    scan.take_joints(reading(10.0, (0.0, 0.0)))
    assert scan.take_power(power(10.0)) == []
    scan.take_status(*status(10.1))
    scan.take_joints(reading(10.1, (0.0, 0.0)))
    assert [error.reason for error in scan.take_power(power(10.1))] == ["window holds 1 of 8 samples"]


def test_a_new_scan_starts_with_an_empty_window() -> None:
    scan = tracker()
    for mode in ("conscan", "coast", "conscan"):
        for k in range(4):
            scan.take_status(*status(0.1 * k, mode))
            scan.take_joints(reading(0.1 * k, (0.0, 0.0)))
    scan.take_power(power(0.2))
    assert len(scan.conscan.state.samples) == 1


def test_powers_that_can_never_be_placed_do_not_pile_up() -> None:
    scan = tracker()
    scan.take_status(*status(0.0))
    for k in range(100):
        scan.take_power(power(10.0 + 0.1 * k))
    assert len(scan._waiting) <= 8
