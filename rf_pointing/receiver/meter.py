"""From samples to what trackers take: carrier power with its sigma, clusters of three channels.

Every block of the stream is placed in time, its frequency predicted from range rate, frequencies
and clock of the radio; a detector follows what is left.  A report covers whole blocks.
"""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import Array, BoolArray, CarrierPower, ComplexArray, MonopulseCluster, Pair
from rf_pointing.receiver.balance import ChannelBalance
from rf_pointing.receiver.band import BandPower, band_bound
from rf_pointing.receiver.carrier import CarrierTracker, power_bound
from rf_pointing.receiver.noise import DC_BINS, Line, NoiseDensity, strongest_line
from rf_pointing.receiver.params import BAND, CARRIER, PREAMBLE, IqParams, SignalReceiverParams
from rf_pointing.receiver.preamble import Burst, PreambleDetector
from rf_pointing.receiver.spectrum import IqSamples, Layout, Spectrum, SpectrumStream
from rf_pointing.receiver.stream_clock import DopplerPrediction, StreamClock
from rf_pointing.rf.noise import BOLTZMANN_J_K

FLOOR_DB_HZ = 0.0
NOISE_BINS = 500
"""Bins beyond the searched ones on either side: enough for 0.5 % of the noise in 2 s."""
GUARD_BINS = 20
"""Bins next to the carrier that its own line may reach at 90 dB-Hz."""
SPAN = 0.48
"""Usable half of the spectrum: filters cut its ends."""
CLIPPED_SHARE, CLIPPED_MOST = 1e-3, 0.1
"""Shares of clipped samples that are named, and beyond which a level no longer shows a scan."""
LATE_S = 1.0
LINE_S = 1.0
RIVAL_DB = 3.0
"""At the half-power edge of the beam a line that is weaker by less is the strongest one."""
GARBAGE_SHARE, JUDGED, FEWEST, RELATED = 0.5, 4096, 250, 0.2
"""A datagram of DIFI holds 360 samples."""
FLAT_POWER, FLAT_KURTOSIS = 0.25, 2.2
"""Numbers flat over the scale have 1/3 and 1.8, those at its ends 1 and 1; noise has 3."""
BURST_S = 5.0
"""A signal of bursts counts as lost after so long without one."""
NAMED_S = 10.0
"""How long something that has happened once is named."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """One report: the power, the cluster of three channels, and the bound of the power's sigma."""

    power: CarrierPower
    cluster: MonopulseCluster | None
    bound_w: float


@dataclass
class MeterState:
    """Findings of the meter about its stream, for the operator."""

    clipped: float = 0.0
    garbage: float = 0.0
    """Share of the newest pieces that are random numbers."""
    late_s: float | None = None
    line: Line | None = None
    outside_hz: float | None = None
    events: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=8))
    blocks: int = 0


def centre_offset_hz(params: SignalReceiverParams, stated_hz: float | None = None) -> Pair:
    """Return where the carrier lies from the middle of the spectrum, and the sign of its Doppler.

    `stated_hz` is the centre as the source states it.
    """
    iq: IqParams = params.iq
    received_hz = params.frequency_hz - 1e6 * iq.converter_mhz
    sign = -1.0 if iq.swapped else 1.0
    received_hz = abs(received_hz)
    centre_hz = stated_hz or 1e6 * iq.centre_mhz or received_hz
    return received_hz - centre_hz * (1.0 + 1e-6 * iq.clock_ppm), sign


