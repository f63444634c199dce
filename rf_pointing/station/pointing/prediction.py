"""The axis motion that holds the beam on the target, ahead of time: target motion through the bias model, in blocks.

Where the branch of a pass leaves the target, the beam's motion is the branch's.  The lags of the mount are those of the
motion that the beam has really made since the axes began to move (`calibration.LagHistory`), or with `lag_averaging_s` = 0
those of the target's momentary one.

The exact bias model costs the same for one instant as for twenty, so a block of coming instants is computed at once and
kept until it is used up or something changes.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel, LagHistory, LagState, without_lags
from rf_pointing.core import JointReading, Motion, nearest_turn_rad
from rf_pointing.station.pointing.axis_motion import axis_motion
from rf_pointing.station.pointing.branch import TrackingBranch
from rf_pointing.station.pointing.target_buffer import TargetBuffer

__all__ = ["Plan", "Prediction", "StandingPlan"]

Array = NDArray[np.float64]
LONGEST_BLOCK_S = 2.0
"""Shorter than what a crossing holds on either side of the instant at which the dish goes over the top."""


class Plan(Protocol):
    """How the pass is tracked: the course of its branch, and how a motion on the sky becomes one of the axes there."""

    course: TrackingBranch

    def model_motion(self, t_s: float, sky: Motion, model: BiasModel) -> Motion:
        """Return the direct axis angles that hold the beam on `sky` (n, 2)."""


class StandingPlan:
    """Direct, without a crossing."""

    def __init__(self) -> None:
        self.course = TrackingBranch()

    def model_motion(self, _t_s: float, sky: Motion, model: BiasModel) -> Motion:
        """Return the motion through the model."""
        return axis_motion(sky, model)


class Prediction:
    """Axis motion (n, 2) at instants `period_s` apart, azimuth on the turn next to `near_azimuth_rad`."""

    def __init__(self, period_s: float, plan: Plan | None = None, lag_averaging_s: float = 0.0) -> None:
        self._period_s, self._plan = period_s, plan or StandingPlan()
        self.lag_averaging_s = lag_averaging_s
        self._known: dict[int, Array] = {}
        self._lagging: dict[int, LagState] = {}
        self._before: LagState | None = None
        self._start: Motion | None = None

    def clear(self) -> None:
        """Forget the block: the target, the model or the turn has changed."""
        self._known.clear()
        self._start = None

    def restart(self) -> None:
        """Begin a pass: the axes will wait at rest."""
        self.clear()
        self._lagging.clear()
        self._before = None

    def take_axes(self, reading: JointReading, model: BiasModel) -> None:
        """Note how the axes move on their way to the start: what is left of their lags there is not the target's."""
        fresh = self._before is None or reading.t_s > self._before.t_s
        if self.lag_averaging_s > 0.0 and model.has_lags and not self._lagging and fresh:
            history = LagHistory(model, self.lag_averaging_s)
            self._before = history.dragged(reading.t_s, reading.velocity_rad_s, self._before)

    def waiting(self, count: int, t_s: float, sky_rad: Array, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the motion of waiting where the target will rise, at apparent `sky_rad` (2,), for `count` instants."""
        if self._start is None:
            still = np.zeros((1, 2))
            self._start = self._held(t_s, Motion(sky_rad[None, :], still, still), model, near_azimuth_rad)
        return Motion(*(np.tile(part, (count, 1)) for part in self._start))

    def at(self, times: Array, targets: TargetBuffer, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the motion at `times` (n,); what lies beyond is computed too, as far as the target is known."""
        keys = [_key(t) for t in times]
        if any(key not in self._known for key in keys):
            self._compute(times, targets, model, near_azimuth_rad)
        rows = np.array([self._known[key] for key in keys])
        return Motion(rows[:, 0:2], rows[:, 2:4], rows[:, 4:6])

    def _compute(self, times: Array, targets: TargetBuffer, model: BiasModel, near_azimuth_rad: float) -> None:
        ahead = min(targets.known_until_s - float(times[-1]), LONGEST_BLOCK_S)
        beyond = float(times[-1]) + self._period_s * np.arange(1, max(0, int(ahead / self._period_s)) + 1)
        block = np.concatenate([times, beyond])
        course, sky, last_s = self._plan.course, targets.at(block), float(block[-1])
        if self.lag_averaging_s > 0.0 and model.has_lags:
            beam = course.detour(block, self._held(last_s, sky, without_lags(model), near_azimuth_rad))
            motion = self._with_lags(block, beam, course.detour(block, sky), model)
        else:
            motion = course.detour(block, self._held(last_s, sky, model, near_azimuth_rad))
        rows = np.concatenate(motion, axis=1)
        self._known = {_key(t): row for t, row in zip(block, rows, strict=True)}

    def _with_lags(self, block: Array, beam: Motion, moving: Motion, model: BiasModel) -> Motion:
        """Return the axes that hold a beam whose rates are those of `moving`, with the lags of all that it has done before.

        The lags act in the angles of the axes, which over the top run the other way.
        """
        signs = self._plan.course.signs(block)
        earlier = [state for key, state in self._lagging.items() if key <= _key(block[0])]
        before = earlier[-1] if earlier else self._before if not self._lagging else None
        history = LagHistory(model, self.lag_averaging_s)
        lags, states = history.along(block, signs * moving.velocity, signs * moving.acceleration, before)
        self._lagging = {_key(state.t_s): state for state in states}
        return Motion(*(part + signs * lag for part, lag in zip(beam, lags, strict=True)))

    def _held(self, t_s: float, sky: Motion, model: BiasModel, near_azimuth_rad: float) -> Motion:
        """Return the axis motion (n, 2) that holds the beam on apparent directions, on the turn next to an azimuth."""
        position, velocity, acceleration = self._plan.model_motion(t_s, sky, model)
        first = float(position[0, 0])
        near = nearest_turn_rad(first, near_azimuth_rad + self._plan.course.turned_rad(t_s))
        return Motion(position + np.array([near - first, 0.0]), velocity, acceleration)


def _key(t_s: float) -> int:
    """Time in whole milliseconds."""
    return round(float(t_s) * 1000.0)
