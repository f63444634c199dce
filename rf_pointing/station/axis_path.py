"""The axis motion that holds the beam on the target, ahead of time: target motion through the bias model, in blocks.

The lags of a bias model are those of steady motion.  Axes that start from rest have none yet: they build up as the average
of the beam's rates does that they act on (two poles, T = `lag_averaging_s`), and so does what is commanded against them.

The exact bias model costs the same for one instant as for twenty, so a block of coming instants is computed at once and
kept until it is used up or something changes.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.geometry import Motion, nearest_turn_rad
from rf_pointing.station.axis_motion import axis_motion
from rf_pointing.station.target_buffer import TargetBuffer

__all__ = ["RATE_LAGS", "AxisPath"]

Array = NDArray[np.float64]
ThroughModel = Callable[[Motion, BiasModel], Motion]
"""How a motion on the sky becomes one of the axes."""
SETTLED = 30.0
"""Averaging times after which the lags are there: exp(-9) of half a degree is 0.06 mdeg."""
RATE_LAGS = ("azimuth_velocity_lag", "elevation_velocity_lag")


class AxisPath:
    """Axis motion (n, 2) at instants `period_s` apart, azimuth on the turn next to `near_azimuth_rad`."""

    def __init__(self, period_s: float, through: ThroughModel = axis_motion, lag_averaging_s: float = 0.0) -> None:
        self._period_s, self._through = period_s, through
        self.lag_averaging_s = lag_averaging_s
        self._moving_s: float | None = None
        self._known: dict[int, Array] = {}
        self._start: Motion | None = None

    def clear(self) -> None:
        """Forget the block: the target, the model or the turn has changed."""
        self._known.clear()
        self._start = None

    def restart(self) -> None:
        """Begin a pass: the axes will wait at rest."""
        self.clear()
        self._moving_s = None

    def waiting(self, count: int, sky_rad: Array, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the motion of waiting where the target will rise, at apparent `sky_rad` (2,), for `count` instants."""
        if self._start is None:
            still = np.zeros((1, 2))
            self._start = held(Motion(sky_rad[None, :], still, still), model, near_azimuth_rad, self._through)
        return Motion(*(np.tile(part, (count, 1)) for part in self._start))

    def at(self, times: Array, targets: TargetBuffer, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the motion at `times` (n,); what lies beyond is computed too, as far as the target is known."""
        if self._moving_s is None:
            self._moving_s = float(times[0])
        keys = [round(float(t) * 1000.0) for t in times]
        if any(key not in self._known for key in keys):
            self._compute(times, targets, model, near_azimuth_rad)
        rows = np.array([self._known[key] for key in keys])
        return Motion(rows[:, 0:2], rows[:, 2:4], rows[:, 4:6])

    def _compute(self, times: Array, targets: TargetBuffer, model: BiasModel, near_azimuth_rad: float) -> None:
        ahead = targets.known_until_s - float(times[-1])
        beyond = float(times[-1]) + self._period_s * np.arange(1, max(0, int(ahead / self._period_s)) + 1)
        block = np.concatenate([times, beyond])
        sky = targets.at(block)
        motion = held(sky, model, near_azimuth_rad, self._through)
        since_s = block - (self._moving_s or 0.0)
        if model.has_lags and since_s[0] < SETTLED * self.lag_averaging_s:
            steady = held(sky, without_lags(model), near_azimuth_rad, self._through)
            lags_s = np.array([model.coefficients.get(name, 0.0) for name in RATE_LAGS])
            motion = settling(steady, motion, since_s, self.lag_averaging_s, lags_s)
        rows = np.concatenate(motion, axis=1)
        self._known = {round(float(t) * 1000.0): row for t, row in zip(block, rows, strict=True)}


def held(sky: Motion, model: BiasModel, near_azimuth_rad: float, through: ThroughModel = axis_motion) -> Motion:
    """Return the axis motion (n, 2) that holds the beam on apparent directions, on the turn next to an azimuth."""
    position, velocity, acceleration = through(sky, model)
    first = float(position[0, 0])
    return Motion(position + np.array([nearest_turn_rad(first, near_azimuth_rad) - first, 0.0]), velocity, acceleration)


def without_lags(model: BiasModel) -> BiasModel:
    """Return the model of the same antenna at rest."""
    return model.replace(**{term.name: 0.0 for term in model.terms if term.kind == "lag"})


def settling(at_rest: Motion, steady: Motion, since_s: Array, averaging_s: float, lags_s: Array) -> Motion:
    """Return what leads from `at_rest` to `steady` (n, 2), `since_s` (n,) after the axes began to move.

    The average of the beam's rates is 1 / (1 + T s + T^2 s^2), and the beam drags behind the axes by x times that: from the
    axes' rates to the average it is 1 / (1 + (T + x) s + T^2 s^2) with the velocity lags x = `lags_s` (2,), here as its step
    response and that one's derivatives.
    """
    damping = np.clip(0.5 + 0.5 * lags_s / averaging_s, 0.05, 0.95)
    swing = np.sqrt(1.0 - damping**2)
    turned = since_s[:, None] / averaging_s
    decay = np.exp(-damping * turned)
    sine, cosine = decay * np.sin(swing * turned), decay * np.cos(swing * turned)
    share = 1.0 - cosine - damping / swing * sine
    rate = sine / (swing * averaging_s)
    slope = (cosine - damping / swing * sine) / averaging_s**2
    position, velocity, acceleration = (b - a for a, b in zip(at_rest, steady, strict=True))
    return Motion(
        at_rest.position + share * position,
        at_rest.velocity + share * velocity + rate * position,
        at_rest.acceleration + share * acceleration + 2.0 * rate * velocity + slope * position,
    )