class SignalMeter:
    """Takes samples and range rates; `take` returns the reports that they complete."""

    def __init__(self, params: SignalReceiverParams) -> None:
        self.params, self.doppler = params, DopplerPrediction(params.frequency_hz)
        self.balance = ChannelBalance()
        self.state = MeterState()
        self._centre_hz: float | None = None
        self._begin(params.iq.rate_hz)

    def _begin(self, rate_hz: float) -> None:
        """Start anew, for a stream of this rate."""
        signal = self.params.signal
        self.layout = Layout.of_rate(rate_hz)
        self.clock = StreamClock(rate_hz, self.params.link.latency_s)
        self._stream = SpectrumStream(self.layout)
        self.carrier = CarrierTracker(signal, self.layout, signal.channels)
        self.band = BandPower(signal, self.layout)
        self.preamble = PreambleDetector(signal, self.layout) if signal.kind == PREAMBLE else None
        self._burst_s: float | None = None
        self.noise = NoiseDensity(signal.noise_time_constant_s / self.params.period_s)
        self._density, self._level_db_hz = 0.0, math.inf
        wide_hz = signal.band_hz if signal.kind == BAND else 0.0
        self._reach = (
            round((signal.uncertainty_hz + 1.5 * wide_hz) / self.layout.bin_hz) + NOISE_BINS
        )
        self._stamped: float | None = None
        self._long, self._long_blocks = np.zeros(2 * self._reach + 1), 0
        self._clear()

    def _clear(self) -> None:
        self._prompts: list[ComplexArray] = []
        self._powers: list[float] = []
        self._spectrum = np.zeros(2 * self._reach + 1)
        self._channel_noise = np.zeros(self.params.signal.channels)
        self._times: list[float] = []
        self._dc: BoolArray = np.zeros(2 * self._reach + 1, dtype=bool)

    def take(self, arrived: IqSamples) -> list[Measurement]:
        """Take samples in the order of their index; return the reports that are complete."""
        if arrived.rate_hz != self.layout.rate_hz:
            stated = f"stated {self.params.iq.rate_hz:.0f}"
            text = f"the source's rate is {arrived.rate_hz:.0f} sample/s, {stated}"
            self._event(arrived.arrival_s, text)
            self._begin(arrived.rate_hz)
        if arrived.centre_hz != self._centre_hz:
            if self._centre_hz is not None:
                self._event(
                    arrived.arrival_s,
                    f"the radio was retuned to {1e-6 * (arrived.centre_hz or 0.0):.6f} MHz",
                )
                self.carrier.lose()
            self._centre_hz = arrived.centre_hz
        state, count = self.state, arrived.samples.shape[1]
        state.clipped += 0.2 * (arrived.clipped - state.clipped)
        state.garbage += 0.2 * (is_random(arrived) - state.garbage)
        end = arrived.index + count
        if arrived.t_s is None:
            self.clock.take(end, arrived.arrival_s)
        else:
            late_s = arrived.arrival_s - (arrived.t_s + count / arrived.rate_hz)
            state.late_s = (
                late_s if state.late_s is None else state.late_s + 0.1 * (late_s - state.late_s)
            )
            self._stamped = (
                arrived.t_s - arrived.index / arrived.rate_hz - self.params.link.latency_s
            )
            if abs(late_s) > LATE_S:
                state.late_s = late_s
                return []
        return [
            found
            for block in self._stream.take(arrived.samples, arrived.index)
            for found in self._block(block)
        ]

    def problem(self, t_s: float) -> str:
        """Return what is wrong with the signal, "" when it is measured."""
        state, words = self.state, []
        if state.late_s is not None and abs(state.late_s) > LATE_S:
            words.append(
                f"samples are {state.late_s:.1f} s {'late' if state.late_s > 0.0 else 'ahead'}"
            )
        if self.clock.wrong_rate:
            words.append(self.clock.wrong_rate)
        if state.garbage > GARBAGE_SHARE and not self.found:
            words.append(
                "the samples are random numbers of full scale: garbage, or a gain far too high"
            )
        elif state.clipped > CLIPPED_SHARE:
            words.append(
                f"{100.0 * state.clipped:.1f} % of the samples are clipped: lower the gain"
            )
        if state.outside_hz is not None:
            words.append(
                f"the carrier is predicted {1e-3 * state.outside_hz:+.1f} kHz from the centre, "
                f"outside the {1e-3 * self.layout.rate_hz:.0f} kHz that are received"
            )
        elif not self.found and state.blocks:
            words.append("no signal: nothing above the noise where it is predicted")
        elif (line := self.rival) is not None:
            words.append(
                f"interference: {line}, where the signal has {self._level_db_hz:.0f} dB-Hz"
            )
        if self.params.signal.channels == 3 and self.balance.problem:
            words.append(self.balance.problem)
        words += [text for at_s, text in state.events if 0.0 <= t_s - at_s < NAMED_S]
        return "; ".join(words)

    @property
    def rival(self) -> Line | None:
        """The line that a search could take for the signal, or None.

        Lines elsewhere, and weaker ones, are kept out of noise and signal.
        """
        line, signal = self.state.line, self.params.signal
        if line is None or line.level_db_hz < self._level_db_hz - RIVAL_DB:
            return None
        reach_hz = signal.uncertainty_hz + (0.5 * signal.band_hz if signal.kind == BAND else 0.0)
        return line if abs(line.offset_hz) <= reach_hz else None

    @property
    def found(self) -> bool:
        """Whether there is a signal."""
        if self.preamble is not None:
            return (
                self._burst_s is not None
                and self._burst_s > (self._times or [math.inf])[-1] - BURST_S
            )
        return self.carrier.tracking if self.params.signal.kind == CARRIER else self.band.found

    def _event(self, t_s: float, text: str) -> None:
        self.state.events.append((t_s, text))

    def _time_s(self, index: int) -> float | None:
        if self._stamped is not None:
            return self._stamped + index / self.layout.rate_hz
        return self.clock.time_s(index)

    def _block(self, block: Spectrum) -> list[Measurement]:
        begin_s = self._time_s(block.first)
        if begin_s is None:
            return []
        layout, state = self.layout, self.state
        state.blocks += 1
        end_s = begin_s + layout.hop_s
        found = []
        period_s = self.params.period_s
        if self._times and math.floor(end_s / period_s) != math.floor(self._times[-1] / period_s):
            found = self._report()
        offset_hz, sign = centre_offset_hz(self.params, self._centre_hz)
        begin_hz, end_hz = (
            sign * (offset_hz + self.doppler.offset_hz(t)) for t in (begin_s, end_s)
        )
        state.outside_hz = begin_hz if abs(begin_hz) > SPAN * layout.rate_hz else None
        if state.outside_hz is not None:
            return found
        frame = round(0.5 * (begin_hz + end_hz) / layout.bin_hz)
        power = block.power(frame - self._reach, frame + self._reach + 1)
        edge = round(SPAN * layout.block)
        if frame - self._reach < -edge:
            power[: -edge - frame + self._reach] = 0.0
        if frame + self._reach > edge:
            power[edge - frame - self._reach - 1 :] = 0.0
        if self.params.signal.kind == CARRIER:
            jumps = self.carrier.jumps
            drifts = not self.doppler.known(begin_s)
            prompt = self.carrier.take(
                block, (begin_hz, end_hz), frame, power, self._density, drifts
            )
            self._prompts.append(prompt)
            if self.carrier.jumps > jumps:
                jump = f"{1e-3 * self.carrier.jump_hz:+.1f} kHz from where it was"
                self._event(begin_s, f"the carrier was found {jump}: retuned, or another signal")
        else:
            self._powers.append(self.band.take(power))
        if self.preamble is not None:
            bursts = self.preamble.take(block, begin_hz, layout.density(self._density))
            found = [self._burst(each) for each in bursts]
        self._spectrum += power
        low = max(self._reach - frame - DC_BINS, 0)
        self._dc[low : max(self._reach - frame + DC_BINS + 1, 0)] = True
        if len(self._channel_noise) > 1:
            self._channel_noise += channel_noise(block, frame)
        self._times.append(end_s)
        return found

    def _usable(self) -> BoolArray:
        """Return the bins that hold noise, as far as it is known where the signal is."""
        usable = ~self._dc
        if self.params.signal.kind == CARRIER:
            offset_hz = self.carrier.offset_hz
            if offset_hz is not None:
                at = self._reach + round(offset_hz / self.layout.bin_hz)
                usable[max(at - GUARD_BINS, 0) : max(at + GUARD_BINS + 1, 0)] = False
        else:
            at = self._reach + round(self.band.centre_bins)
            half = round(1.2 * self.band.half_bins) + 2
            usable[max(at - half, 0) : at + half + 1] = False
        return usable

    def _report(self) -> list[Measurement]:
        """Return the measurement of the blocks since the last report."""
        blocks, layout = len(self._times), self.layout
        spectrum = (self._spectrum / blocks).astype(np.float32)
        usable = self._usable()
        noise = self.noise
        self._density = noise.take(spectrum, usable, blocks)
        t_s, seconds = self._times[-1], blocks * layout.hop_s
        self._watch_lines(spectrum, usable, blocks)
        density = layout.density(self._density)
        if noise.stepped:
            self._event(t_s, f"gain or noise has changed by {noise.step_db:+.1f} dB")
            # Averages over both scales would show the louder one for long.
            self.carrier.begin_search()
            self.band.forget()
        if density <= 0.0 or self.state.clipped > CLIPPED_MOST:
            self._clear()
            return []
        if self.params.signal.kind == CARRIER:
            prompts = np.array(self._prompts)
            each = density / layout.hop_s
            carrier = float(np.mean(np.abs(prompts[:, 0]) ** 2)) - each
            sigma = math.sqrt((2.0 * max(carrier, 0.0) * each + each**2) / blocks)
            error = noise.sigma * (max(carrier, 0.0) + each)
            bound = power_bound(carrier / density, seconds)
        else:
            band_hz = self.band.band_hz
            total = float(np.mean(self._powers))
            carrier = total - density * band_hz
            sigma = self.band.sigma(total, blocks, noise.step_db if noise.stepped else 0.0)
            error = noise.sigma * total
            bound = band_bound(max(carrier / density, 0.0), band_hz, seconds)
            self.band.follow(self._density)
        if self.preamble is not None:
            self._clear()
            return []
        ratio_hz = carrier / density
        watts = BOLTZMANN_J_K * self.params.system_noise_k
        power = CarrierPower(
            t_s=t_s,
            integration_s=seconds,
            # A power meter never reads below zero.
            power_w=max(ratio_hz, 0.0) * watts,
            sigma_w=math.hypot(sigma, error) / density * watts,
            carrier_to_noise_db_hz=max(10.0 * math.log10(max(ratio_hz, 1e-9)), FLOOR_DB_HZ),
        )
        self._level_db_hz = power.carrier_to_noise_db_hz
        cluster = (
            self._cluster(power, density)
            if self.params.signal.channels == 3 and blocks >= 3
            else None
        )
        self._clear()
        return [Measurement(power, cluster, bound * watts)]

    def _burst(self, burst: Burst) -> Measurement:
        """Return the power of a known sequence."""
        watts, end_s = BOLTZMANN_J_K * self.params.system_noise_k, self._time_s(burst.end)
        assert end_s is not None
        self._burst_s, self._level_db_hz = end_s, 10.0 * math.log10(burst.ratio_hz)
        power = CarrierPower(
            t_s=end_s, integration_s=burst.seconds, power_w=burst.ratio_hz * watts,
            sigma_w=math.hypot(burst.sigma_hz, burst.ratio_hz * self.noise.sigma) * watts,
            carrier_to_noise_db_hz=self._level_db_hz,
        )  # fmt: skip
        return Measurement(power, None, power_bound(burst.ratio_hz, burst.seconds) * watts)

    def _cluster(self, power: CarrierPower, density: float) -> MonopulseCluster:
        prompts = np.array(self._prompts)
        self.balance.take(prompts, self._channel_noise)
        # The scale of the samples is free; that of the noise is the same for every gain.
        prompts = prompts / math.sqrt(density)
        times = np.array(self._times) - 0.5 * self.layout.hop_s
        return MonopulseCluster(
            t_s=times, sum=prompts[:, 0], difference_cross_elevation=prompts[:, 1],
            difference_elevation=prompts[:, 2], carrier_to_noise_db_hz=power.carrier_to_noise_db_hz,
        )  # fmt: skip

    def _watch_lines(self, spectrum: NDArray[np.float32], usable: BoolArray, blocks: int) -> None:
        self._long += blocks * spectrum
        self._long_blocks += blocks
        if self._long_blocks * self.layout.hop_s >= LINE_S:
            mean = (self._long / self._long_blocks).astype(np.float32)
            self.state.line = strongest_line(mean, usable, self.layout.bin_hz, self._reach)
            self._long[:] = 0.0
            self._long_blocks = 0


