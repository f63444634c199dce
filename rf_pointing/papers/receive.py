"""Noise of the receiving system: the dichroic plate of DSS-13 and the cryogenic amplifiers.

What `rf/noise.py` makes of their losses, noise figures and gains, with what DICHROIC and HEMT
print, and the two-port noise of HEMT section III:

    T_n = T_min + T_0 (g_n / R_g) |Z_g - Z_opt|^2,   T_min = 2 T_0 (g_n R_opt + Re C),
    R_opt = sqrt(R_n/g_n - X_opt^2),   X_opt = Im C / g_n,   C = r sqrt(R_n g_n)

HEMT prints |Z_g - Z_opt|^2 below the fraction line, which would make T_n infinite at the best
match.  It belongs above: T_n is the noise <|e + Z_g i|^2> over that of R_g.
"""

import math
from dataclasses import dataclass
from typing import Self

from rf_pointing.papers.row import Row, near
from rf_pointing.rf.noise import REFERENCE_K, Stage, cascade_k, noise_of_figure_k, noise_of_plate_k

PLATE = (
    ("32.0 GHz", 0.007, 0.013, 1.34),
    ("33.7 GHz", 0.103, 0.010, 7.57),
    ("34.5 GHz", 0.078, 0.009, 5.83),
)
"""DICHROIC table 3, calculated: reflection and ohmic loss in dB, least noise in K."""
PLATE_K = 293.0
"""Room temperature, at which one temperature of the plate gives all three."""
ROUNDED_DB = 0.001
"""Two losses with three decimals each."""
MEASURED_K = 11.0
FIGURES = ((0.4, 27.98), (0.7, 50.72), (1.2, 92.29), (1.3, 101.20), (2.0, 169.62))
"""Noise figures of HEMT table 1 and section II, and their noise temperatures."""
AMPLIFIERS = (
    ("two-stage, 35 K, 16.5 dB", 35.0, 16.5, 57.39),
    ("three-stage, 41 K, 26.0 dB", 41.0, 26.0, 43.51),
)
FOLLOWING_K = 1000.0
HEMT_GHZ = 32.0


@dataclass(frozen=True, slots=True)
class TwoPortNoise:
    """Noise of a linear two-port: resistance R_n, conductance g_n, their product C (complex)."""

    resistance_ohm: float
    conductance_s: float
    product: complex

    @classmethod
    def of_hemt(
        cls,
        frequency_hz: float,
        *,
        transition_hz: float,
        capacitance_f: float,
        gate: tuple[float, float],
        drain: tuple[float, float],
    ) -> Self:
        """Return the noise of a chip after Pospieszalski, at any frequency.

        `gate` is its resistance (ohm) and temperature (K), `drain` its conductance (S) and
        temperature (K).  The drain current i = i_d f/f_t also drops (r_gs + 1/jwC) i across the
        gate; HEMT's expressions are the limit of low frequencies.
        """
        (resistance, gate_k), (drain_s, drain_k) = gate, drain
        conductance = (frequency_hz / transition_hz) ** 2 * drain_s * drain_k / REFERENCE_K
        reactance = 1.0 / (2.0 * math.pi * frequency_hz * capacitance_f)
        product = conductance * complex(resistance, reactance)
        thermal = resistance * gate_k / REFERENCE_K
        return cls(thermal + conductance * (resistance**2 + reactance**2), conductance, product)

    @property
    def best_impedance_ohm(self) -> complex:
        """Z_opt: the generator impedance of least noise."""
        reactance = self.product.imag / self.conductance_s
        # The root of a rounding error below zero would be NaN at a perfect correlation.
        return complex(
            math.sqrt(max(self.resistance_ohm / self.conductance_s - reactance**2, 0.0)), reactance
        )

    @property
    def least_noise_k(self) -> float:
        """T_min: the noise temperature at Z_opt."""
        return (
            2.0
            * REFERENCE_K
            * (self.conductance_s * self.best_impedance_ohm.real + self.product.real)
        )

    def noise_k(self, generator_ohm: complex) -> float:
        """Return the noise temperature for a generator of this impedance."""
        mismatch = abs(generator_ohm - self.best_impedance_ohm) ** 2
        return self.least_noise_k + REFERENCE_K * self.conductance_s / generator_ohm.real * mismatch

    def printed_noise_k(self, generator_ohm: complex) -> float:
        """Return what the printed form gives, with the mismatch below the fraction line."""
        mismatch = abs(generator_ohm - self.best_impedance_ohm) ** 2
        return self.least_noise_k + REFERENCE_K * self.conductance_s / (
            generator_ohm.real * mismatch
        )

    def sources_k(self, generator_ohm: complex) -> float:
        """Return <|e + Z_g i|^2> over the noise of R_g: the definition."""
        both = self.resistance_ohm + self.conductance_s * abs(generator_ohm) ** 2
        return REFERENCE_K / generator_ohm.real * (both + 2.0 * (self.product * generator_ohm).real)


