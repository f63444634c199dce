"""Bursts with a known sequence: planted among noise, each is found once, with its level."""

import math

import numpy as np
import pytest

from rf_pointing.core.types import Array, ComplexArray
from rf_pointing.receiver import IqSamples, Measurement, SignalMeter, SignalReceiverParams
from rf_pointing.receiver.params import IqParams, SignalSearchParams

RATE_HZ, SYMBOL_HZ, ROLL_OFF = 9.6e4, 1e4, 0.35
SEQUENCE = "01101000111010110010111100010011"
START_S, EVERY_S, PIECE_S = 100.0, 0.25, 0.02


def root_raised_cosine(t: Array) -> Array:
    """Closed form of the pulse, `t` in symbols (Proakis, Digital Communications, section 9.2)."""
    t = t + 1e-9
    top = np.sin(np.pi * t * (1.0 - ROLL_OFF)) + 4.0 * ROLL_OFF * t * np.cos(np.pi * t * (1.0 + ROLL_OFF))
    return np.asarray(top / (np.pi * t * (1.0 - (4.0 * ROLL_OFF * t) ** 2)))


def burst(qpsk: bool) -> ComplexArray:
    numbers = np.array([int(each) for each in SEQUENCE])
    symbols = np.exp(0.5j * np.pi * (numbers + 0.5)) if qpsk else 1.0 - 2.0 * numbers
    n = np.arange(-400, round(len(symbols) * RATE_HZ / SYMBOL_HZ) + 400) * SYMBOL_HZ / RATE_HZ
    return np.asarray(sum(value * root_raised_cosine(n - at) for at, value in enumerate(symbols)), dtype=np.complex128)


def measured(level_db_hz: float, offset_hz: float, seconds: float, seed: int, sequence: str) -> list[Measurement]:
    signal = SignalSearchParams(kind="preamble", preamble=sequence, symbol_rate_hz=SYMBOL_HZ, uncertainty_hz=2e3)
    iq = IqParams(rate_hz=RATE_HZ, centre_mhz=437.5)
    params = SignalReceiverParams(type="rtl_tcp", frequency_hz=437.5e6, iq=iq, signal=signal)
    rng, count = np.random.default_rng(seed), round(seconds * RATE_HZ)
    samples = math.sqrt(0.5 * RATE_HZ) * (rng.standard_normal(count) + 1j * rng.standard_normal(count))
    one = burst("2" in sequence)
    for at_s in np.arange(1.0, seconds - 0.5, EVERY_S):
        begin = round(at_s * RATE_HZ)
        samples[begin : begin + len(one)] += 10.0 ** (level_db_hz / 20.0) * one
    samples *= np.exp(2j * np.pi * offset_hz / RATE_HZ * np.arange(count))
    meter, found, piece = SignalMeter(params), [], round(PIECE_S * RATE_HZ)
    for begin in range(0, count - piece + 1, piece):
        part = (1e-4 * samples[None, begin : begin + piece]).astype(np.complex64)
        found += meter.take(IqSamples(part, RATE_HZ, begin, START_S + (begin + piece) / RATE_HZ))
    return found


@pytest.mark.parametrize(("level_db_hz", "offset_hz"), [(42.0, -1900.0), (50.0, 1370.0), (60.0, 0.0)])
def test_bursts_are_found_once_with_their_level_and_time(level_db_hz: float, offset_hz: float) -> None:
    found = [each.power for each in measured(level_db_hz, offset_hz, 8.0, 5, SEQUENCE)]
    ends_s = [
        START_S + at_s + (400 + len(SEQUENCE) * RATE_HZ / SYMBOL_HZ) / RATE_HZ for at_s in np.arange(1.0, 7.5, EVERY_S)
    ]
    # The noise has to be known before the first one.
    assert len(found) >= len(ends_s) - 4
    assert all(min(abs(each.t_s - end_s) for end_s in ends_s) < 2e-3 for each in found)
    assert len({round((each.t_s - ends_s[0]) / EVERY_S) for each in found}) == len(found)
    ratios = 10.0 ** (0.1 * np.array([each.carrier_to_noise_db_hz for each in found]))
    sigmas = np.array([each.sigma_w / each.power_w for each in found]) * ratios
    off = (np.mean(ratios) - 10.0 ** (0.1 * level_db_hz)) / np.mean(ratios)
    # Of the template's sampling and its ends 2 % of the power are lost.
    assert abs(off) < 0.03 + 4.0 * np.mean(sigmas) / np.mean(ratios) / math.sqrt(len(found))
    assert 0.5 < np.std(ratios) / np.mean(sigmas) < 1.6


def test_noise_and_another_sequence_are_no_bursts() -> None:
    assert len(measured(-30.0, 0.0, 10.0, 6, SEQUENCE)) <= 1
    other = "".join("10"[int(each)] if place % 3 else each for place, each in enumerate(SEQUENCE))
    assert len(measured(42.0, 0.0, 5.0, 7, other)) <= 1
