"""From samples to tones: the common shift, the channels, the noise beside them, and the phase reference."""

import numpy as np
import pytest

from rf_pointing.array_sensors.tripulse.channels import (
    channelise,
    detect_with_references,
    find_shift_hz,
    reference_phase,
)
from rf_pointing.array_sensors.tripulse.signal import TripulseSignalParams, segment_beams
from rf_pointing.core import random_stream

LARGEST_HZ = 5e4
CARRIER_HZ, SEPARATION_HZ, RATE_HZ = 12e9, 4e5, 4e6
COUNT = 900
BEAMS = np.repeat(np.array([3.0, 0.4j, -0.2j]), 300)


def composite(signal: TripulseSignalParams, shift_hz: float, beams: np.ndarray) -> np.ndarray:
    time_s = np.arange(signal.samples) / signal.sample_rate_hz
    sent = np.repeat(beams[segment_beams(signal)], signal.samples_per_segment)
    offsets = np.exp(2j * np.pi * signal.tone_separation_hz * time_s)
    references = offsets + offsets.conj() if signal.scheme == "two_tone" else 0.0
    return np.asarray((sent + references) * np.exp(2j * np.pi * shift_hz * time_s))


def noise(signal: TripulseSignalParams, variance: float) -> np.ndarray:
    return np.sqrt(variance / 2.0) * random_stream(1, "channels").normal(size=(signal.samples, 2)) @ [1.0, 1j]


@pytest.mark.parametrize("shift_hz", [-31234.5, 0.0, 17.0, 45000.0])
def test_tones_are_separated_exactly_under_any_shift(shift_hz: float) -> None:
    signal, beams = TripulseSignalParams(), np.array([2.0, 0.3j, -0.1j])
    found = channelise(signal, composite(signal, shift_hz, beams) + noise(signal, 1e-16), LARGEST_HZ)
    assert found.shift_hz == pytest.approx(shift_hz, abs=1e-3)
    np.testing.assert_allclose(np.abs(found.tone), np.abs(beams[segment_beams(signal)]), atol=1e-6)
    np.testing.assert_allclose(np.abs(found.lower_reference), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.abs(found.upper_reference), 1.0, atol=1e-6)


def test_tripulse_tone_14_db_above_the_references_does_not_pass_for_a_reference() -> None:
    signal = TripulseSignalParams()
    samples = composite(signal, 12e3, np.array([5.0, 0.5, 0.5]))
    assert find_shift_hz(signal, samples, 1.9e5) == pytest.approx(12e3, abs=500.0)


def test_interleaved_frames_are_found_by_their_sum_segments() -> None:
    signal = TripulseSignalParams(scheme="interleaved", pattern="SxSy")
    samples = composite(signal, -23e3, np.array([1.0, 0.1j, 0.1j]))
    assert find_shift_hz(signal, samples, LARGEST_HZ) == pytest.approx(-23e3, abs=500.0)


def test_noise_density_is_measured_beside_the_tones() -> None:
    signal = TripulseSignalParams(cycles=400)
    variance = 0.04
    found = channelise(signal, composite(signal, 8e3, np.ones(3)) + noise(signal, variance), LARGEST_HZ)
    # 4800 complex values: 1.4 % each.
    assert found.noise_density == pytest.approx(variance / signal.sample_rate_hz, rel=0.06)


