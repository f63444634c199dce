"""Watches the axes' own sensors against each other: an encoder that jumps, freezes or lies.

The tachometer carries the last trusted angle on.  A sample off that prediction is bridged by it; the fourth in a row, or a
difference that grows within the window, is a fault.  Drives that run away: `drive_watch.py`.
"""

import math
from collections import deque
from dataclasses import dataclass

from rf_pointing.core import AXES, Params, parameter

__all__ = ["AxisWatch", "AxisWatchParams"]

Pair = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class AxisWatchParams(Params):
    """What differences between encoder and tachometer are no longer the machine's own."""

    jump_rad: float = parameter(math.radians(0.03), "encoder off its prediction in one tick", low=1e-6, high=1.0)
    bridged_samples: int = parameter(3, "samples in a row that are bridged", low=0, high=50)
    drift_rad: float = parameter(
        math.radians(0.03), "encoder off the integrated rate within the window", low=1e-6, high=1.0
    )
    frozen_rad: float = parameter(
        math.radians(0.008), "motion by the tachometer during which the encoder must change", low=1e-7, high=1.0
    )
    window_s: float = parameter(0.16, "window of the comparison", low=0.02, high=2.0)


class _Axis:
    """One axis: trusted angle, and the last window of encoder and integrated rate."""

    def __init__(self, samples: int) -> None:
        self.trusted: float | None = None
        self.raw = math.nan
        self.bad = 0
        self.travel = 0.0
        self.frozen_travel = 0.0
        self.window: deque[tuple[float, float]] = deque(maxlen=samples)
        self.shown: deque[tuple[float, float]] = deque(maxlen=samples)


class AxisWatch:
    """Both axes; `step` once a tick, in plain floats."""

    def __init__(self, params: AxisWatchParams, tick_s: float) -> None:
        self.params, self._tick_s = params, tick_s
        self._samples = max(2, round(params.window_s / tick_s) + 1)
        self.reset()

    def reset(self) -> None:
        """Trust the next encoder samples as they come."""
        self._axes = (_Axis(self._samples), _Axis(self._samples))
        self.reason = ""

    def step(self, encoder_rad: Pair, rate_rad_s: Pair) -> tuple[Pair, str]:
        """Return the angles to use, bridged where a sample is not trusted, and "" or what is wrong."""
        reasons, used = [], []
        for index, axis in enumerate(self._axes):
            angle, reason = self._angle(axis, encoder_rad[index], rate_rad_s[index])
            used.append(angle)
            if reason:
                reasons.append(f"{AXES[index]} {reason}")
        self.reason = "; ".join(reasons)
        return (used[0], used[1]), self.reason

    @property
    def cause(self) -> str:
        """Return what is still wrong by the last window alone, "" when the sensors agree again, wherever they stand."""
        found = []
        for name, axis in zip(AXES, self._axes, strict=True):
            shown = list(axis.shown)
            drift = (shown[-1][0] - shown[0][0]) - (shown[-1][1] - shown[0][1]) if shown else 0.0
            if not all(math.isfinite(encoder) for encoder, _ in shown):
                found.append(f"{name} encoder gives no number")
            elif abs(drift) > self.params.drift_rad:
                found.append(f"{name} encoder moved {math.degrees(drift):.3f} deg more than the drive")
        return "; ".join(found)

    def _angle(self, axis: _Axis, encoder: float, rate: float) -> tuple[float, str]:
        params = self.params
        if axis.trusted is None:
            if not math.isfinite(encoder):
                return 0.0, "encoder gives no number"
            axis.trusted, axis.raw = encoder, encoder
            return encoder, ""
        moved = rate * self._tick_s if math.isfinite(rate) else 0.0
        predicted = axis.trusted + moved
        axis.travel += moved
        axis.shown.append((encoder, axis.travel))
        off = encoder - predicted
        if not abs(off) <= params.jump_rad:
            axis.bad += 1
            axis.trusted = predicted
            said = f"encoder jumped by {math.degrees(off):.3f} deg" if math.isfinite(off) else "encoder gives no number"
            return predicted, said if axis.bad > params.bridged_samples else ""
        axis.bad = 0
        axis.frozen_travel = axis.frozen_travel + moved if encoder == axis.raw else 0.0
        axis.trusted = axis.raw = encoder
        axis.window.append((encoder, axis.travel))
        if abs(axis.frozen_travel) > params.frozen_rad:
            return encoder, f"encoder stands still while the drive moved {math.degrees(axis.frozen_travel):.3f} deg"
        first = axis.window[0]
        drift = (encoder - first[0]) - (axis.travel - first[1])
        if abs(drift) > params.drift_rad:
            return encoder, f"encoder moved {math.degrees(drift):.3f} deg more than the drive"
        return encoder, ""
