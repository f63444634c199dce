"""A receiver behind any source, stepped by time: what a node publishes and says about it."""

import math
from collections.abc import Callable

from rf_pointing.core import CarrierPower
from rf_pointing.receiver.level_meter import LevelMeter
from rf_pointing.receiver.meter import Measurement, SignalMeter
from rf_pointing.receiver.params import CARRIER, LEVELS, SignalReceiverParams
from rf_pointing.receiver.registry import make_source
from rf_pointing.receiver.source import Source
from rf_pointing.receiver.spectrum import IqSamples
from rf_pointing.receiver.spin import SpinWatch

SPIN_EVERY_S = 5.0


class SignalReceiver:
    """Source and meters together; times are those of the station's clock, `now_s`.

    Raises ValueError for parameters with which no source can be made.
    """

    def __init__(
        self, params: SignalReceiverParams, now_s: Callable[[], float], source: Source | None = None
    ) -> None:
        self.params = params
        self.source = source if source is not None else make_source(params, now_s)
        self.meter = SignalMeter(params)
        self.levels = LevelMeter(params)
        self.spin = SpinWatch()
        self.newest: CarrierPower | None = None
        self.reports = 0
        self._spin_s = -math.inf
        self._spin_text = ""
        self._age_s = 0.0

    def step(self, t_s: float) -> list[Measurement]:
        """Return what was measured since the last step."""
        found: list[Measurement] = []
        for arrived in self.source.step():
            if isinstance(arrived, IqSamples):
                found += self.meter.take(arrived)
            else:
                found += [
                    Measurement(power, None, power.sigma_w) for power in self.levels.take(arrived)
                ]
        for each in found:
            self.spin.take(each.power.t_s, each.power.power_w)
            self.newest, self.reports, self._age_s = (
                each.power, self.reports + 1, t_s - each.power.t_s,
            )  # fmt: skip
        if t_s - self._spin_s > SPIN_EVERY_S or t_s < self._spin_s:
            spin, self._spin_s = self.spin.estimate(), t_s
            self._spin_text = "" if spin is None else (
                f"{spin.frequency_hz:.4f} +- {spin.sigma_hz:.4f} Hz, {100.0 * spin.depth:.0f} % deep"
            )  # fmt: skip
        return found

    def end(self) -> None:
        """End the source."""
        self.source.end()

    def problem(self, t_s: float) -> str:
        """Return why there is no good signal, "" while there is one."""
        if self.source.problem:
            return self.source.problem
        if self.levels.unlocked and not self.levels.locked:
            return "the receiver reports that it has no lock"
        if words := self.meter.problem(t_s):
            return words
        if self.newest is None or t_s - self.newest.t_s > max(1.5, 3.0 * self.params.period_s):
            return "samples arrive, but no power could be measured yet"
        if self.params.type in LEVELS and self.newest.carrier_to_noise_db_hz <= 0.0:
            return "no signal: the level is that of noise alone"
        return ""

    def values(self) -> dict[str, object]:
        """Return the numbers for an operator: level, frequency, latency, losses."""
        meter, newest = self.meter, self.newest
        values: dict[str, object] = {"reports": self.reports}
        if newest is not None:
            values |= {
                "carrier_to_noise_db_hz": round(newest.carrier_to_noise_db_hz, 2),
                "sigma_db": round(4.34 * newest.sigma_w / newest.power_w, 3)
                if newest.power_w > 0.0
                else "inf",
                "latency_s": round(self._age_s, 3),
            }
        if meter.state.blocks:
            offset_hz = meter.carrier.offset_hz
            values |= {
                "frequency_offset_hz": "unknown" if offset_hz is None else round(offset_hz, 1),
                "arrival_spread_s": round(meter.clock.spread_s, 4),
                "clipped_share": round(meter.state.clipped, 5),
                "gain_steps": meter.noise.steps,
            }
            if self.params.signal.kind == CARRIER:
                values["phase_locked"] = meter.carrier.locked
            if meter.state.line is not None:
                values["interference"] = str(meter.state.line)
        if self._spin_text:
            values["spin"] = self._spin_text
        return values | {
            f"lost {name}": count for name, count in self.source.losses.items() if count
        }
