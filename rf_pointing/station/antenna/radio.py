"""The radio of a simulated antenna: samples of the satellite's signal instead of measurements.

    offset = f_c (1 - range rate / c) - f_centre (1 + clock error)

Boresights come in, one per control tick, and each gives the samples since the one before.
"""

import math
from typing import NamedTuple

import numpy as np

from rf_pointing.core import LEVEL, Boresight, ComplexArray, Kinematics, PointingError
from rf_pointing.core.constants import SPEED_OF_LIGHT_M_S
from rf_pointing.ephemeris import TopocentricTrack
from rf_pointing.receiver.generator import SignalGenerator
from rf_pointing.receiver.meter import SignalMeter
from rf_pointing.receiver.params import SignalReceiverParams
from rf_pointing.receiver.spectrum import IqSamples, Samples
from rf_pointing.rf import Beam
from rf_pointing.station.antenna.receiver import Arriving, ArrivingSignal, RadioParams, Reception, SignalParams

AHEAD_S, SPAN_S = 0.1, 5.0
"""Spacing and span of the range rates that a meter is given ahead of time."""


class RadioPiece(NamedTuple):
    """Samples (channels, n), the time of the first one, and the true error at their end."""

    samples: Samples
    t_s: float
    truth: PointingError


class SimulatedRadio(ArrivingSignal):
    """Makes samples for every tick; `take` returns None for the first one, and after a gap."""

    def __init__(
        self, params: SignalParams, radio: RadioParams, real_track: TopocentricTrack, mount: Kinematics = LEVEL
    ) -> None:
        super().__init__(params, real_track, mount)
        self.radio = radio
        self._generator = SignalGenerator(radio.generator)
        self._beam = Beam(params.beam)
        self._before: Boresight | None = None
        self._due = 0.0

    def take(self, boresight: Boresight) -> RadioPiece | None:
        """Take the boresight of a tick; return the samples since the one before."""
        before, self._before = self._before, boresight
        if before is None or not 0.5 < (boresight.t_s - before.t_s) / self.params.sample_s < 1.5:
            return None
        generator, t_s = self.radio.generator, np.array([before.t_s, boresight.t_s])
        arriving = self.at(t_s, [before, boresight])
        # A fast clock takes more samples in a tick.
        self._due += (t_s[1] - t_s[0]) * generator.rate_hz * (1.0 + 1e-6 * generator.clock_ppm)
        count = round(self._due) - self._generator.count
        centre_hz = self.radio.centre_hz * (1.0 + 1e-6 * generator.clock_ppm)
        shift_hz = self.radio.doppler_hz * arriving.range_rate_m_s / SPEED_OF_LIGHT_M_S
        begin_hz, end_hz = (self.radio.carrier_hz - centre_hz - shift_hz).tolist()
        volts = self._volts(arriving)
        share = (np.arange(count) + 0.5) / count
        ramp = volts[:, :1] + (volts[:, 1:] - volts[:, :1]) * share
        samples = self._generator.take(count, (begin_hz, end_hz), ramp)
        return RadioPiece(samples, before.t_s, arriving.truth(boresight.t_s))

    def _volts(self, arriving: Arriving) -> ComplexArray:
        """Return the amplitudes (channels, 2) of the feed's channels at both ends of the tick."""
        x, y = arriving.cross_elevation_rad, arriving.elevation_rad
        channels = self.radio.generator.channels
        feed = np.stack(self.feed.voltages(x, y)) if channels == 3 else self._beam.voltage(x, y)[None, :]
        return np.asarray(feed * 10.0 ** (arriving.level_db_hz / 20.0), dtype=np.complex128)


class SampledReceiver:
    """A radio and the meter of its samples, in place of the simulated receiver.

    `predicted` is the target as the station predicts it: its Doppler is what the meter expects.
    """

    def __init__(self, radio: SimulatedRadio, receiver: SignalReceiverParams, predicted: TopocentricTrack) -> None:
        self._radio, self.meter, self._predicted = radio, SignalMeter(receiver), predicted
        self._index, self._predicted_s = 0, -math.inf

    def take(self, boresight: Boresight) -> Reception | None:
        """Take one boresight; return the reception when it completes a report."""
        if boresight.t_s >= self._predicted_s - 1.0:
            times = boresight.t_s + AHEAD_S * np.arange(round(SPAN_S / AHEAD_S))
            for t_s, rate in zip(times, self._predicted.sample(times).range_rate_m_s, strict=True):
                self.meter.doppler.take(float(t_s), float(rate))
            self._predicted_s = float(times[-1])
        piece = self._radio.take(boresight)
        if piece is None:
            return None
        arrived = IqSamples(piece.samples, self.meter.layout.rate_hz, self._index, boresight.t_s, t_s=piece.t_s)
        self._index += piece.samples.shape[1]
        measured = self.meter.take(arrived)
        return Reception(measured[-1].cluster, measured[-1].power, piece.truth) if measured else None


def seeded(radio: RadioParams, seed: int) -> RadioParams:
    """Return the radio whose noise has the seed of a run."""
    return radio.replace(generator=radio.generator.replace(seed=seed))
