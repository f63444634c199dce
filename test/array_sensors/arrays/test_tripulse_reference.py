import numpy as np
import pytest

from rf_pointing.array_sensors.arrays.tripulse_reference import detect_with_references, reference_phase
from rf_pointing.core import random_stream

CARRIER_HZ, SEPARATION_HZ, RATE_HZ = 12e9, 4e5, 4e6
COUNT = 900
BEAMS = np.repeat(np.array([3.0, 0.4j, -0.2j]), 300)


def tones(travel_s: np.ndarray, satellite_rad: np.ndarray, station_rad: np.ndarray) -> list[np.ndarray]:
    """Return f_r1, f_t, f_r2 with phases linear in frequency and a constant phase of their own each."""
    return [
        np.exp(1j * (start - 2.0 * np.pi * f_hz * travel_s + f_hz / CARRIER_HZ * satellite_rad - station_rad))
        for start, f_hz in zip(
            (0.4, -1.1, 2.9), (CARRIER_HZ - SEPARATION_HZ, CARRIER_HZ, CARRIER_HZ + SEPARATION_HZ), strict=True
        )
    ]


def test_doppler_with_acceleration_and_independent_clock_noise_cancel_exactly() -> None:
    rng, t = random_stream(1, "clocks"), np.arange(COUNT) / RATE_HZ
    travel_s = (300.0 * t + 0.5 * 4e6 * t**2) / 299792458.0
    satellite, station = np.cumsum(0.03 * rng.normal(size=(2, COUNT)), axis=1)
    lower, tone, upper = tones(travel_s, satellite, station)
    values, lost = detect_with_references(BEAMS * tone, lower, upper, 1e-6)
    assert lost == ""
    constant = values / BEAMS
    # Phases of 2 pi f tau reach 3e2 rad: rounding 1e-13 rad per operation.
    np.testing.assert_allclose(constant, constant[0], atol=1e-10)


def test_without_references_the_same_clocks_spoil_the_phase() -> None:
    rng = random_stream(1, "clocks")
    satellite, station = np.cumsum(0.03 * rng.normal(size=(2, COUNT)), axis=1)
    _, tone, _ = tones(np.zeros(COUNT), satellite, station)
    assert np.ptp(np.unwrap(np.angle(tone))) > 0.5


def test_half_phase_is_followed_through_whole_turns() -> None:
    turn = np.linspace(0.0, 40.0, 200)
    found = reference_phase(np.exp(1j * turn), np.exp(1j * turn), 1e-6)
    np.testing.assert_allclose(found.phase_rad - found.phase_rad[0], turn, atol=1e-12)


def test_a_slipped_reference_is_reported_as_lost_lock_between_its_segments() -> None:
    lower, upper = np.ones(20, dtype=complex), np.ones(20, dtype=complex)
    lower[7:] *= -1.0
    assert "between segments 6 and 7" in detect_with_references(lower, lower, upper, 1e-3)[1]


def test_a_fading_reference_is_reported() -> None:
    lower, upper = np.ones(20, dtype=complex), np.ones(20, dtype=complex)
    upper[11] = 0.1
    lost = detect_with_references(lower, lower, upper, 1e-3)[1]
    assert "lost lock in segment 11" in lost
    assert "upper reference" in lost


def test_references_below_10_db_are_reported() -> None:
    values = np.ones(20, dtype=complex)
    assert "lower reference has SNR" in reference_phase(values, values, 0.2).lost


def test_ratio_keeps_its_sign_whatever_branch_the_half_phase_starts_on() -> None:
    for start in np.linspace(-3.0, 3.0, 13):
        lower = np.exp(1j * start) * np.ones(3)
        values, _ = detect_with_references(np.array([3.0, 0.3j, 0.2j]), lower, np.ones(3, dtype=complex), 1e-3)
        assert values[1] / values[0] == pytest.approx(0.1j)
