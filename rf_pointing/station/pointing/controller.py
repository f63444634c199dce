"""The pointing controller: the only author of motion.

It follows one pass at a time, from its start on the chosen turn to the controlled stop at its end.
Every period it decides the mode (`mode.py`), updates the corrections (`corrections.py`) and issues
the trajectory that starts `transport_s` from now (`motion.py`), if the safety gate allows it.
"""

import math

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, JointTrajectory, Mode, PointingError, Sensor, Target, require_choice
from rf_pointing.ephemeris import Pass
from rf_pointing.ephemeris.solar import SolarDirection
from rf_pointing.planning import choose_turns
from rf_pointing.station.pointing.corrections import PointingCorrections
from rf_pointing.station.pointing.mode import CarrierWatch, PassStatistics, SensedErrors, TrackingMode, newest
from rf_pointing.station.pointing.motion import CommandedMotion
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.plan import PassPlan
from rf_pointing.station.pointing.scan_patterns import Scans
from rf_pointing.station.pointing.status import TrackingStatus
from rf_pointing.tracking import AutotrackState
from rf_pointing.tracking.sensors import SENSOR_CHOICES, SENSORS

# A pass that has begun may be started before the target's motion has arrived; not for longer.
PREDICTION_PATIENCE_S = 5.0


class PointingController:
    """Follows one pass at a time; `step` once a period, between them the inputs as they come."""

    def __init__(self, params: ControllerParams) -> None:
        self.params = params
        self.plan = PassPlan(params.machine, params.mask, params.gate, params.limits, SolarDirection(params.sun))
        scans = Scans(params.spiral, params.calibration.scan, params.watch.probe, params)
        self.corrections = PointingCorrections(params.integrator, scans, params.trim)
        self.carrier = CarrierWatch(params.watch, params.link)
        self._mode = TrackingMode(params.autotrack, params.pointing, self.carrier)
        self._motion = CommandedMotion(params.pointing, self.plan, self.corrections)
        self._pass: Pass | None = None
        self._turns_rad: float | None = None
        self._stopping, self._moved, self._sensor = "", False, Sensor.PROGRAM.value
        self.statistics = PassStatistics()

    @property
    def busy(self) -> bool:
        """Whether a pass is being tracked, or waited for at its start."""
        return self._pass is not None

    @property
    def state(self) -> AutotrackState:
        """Where the state table stands."""
        return self._mode.state

    @property
    def errors(self) -> SensedErrors:
        """The errors of the pass, and how many came from a sensor that is not registered."""
        return self._mode.errors

    def retune(self, params: ControllerParams) -> None:
        """Use new `pointing`, `limits` and `autotrack` parameters from the next period on.

        All other sets are read once, when the controller is made: a new one of them has no effect.
        """
        self.params = params
        self.plan.take_limits(params.limits)
        self._motion.retune(params.pointing)
        self._mode.retune(params.autotrack, params.pointing)

    def take_model(self, model: BiasModel) -> None:
        """Use `model` from the next trajectory on."""
        self._motion.take_model(model)

    def take_joints(self, reading: JointReading) -> None:
        """Note where the axes are."""
        self._motion.take_joints(reading)

    def take_target(self, target: Target) -> None:
        """Note where the target will be; other targets are ignored."""
        if self._pass is not None and target.name == self._pass.name:
            self._motion.targets.add(target)

    def take_error(self, error: PointingError) -> None:
        """Note what a sensor measured; only those that the pass may use count."""
        self._mode.errors.take(error)

    def awaits_error(self, t_s: float) -> bool:
        """Whether a sensor that reports every period is late with what this period should use."""
        return self._pass is not None and self._mode.awaits_error(t_s)

    def calibrate(self) -> str:
        """Request a calibration scan of the feed; return why not, "" when it will begin."""
        return self._mode.calibrate()

    def start(self, t_s: float, window: Pass, sensor: str) -> None:
        """Begin to track a pass; the antenna moves as soon as the position of its axes is known.

        Raises
        ------
        ValueError
            When the pass is over, another one is tracked, it does not fit the limits, or its
            carrier is too weak.
        """
        require_choice("sensor", sensor, SENSOR_CHOICES)
        if self._pass is not None:
            raise ValueError(f"{self._pass.name} is being tracked until its loss of signal; cancel that first")
        # Refused before anything moves: all of this is known without the axes.
        if t_s >= window.los_t_s:
            raise ValueError(f"the pass of {window.name} ended {t_s - window.los_t_s:.0f} s ago")
        self.carrier.require_level(window, sensor, self._mode.params)
        axes = self._motion.axes
        self._turns_rad = None if axes is None else self._choose_turn(t_s, window, axes, sensor)
        self._sensor = sensor
        self._pass, self._stopping, self._moved = window, "", False
        self._motion.restart()
        self.corrections.restart(t_s)
        self._mode.restart(t_s, sensor)
        self.statistics = PassStatistics()

    def stop(self, reason: str) -> None:
        """End the pass at the next period with a controlled stop."""
        if self._pass is not None:
            self._stopping = reason

    def step(self, t_s: float) -> tuple[JointTrajectory | None, TrackingStatus]:
        """Return the trajectory of `t_s`, None when nothing is commanded, and the status."""
        window = self._pass
        if window is None:
            return None, self._status(t_s, self._mode.fresh_error(t_s))
        if not self._stopping and t_s >= window.los_t_s:
            self._stopping = "loss of signal"
        if self._turns_rad is None and not self._stopping:
            if self._motion.axes is None:
                return None, self._status(t_s, self._mode.fresh_error(t_s))
            try:
                self._turns_rad = self._choose_turn(t_s, window, self._motion.axes, self._sensor)
            except ValueError as refused:
                self._stopping = str(refused)
        # Before the trajectory: a lost carrier freezes the loop in the period that sees it.
        self._advance_mode(t_s, window)
        self._moved = self._moved or self.state.mode != Mode.IDLE
        if not self._stopping and self.state.mode == Mode.IDLE:
            if not self._moved and t_s - self.state.entered_s <= PREDICTION_PATIENCE_S:
                return None, self._status(t_s, self._mode.fresh_error(t_s))
            self._stopping = self.state.reason if self._moved else "no prediction of the target has arrived"
        trajectory = None
        if not self._stopping:
            kind = _motion_of(self.state.mode)
            trajectory, self._stopping = self._motion.follow(t_s, window, self._turns_rad or 0.0, kind)
        if self._stopping:
            return self._finish(t_s)
        error = self._mode.fresh_error(t_s)
        self.statistics.count(self.params.pointing.period_s, self._mode.state.mode, error, t_s >= window.aos_t_s)
        return trajectory, self._status(t_s, error)

    def _choose_turn(self, t_s: float, window: Pass, joints: JointReading, sensor: str) -> float:
        """Return the turns (rad) to track on, of the certificate or else of the summary."""
        if self.plan.choose(t_s, window, joints, self._motion.model, sensor, self.params.pointing.lag_averaging_s):
            # Again, for over the top the same encoders are other direct angles.
            self.take_joints(joints)
            return self.plan.course.turns_rad
        low, high, present = window.azimuth_min_rad, window.azimuth_max_rad, float(joints.position_rad[0])
        turns_rad = 2.0 * math.pi * choose_turns(self.params.limits, low, high, present)
        refused = self.params.limits.reason(window.aos_azimuth_rad + turns_rad, window.peak_elevation_rad)
        if refused:
            raise ValueError(refused)
        return turns_rad

    def _advance_mode(self, t_s: float, window: Pass) -> None:
        """Decide the mode and update the corrections; a crossing is blind."""
        course = self.plan.course
        if not course.direct and course.crossing(t_s) and not self._stopping:
            return
        before, arriving = self.state.mode, self.corrections.arriving(t_s)
        errors = self._mode.usable_errors(t_s)
        error = newest(errors, before)
        motion = self._motion.snapshot(t_s, window, error.t_s if error else None)
        self._mode.advance(t_s, errors, motion, arriving=arriving, ended=bool(self._stopping))
        command_s = t_s + self.params.pointing.transport_s
        self.corrections.update(command_s, before, self._mode.state, error, motion.beam_rad)

    def _finish(self, t_s: float) -> tuple[JointTrajectory | None, TrackingStatus]:
        reason = self._stopping
        self.statistics.reason = reason
        self._pass = None
        self.plan.clear()
        self._mode.end(t_s, reason)
        return self._motion.halt(t_s), self._status(t_s, self._mode.fresh_error(t_s))

    def _status(self, t_s: float, error: PointingError | None) -> TrackingStatus:
        state, window = self._mode.state, self._pass
        sensed = error is not None and error.valid and state.carrier and error.sensor == state.mode
        correction = self.corrections.correction_rad(t_s)
        sky = self._motion.sky_rad(t_s, window, correction)
        return TrackingStatus(
            t_s=t_s,
            mode=state.mode,
            sensor=self._mode.sensor,
            target=window.name if window else "",
            reason=state.reason,
            los_t_s=window.los_t_s if window else 0.0,
            azimuth_rad=float(sky[0]),
            elevation_rad=float(sky[1]),
            scan_centre_rad=self._motion.centre_rad(t_s),
            cross_elevation_error_rad=error.cross_elevation_rad if sensed and error else 0.0,
            elevation_error_rad=error.elevation_rad if sensed and error else 0.0,
            cross_elevation_offset_rad=float(correction[0]),
            elevation_offset_rad=float(correction[1]),
            carrier_to_noise_db_hz=error.carrier_to_noise_db_hz if error else 0.0,
            half_power_beamwidth_rad=self.corrections.half_power_beamwidth_rad,
            command_lead_s=self.params.pointing.horizon_s if window else 0.0,
        )


def _motion_of(mode: str) -> str:
    """Return what the safety gate calls the motion of a mode."""
    if mode == Mode.CALIBRATE:
        return "calibration"
    return "scan" if mode == Mode.SEARCH or (mode in SENSORS and SENSORS[mode].scans) else "track"