@pytest.mark.parametrize(
    ("samples", "message"),
    [
        (np.ones(10, dtype=complex), "shape"),
        (np.full(960, np.nan, dtype=complex), "finite"),
        (np.zeros(960, dtype=complex), "no noise"),
    ],
)
def test_frames_that_cannot_be_real_are_refused(samples: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        channelise(TripulseSignalParams(), samples, LARGEST_HZ)


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


def test_half_phase_is_followed_through_whole_turns() -> None:
    turn = np.linspace(0.0, 40.0, 200)
    found = reference_phase(np.exp(1j * turn), np.exp(1j * turn), 1e-6)
    np.testing.assert_allclose(found.phase_rad - found.phase_rad[0], turn, atol=1e-12)


def test_a_slipped_reference_is_reported_as_lost_lock_between_its_segments() -> None:
    lower, upper = np.ones(20, dtype=complex), np.ones(20, dtype=complex)
    lower[7:] *= -1.0
    assert "between segments 6 and 7" in detect_with_references(lower, lower, upper, 1e-3)[1]


def test_ratio_keeps_its_sign_whatever_branch_the_half_phase_starts_on() -> None:
    for start in np.linspace(-3.0, 3.0, 13):
        lower = np.exp(1j * start) * np.ones(3)
        values, _ = detect_with_references(np.array([3.0, 0.3j, 0.2j]), lower, np.ones(3, dtype=complex), 1e-3)
        assert values[1] / values[0] == pytest.approx(0.1j)


@pytest.mark.parametrize(("amplitude", "lost"), [(0.301, False), (0.299, True)])
def test_a_reference_has_faded_below_three_tenths_of_its_median(amplitude: float, lost: bool) -> None:
    lower, upper = np.full(21, 2.0 + 0j), np.full(21, 3.0 + 0j)
    lower[5] *= amplitude
    words = reference_phase(lower, upper, 1e-6).lost
    assert words == (
        f"lost lock in segment 5: lower reference faded to {np.abs(lower[5]) / 2.0} of its median" if lost else ""
    )


@pytest.mark.parametrize(("snr", "lost"), [(10.01, False), (9.99, True)])
def test_a_reference_needs_ten_times_the_noise(snr: float, lost: bool) -> None:
    lower, upper = np.full(21, 3.0 + 0j), np.full(21, np.sqrt(snr * 0.04) + 0j)
    words = reference_phase(lower, upper, 0.04).lost
    assert words.startswith("upper reference has SNR 9.99") if lost else words == ""


@pytest.mark.parametrize(("step_rad", "lost"), [(1.99, False), (2.01, True), (-2.01, True)])
def test_a_jump_of_both_references_by_more_than_two_radians_is_a_lost_lock(step_rad: float, lost: bool) -> None:
    turned = np.where(np.arange(21) < 9, 1.0, np.exp(0.5j * step_rad))
    found = reference_phase(turned, turned, 1e-6)
    assert found.lost.startswith("lost lock between segments 8 and 9: references jumped") is lost
    np.testing.assert_allclose(found.phase_rad[[0, 8, 9, 20]], [0.0, 0.0, 0.5 * step_rad, 0.5 * step_rad], atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.6])
def test_a_search_reaches_less_than_half_of_the_tone_spacing(share: float) -> None:
    signal = TripulseSignalParams()
    with pytest.raises(ValueError, match="must be > 0 and < "):
        find_shift_hz(signal, np.ones(signal.samples, dtype=complex), share * signal.tone_separation_hz)
    find_shift_hz(signal, np.ones(signal.samples, dtype=complex), 0.499 * signal.tone_separation_hz)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_line_beside_one_reference_does_not_pass_for_both(side: float) -> None:
    signal, beams = TripulseSignalParams(), np.array([2.0, 0.3j, 0.2j])
    time_s = np.arange(signal.samples) / signal.sample_rate_hz
    stray = 3.0 * np.exp(2j * np.pi * (side * signal.tone_separation_hz + 30e3) * time_s)
    assert find_shift_hz(signal, composite(signal, -12e3, beams) + stray, LARGEST_HZ) == pytest.approx(-12e3, abs=500.0)


def test_a_search_finds_the_line_at_its_end_and_none_beyond() -> None:
    signal = TripulseSignalParams(scheme="interleaved")
    line_hz = 4e6 / 8192
    for largest_hz, found in ((10.5 * line_hz, 10.0), (9.5 * line_hz, 9.0)):
        for sign in (-1.0, 1.0):
            samples = composite(signal, sign * 10.0 * line_hz, np.array([1.0, 0.0, 0.0]))
            assert find_shift_hz(signal, samples, largest_hz) == pytest.approx(sign * found * line_hz)
