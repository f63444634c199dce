"""What is commanded ahead of time, and where the axes stand against it.

    axis angles = model(target) + trim and residual + scan + lead of what is added

The prediction goes through the bias model (`axis_path.py`); what is added to it on the sky (`sky_offsets.py`) moves
quickly, and the lags of the mount that it would meet are led (`correction_lag.py`).
"""

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, JointTrajectory, Motion
from rf_pointing.ephemeris import Pass
from rf_pointing.station.pointing.correction_lag import CorrectionLag
from rf_pointing.station.pointing.corrections import PointingCorrections, added
from rf_pointing.station.pointing.mode import MotionSnapshot
from rf_pointing.station.pointing.params import PointingParams
from rf_pointing.station.pointing.plan import PassPlan
from rf_pointing.station.pointing.prediction import Prediction
from rf_pointing.station.pointing.target_buffer import TargetBuffer
from rf_pointing.tracking.beam_position import BeamPosition

__all__ = ["CommandedMotion"]

Array = NDArray[np.float64]


class CommandedMotion:
    """The trajectories of one pass; `model` is the bias model in force, `axes` where the axes were last, if it is known."""

    def __init__(self, params: PointingParams, plan: PassPlan, offsets: PointingCorrections) -> None:
        self.params = params
        self.model = BiasModel.zero()
        self.axes: JointReading | None = None
        self.targets = TargetBuffer()
        self.beam = BeamPosition()
        self._plan, self._offsets = plan, offsets
        self._direct: JointReading | None = None
        self._path = Prediction(params.period_s, plan, params.lag_averaging_s)
        self._lag = CorrectionLag(params.lag_averaging_s)
        self._centre: dict[int, Array] = {}
        self._last_sky = np.zeros(2)

    def retune(self, params: PointingParams) -> None:
        """Take new timing and tolerances between two periods."""
        self.params = params
        self._path.lag_averaging_s = self._lag.averaging_s = params.lag_averaging_s

    def restart(self) -> None:
        """Forget the last pass."""
        self.targets.clear()
        self._path.restart()
        self._lag.restart()
        self._centre.clear()
        self.beam.clear()

    def take_model(self, model: BiasModel) -> None:
        """Use `model` from the next trajectory on."""
        self.model = model
        self._path.clear()

    def take_joints(self, reading: JointReading) -> None:
        """Note where the axes are."""
        self.axes, self._direct = reading, self._plan.course.from_axes(reading)
        self.beam.take_joints(self._direct)
        self._path.take_axes(reading, self.model)

    def target_known(self, t_s: float, window: Pass) -> bool:
        """Whether a trajectory issued at `t_s` has a target all the way: before the pass that is its start."""
        return t_s < window.aos_t_s or self.targets.covers(t_s, t_s + self.params.horizon_s)

    def on_target(self, t_s: float, window: Pass) -> bool:
        """Whether the slew to the pass is over: the axes are within the tolerance of the command."""
        centre = self._centre.get(_key(t_s))
        if t_s < window.aos_t_s or centre is None or self._direct is None:
            return False
        lag_s = t_s - self._direct.t_s
        apart = centre - self._direct.position_rad - lag_s * self._direct.velocity_rad_s
        return float(np.max(np.abs(apart))) < self.params.on_target_rad

    def snapshot(self, t_s: float, window: Pass, error_t_s: float | None) -> MotionSnapshot:
        """Return what the state table must know at `t_s`; `error_t_s` is the time of the newest error."""
        known = self.targets.covers(t_s, t_s)
        # Before the first sample of the target there is nothing to compare the beam with.
        sensed = error_t_s is not None and math.isfinite(self.targets.known_until_s)
        beam = self.beam.offset(error_t_s) if sensed and error_t_s is not None else None
        return MotionSnapshot(
            target_available=self.target_known(t_s, window),
            on_target=self.on_target(t_s, window),
            range_m=self._range_m(t_s) if known else None,
            beam_rad=beam,
            error_range_m=None if beam is None or error_t_s is None else self._range_m(error_t_s),
        )

    def _range_m(self, t_s: float) -> float:
        return float(self.targets.range_m([t_s])[0])

    def centre_rad(self, t_s: float) -> Array:
        """Return the commanded direct angles (2,) at `t_s` without the scan, zero where that is not known."""
        return self._centre.get(_key(t_s), np.zeros(2))

    def sky_rad(self, t_s: float, window: Pass | None) -> Array:
        """Return the commanded apparent direction (2,) at `t_s`: the pass's start before it, the last one after it."""
        if window is not None and t_s < window.aos_t_s:
            self._last_sky = np.array([window.aos_azimuth_rad, window.aos_elevation_rad])
        elif window is not None and self.targets.covers(t_s, t_s):
            trim = self._offsets.trim(t_s)[None, :]
            self._last_sky = added(self.targets.at([t_s]), trim, np.zeros((1, 2))).position[0]
        return self._last_sky

    def follow(self, t_s: float, window: Pass, turns_rad: float, kind: str) -> tuple[JointTrajectory | None, str]:
        """Return the trajectory issued at `t_s`, or None and why the gate refuses this kind of motion."""
        params = self.params
        count = round((params.horizon_s - params.transport_s) / params.period_s) + 1
        # On whole microseconds, as on the wire: one instant is one number in every trajectory that has it.  Else the old
        # point would stay a rounding error before the new one, and the axes would follow it to the end.
        times = np.round(t_s + params.transport_s + params.period_s * np.arange(count, dtype=np.float64), 6)
        try:
            predicted = self._prediction(t_s, times, window, turns_rad)
        except ValueError as refused:
            return None, str(refused)
        centre, moved = predicted, np.zeros_like(predicted.velocity)
        if t_s >= window.aos_t_s:
            centre, moved = self._corrected(times, predicted)
        scanned = self._offsets.add_scan(times, centre)
        lead = self._lag.lead(times, moved + scanned.velocity - centre.velocity, self.model)
        self._note_centre(t_s, float(times[0]), centre.position[0] + lead.position[0])
        self.beam.take_centre(float(times[0]), predicted.position[0] + lead.position[0])
        position, velocity, acceleration = (a + b for a, b in zip(scanned, lead, strict=True))
        trajectory = self._plan.course.to_axes(
            JointTrajectory(t_s=times, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration)
        )
        present = None if self.axes is None else (float(self.axes.position_rad[0]), float(self.axes.position_rad[1]))
        refusal = self._plan.refusal(kind, t_s, present, trajectory.position_rad)
        return (None, refusal) if refusal else (trajectory, "")

    def halt(self, t_s: float) -> JointTrajectory | None:
        """Return one point at rest, where the axes can stop; None when their motion is unknown."""
        if self.axes is None:
            return None
        rate = self.axes.velocity_rad_s
        present = self.axes.position_rad + (t_s - self.axes.t_s) * rate
        position = present + rate * np.abs(rate) / (2.0 * self.params.stop_deceleration_rad_s2)
        still = np.zeros((1, 2))
        times = np.array([t_s + self.params.transport_s])
        return JointTrajectory(
            t_s=times, position_rad=position[None, :], velocity_rad_s=still, acceleration_rad_s2=still
        )

    def _prediction(self, t_s: float, times: Array, window: Pass, turns_rad: float) -> Motion:
        """Return the axis motion that would hold the target if it were where it is predicted.

        The bias model sees the target's own motion: its lags stand for steady rates, and fed with the small quick
        corrections of the tracking loop they would shake the antenna.
        """
        near_rad = 0.5 * (window.azimuth_min_rad + window.azimuth_max_rad) + turns_rad
        if t_s < window.aos_t_s:
            start = np.array([window.aos_azimuth_rad, window.aos_elevation_rad])
            waiting = self._path.waiting(len(times), t_s, start, self.model, near_rad)
            next_rad = self._plan.to_start(t_s, self.axes, waiting.position[0])
            return waiting._replace(position=np.tile(next_rad, (len(times), 1)))
        return self._path.at(times, self.targets, self.model, near_rad)

    def _corrected(self, times: Array, predicted: Motion) -> tuple[Motion, Array]:
        """Return the motion with trim and residual, carried through a crossing, and the rates (n, 2) that they add."""
        course, range_m = self._plan.course, self.targets.range_m(times)
        self._offsets.stand(course.plunge_at(float(times[0])))
        trimmed = self._offsets.add_trim(times, predicted, range_m)
        beside = partial(self._offsets.beside, range_m=float(range_m[0]))
        return course.carry(times, predicted, trimmed, beside), trimmed.velocity - predicted.velocity

    def _note_centre(self, t_s: float, first_s: float, centre: Array) -> None:
        """Note where the axes are to be at `first_s`; what was noted for times before `t_s` is forgotten."""
        self._centre = {**{key: at for key, at in self._centre.items() if key >= _key(t_s)}, _key(first_s): centre}


def _key(t_s: float) -> int:
    """Time in whole milliseconds: periods are compared without the rounding of floats."""
    return round(t_s * 1000.0)
