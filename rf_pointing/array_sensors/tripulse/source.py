"""Simulated satellite and space link of Tripulse: the frames that the ground stations receive.

y(t) = A beam*(T) exp(j phi(f_t, t)) + A_r (exp(j phi(f_r1, t)) + exp(j phi(f_r2, t))) + noise,
phi(f, t) = 2 pi (f - f_t) t - 2 pi f rho'(t) / c + (f / f_t) phi_satellite(t) - phi_station(t),

with random walks for the two clocks.  Everything but the noise is linear in f, which is what the
two-tone scheme relies on.  The conjugate of the beam stands because the receiver counts exp(+j w
t).  N_0 = 1, so A^2 is C/N_0 in hertz.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rf_pointing.array_sensors.attitude.quaternion import require_rotation
from rf_pointing.array_sensors.doa.snapshots import complex_normal
from rf_pointing.array_sensors.tripulse.array import TripulseArrayParams, element_weights
from rf_pointing.array_sensors.tripulse.beams import beam_signals
from rf_pointing.array_sensors.tripulse.signal import (
    TripulseFrame,
    TripulseSignalParams,
    segment_beams,
)
from rf_pointing.core import (
    Params,
    as_finite_array,
    parameter,
    random_stream,
    require_between,
    require_finite,
)
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.core.types import Array, ComplexArray


@dataclass(frozen=True, kw_only=True)
class TripulseSourceParams(Params):
    """Link budget and clocks of the simulated satellite and stations."""

    element_carrier_to_noise_db_hz: float = parameter(
        37.0, "C/N0 of one array element", low=-20.0, high=120.0
    )
    reference_carrier_to_noise_db_hz: float = parameter(
        80.0, "C/N0 of each reference tone", low=-20.0, high=160.0
    )
    satellite_linewidth_hz: float = parameter(
        10.0, "linewidth of the satellite's clock at f_t", low=0.0, high=1e6
    )
    station_linewidth_hz: float = parameter(
        10.0, "linewidth of the stations' clocks at f_t", low=0.0, high=1e6
    )
    quadrant_phase_rad: float = parameter(
        0.0, "sigma of a fixed, unknown phase of each quadrant's beamformer", low=0.0, high=math.pi
    )
    elevation_min_rad: float = parameter(
        math.radians(5.0), "lowest elevation of the satellite", low=0.0, high=1.5
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StationLine:
    """Line of sight to a station.

    Unit vector (3,) in the reference frame, range rate, elevation at the station.
    """

    name: str
    direction: Array
    range_rate_m_s: float
    elevation_rad: float

    def __post_init__(self) -> None:
        direction = as_finite_array("direction", self.direction, (3,))
        require_between(
            "length of direction", float(np.linalg.norm(direction)), 1.0 - 1e-6, 1.0 + 1e-6
        )
        require_finite("range_rate_m_s", self.range_rate_m_s)
        require_finite("elevation_rad", self.elevation_rad)
        object.__setattr__(self, "direction", direction)


@dataclass(frozen=True, slots=True, kw_only=True)
class TripulseSourceState:
    """Everything that the next frames depend on."""

    generator: dict[str, Any]
    sequence: int
    t_s: float | None
    prior: Array


class TripulseSource:
    """Satellite array that sends one frame to every station in each step.

    `prior` (3, 3) is the rotation, reference to array frame, that the satellite believes and steers
    its beams by.
    """

    def __init__(
        self,
        array: TripulseArrayParams,
        signal: TripulseSignalParams,
        params: TripulseSourceParams,
        *,
        seed: int,
        failed: NDArray[np.bool_] | None = None,
        prior: ArrayLike | None = None,
    ) -> None:
        self.array, self.signal, self.params, self.failed = array, signal, params, failed
        # Only to check: an array without a living element is refused when it is made, not at the
        # first frame.
        element_weights(array, [0.0, 0.0], failed=failed)
        self._stream = random_stream(seed, "tripulse_source")
        # A stream of its own: the phases of the hardware do not change with the noise drawn before.
        quadrants = (
            random_stream(seed, "tripulse beamformer").standard_normal((2, 2))
            * params.quadrant_phase_rad
        )
        self._phase_errors_rad = np.kron(quadrants, np.ones((array.n_x // 2, array.n_y // 2)))
        self._sequence = 0
        self._t_s: float | None = None
        self.steer(np.eye(3) if prior is None else prior)

    @property
    def state(self) -> TripulseSourceState:
        """A copy of the state, to stop here and resume with `restore`."""
        generator = copy.deepcopy(dict(self._stream.bit_generator.state))
        return TripulseSourceState(
            generator=generator, sequence=self._sequence, t_s=self._t_s, prior=self._prior.copy()
        )

    def restore(self, state: TripulseSourceState) -> None:
        """Continue from `state`: the following frames are those that followed it."""
        self._stream.bit_generator.state = copy.deepcopy(state.generator)
        self._sequence, self._t_s, self._prior = state.sequence, state.t_s, state.prior.copy()

    def steer(self, prior: ArrayLike) -> None:
        """Steer the next frames by the rotation `prior` (3, 3), reference to array frame."""
        self._prior = require_rotation("prior", as_finite_array("prior", prior, (3, 3)))

    def step(
        self, t_s: float, rotation: ArrayLike, lines: Sequence[StationLine]
    ) -> list[TripulseFrame]:
        """Return the frames sent at `t_s`, one per line of sight, for the true `rotation` (3, 3).

        Raises
        ------
        ValueError : if time does not advance, the satellite is below a station's lowest elevation,
            or a station lies behind the array.
        """
        require_finite("t_s", t_s)
        if self._t_s is not None and t_s <= self._t_s:
            raise ValueError(f"t_s={t_s} must be > the last frames' {self._t_s}")
        true = require_rotation("rotation", as_finite_array("rotation", rotation, (3, 3)))
        for line in lines:
            self._require_visible(line, true)
        self._t_s, self._sequence = t_s, self._sequence + 1
        return [self._frame(t_s, true, line) for line in lines]

    def _require_visible(self, line: StationLine, rotation: Array) -> None:
        lowest_rad = self.params.elevation_min_rad
        if line.elevation_rad < lowest_rad:
            raise ValueError(
                f"station {line.name} sees the satellite at elevation_rad={line.elevation_rad}, must be >= {lowest_rad}"
            )
        # Both: steering behind the array is as impossible as radiating there.
        for name, frame in (("attitude", rotation), ("prior attitude", self._prior)):
            height = float((frame @ line.direction)[2])
            if height <= 0.0:
                raise ValueError(
                    f"station {line.name} lies behind the array in its {name}: z={height} must be > 0"
                )

    def _frame(self, t_s: float, rotation: Array, line: StationLine) -> TripulseFrame:
        steering = (self._prior @ line.direction)[:2]
        weights = element_weights(
            self.array, steering, failed=self.failed, phase_errors_rad=self._phase_errors_rad
        )
        beams = beam_signals(self.array, weights, (rotation @ line.direction)[:2]).conj()
        samples = self._received(beams, line.range_rate_m_s)
        return TripulseFrame(
            t_s=t_s, station=line.name, sequence=self._sequence, steering=steering, samples=samples
        )

    def _received(self, beams: ComplexArray, range_rate_m_s: float) -> ComplexArray:
        signal, params = self.signal, self.params
        time_s = np.arange(signal.samples) / signal.sample_rate_hz
        satellite_rad = self._clock_rad(params.satellite_linewidth_hz)
        station_rad = self._clock_rad(params.station_linewidth_hz)

        def tone(offset_hz: float) -> ComplexArray:
            frequency_hz = signal.carrier_hz + offset_hz
            travel_rad = 2.0 * math.pi * frequency_hz * range_rate_m_s / SPEED_OF_LIGHT_M_S * time_s
            # Tones start at unknown phases: the receiver must not rely on their relation.
            start_rad = self._stream.uniform(0.0, 2.0 * math.pi)
            clock_rad = frequency_hz / signal.carrier_hz * satellite_rad - station_rad
            return np.asarray(
                np.exp(
                    1j * (2.0 * math.pi * offset_hz * time_s - travel_rad + clock_rad + start_rad)
                )
            )

        sent = np.repeat(beams[segment_beams(signal)], signal.samples_per_segment)
        total = 10.0 ** (params.element_carrier_to_noise_db_hz / 20.0) * sent * tone(0.0)
        if signal.scheme == "two_tone":
            reference = 10.0 ** (params.reference_carrier_to_noise_db_hz / 20.0)
            total = total + reference * (
                tone(-signal.tone_separation_hz) + tone(signal.tone_separation_hz)
            )
        # N_0 = 1 per hertz, so the samples have the variance of the sample rate.
        noise = math.sqrt(signal.sample_rate_hz) * complex_normal(self._stream, (signal.samples,))
        return np.asarray(total + noise)

    def _clock_rad(self, linewidth_hz: float) -> Array:
        # A Lorentzian line of this width is a random walk of 2 pi times the width per second.
        step_rad = math.sqrt(2.0 * math.pi * linewidth_hz / self.signal.sample_rate_hz)
        return np.cumsum(self._stream.normal(scale=step_rad, size=self.signal.samples))
