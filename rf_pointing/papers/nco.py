"""Rows of the spur-reduced oscillator (NCO: Flanagan and Zimmerman, TDA Progress Report 42-115).

The expected waveform of a dithered phase is exact: the probability of each table entry is that of a
sum of M uniform numbers (Irwin and Hall).  Its lines are the spurs; what is left of the power is
noise.  Worst frequencies are R cycles in 2^(b+1) samples, R odd (2^(b+2) for M = 2).

Every dBc here is relative to the whole power of the carrier; relative to its one bin of a one-sided
spectrum noise is 3 dB more.
"""

import math

import numpy as np

from rf_pointing.core import random_stream
from rf_pointing.core.types import Array
from rf_pointing.papers.row import Row
from rf_pointing.receiver.nco import Oscillator
from rf_pointing.receiver.params import OscillatorParams

POINTS, SAMPLE_HZ, R = 8192, 160e6, 5
TABLE = (-102.20, -108.22, -114.24, -120.26, -126.28, -132.30, -138.32, -144.35)
BITS = range(5, 13)
REPEATS = 512
GENERIC = 0.1234567
"""A frequency in cycles per sample without a short period."""


def rows(seed: int = 1) -> list[Row]:
    """Return every row of the paper."""
    return [*spur_rows(), *noise_rows(seed), *design_rows(seed)]


def spur_rows() -> list[Row]:
    """Return the levels of lines, from expected waveforms."""
    first = {bits: spur_dbc(bits, 1) for bits in range(4, 10)}
    second = {bits: spur_dbc(bits, 2, 2) for bits in range(4, 10)}
    return [
        Row("worst spur, 5 bits, 1 dither", "NCO Fig. 10", -52.3, first[5], "dBc", 0.1),
        Row("worst spur, 8 bits, 1 dither", "NCO Fig. 12", -88.0, first[8], "dBc", 0.5),
        Row("worst spur, 9 bits, 1 dither", "NCO VII", -100.5, first[9], "dBc", 0.1),
        Row("worst spur, 5 bits, 1 dither, approximated", "NCO VII", 7.84 - 12.04 * 5, first[5], "dBc", 0.1),
        Row("worst spur, 5 bits, no dither", "NCO IV", 13.0 - 6.0 * 5, spur_dbc(5, 0), "dBc", 0.0, "<=",
            remark="the bound of section IV; reference 7 of the paper is tighter by about 9 dB: -26.2"),
        Row("worst spur, 5 bits, 2 dithers", "NCO Fig. 11", -63.0, spur_dbc(5, 2), "dBc", 0.0, "<="),
        Row("spur reduction, 1 dither", "NCO abstract", 12.0, -_slope(first), "dB/bit", 0.1),
        Row("spur reduction, 2 dithers", "NCO VIII", 18.0, -_slope(second), "dB/bit", 0.5,
            remark="at R / 2^(b+2); at the frequencies that are worst for 1 dither it is 24 dB/bit"),
        Row("phase bits for -90 dBc, 1 dither", "NCO VII", 8.1, _bits_for(-90.0), "bit", 0.05),
    ]  # fmt: skip


def noise_rows(seed: int) -> list[Row]:
    """Return the noise per bin and per hertz."""
    per_hertz = 10.0 * math.log10(SAMPLE_HZ / 2.0)
    worst_db = _noise_db(5, R / 2**6, seed)
    generic_db = _noise_db(5, GENERIC, seed)
    sixth_db = 6.93 - 6.02 * 5 + 10.0 * math.log10(4.0 / 3.0)
    density = [
        Row(f"noise density, {bits} bits", "NCO Table 1", paper,
            10.0 * math.log10(0.5 * math.pi**2) - 20.0 * bits * math.log10(2.0) - per_hertz, "dBc/Hz", 0.006)
        for bits, paper in zip(BITS, TABLE, strict=True)
    ]  # fmt: skip
    return [
        Row("noise per bin of 8192, 5 bits, 1 dither", "NCO Fig. 10", -62.3, worst_db - 10.0 * math.log10(POINTS), "dB",
            0.1),
        *density,
        Row("noise at any frequency against the bound, 5 bits", "NCO eq. 6", 6.93 - 6.02 * 5, generic_db, "dBc", 0.1,
            "<=", remark="eq. 6 is called an upper bound but is the mean of the worst spurs, Var eps = step^2 / 8; "
            f"elsewhere it is step^2 / 6: {generic_db - 6.93 + 6.02 * 5:.2f} dB more. The bound is step^2 / 4: 3 dB",
            due=(sixth_db - 0.1, sixth_db + 0.1)),
        Row("noise at any frequency, Var eps = step^2 / 4", "NCO after eq. 5", 9.94 - 6.02 * 5, generic_db, "dBc", 0.0,
            "<="),
    ]  # fmt: skip


