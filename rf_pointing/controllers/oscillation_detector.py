"""Detects a loop that oscillates, before the antenna is shaken apart.

An oscillation is large, regular swings of the servo error.  The error, high-passed to take out slow
tracking error, is followed from zero crossing to zero crossing.  A swing whose peak exceeds the
threshold counts; `cycles` such swings in a row with half periods alike within `regularity` are an
oscillation.  One gust, one command step or the end of a slew gives a few swings and then decays;
wind noise is irregular.  A loop whose drive saturates swings ever more slowly as it grows, so
swings beyond the gross threshold need not be alike.  Beyond the largest no further swing is waited
for: its period may never end.  Error slower than the high-pass is tracking error, however large.
"""

import math
from dataclasses import dataclass, replace

from rf_pointing.core import Params, parameter, require_between, require_finite


@dataclass(frozen=True, kw_only=True)
class OscillationDetectorParams(Params):
    """Limits from which on a motion counts as an oscillation."""

    threshold_rad: float = parameter(math.radians(0.02), "smallest peak of a swing that counts", low=1e-7, high=0.1)
    high_pass_hz: float = parameter(0.05, "slower error is tracking error, not oscillation", low=1e-4, high=10.0)
    highest_hz: float = parameter(12.0, "faster swings are encoder noise", low=0.1, high=500.0)
    half_cycles: int = parameter(6, "half periods in a row", low=3, high=100)
    regularity: float = parameter(0.35, "largest spread of the half periods over their mean", low=0.01, high=1.0)
    growth: float = parameter(0.5, "smallest ratio of the last to the first peak of the row", low=0.0, high=10.0)

    gross_threshold_rad: float = parameter(
        math.radians(0.05), "peak from which swings need not be alike", low=1e-7, high=1.0
    )
    gross_half_cycles: int = parameter(3, "half periods in a row beyond it", low=2, high=100)
    largest_rad: float = parameter(
        math.radians(0.5), "error at which no further swing is waited for", low=1e-7, high=1.0
    )

    ordered = ("high_pass_hz < highest_hz", "gross_threshold_rad >= threshold_rad", "gross_half_cycles <= half_cycles")


@dataclass(slots=True)
class OscillationDetectorState:
    """High-pass memory, running swing (age, peak), row of counted swings, verdict."""

    input_rad: float = 0.0
    output_rad: float = 0.0
    started: bool = False
    age_s: float = 0.0
    peak_rad: float = 0.0
    row: tuple[tuple[float, float], ...] = ()
    reason: str = ""


class OscillationDetector:
    """One axis: `update` with every servo error; the verdict latches until `reset`."""

    def __init__(self, params: OscillationDetectorParams) -> None:
        self.params = params
        self._state = OscillationDetectorState()
        self._decay = (0.0, 0.0)

    @property
    def state(self) -> OscillationDetectorState:
        """A copy of the complete state."""
        return replace(self._state)

    @state.setter
    def state(self, state: OscillationDetectorState) -> None:
        self._state = replace(state)

    @property
    def oscillating(self) -> bool:
        """Whether an oscillation has been seen since the last reset."""
        return bool(self._state.reason)

    @property
    def reason(self) -> str:
        """Frequency and size of the oscillation, "" without one."""
        return self._state.reason

    def retune(self, params: OscillationDetectorParams) -> None:
        """Take new thresholds from the next error on."""
        self.params, self._decay = params, (0.0, 0.0)

    def reset(self) -> None:
        """Forget the verdict and the swings so far."""
        self._state = OscillationDetectorState()

    def update(self, error_rad: float, dt_s: float) -> bool:
        """Take the servo error of this sample, `dt_s` after the one before; return `oscillating`.

        Raises
        ------
        ValueError
            For a non-finite error.
        """
        if not (math.isfinite(error_rad) and 1e-5 <= dt_s <= 1.0):
            require_finite("error_rad", error_rad)
            require_between("dt_s", dt_s, 1e-5, 1.0)
        state, before = self._state, self._state.output_rad
        if dt_s != self._decay[0]:
            self._decay = (dt_s, math.exp(-2.0 * math.pi * self.params.high_pass_hz * dt_s))
        # The first error is taken as the mean: an antenna enabled far from its command is not
        # oscillating.
        change = error_rad - state.input_rad if state.started else 0.0
        state.output_rad = self._decay[1] * (before + change)
        state.input_rad, state.started = error_rad, True
        state.age_s += dt_s
        if before * state.output_rad < 0.0:
            self._swing(state.age_s, state.peak_rad)
            state.age_s, state.peak_rad = 0.0, 0.0
        size_rad = abs(state.output_rad)
        state.peak_rad = size_rad if size_rad > state.peak_rad else state.peak_rad
        # A loop that runs away from its command never crosses zero again.
        if state.peak_rad >= self.params.largest_rad and not state.reason:
            most = _mdeg(self.params.largest_rad)
            state.reason = f"oscillation of {_mdeg(state.peak_rad)}, at most {most}, cut before its period was known"
        return bool(state.reason)

    def _swing(self, half_period_s: float, peak_rad: float) -> None:
        """Count a completed swing, or begin a new row where it does not fit."""
        state, params = self._state, self.params
        # Faster is encoder noise, slower is tracking error.
        in_band = 0.5 / params.highest_hz <= half_period_s <= 0.5 / params.high_pass_hz
        fits = in_band and peak_rad >= params.threshold_rad
        state.row = (*state.row, (half_period_s, peak_rad))[-params.half_cycles :] if fits else ()
        lengths, peaks = [swing[0] for swing in state.row], [swing[1] for swing in state.row]
        gross = peaks[-params.gross_half_cycles :]
        # A saturated drive swings ever more slowly as it grows, so gross swings need not be alike.
        large = len(gross) == params.gross_half_cycles and min(gross) >= params.gross_threshold_rad
        if large and gross[-1] >= params.growth * gross[0]:
            self._found(lengths[-params.gross_half_cycles :], gross, params.gross_threshold_rad)
        elif len(state.row) == params.half_cycles:
            mean = sum(lengths) / len(lengths)
            if max(lengths) - min(lengths) <= params.regularity * mean and peaks[-1] >= params.growth * peaks[0]:
                self._found(lengths, peaks, params.threshold_rad)

    def _found(self, lengths: list[float], peaks: list[float], threshold_rad: float) -> None:
        frequency_hz = 0.5 * len(lengths) / sum(lengths)
        most = _mdeg(threshold_rad)
        self._state.reason = f"oscillation of {_mdeg(max(peaks))} at {frequency_hz:.2f} Hz, at most {most}"


def _mdeg(angle_rad: float) -> str:
    return f"{1e3 * math.degrees(angle_rad):.1f} mdeg"
