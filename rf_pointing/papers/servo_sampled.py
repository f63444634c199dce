"""One axis as a sampled loop: exact responses, wind error, sensitivity of encoder and radio loop.

    L = G_e K,   S = 1 / (1 + L),   S_radio = 1 / (1 + H G_b (K + F N s) S)
    beam under wind = (W_b - G_b K W_e S) w

G: rate command to encoder and beam, exact for held commands; W: wind acceleration to both; K:
position law; H the radio integrator of the station with its averages and its delay.  Gusts have
Davenport's spectrum.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.integrate import trapezoid

from rf_pointing.controllers import LawMatrices
from rf_pointing.controllers.filters import SectionParams
from rf_pointing.controllers.margins import RadioLoop, encircles_not
from rf_pointing.core.types import Array, ComplexArray
from rf_pointing.servo import PlantParams
from rf_pointing.station.antenna.axis_response import AxisResponse, Variation, davenport_psd

SAMPLE_S = 0.02


def published_radio(bandwidth_hz: float) -> RadioLoop:
    """Return the radio loop of BWG Fig. 12: one sample every 0.1 s, 0.1 s late."""
    return RadioLoop(bandwidth_hz, mean_of=1, cluster=1, wait_s=0.1)


def station_radio(bandwidth_hz: float) -> RadioLoop:
    """Return the radio loop of the station: an error waits for the next period, its command for the
    0.1 s after that.
    """
    return RadioLoop(bandwidth_hz, mean_of=5, cluster=5, wait_s=0.2)


@dataclass(frozen=True, slots=True)
class LoopQuality:
    """Beam error rms per unit of wind acceleration gain, sensitivity peaks, stability of both
    loops.

    `rms_s2_per_m_s` times the wind acceleration per gust speed (rad/s^2 per m/s) is the rms error
    in radians.
    """

    rms_s2_per_m_s: float
    encoder_peak: float
    radio_peak: float
    stable: bool


class SampledLaw(Protocol):
    """A position law, or one that is being designed."""

    @property
    def notch(self) -> SectionParams:
        """The notch, through which the feedforward goes as well."""

    def matrices(self, sample_s: float) -> LawMatrices:
        """Return the law from error to rate command, its filters included."""


class LawResponse:
    """Responses of one position law on the same frequency grid; independent of the antenna.

    `gain` (f,) leads from error to rate command, `fed` (f,) from command angle to rate command
    through the feedforward; `matrices` is the law from error to rate command in state space.
    """

    def __init__(self, law: SampledLaw) -> None:
        frequency = _grid()
        s, z = 2j * np.pi * frequency, np.exp(2j * np.pi * frequency * SAMPLE_S)
        self.matrices = a, b, c, d = law.matrices(SAMPLE_S)
        solved = np.linalg.solve(
            z[:, None, None] * np.eye(len(a)) - a, b.astype(np.complex128)[None]
        )
        self.gain: ComplexArray = np.asarray(c @ solved + d, dtype=np.complex128)[:, 0, 0]
        self.fed: ComplexArray = _notch_response(law, z) * s / (1.0 + s / (2.0 * math.pi * 10.0))


def loop_quality(
    response: AxisResponse, law: LawResponse, radio_loop: RadioLoop | None, wind_m_s: float
) -> LoopQuality:
    """Return error and margins of one axis under a position law, with a radio loop around it or
    without.
    """
    frequency, gain, fed = response.frequency_hz, law.gain, law.fed
    encoder, beam = response.from_command.T
    wind_encoder, wind_beam = response.from_wind.T
    sensitivity = 1.0 / (1.0 + encoder * gain)
    integrator = np.zeros_like(gain) if radio_loop is None else radio_loop.response(frequency)
    around = integrator * beam * (gain + fed) * sensitivity
    radio = 1.0 / (1.0 + around)
    error = (wind_beam - beam * gain * wind_encoder * sensitivity) * radio
    gusts = davenport_psd(frequency, wind_m_s, 0.005)
    rms = math.sqrt(float(trapezoid(np.abs(error) ** 2 * gusts, frequency)))
    peaks = float(np.max(np.abs(sensitivity))), float(np.max(np.abs(radio)))
    stable = response.closed_radius(law.matrices) < 1.0 and (
        radio_loop is None or encircles_not(around)
    )
    return LoopQuality(rms, *peaks, stable)


def sampled_axis(plant: PlantParams, axis: int, variation: Variation) -> AxisResponse:
    """Return an axis of DSS-13 on the grid of these loops."""
    return AxisResponse(plant, axis, variation, _grid(), SAMPLE_S)


def _grid() -> Array:
    fine = [
        np.linspace(low, high, count) for low, high, count in ((1.3, 2.7, 300), (2.7, 6.0, 160))
    ]
    return np.unique(np.concatenate([np.geomspace(1e-3, 24.0, 700), *fine]))


def _notch_response(law: SampledLaw, z: ComplexArray) -> ComplexArray:
    notch = law.notch
    if not notch.enabled:
        return np.ones_like(z)
    omega = 2.0 * math.pi * notch.pole_hz
    s = omega / math.tan(0.5 * omega * SAMPLE_S) * (z - 1.0) / (z + 1.0)
    return np.asarray((s**2 + omega**2) / (s**2 + 2.0 * notch.pole_damping * omega * s + omega**2))
