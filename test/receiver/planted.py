"""Streams of samples whose truth is planted, and what a meter makes of them."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rf_pointing.core import SPEED_OF_LIGHT_M_S, Array
from rf_pointing.receiver import GeneratorParams, Measurement, SignalGenerator, SignalMeter, SignalReceiverParams
from rf_pointing.receiver.params import IqParams, SignalSearchParams
from rf_pointing.receiver.spectrum import IqSamples
from rf_pointing.rf.noise import BOLTZMANN_J_K

START_S, PIECE_S = 1000.0, 0.02


@dataclass
class Planted:
    """A carrier at `carrier_hz`, its Doppler and the radio; `level` is C/N0 in dB-Hz over time."""

    level: Any
    rate_hz: float = 2.4e5
    carrier_hz: float = 2.25e9
    doppler_hz: float = 0.0
    slope_hz_s: float = 0.0
    clock_ppm: float = 0.0
    predicted: bool = True
    signal: SignalSearchParams = field(default_factory=SignalSearchParams)
    period_s: float = 0.1
    radio: dict[str, Any] = field(default_factory=dict)
    volts: Any = None
    """Relative complex amplitudes (channels,), by default of one channel."""

    def __post_init__(self) -> None:
        centre_hz = self.carrier_hz - 0.1 * self.rate_hz
        self.params = SignalReceiverParams(
            type="rtl_tcp", frequency_hz=self.carrier_hz, signal=self.signal, period_s=self.period_s,
            iq=IqParams(rate_hz=self.rate_hz, centre_mhz=1e-6 * centre_hz),
        )  # fmt: skip
        self.meter = SignalMeter(self.params)
        channels = 1 if self.volts is None else len(self.volts)
        self.generator = SignalGenerator(
            GeneratorParams(
                rate_hz=self.rate_hz, clock_ppm=self.clock_ppm, channels=channels,
                # Room for the strongest carrier.
                **{"noise_dbfs": -45.0, "bits": 12, **self.radio},
            )
        )  # fmt: skip
        self._true_rate = self.rate_hz * (1.0 + 1e-6 * self.clock_ppm)
        self._centre_hz = centre_hz * (1.0 + 1e-6 * self.clock_ppm)
        self.index, self.skipped = 0, 0

    @property
    def converter_noise(self) -> float:
        """Noise that the rounding of the converter adds, over that of the channel."""
        params = self.generator.params
        step = 2.0 ** (1 - params.bits) if params.bits else 0.0
        return 2.0 * step**2 / 12.0 / 10.0 ** (0.1 * params.noise_dbfs)

    def time_s(self, index: int) -> float:
        return START_S + index / self._true_rate

    def offset_hz(self, t_s: float) -> float:
        return self.carrier_hz + self.doppler_hz + self.slope_hz_s * (t_s - START_S) - self._centre_hz

    def piece(self) -> IqSamples:
        """Return the next samples as they arrive."""
        count = round(PIECE_S * self.rate_hz)
        begin_s, end_s = self.time_s(self.index), self.time_s(self.index + count)
        level = self.level(begin_s - START_S) if callable(self.level) else self.level
        volts = 10.0 ** (level / 20.0) * np.asarray([1.0] if self.volts is None else self.volts)
        samples = self.generator.take(count, (self.offset_hz(begin_s), self.offset_hz(end_s)), volts)
        if self.predicted:
            ahead = self.doppler_hz + self.slope_hz_s * (end_s + 1.0 - START_S)
            self.meter.doppler.take(end_s + 1.0, -ahead / self.carrier_hz * SPEED_OF_LIGHT_M_S)
        self.index += count
        clipped = float(np.mean(np.abs(samples.view(np.float32)) > 0.995))
        return IqSamples(samples, self.rate_hz, self.index - count + self.skipped, end_s, clipped=clipped)

    def run(self, seconds: float, settle_s: float = 1.5) -> list[Measurement]:
        """Return the measurements of `seconds`, without those before the carrier has settled."""
        found = []
        for _ in range(round(seconds / PIECE_S)):
            found += self.meter.take(self.piece())
        since_s = self.time_s(self.index) - seconds + settle_s
        return [each for each in found if each.power.t_s > since_s]


def ratios(measured: list[Measurement]) -> tuple[Array, Array]:
    """Return C/N0 (n,) and its sigma in hertz."""
    watts = BOLTZMANN_J_K * SignalReceiverParams().system_noise_k
    rows = np.array([(each.power.power_w, each.power.sigma_w) for each in measured]) / watts
    return rows[:, 0], rows[:, 1]


def mean_db(measured: list[Measurement]) -> float:
    """Return the mean C/N0 in dB-Hz."""
    return float(10.0 * np.log10(np.mean(ratios(measured)[0])))