CHIP = TwoPortNoise.of_hemt(
    HEMT_GHZ * 1e9,
    transition_hz=0.05 / (2.0 * math.pi * 4e-14),
    capacitance_f=4e-14,
    gate=(2.5, 12.5),
    drain=(0.004, 500.0),
)
"""g_m 50 mS, C_gs 0.04 pF: a chip of the time at 32 GHz."""
GENERATOR_OHM = complex(50.0, -20.0)


def rows(seed: int = 1) -> list[Row]:
    """Return the rows of both articles; nothing in them is random."""
    del seed
    return [*_plate_rows(), *_amplifier_rows(), *_two_port_rows()]


def _plate_rows() -> list[Row]:
    found = []
    for name, reflected, ohmic, paper in PLATE:
        ours, cold = (
            noise_of_plate_k(reflected + ohmic, kelvin) for kelvin in (PLATE_K, REFERENCE_K)
        )
        within = noise_of_plate_k(reflected + ohmic + ROUNDED_DB, PLATE_K) - ours
        where = "DICHROIC table 3"
        found += [
            Row(f"noise of the plate at {PLATE_K:g} K, {name}", where, paper, ours, "K", within),
            Row(
                f"noise of the plate at {REFERENCE_K:g} K, {name}", where, paper, cold, "K", within,
                remark="One temperature gives all three: 293 K, and not the 290 K of noise figures.",
                due=near(paper * REFERENCE_K / PLATE_K, 0.006),
            ),
        ]  # fmt: skip
    calculated = noise_of_plate_k(PLATE[1][1] + PLATE[1][2], PLATE_K)
    within = noise_of_plate_k(ROUNDED_DB, PLATE_K)
    excess = MEASURED_K - calculated
    return [
        *found,
        Row("measured above calculated, 33.7 GHz", "DICHROIC section V", 3.43, excess, "K", within),
    ]


def _amplifier_rows() -> list[Row]:
    figures = [
        Row(
            f"noise figure {figure:g} dB",
            "HEMT table 1, text",
            kelvin,
            noise_of_figure_k(figure),
            "K",
            0.006,
        )
        for figure, kelvin in FIGURES
    ]
    follower = Stage(FOLLOWING_K, 0.0)
    behind = [
        Row(
            f"{name}, then {FOLLOWING_K:g} K", "HEMT section VI, Friis", paper,
            cascade_k([Stage(noise_k, gain_db), follower]), "K", 0.006,
        )
        for name, noise_k, gain_db, paper in AMPLIFIERS
    ]  # fmt: skip
    return figures + behind


def _two_port_rows() -> list[Row]:
    due = CHIP.sources_k(GENERATOR_OHM)
    printed = CHIP.printed_noise_k(GENERATOR_OHM)
    best = CHIP.best_impedance_ohm
    ratio = HEMT_GHZ * 1e9 * 2.0 * math.pi * 4e-14 / 0.05
    low_k = 2.0 * ratio * math.sqrt(0.004 * 500.0 * 2.5 * 12.5)
    low_ohm = math.sqrt(2.5 * 12.5 / (0.004 * 500.0)) / ratio
    return [
        Row("T_n by its two sources, and by Z_opt", "HEMT p. 73", due, CHIP.noise_k(GENERATOR_OHM), "K", 1e-9 * due),
        Row(
            "T_n as printed", "HEMT p. 73", due, printed, "K", 1e-9 * due,
            remark="Printed with |Z_g - Z_opt|^2 below the line: the mismatch would lower the noise to T_min.",
            due=near(CHIP.least_noise_k, 1e-3),
        ),
        Row("T_min of a chip at 32 GHz", "HEMT, Pospieszalski", 2.543, low_k, "K", 6e-4),
        Row("R_opt of a chip at 32 GHz", "HEMT, Pospieszalski", 24.57, low_ohm, "ohm", 6e-3),
        Row("X_opt of a chip at 32 GHz", "HEMT, Pospieszalski", 124.34, best.imag, "ohm", 6e-3),
        Row("g_n of a chip at 32 GHz", "HEMT, Pospieszalski", 0.1784, 1e3 * CHIP.conductance_s, "mS", 6e-5),
    ]  # fmt: skip
