"""Levels without a carrier: what conscan and step-track make of them is as sure as they say."""

import math

import numpy as np
import pytest

from rf_pointing.core import CarrierPower
from rf_pointing.receiver import Level, SignalReceiverParams
from rf_pointing.receiver.level_meter import LevelMeter
from rf_pointing.receiver.params import LevelParams, SignalSearchParams
from rf_pointing.rf.noise import BOLTZMANN_J_K
from rf_pointing.tracking.conscan import ConscanTracker
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.steptrack import StepTracker, StepTrackParams

WATTS = BOLTZMANN_J_K * 120.0
KINDS = {
    "Es/N0 of a modem": (LevelParams(kind="es_n0_db"), lambda ratio: 10.0 * np.log10(ratio / 1e6)),
    "power of a meter above its noise": (
        LevelParams(floor_dbm=-80.0, bandwidth_hz=1e6), lambda ratio: -80.0 + 10.0 * np.log10(1.0 + ratio / 1e6)
    ),
    "power of a meter without its noise": (LevelParams(), lambda ratio: -120.0 + 10.0 * np.log10(ratio)),
}  # fmt: skip


def meter(level: LevelParams, **more: object) -> LevelMeter:
    signal = SignalSearchParams(symbol_rate_hz=1e6)
    return LevelMeter(SignalReceiverParams(type="level", level=level, signal=signal).replace(**more))


def powers(kind: str, ratios: np.ndarray, noise_db: float, random: np.random.Generator) -> list[CarrierPower]:
    """Return the powers of levels every 0.1 s whose true C/N0 are `ratios` (n,) in hertz."""
    params, level_of = KINDS[kind]
    subject, found = meter(params), []
    levels = level_of(ratios) + noise_db * random.standard_normal(len(ratios))
    for row, db in enumerate([*levels, 0.0]):
        found += subject.take(Level(0.1 * row + 0.05, float(db)))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_the_power_of_a_level_is_that_of_the_link(kind: str, random: np.random.Generator) -> None:
    truth = np.full(300, 10.0**6.5)
    found = powers(kind, truth, 0.05, random)[50:]
    measured, sigma = (np.array([getattr(each, name) for each in found]) for name in ("power_w", "sigma_w"))
    if kind != "power of a meter without its noise":
        assert np.mean(measured) == pytest.approx(10.0**6.5 * WATTS, rel=5e-3)
        assert found[0].carrier_to_noise_db_hz == pytest.approx(65.0, abs=0.3)
    assert np.std(measured) / np.mean(sigma) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sensor", ["conscan", "steptrack"])
def test_the_covariance_of_a_scan_by_levels_is_honest(kind: str, sensor: str, random: np.random.Generator) -> None:
    """The normalised squared error of two axes is 2 on the average."""
    conscan, steps = ConscanParams(period_s=3.2, sample_s=0.1, ramp_s=0.0), StepTrackParams()
    tracker = ConscanTracker(conscan) if sensor == "conscan" else StepTracker(steps)
    width = conscan.half_power_beamwidth_rad if sensor == "conscan" else steps.half_power_beamwidth_rad
    target = np.array([0.05, -0.03]) * width
    count = 4000
    t_s = 0.1 * np.arange(count) + 0.05
    if sensor == "conscan":
        angle = 2.0 * math.pi * t_s / conscan.period_s
        beam = conscan.radius_rad * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        place = (t_s // 0.5).astype(int) % 4
        beam = steps.step_rad * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])[place]
    away = np.hypot(*(target - beam).T) / width
    ratios = 10.0**6.5 * np.exp(-4.0 * math.log(2.0) * away**2)
    squares = []
    for row, power in enumerate(powers(kind, ratios, 0.05, random)):
        error = tracker.add(power, *map(float, beam[row]))
        # Windows and rounds share no sample.
        if error is not None and row > 400:
            left = np.array([error.cross_elevation_rad, error.elevation_rad]) - target
            squares.append(float(left @ np.linalg.solve(error.covariance_rad2, left)))
    assert len(squares) > 50
    assert 1.0 < np.mean(squares) < 3.5


def test_no_lock_is_no_carrier_for_every_gate() -> None:
    subject = meter(LevelParams(kind="c_n0_db_hz"))
    found = []
    for row in range(40):
        found += subject.take(Level(0.1 * row, 60.0, locked=row < 20))
    assert found[10].carrier_to_noise_db_hz == pytest.approx(60.0)
    assert found[-1].carrier_to_noise_db_hz == 0.0
    assert subject.unlocked == 20


def test_a_display_in_whole_decibels_is_known_to_its_step(random: np.random.Generator) -> None:
    subject, found = meter(LevelParams(kind="c_n0_db_hz")), []
    for row, db in enumerate(np.round(60.0 + 0.4 * random.standard_normal(400))):
        found += subject.take(Level(0.1 * row + 0.01, float(db)))
    assert subject.sigma_db > 1.0 / math.sqrt(12.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e5, 9.91e37])
def test_what_cannot_be_a_level_is_left_out(value: float) -> None:
    subject = meter(LevelParams(kind="c_n0_db_hz"))
    found = [subject.take(Level(0.1 * row, value if row % 2 else 60.0)) for row in range(40)]
    powers = [power for each in found for power in each]
    assert len(powers) > 15
    assert [power.carrier_to_noise_db_hz for power in powers] == pytest.approx([60.0] * len(powers))


@pytest.mark.parametrize("value", [0.0, 60.0])
def test_a_level_that_never_moves_is_a_sample_of_a_scan(value: float) -> None:
    """Of a modem that prints 0.0 without a signal, or of a coarse display: its sigma is not zero."""
    subject, found = meter(LevelParams(kind="c_n0_db_hz")), []
    tracker = ConscanTracker(ConscanParams(period_s=3.2, sample_s=0.1, ramp_s=0.0))
    for row in range(200):
        found += subject.take(Level(0.1 * row + 0.01, value))
    assert all(power.sigma_w > 0.0 for power in found)
    assert found[-1].carrier_to_noise_db_hz == pytest.approx(value, abs=1e-9)
    errors = [
        tracker.add(power, 1e-4 * math.cos(0.2 * row), 1e-4 * math.sin(0.2 * row)) for row, power in enumerate(found)
    ]
    assert any(errors[-50:]) == (value > 0.0)
    if value == 0.0:
        assert tracker.state.last_rejection.startswith("no lock: C/N0 0.0 dB-Hz")


def test_levels_that_come_late_or_twice_are_left_out() -> None:
    subject = meter(LevelParams(kind="c_n0_db_hz"))
    assert not subject.take(Level(1.0, 60.0))
    assert not subject.take(Level(1.0, 60.0))
    assert not subject.take(Level(0.5, 60.0))
    (power,) = subject.take(Level(1.2, 60.0))
    assert power.t_s == 1.0
