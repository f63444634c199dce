"""Noise temperature of a two-port such as a HEMT amplifier (HEMT section III).

    T_n = T_min + T_0 (g_n / R_g) |Z_g - Z_opt|^2,   T_min = 2 T_0 (g_n R_opt + Re C),
    R_opt = sqrt(R_n/g_n - X_opt^2),   X_opt = Im C / g_n,
    C = r sqrt(R_n g_n),   r = <e* i> / sqrt(<e^2> <i^2>).

The article prints |Z_g - Z_opt|^2 below the fraction line, which would make T_n infinite at the
best match.  It belongs above: T_n is the noise <|e + Z_g i|^2> over that of R_g.
"""

import math
from dataclasses import dataclass
from typing import Self

from rf_pointing.core import Params, parameter, require_between

REFERENCE_K = 290.0


@dataclass(frozen=True, kw_only=True)
class HemtParams(Params):
    """Small-signal circuit of a HEMT chip and its two equivalent temperatures (Pospieszalski's
    model).
    """

    transition_hz: float = parameter(70e9, "transit frequency g_m / (2 pi C_gs)", low=1e8, high=2e12)
    gate_resistance_ohm: float = parameter(2.5, "intrinsic gate-to-source resistance", low=1e-3, high=1e3)
    drain_conductance_s: float = parameter(0.004, "drain conductance, siemens", low=1e-6, high=1.0)
    gate_source_capacitance_f: float = parameter(7e-14, "gate-to-source capacitance, farads", low=1e-16, high=1e-10)
    gate_k: float = parameter(14.0, "equivalent temperature of the gate resistance", low=0.0, high=1000.0)
    drain_k: float = parameter(500.0, "equivalent temperature of the drain conductance", low=0.0, high=1e5)


@dataclass(frozen=True, slots=True)
class TwoPortNoise:
    """Noise of a linear two-port.

    Equivalent resistance R_n, conductance g_n, and their correlation r (complex).
    """

    resistance_ohm: float
    conductance_s: float
    correlation: complex

    def __post_init__(self) -> None:
        require_between("resistance_ohm", self.resistance_ohm, 0.0, None)
        require_between("conductance_s", self.conductance_s, 1e-15, None)
        require_between("correlation", abs(self.correlation), 0.0, 1.0)

    @classmethod
    def of_hemt(cls, params: HemtParams, frequency_hz: float) -> Self:
        """Return the noise of an intrinsic chip at `frequency_hz`.

        Thermal noise of r_gs at T_g and g_ds at T_d.  The drain current referred to the input is i
        = i_d f/f_t; it also drops e = (r_gs + 1/jwC) i across the gate, fully correlated.  Valid at
        any frequency; the paper's expressions are the limit of low ones.
        """
        ratio = frequency_hz / params.transition_hz
        gate, drain = params.gate_k / REFERENCE_K, params.drain_k / REFERENCE_K
        conductance = ratio**2 * params.drain_conductance_s * drain
        reactance = 1.0 / (2.0 * math.pi * frequency_hz * params.gate_source_capacitance_f)
        thermal = params.gate_resistance_ohm * gate
        resistance = thermal + conductance * (params.gate_resistance_ohm**2 + reactance**2)
        # The drain current drops e across the gate: both noises are fully correlated through it.
        product = conductance * complex(params.gate_resistance_ohm, reactance)
        return cls(resistance, conductance, product / math.sqrt(resistance * conductance))

    @property
    def product(self) -> complex:
        """C = r sqrt(R_n g_n)."""
        return self.correlation * math.sqrt(self.resistance_ohm * self.conductance_s)

    @property
    def best_impedance_ohm(self) -> complex:
        """Z_opt: the generator impedance of least noise."""
        # The root of a rounding error below zero would be NaN at a perfect correlation.
        reactance = self.product.imag / self.conductance_s
        return complex(math.sqrt(max(self.resistance_ohm / self.conductance_s - reactance**2, 0.0)), reactance)

    @property
    def least_noise_k(self) -> float:
        """T_min: the noise temperature at Z_opt."""
        return 2.0 * REFERENCE_K * (self.conductance_s * self.best_impedance_ohm.real + self.product.real)

    def noise_k(self, generator_ohm: complex) -> float:
        """Return the noise temperature for a generator of this impedance."""
        require_between("generator resistance", generator_ohm.real, 1e-9, None)
        mismatch = abs(generator_ohm - self.best_impedance_ohm) ** 2
        return self.least_noise_k + REFERENCE_K * self.conductance_s / generator_ohm.real * mismatch


def cascade_noise_k(stages: list[tuple[float, float]]) -> float:
    """Return the noise temperature of stages (noise temperature K, gain dB) in order (Friis)."""
    total, gain = 0.0, 1.0
    for noise_k, gain_db in stages:
        require_between("noise_k", noise_k, 0.0, None)
        total += noise_k / gain
        gain *= 10.0 ** (gain_db / 10.0)
    return total