def design_rows(seed: int) -> list[Row]:
    """Return the system of section X: 16-bit table, 9 phase bits, 8 bits out, both dithered."""
    params = OscillatorParams(phase_bits=9, dithers=1, amplitude_bits=8, table_bits=16)
    oscillator = Oscillator(params, random_stream(seed, "oscillator of section X"))
    cycles = (R * np.arange(POINTS) / 2**10) % 1.0
    waves = np.array([oscillator.samples(cycles).real for _ in range(REPEATS)], dtype=np.float64)
    mean = np.mean(waves, axis=0)
    carrier = float(np.abs(np.fft.rfft(mean)[R * POINTS // 2**10]) ** 2)
    # Offset of the floor, a constant half step, does not belong to the signal.
    lines = np.abs(np.fft.rfft(mean - np.mean(mean))) ** 2
    lines[R * POINTS // 2**10] = 0.0
    noise = float(np.mean(np.var(waves, axis=0))) / (2.0 * carrier / POINTS**2)
    return [
        Row("largest line, 9 phase bits, 8 bits out", "NCO X", -90.0, 10.0 * math.log10(np.max(lines) / carrier), "dBc",
            0.0, "<=", remark=f"of the mean of {REPEATS} periods of {POINTS}: what is left of the noise is above the "
            f"line, {spur_dbc(9, 1):.1f} dBc"),
        Row("noise density, 9 phase bits, 8 bits out", "NCO X", -120.0,
            10.0 * math.log10(noise) - 10.0 * math.log10(SAMPLE_HZ / 2.0), "dBc/Hz", 0.0, "<="),
    ]  # fmt: skip


def expected_cosine(cycles: Array, bits: int, dithers: int) -> Array:
    """Return the expected cosine of phases (n,) that are dithered and cut to `bits`."""
    place = cycles * 2.0**bits + 0.5 * (1 - dithers)
    whole = np.floor(place)
    share = place - whole
    found = np.zeros(len(cycles))
    for step in range(dithers + 1):
        # Between `step` and the next one: the sum of the dithers lies that far from the place.
        chance = _sum_below(step + 1.0 - share, dithers) - _sum_below(step - share, dithers)
        found += chance * np.cos(2.0 * math.pi * (whole + step) / 2.0**bits)
    return found


def _sum_below(x: Array, count: int) -> Array:
    """Return the probability that a sum of uniform numbers is at most x (Irwin and Hall)."""
    if count == 0:
        return np.asarray(x > 0.0, dtype=np.float64)
    inside = np.clip(x, 0.0, float(count))
    terms = [
        (-1.0) ** k * math.comb(count, k) * np.maximum(inside - k, 0.0) ** count
        for k in range(count + 1)
    ]
    return np.asarray(sum(terms) / math.factorial(count))


def spur_dbc(bits: int, dithers: int, further: int = 1) -> float:
    """Return the largest line at R cycles in 2^(bits + further) samples, against the carrier."""
    period = 2 ** (bits + further)
    wave = expected_cosine((R * np.arange(period) / period) % 1.0, bits, dithers)
    lines = np.abs(np.fft.rfft(wave)) ** 2
    carrier = float(lines[R])
    lines[[0, R]] = 0.0
    return float(10.0 * math.log10(np.max(lines) / carrier))


def _slope(levels: dict[int, float]) -> float:
    return float(np.polyfit(list(levels), list(levels.values()), 1)[0])


def _bits_for(level_dbc: float) -> float:
    """Return the bits at which the worst spur has this level, between the exact ones."""
    levels = {bits: spur_dbc(bits, 1) for bits in range(4, 10)}
    return float(np.interp(-level_dbc, [-each for each in levels.values()], list(levels)))


def _noise_db(bits: int, frequency: float, seed: int) -> float:
    """Return the noise of the oscillator, relative to its carrier, from its own samples."""
    oscillator = Oscillator(
        OscillatorParams(phase_bits=bits), random_stream(seed, f"oscillator at {frequency}")
    )
    cycles = np.asarray((frequency * np.arange(32 * POINTS)) % 1.0, dtype=np.float64)
    error = oscillator.samples(cycles).real - expected_cosine(cycles, bits, 1)
    return float(10.0 * math.log10(2.0 * np.mean(error**2)))
