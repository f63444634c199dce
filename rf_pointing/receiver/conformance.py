"""Whether a receiver gives what trackers rely on: one line per property, pass or fail.

Connection, period, latency, rate, clipping, interference, channels, signal and its sigma, losses.
The antenna may look anywhere; with a signal in the beam all lines can pass.
"""

import math
from collections.abc import Callable

import numpy as np

from rf_pointing.core.checks import Line
from rf_pointing.receiver.meter import CLIPPED_SHARE, Measurement
from rf_pointing.receiver.params import LEVELS
from rf_pointing.receiver.receiver import SignalReceiver

CONNECT_S = 10.0
LATEST_S = 0.5
"""Age of a report at which a scan of 4 s still closes."""
NORMAL_MEDIAN = 0.6745 * math.sqrt(2.0)
"""Median size of the difference of two normal variates of sigma 1."""


class ReceiverCheck:
    """The checks of one receiver; `tick` lets time pass and returns it."""

    def __init__(self, receiver: SignalReceiver, tick: Callable[[], float]) -> None:
        self._receiver, self._tick = receiver, tick
        self._measured: list[tuple[float, Measurement]] = []
        self._t_s = tick()

    def lines(self, seconds: float) -> list[Line]:
        """Watch for `seconds` and return the lines; the first one is the connection."""
        begun_s = self._t_s
        self._pass(CONNECT_S, lambda: not self._receiver.source.problem)
        if self._receiver.source.problem:
            return [Line("connection", False, self._receiver.source.problem)]
        lines = [Line("connection", True, f"first data after {self._t_s - begun_s:.1f} s")]
        self._pass(seconds)
        params, meter = self._receiver.params, self._receiver.meter
        lines += [self._period(seconds), self._stamps()]
        if params.type not in LEVELS and meter.state.blocks:
            wrong = meter.clock.wrong_rate
            stated = f"{1e-3 * meter.layout.rate_hz:.1f} ksample/s as stated"
            share = meter.state.clipped
            clipped = f"{100.0 * share:.3f} % clipped, at most {100.0 * CLIPPED_SHARE:.1f} %"
            lines += [
                Line("rate", not wrong, wrong or stated),
                Line("clipping", share <= CLIPPED_SHARE, clipped),
                Line("interference", meter.state.line is None, str(meter.state.line or "no line")),
            ]
        if params.signal.channels == 3:
            problem = meter.balance.problem
            lines.append(Line("channels", not problem, problem or "no drift"))
        return [*lines, self._signal(), self._sigma(), self._losses()]

    def _period(self, seconds: float) -> Line:
        due = seconds / self._receiver.params.period_s
        text = f"{len(self._measured)} powers in {seconds:.0f} s, stated {due:.0f}"
        return Line("period", len(self._measured) >= 0.7 * due, text)

    def _stamps(self) -> Line:
        ages = [t_s - each.power.t_s for t_s, each in self._measured]
        newest, oldest = min(ages, default=-math.inf), max(ages, default=math.inf)
        good = newest >= -1e-3 and oldest <= LATEST_S
        text = f"{newest:.2f} to {oldest:.2f} s old when they come, must be 0 to {LATEST_S:.1f} s"
        return Line("latency", good, text)

    def _signal(self) -> Line:
        problem = self._receiver.problem(self._t_s)
        levels = [each.power.carrier_to_noise_db_hz for _, each in self._measured]
        level = float(np.median(levels)) if levels else -math.inf
        found = f"C/N0 {level:.1f} dB-Hz"
        if not self._receiver.params.level_known:
            found = "its changes are known, not its C/N0: level.floor_dbm is unknown"
        return Line("signal", not problem, problem or found)

    def _sigma(self) -> Line:
        """Compare the scatter of successive powers with the sigma that they state."""
        powers = np.array([each.power.power_w for _, each in self._measured])
        sigmas = [each.power.sigma_w for _, each in self._measured]
        if len(powers) < 10:
            return Line("sigma", False, "too few powers to judge it")
        # Medians: the first powers are from before the signal was found.
        share = float(np.median(np.abs(np.diff(powers))) / NORMAL_MEDIAN / np.median(sigmas))
        good = 0.3 < share < 2.0
        return Line("sigma", good, f"the powers scatter by {share:.2f} of it, must be 0.3 to 2")

    def _losses(self) -> Line:
        lost = {name: count for name, count in self._receiver.source.losses.items() if count}
        text = ", ".join(f"{name}: {count}" for name, count in lost.items())
        return Line("losses", not lost, text or "nothing was lost")

    def _pass(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        begun_s = self._t_s
        while self._t_s - begun_s < seconds and not until():
            self._t_s = self._tick()
            self._measured += [(self._t_s, each) for each in self._receiver.step(self._t_s)]
