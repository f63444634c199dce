"""Motion commanded ahead of time, and how far the axes are from it.

    axis angles = model(target) + corrections + scan + lead of what is added

The prediction goes through the bias model (`prediction.py`).  What is added to it on the sky
(`corrections.py`) moves quickly; the lags of the mount that it would meet are led
(`CorrectionLag`).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from rf_pointing.calibration import BiasModel, LagHistory, LagState
from rf_pointing.core import Array, JointReading, JointTrajectory, Motion, Pair
from rf_pointing.core.signals import BeamPosition, TimeBuffer
from rf_pointing.ephemeris import Pass
from rf_pointing.station.pointing.corrections import PointingCorrections, added
from rf_pointing.station.pointing.params import PointingParams
from rf_pointing.station.pointing.plan import PassPlan
from rf_pointing.station.pointing.prediction import Prediction, TargetBuffer, time_key

# Age of a reading from which the motion of the axes is not known.
STALE_S = 1.0
# Factor on the fastest stated rate of the mount: loops overshoot, and gusts push.
BELIEVED_RATE = 2.0
ORIGIN = np.zeros((1, 2))
# Before this the motion of the axes has left no trace in the mount.
REMEMBERED_S = 60.0


class CorrectionLag:
    """Leads the mount's lags: the beam lags behind an offset as it does behind the target.

    For the target's own motion the prediction contains the lags.  An offset o that the loop or a
    search adds is commanded as o + lag(o), with the history of its own rates.  Without that the
    beam is off by up to a fifth of o for a lag of 1.9 s and T = 5 s, and swings for half a minute.
    The encoders are read against the prediction with lag(o) in it.  The rates are averaged over T,
    so that no quick correction shakes the antenna; T = 0 leads nothing.
    """

    def __init__(self, averaging_s: float) -> None:
        self._averaging_s = averaging_s
        self._model: BiasModel | None = None
        self._history: LagHistory | None = None
        self.restart()

    def restart(self) -> None:
        """Begin a pass: the axes wait on the prediction."""
        self._commanded: LagState | None = None

    def retune(self, averaging_s: float) -> None:
        """Average over another time from now on."""
        self._averaging_s, self._model = averaging_s, None

    def lead(self, times: Array, rate_rad_s: Array, model: BiasModel) -> Motion:
        """Return what to add to the axes for offsets that move at these rates, both (n, 2).

        The rate at the first time is what will be commanded then; the others may change with the
        next call.
        """
        if model is not self._model:
            lagging = self._averaging_s > 0.0 and model.has_lags
            self._model, self._history = model, LagHistory(model, self._averaging_s) if lagging else None
        still = np.zeros_like(rate_rad_s)
        if self._history is None:
            return Motion(still, still, still)
        parts, states = self._history.along(times, rate_rad_s, still, self._commanded)
        self._commanded = states[0]
        return Motion(*parts)


@dataclass(frozen=True, slots=True)
class MotionSnapshot:
    """Target and axes at one instant, for the state table.

    Attributes
    ----------
    target_available, on_target : whether there is motion to command, and whether the slew to it is
        over.
    path : distance of the target now in m and gain of its antenna towards the station in dB, None
        while its motion is not known.
    beam_rad : where the beam was from the prediction when the newest error was measured (2,), None
        where not known.
    error_path : distance and gain at that time.
    """

    target_available: bool
    on_target: bool
    path: Pair | None = None
    beam_rad: Array | None = None
    error_path: Pair | None = None


class CommandedMotion:
    """The trajectories of one pass; `axes` is the latest encoder reading."""

    def __init__(self, params: PointingParams, plan: PassPlan, corrections: PointingCorrections) -> None:
        self.params = params
        self.model = BiasModel.zero()
        self.axes: JointReading | None = None
        self.targets = TargetBuffer()
        self.beam = BeamPosition()
        self._centres = TimeBuffer()
        self._issued: JointTrajectory | None = None
        self._plan, self._corrections = plan, corrections
        self._direct: JointReading | None = None
        self._path = Prediction(params.period_s, plan, params.lag_averaging_s)
        self._lag = CorrectionLag(params.lag_averaging_s)
        self._centre: dict[int, Array] = {}
        self._last_sky = np.zeros(2)

    def retune(self, params: PointingParams) -> None:
        """Take new timing and tolerances between two periods."""
        self.params = params
        self._path.lag_averaging_s = params.lag_averaging_s
        self._lag.retune(params.lag_averaging_s)

    def restart(self) -> None:
        """Forget the last pass."""
        self.targets.clear()
        self._path.slew()
        self._lag.restart()
        self._issued = None
        self._centre.clear()
        self._centres.clear()
        self.beam.clear()

    def take_model(self, model: BiasModel) -> None:
        """Use `model` from the next trajectory on."""
        self.model = model
        self._path.clear()

    def slew(self) -> None:
        """Let the axes lead: they are on their way to the target, not on its path."""
        self._path.slew()

    def resume(self, t_s: float) -> None:
        """Join a pass that goes on already, perhaps once more after a restart."""
        profile = self._plan.profile
        if profile is None or self.axes is None:
            return
        known = (profile.t_s >= t_s - REMEMBERED_S) & (profile.t_s <= t_s)
        sky = Motion(profile.position_rad[known], profile.velocity_rad_s[known], profile.acceleration_rad_s2[known])
        self._path.followed(profile.t_s[known], sky, self.axes, self.model)

    def take_joints(self, reading: JointReading) -> None:
        """Note where the axes are.

        Rates far beyond those of the mount are noise of its encoders: nothing is stopped or met by
        them.
        """
        fastest = [BELIEVED_RATE * rate for rate in self._plan.machine.axes.rate_rad_s]
        first, second = reading.velocity_rad_s.tolist()
        if not (-fastest[0] <= first <= fastest[0] and -fastest[1] <= second <= fastest[1]):
            believed = np.clip(reading.velocity_rad_s, np.negative(fastest), fastest)
            reading = replace(reading, velocity_rad_s=believed)
        self.axes, self._direct = reading, self._plan.course.from_axes(reading)
        self.beam.take_joints(self._direct)
        self._path.take_axes(reading, self.model)

    def snapshot(self, t_s: float, window: Pass, error_t_s: float | None) -> MotionSnapshot:
        """Return what the state table must know; `error_t_s` is the time of the newest error."""
        on_target, profile = self._on_target(t_s, window), self._plan.profile
        end_s = t_s + self.params.horizon_s
        # Where the prediction has not arrived, the profile of the pass goes on.
        if t_s >= window.aos_t_s and profile is not None and not self.targets.covers(t_s, end_s):
            self.targets.fill(profile, t_s, end_s, window.smallest_range_m)
        # The shortest trajectory has three points.
        ahead = self.targets.covers(t_s, t_s + self.params.transport_s + 2.0 * self.params.period_s)
        known = ahead or self.targets.covers(t_s, t_s)
        path: Pair | None = None
        error_path: Pair | None = None
        # Before the first sample of the target no distance is known, and nothing to compare the
        # beam with.
        if math.isfinite(self.targets.known_until_s):
            then_s = t_s if error_t_s is None else error_t_s
            path, error_path = map(self.targets.path, (t_s, then_s))
        return MotionSnapshot(
            # Before the pass the axes wait where it begins, which is always known.
            target_available=ahead or t_s < window.aos_t_s,
            on_target=on_target,
            path=path if known else None,
            beam_rad=None if error_t_s is None else self.beam.offset(error_t_s),
            error_path=error_path,
        )

    def off_centre_rad(self) -> Array | None:
        """Return the centre of the scan minus the encoders on the sky (2,), None if not known."""
        if self._direct is None or not self._centres.times:
            return None
        centre = self._centres.at(min(self._direct.t_s, self._centres.times[-1]))
        if centre is None:
            return None
        stretch = np.array([math.cos(float(self._direct.position_rad[1])), 1.0])
        return np.asarray((centre - self._direct.position_rad) * stretch)

    def _on_target(self, t_s: float, window: Pass) -> bool:
        """Whether the slew is over: the axes are within the tolerance of the command."""
        centre = self._centre.get(time_key(t_s))
        if t_s < window.aos_t_s or centre is None or self._direct is None:
            return False
        lag_s = t_s - self._direct.t_s
        apart = centre - self._direct.position_rad - lag_s * self._direct.velocity_rad_s
        return bool(max(map(abs, apart.tolist())) < self.params.on_target_rad)

    def centre_rad(self, t_s: float) -> Array:
        """Return the commanded axis angles (2,) without the scan, zero if not known."""
        centre = self._centre.get(time_key(t_s))
        if centre is None:
            return np.zeros(2)
        # What is scanned is read off the encoders, which over the top show other angles.
        course = self._plan.course
        return centre if course.direct else course.axes_rad(t_s, centre)

    def sky_rad(self, t_s: float, window: Pass | None, correction_rad: Array) -> Array:
        """Return the commanded apparent direction (2,); before the pass it is its start.

        `correction_rad` (2,) is what is added to the prediction then.
        """
        if window is not None and t_s < window.aos_t_s:
            self._last_sky = np.array([window.aos_azimuth_rad, window.aos_elevation_rad])
        elif window is not None and self.targets.covers(t_s, t_s):
            self._last_sky = added(self.targets.at([t_s]), correction_rad[None, :], ORIGIN).position[0]
        return self._last_sky

    def follow(
        self, t_s: float, window: Pass, turns_rad: float, kind: str, *, joining: bool = False
    ) -> tuple[JointTrajectory | None, str]:
        """Return the trajectory issued at `t_s`, or None and why the safety gate refuses it.

        `joining`: the axes are still on their way to a pass that goes on.
        """
        params, plan = self.params, self._plan
        horizon_s = params.horizon_s
        if t_s >= window.aos_t_s:
            # A prediction that ends sooner is followed to its end.
            horizon_s = min(horizon_s, self.targets.known_until_s - t_s)
        count = math.floor((horizon_s - params.transport_s) / params.period_s + 1e-3) + 1
        # On whole microseconds, as on the wire: one instant is one number in every trajectory that
        # has it.  Else the old point would stay a rounding error before the new one, and the axes
        # would follow it to the end.
        times = np.round(t_s + params.transport_s + params.period_s * np.arange(count, dtype=np.float64), 6)
        now, first = time_key(t_s), time_key(times[0])
        near_rad = 0.5 * (window.azimuth_min_rad + window.azimuth_max_rad) + turns_rad
        try:
            if t_s < window.aos_t_s:
                predicted = self._waiting(t_s, count, window, near_rad)
            else:
                predicted = self._path.at(times, self.targets, self.model, near_rad)
        except ValueError as refused:
            return None, str(refused)
        centre, added_rates = predicted, np.zeros_like(predicted.velocity)
        if t_s >= window.aos_t_s:
            centre, added_rates = self._corrected(times, predicted, self.targets.range_m(times))
        scanned = self._corrections.add_scan(times, centre, plan.machine.planned)
        if self._corrections.searching:
            scanned = plan.kept_inside(t_s, times, centre, scanned)
        lead = self._lag.lead(times, added_rates + scanned.velocity - centre.velocity, self.model)
        # The encoders are compared with what was commanded, lead included.
        kept = {key: at for key, at in self._centre.items() if key >= now}
        self._centre = {**kept, first: centre.position[0] + lead.position[0]}
        self._centres.add(float(times[0]), centre.position[0] + lead.position[0])
        self.beam.take_centre(float(times[0]), predicted.position[0] + lead.position[0])
        position, velocity, acceleration = scanned
        trajectory = JointTrajectory(
            t_s=times,
            position_rad=position + lead.position,
            velocity_rad_s=velocity + lead.velocity,
            acceleration_rad_s2=acceleration + lead.acceleration,
        )
        if not plan.course.direct:
            trajectory = plan.course.to_axes(trajectory)
        meeting = plan.meeting_rad(t_s, self.axes) if joining and self.axes is not None else None
        if meeting is not None:
            still = np.zeros_like(trajectory.velocity_rad_s)
            trajectory = JointTrajectory(
                t_s=times, position_rad=still + meeting, velocity_rad_s=still, acceleration_rad_s2=still
            )
        encoder_rad = trajectory.position_rad[0] if self.axes is None else self.axes.position_rad
        here = (float(encoder_rad[0]), float(encoder_rad[1]))
        self._issued = trajectory
        sun_rad = plan.sun.avoided(t_s)
        decision = plan.gate.check(kind, here, trajectory.position_rad, sun_rad=sun_rad)
        return (trajectory, "") if decision.allowed else (None, decision.reason)

    def halt(self, t_s: float) -> JointTrajectory | None:
        """Return one point at rest, where the axes can stop; None when their motion is unknown."""
        if self.axes is None:
            return None
        rate = self.axes.velocity_rad_s
        present = self.axes.position_rad + (t_s - self.axes.t_s) * rate
        if t_s - self.axes.t_s > STALE_S and self._issued is not None:
            # Where silent axes have come to an old rate does not tell; the command does.
            row = int(np.argmin(np.abs(self._issued.t_s - t_s)))
            rate, present = self._issued.velocity_rad_s[row], self._issued.position_rad[row]
        position = present + rate * np.abs(rate) / (2.0 * self.params.stop_deceleration_rad_s2)
        still = np.zeros((1, 2))
        times = np.array([t_s + self.params.transport_s])
        return JointTrajectory(
            t_s=times, position_rad=position[None, :], velocity_rad_s=still, acceleration_rad_s2=still
        )

    def _waiting(self, t_s: float, count: int, window: Pass, near_rad: float) -> Motion:
        """Return the motion before the pass: on the way to where it begins, or at rest there."""
        start = np.array([window.aos_azimuth_rad, window.aos_elevation_rad])
        waiting = self._path.waiting(count, t_s, start, self.model, near_rad)
        next_rad = self._plan.to_start(t_s, self.axes, waiting.position[0])
        return waiting._replace(position=np.tile(next_rad, (count, 1)))

    def _corrected(self, times: Array, predicted: Motion, range_m: Array) -> tuple[Motion, Array]:
        """Return the motion with the corrections, and the rates (n, 2) that they add."""
        course = self._plan.course
        if not course.direct:
            self._corrections.turn_over(course.plunge_at(float(times[0])))
        corrected = self._corrections.add_corrections(times, predicted, range_m)
        added_rates = corrected.velocity - predicted.velocity
        ends = None if course.direct else course.ends_of_crossing(times)
        if ends is not None:
            offsets = self._corrections.axis_offsets_rad(*ends, float(range_m[0]))
            corrected = course.carry(times, predicted, corrected, offsets)
        return corrected, added_rates
