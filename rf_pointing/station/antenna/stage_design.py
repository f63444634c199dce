"""Gain of a second stage in wind, its predictor, and the margins of the loops around it.

    F(s) = e^(-T s) hold(s) / (1 + s / w_s) sum_k p_k z^-k       stage, command to deflection
    error = B - F (E + n),   E = S W_e,   B = W_b - G_b C S W_e

E, B: wind to encoder residual and beam; n: noise and steps of the encoder.  The taps p minimise the
mean square of the error over gusts about 12 m/s and over antennas whose modes are up to 10 % and
whose residues are 30 % off (a Wiener filter).  A white part of `UNKNOWN` of the wind's error in the
residual keeps them small.

The stage acts on the command and never on the encoder, so the position loops stay as they are.  The
radio loop sees B_c + F (1 - E_c) in place of B_c, with E_c, B_c the responses of encoder and beam
to the command, and has to keep its margins with the latency.  A stage without them is refused, and
so is one that does not lower the wind's error on every one of these antennas.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rf_pointing.controllers.filters import section_matrices
from rf_pointing.controllers.margins import RadioLoop, encircles_not, loop_margins, sampled_response
from rf_pointing.core import AXES
from rf_pointing.core.second_stage import SecondStageParams
from rf_pointing.core.types import Array, ComplexArray
from rf_pointing.servo import PlantParams, WindParams
from rf_pointing.station.antenna.axis_response import AS_KNOWN, AxisResponse, Variation
from rf_pointing.station.antenna.axis_response import davenport_psd as gust_spectrum
from rf_pointing.station.antenna.loops import Law
from rf_pointing.station.antenna.tuning import MOST_SENSITIVE, gust_acceleration

TAPS, UNKNOWN = 15, 0.03
DESIGN_WIND_M_S = 12.0
MODES, RESIDUES = (0.9, 0.95, 1.0, 1.05, 1.1), (0.7, 1.0, 1.3)
OFF = tuple(Variation(modes, share) for modes in MODES for share in RESIDUES)
LEAST_GAIN = 1.25
"""Times by which a stage has to lower the wind's error, on the worst of these antennas."""
LEAST_TRAVEL = 3.0
"""Times the rms of its command in that wind that a stage has to reach."""
DRAG = 0.005
MEAN_OF, CLUSTER, WAIT_S = 5, 5, 0.2
"""The radio loop of the station: mean of five errors of five samples, 0.2 s to the command."""


@dataclass(frozen=True, slots=True)
class StageAxis:
    """One direction: its taps (n,), rms beam error in wind without and with the stage, margins.

    `command_rad` is the rms of what is commanded in the wind of the design, `worst_gain` the
    smallest ratio of the errors over the antennas that differ; `radio_peak` the peak of the radio
    loop's sensitivity at `radio_hz`, infinite where it is unstable.
    """

    name: str
    taps: Array
    before_rad: float
    after_rad: float
    command_rad: float
    worst_gain: float
    radio_peak: float
    radio_hz: float


@dataclass(frozen=True, slots=True)
class StageDesign:
    """A stage on its antenna; `require_useful` raises ValueError for one that is refused."""

    params: SecondStageParams
    axes: tuple[StageAxis, StageAxis]

    @property
    def taps(self) -> Array:
        """Taps (n, 2) of both directions."""
        return np.column_stack([axis.taps for axis in self.axes])

    @property
    def before_rad(self) -> float:
        """Radial rms error in wind without the stage."""
        return math.hypot(*(axis.before_rad for axis in self.axes))

    @property
    def after_rad(self) -> float:
        """Radial rms error in wind with it."""
        return math.hypot(*(axis.after_rad for axis in self.axes))

    def require_useful(self) -> None:
        """Refuse a stage that makes the wind's error larger, or the radio loop swing."""
        own = self.params
        given = f"second_stage.latency_s={own.latency_s:g}, bandwidth_hz={own.bandwidth_hz:g}"
        for axis in self.axes:
            least_rad, why = LEAST_TRAVEL * axis.command_rad, ""
            if axis.worst_gain < LEAST_GAIN:
                why = (
                    f"the error in wind is {axis.worst_gain:.2f} times smaller with the modes 10 % "
                    f"off, must be >= {LEAST_GAIN:g}"
                )
            elif own.travel_rad < least_rad:
                why = (
                    f"travel_deg={math.degrees(own.travel_rad):.4g} must be >= "
                    f"{math.degrees(least_rad):.4g} in wind of {DESIGN_WIND_M_S:g} m/s"
                )
            elif axis.radio_peak > MOST_SENSITIVE:
                why = (
                    f"the tracking loop of {own.radio_bandwidth_hz:g} Hz has a sensitivity peak of "
                    f"{axis.radio_peak:.2f} at {axis.radio_hz:.2f} Hz, "
                    f"must be <= {MOST_SENSITIVE:g}"
                )
            if why:
                raise ValueError(f"{given}: {axis.name}: {why}")


