"""One axis as a sampled loop: exact responses at 50 Hz, wind error, sensitivity of encoder and
radio loop.

    L = G_e K,   S = 1 / (1 + L),   S_radio = 1 / (1 + H G_b (K + F N s) S)
    beam under wind = (W_b - G_b K W_e S) w

G: rate command to encoder and beam, exact for held commands; W: wind acceleration to both; K:
position law; H the radio integrator of the station with its averages and its delay.  Gusts have
Davenport's spectrum.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import trapezoid

from rf_pointing.controllers import LawMatrices, LqgDesign, PositionLoopParams
from rf_pointing.core.types import Array, ComplexArray
from rf_pointing.servo import PlantParams, discretise
from rf_pointing.servo.linear_model import linear_model
from rf_pointing.servo.wind import GUST_LENGTH_M

SAMPLE_S = 0.02
RADIO_PERIOD_S = 0.1
_AXES = ("azimuth", "elevation")


@dataclass(frozen=True, slots=True)
class Variation:
    """How the antenna differs from the one the controller was made for."""

    frequency: float = 1.0
    residue: float = 1.0


@dataclass(frozen=True, slots=True)
class RadioLoop:
    """Radio integrator of f_m `bandwidth_hz` that acts on the mean of the latest `mean_of` errors,
    one every 0.1 s.

    Each error is the mean of the latest `cluster` samples at 50 Hz and acts `wait_s` after the last
    of them, on a straight line 0.1 s long.
    """

    bandwidth_hz: float
    mean_of: int
    cluster: int
    wait_s: float

    def response(self, frequency_hz: Array) -> ComplexArray:
        """Return the response (f,) from error to offset, without the images of the sampling."""
        s = 2j * np.pi * frequency_hz
        errors = sum(np.exp(-k * RADIO_PERIOD_S * s) for k in range(self.mean_of)) / self.mean_of
        samples = sum(np.exp(-k * SAMPLE_S * s) for k in range(self.cluster)) / self.cluster
        line = np.exp(-0.5 * RADIO_PERIOD_S * s) * np.sinc(frequency_hz * RADIO_PERIOD_S)
        whole = (
            2.0
            * math.pi
            * self.bandwidth_hz
            / s
            * np.exp(-self.wait_s * s)
            * errors
            * samples
            * line
        )
        return np.asarray(whole, dtype=np.complex128)


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


class AxisResponse:
    """Responses of one axis of a plant on a frequency grid; independent of the controller."""

    def __init__(self, plant: PlantParams, axis: int, variation: Variation) -> None:
        name = _AXES[axis]
        model = linear_model(_varied(plant, name, variation))
        kept = [i for i, state in enumerate(model.state_names) if name in state]
        block = np.ix_(kept, kept)
        self.a, self.command = model.a[block], model.b_command[kept][:, [axis]]
        self.wind = model.b_wind[kept][:, [axis]]
        self.outputs = np.vstack([model.encoder[axis, kept], model.beam[axis, kept]])
        self.step = discretise(self.a, self.command, SAMPLE_S)
        self.frequency_hz = _grid()

    @cached_property
    def from_command(self) -> ComplexArray:
        """Response (f, 2) of encoder and beam to the rate command."""
        z: ComplexArray = np.asarray(np.exp(2j * np.pi * self.frequency_hz * SAMPLE_S))
        return self._solve(z, self.step[:, :-1], self.step[:, -1:])

    @cached_property
    def from_wind(self) -> ComplexArray:
        """Response (f, 2) of encoder and beam to wind acceleration."""
        s: ComplexArray = np.asarray(2j * np.pi * self.frequency_hz, dtype=np.complex128)
        return self._solve(s, self.a, self.wind)

    def closed_radius(self, law: LawMatrices) -> float:
        """Return the spectral radius of the encoder loop under a law from error to rate (a, b, c,
        d).
        """
        a, b, c = self.step[:, :-1], self.step[:, -1:], self.outputs[:1]
        la, lb, lc, ld = law
        closed = np.block([[a - b @ ld @ c, b @ lc], [-lb @ c, la]])
        return float(np.max(np.abs(np.linalg.eigvals(closed))))

    def _solve(self, points: ComplexArray, a: Array, b: Array) -> ComplexArray:
        solved = np.linalg.solve(
            points[:, None, None] * np.eye(len(a)) - a, b.astype(np.complex128)
        )
        return np.asarray((self.outputs @ solved)[:, :, 0])


class LawResponse:
    """Responses of one position law on the same frequency grid; independent of the antenna.

    `gain` (f,) leads from error to rate command, `fed` (f,) from command angle to rate command
    through the feedforward; `matrices` is the law from error to rate command in state space.
    """

    def __init__(self, law: PositionLoopParams | LqgDesign) -> None:
        frequency = _grid()
        s, z = 2j * np.pi * frequency, np.exp(2j * np.pi * frequency * SAMPLE_S)
        self.matrices = a, b, c, d = law.matrices(SAMPLE_S)
        solved = np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a, b.astype(np.complex128))
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


def davenport_psd(frequency_hz: Array, mean_speed_m_s: float, drag_coefficient: float) -> Array:
    """Return the one-sided spectrum of the gust speed in (m/s)^2/Hz at `frequency_hz` > 0."""
    x = GUST_LENGTH_M * frequency_hz / mean_speed_m_s
    psd: Array = (
        4.0
        * drag_coefficient
        * mean_speed_m_s**2
        / frequency_hz
        * x**2
        / (1.0 + x**2) ** (4.0 / 3.0)
    )
    return psd


def encircles_not(loop: ComplexArray) -> bool:
    """Whether the Nyquist curve of a loop with one integrator leaves -1 alone: 1 + L then turns by
    a quarter.
    """
    angle = np.unwrap(np.angle(1.0 + loop))
    return abs(float(angle[-1] - angle[0]) - 0.5 * math.pi) < 0.25 * math.pi


def _varied(plant: PlantParams, name: str, variation: Variation) -> PlantParams:
    axis = getattr(plant, name)
    changed = axis.replace(
        mode_frequency_hz=tuple(variation.frequency * value for value in axis.mode_frequency_hz),
        mode_encoder_residue=tuple(
            variation.residue * value for value in axis.mode_encoder_residue
        ),
        mode_beam_residue=tuple(variation.residue * value for value in axis.mode_beam_residue),
    )
    return plant.replace(**{name: changed})


def _grid() -> Array:
    fine = [
        np.linspace(low, high, count) for low, high, count in ((1.3, 2.7, 300), (2.7, 6.0, 160))
    ]
    return np.unique(np.concatenate([np.geomspace(1e-3, 24.0, 700), *fine]))


def _notch_response(law: PositionLoopParams | LqgDesign, z: ComplexArray) -> ComplexArray:
    notch = law.weights.notch if isinstance(law, LqgDesign) else law.notch
    if not notch.enabled:
        return np.ones_like(z)
    omega = 2.0 * math.pi * notch.pole_hz
    s = omega / math.tan(0.5 * omega * SAMPLE_S) * (z - 1.0) / (z + 1.0)
    return np.asarray((s**2 + omega**2) / (s**2 + 2.0 * notch.pole_damping * omega * s + omega**2))