def is_random(arrived: IqSamples) -> bool:
    """Return whether samples are random numbers in place of those of a receiver.

    Numbers without relation to each other (a signal that fills the scale has one), and either
    spread flat over the scale, where noise is Gaussian, or at its ends.
    """
    samples = arrived.samples[0, :JUDGED].astype(np.complex128)
    squares = samples.view(np.float64) ** 2
    power = float(np.mean(squares))
    if len(samples) < FEWEST or not power:
        return False
    related = abs(complex(np.vdot(samples[:-1], samples[1:]))) / (2.0 * power * len(samples))
    flat = power > FLAT_POWER and float(np.mean(squares**2)) < FLAT_KURTOSIS * power**2
    return related < RELATED and (flat or arrived.clipped > CLIPPED_MOST)


def channel_noise(block: Spectrum, frame: int) -> Array:
    """Return the noise power of every channel (channels,), from the bins next to the signal."""
    half = block.values.shape[1] // 2
    bins = half + frame + np.r_[-NOISE_BINS:-GUARD_BINS, GUARD_BINS:NOISE_BINS]
    bins = bins[(bins >= 0) & (bins < block.values.shape[1])]
    return np.asarray(np.median(np.abs(block.values[:, bins]) ** 2, axis=1), dtype=np.float64)