def design_stage(
    params: SecondStageParams, plant: PlantParams, laws: Sequence[Law], wind: WindParams, tick_s: float
) -> StageDesign:
    """Return the stage on this antenna, judged in gusts about the mean wind of the design."""
    gusts = gust_acceleration(plant, wind, DESIGN_WIND_M_S)
    axes, known = [], OFF.index(AS_KNOWN)
    for axis, law in enumerate(laws):
        antennas = [_Antenna(params, plant, axis, law, tick_s, off) for off in OFF]
        taps = _wiener(antennas, gusts[axis])
        judged = [each.errors_rad(taps, gusts[axis]) for each in antennas]
        margins = antennas[known].radio_loop(taps)
        command_rad = antennas[known].command_rad(taps, gusts[axis])
        worst = min(before / after for before, after in judged)
        axes.append(StageAxis(AXES[axis], taps, *judged[known], command_rad, worst, *margins))
    return StageDesign(params, (axes[0], axes[1]))


class _Antenna:
    """One axis of one antenna under its law, on its own grid of frequencies (f,)."""

    def __init__(
        self, params: SecondStageParams, plant: PlantParams, axis: int, law: Law, tick_s: float,
        off: Variation,
    ) -> None:  # fmt: skip
        self._params, self._tick_s, own = params, tick_s, getattr(plant, AXES[axis])
        response = AxisResponse.on_own_grid(plant, axis, tick_s, off)
        self._hz = hz = response.frequency_hz
        (encoder, beam), (wind_encoder, wind_beam) = response.from_command.T, response.from_wind.T
        gain = sampled_response(law.matrices(tick_s), hz, tick_s)[:, 0, 0]
        self._sensitivity = 1.0 / (1.0 + encoder * gain)
        self._residual = self._sensitivity * wind_encoder
        self._beam = wind_beam - beam * gain * self._residual
        s, z = 2j * np.pi * hz, np.exp(2j * np.pi * hz * tick_s)
        fed = getattr(law, "feedforward_gain", 1.0) * s / (1.0 + s / (2.0 * math.pi * 10.0))
        if law.notch.enabled:
            fed = fed * sampled_response(section_matrices(law.notch, tick_s), hz, tick_s)[:, 0, 0]
        led = (gain + fed) * self._sensitivity
        self._moved = led * encoder, led * beam
        stage = np.exp(-s * params.latency_s) / (1.0 + s / (2.0 * math.pi * params.bandwidth_hz))
        hold = (1.0 - 1.0 / z) / (s * tick_s)
        self._late: ComplexArray = z[:, None] ** -np.arange(TAPS)
        self._taps: ComplexArray = (stage * hold)[:, None] * self._late
        step_rad = 2.0 * math.pi / 2**own.encoder_bits
        # White, one-sided, up to half the sampling rate; the steps as their own noise.
        self._noise = 2.0 * tick_s * (own.encoder_noise_rad**2 + step_rad**2 / 12.0)

    def _weights(self, acceleration: float) -> Array:
        """Return the power (f,) of the gusts on each part of the grid, in (rad/s^2)^2."""
        gusts = gust_spectrum(self._hz, DESIGN_WIND_M_S, DRAG)
        return np.asarray(acceleration**2 * gusts * np.gradient(self._hz))

    def normal_equations(self, acceleration: float) -> tuple[Array, Array, float]:
        """Return matrix (n, n), right side (n,) and the beam's mean square (rad^2) in the wind."""
        weights = self._weights(acceleration)
        seen = self._taps * self._residual[:, None]
        matrix = (seen.conj().T * weights) @ seen + self._noise * (
            self._taps.conj().T * np.gradient(self._hz)
        ) @ self._taps
        right = (seen.conj().T * weights) @ self._beam
        return matrix.real, right.real, float(np.sum(weights * np.abs(self._beam) ** 2))

    def errors_rad(self, taps: Array, acceleration: float) -> tuple[float, float]:
        """Return the rms beam error in wind without and with the stage."""
        weights, stage = self._weights(acceleration), self._taps @ taps
        left = np.sum(weights * np.abs(self._beam - stage * self._residual) ** 2)
        noise = self._noise * np.sum(np.gradient(self._hz) * np.abs(stage) ** 2)
        return math.sqrt(np.sum(weights * np.abs(self._beam) ** 2)), math.sqrt(left + noise)

    def command_rad(self, taps: Array, acceleration: float) -> float:
        """Return the rms of the command in the wind of the design."""
        weights = self._weights(acceleration)
        return math.sqrt(np.sum(weights * np.abs(self._late @ taps * self._residual) ** 2))

    def radio_loop(self, taps: Array) -> tuple[float, float]:
        """Return the peak of the radio loop's sensitivity, and its frequency (Hz)."""
        encoder, beam = self._moved
        if self._params.radio_bandwidth_hz == 0.0:
            return 1.0, 0.0
        radio = RadioLoop(self._params.radio_bandwidth_hz, MEAN_OF, CLUSTER, WAIT_S)
        loop = radio.response(self._hz) * (beam + self._taps @ taps * (1.0 - encoder))
        margins = loop_margins(self._hz, loop)
        return margins.peak_sensitivity if encircles_not(loop) else math.inf, margins.peak_hz


def _wiener(antennas: list[_Antenna], acceleration: float) -> Array:
    """Return the taps (n,) with the least mean square error over all antennas."""
    parts = [each.normal_equations(acceleration) for each in antennas]
    power = sum(each for _, _, each in parts)
    matrix = np.sum([each for each, _, _ in parts], axis=0) + UNKNOWN**2 * power * np.eye(TAPS)
    return np.asarray(np.linalg.solve(matrix, np.sum([each for _, each, _ in parts], axis=0)))
