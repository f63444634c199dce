"""The pointing controller: the only author of motion.

At every period it asks the state table for the mode, takes the target's motion ahead of time, adds what the tracking
loop and the scans ask for on the sky, turns it into axis angles with the bias model, passes it through the gate and
issues a trajectory that starts `transport_s` from now.  Only errors stamped before the period are used, so the result
does not depend on how fast messages travel within it.
"""

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rf_pointing.calibration import BiasModel
from rf_pointing.controllers import TrackerIntegratorParams
from rf_pointing.ephemeris import Pass
from rf_pointing.geometry import (
    JointReading,
    JointTrajectory,
    Motion,
    PointingError,
    Target,
    require_choice,
)
from rf_pointing.planning import AxisLimits, GateParams, HorizonMask, MachineParams, choose_turns, refusal
from rf_pointing.rf import LinkParams
from rf_pointing.station.axis_path import AxisPath
from rf_pointing.station.beam_position import BeamPosition
from rf_pointing.station.carrier_watch import CarrierWatch
from rf_pointing.station.correction_lag import CorrectionLag
from rf_pointing.station.pass_plan import PassPlan
from rf_pointing.station.pointing_params import PointingParams
from rf_pointing.station.scan_patterns import ScanParams
from rf_pointing.station.sensed_errors import SENSOR_CHOICES, SensedErrors, newest, trusted
from rf_pointing.station.sky_offsets import SkyOffsets, added
from rf_pointing.station.solar import SolarDirection, SunParams
from rf_pointing.station.status import TrackingStatus
from rf_pointing.station.tally import Tally
from rf_pointing.station.target_buffer import TargetBuffer
from rf_pointing.tracking import (
    Autotrack,
    AutotrackInputs,
    AutotrackParams,
    AutotrackState,
    ConscanParams,
    LockWatchParams,
    MonopulseScanParams,
    SpiralParams,
    StepTrackParams,
    TrimParams,
)

__all__ = ["PointingController"]

Array = NDArray[np.float64]
MOTION_OF_MODE = {"search": "scan", "conscan": "scan", "steptrack": "scan", "calibrate": "calibration"}
"""What the gate calls the motion of a mode; the others track."""
PREDICTION_PATIENCE_S = 5.0
"""How long a pass that is going on already may be started without knowing the target's coming motion."""


class PointingController:
    """Follows one pass at a time; `step` once a period, between them the inputs as they come."""

    def __init__(
        self,
        params: PointingParams,
        limits: AxisLimits,
        autotrack: AutotrackParams,
        integrator: TrackerIntegratorParams,
        spiral: SpiralParams,
        conscan: ConscanParams,
        machine: MachineParams | None = None,
        mask: HorizonMask | None = None,
        steptrack: StepTrackParams | None = None,
        calibration: MonopulseScanParams | None = None,
        trim: TrimParams | None = None,
        watch: LockWatchParams | None = None,
        link: LinkParams | None = None,
        gate: GateParams | None = None,
        sun: SunParams | None = None,
    ) -> None:
        self.params, self.limits = params, limits
        self.plan = PassPlan(
            machine or MachineParams(), mask or HorizonMask(), gate or GateParams(), limits,
            SolarDirection(sun or SunParams()),
        )  # fmt: skip
        self._autotrack_params = autotrack
        self._table = Autotrack(autotrack)
        self.state = AutotrackState()
        scans = ScanParams(spiral, conscan, steptrack or StepTrackParams(), calibration or MonopulseScanParams())
        self.offsets = SkyOffsets(integrator, scans, trim or TrimParams())
        self.carrier = CarrierWatch(watch or LockWatchParams(), link or LinkParams())
        self._calibrating = False
        self._targets = TargetBuffer()
        self._model = BiasModel.zero()
        self._axes: JointReading | None = None
        self._joints: JointReading | None = None
        self._errors = SensedErrors()
        self._pass: Pass | None = None
        self._turns_rad: float | None = None
        self._centre: dict[int, Array] = {}
        self._beam = BeamPosition()
        self._path = AxisPath(params.period_s, self.plan, params.lag_averaging_s)
        self._lag = CorrectionLag(params.lag_averaging_s)
        self._stopping, self._moved, self._sensor = "", False, "program"
        self._last_sky = np.zeros(2)
        self.tally = Tally()

    @property
    def busy(self) -> bool:
        """Whether a pass is being tracked, or waited for at its start."""
        return self._pass is not None

    def retune(self, params: PointingParams, limits: AxisLimits, autotrack: AutotrackParams) -> None:
        """Take new parameters between two periods."""
        self.params, self.limits, self._autotrack_params = params, limits, autotrack
        self.plan.take_limits(limits)
        self._path.lag_averaging_s = self._lag.averaging_s = params.lag_averaging_s
        self._table = Autotrack(autotrack.replace(sensor=self._table.params.sensor))

    def take_model(self, model: BiasModel) -> None:
        """Use `model` from the next trajectory on."""
        self._model = model
        self._path.clear()

    def take_joints(self, reading: JointReading) -> None:
        """Note where the axes are."""
        self._axes, self._joints = reading, self.plan.course.from_axes(reading)
        self._beam.take_joints(self._joints)
        self._path.take_axes(reading, self._model)

    def take_target(self, target: Target) -> None:
        """Note where the target will be; other targets are ignored."""
        if self._pass is not None and target.name == self._pass.name:
            self._targets.add(target)

    def take_error(self, error: PointingError) -> None:
        """Note what a sensor measured; only those that the pass may use count."""
        self._errors.take(error, self._table.params.sensor)

    def awaits_error(self, t_s: float) -> bool:
        """Whether a sensor that reports every period has not reported yet what this period should use."""
        if self._pass is None:
            return False
        return self._errors.awaited(t_s, self.state.mode, self.params.period_s, self.params.error_age_s)

    def calibrate(self) -> str:
        """Ask for a calibration scan of the monopulse feed; return why not, "" when it will begin."""
        if self.state.mode not in ("monopulse", "conscan", "program_track", "coast"):
            return f"the mode is {self.state.mode}: a calibration needs a target that is tracked"
        if not self.state.strong:
            return "a calibration needs a carrier strong enough for monopulse"
        self._calibrating = True
        return ""

    def start(self, t_s: float, window: Pass, sensor: str) -> None:
        """Begin to track a pass; the antenna moves to its start at the next period that knows the axes' position.

        Raises
        ------
        ValueError
            When the pass is over, another one is tracked, it does not fit the limits, or its carrier is too weak.
        """
        require_choice("sensor", sensor, SENSOR_CHOICES)
        if self._pass is not None:
            raise ValueError(f"{self._pass.name} is being tracked until its loss of signal; cancel that first")
        if t_s >= window.los_t_s:
            raise ValueError(f"the pass of {window.name} ended {t_s - window.los_t_s:.0f} s ago")
        self.carrier.require_level(window, sensor, self._autotrack_params)
        self._turns_rad = None if self._axes is None else self._choose_turn(t_s, window, self._axes, sensor)
        self._sensor = sensor
        self._pass, self._stopping, self._moved = window, "", False
        self._errors.clear()
        self._targets.clear()
        self._path.restart()
        self._lag.restart()
        self._centre.clear()
        self._beam.clear()
        self.offsets.restart(t_s)
        self.carrier.restart()
        self._calibrating = False
        self.tally = Tally()
        self._table = Autotrack(self._autotrack_params.replace(sensor=SENSOR_CHOICES[sensor]))
        self.state = AutotrackState(entered_s=t_s)

    def stop(self, reason: str) -> None:
        """End the pass at the next period with a controlled stop."""
        if self._pass is not None:
            self._stopping = reason

    def step(self, t_s: float) -> tuple[JointTrajectory | None, TrackingStatus]:
        """Return the trajectory issued at `t_s`, None when nothing is commanded, and the status at `t_s`."""
        if self._pass is None:
            return None, self._status(t_s)
        if not self._stopping and t_s >= self._pass.los_t_s:
            self._stopping = "loss of signal"
        if self._turns_rad is None and not self._stopping:
            if self._axes is None:
                return None, self._status(t_s)
            try:
                self._turns_rad = self._choose_turn(t_s, self._pass, self._axes, self._sensor)
            except ValueError as refused:
                self._stopping = str(refused)
        self._advance_table(t_s)
        self._moved = self._moved or self.state.mode != "idle"
        if not self._stopping and self.state.mode == "idle":
            if not self._moved and t_s - self.state.entered_s <= PREDICTION_PATIENCE_S:
                return None, self._status(t_s)
            self._stopping = self.state.reason if self._moved else "no prediction of the target has arrived"
        trajectory = None
        if not self._stopping:
            trajectory = self._follow(t_s)
        if self._stopping:
            return self._finish(t_s)
        status = self._status(t_s)
        self.tally.count(self.params.period_s, status.mode, self._fresh_error(t_s), t_s >= self._pass.aos_t_s)
        return trajectory, status

    def _choose_turn(self, t_s: float, window: Pass, joints: JointReading, sensor: str) -> float:
        """Return the turns (rad) to track on: those of the certificate, or of the summary when there is no profile."""
        if self.plan.choose(t_s, window, joints, self._model, sensor, self.params.lag_averaging_s):
            self.take_joints(joints)
            return self.plan.course.turns_rad
        low, high, present = window.azimuth_min_rad, window.azimuth_max_rad, float(joints.position_rad[0])
        turns_rad = 2.0 * math.pi * choose_turns(self.limits, low, high, present)
        refused = refusal(self.limits, window.aos_azimuth_rad + turns_rad, window.peak_elevation_rad)
        if refused:
            raise ValueError(refused)
        return turns_rad

    def _advance_table(self, t_s: float) -> None:
        assert self._pass is not None
        if self.plan.course.crossing(t_s) and not self._stopping:
            return
        errors = self._usable_errors(t_s)
        error = newest(errors, self.state.mode)
        before, beam = self.state, self._beam.offset(error.t_s) if error else None
        fault = self._false_lock(before, error, beam)
        request = "calibrate" if self._calibrating else "track"
        self.state = self._table.step(
            before,
            AutotrackInputs(
                t_s=t_s,
                request="idle" if self._stopping else request,
                target_available=t_s < self._pass.aos_t_s or self._targets.covers(t_s, t_s + self.params.horizon_s),
                on_target=t_s >= self._pass.aos_t_s and self._axis_error(t_s) < self.params.on_target_rad,
                carrier_to_noise_db_hz=error.carrier_to_noise_db_hz if error else -math.inf,
                axis_db_hz=self.carrier.level_db_hz(self._range_m(t_s))
                if self._targets.covers(t_s, t_s)
                else -math.inf,
                monopulse_valid=trusted(errors, "monopulse"),
                conscan_valid=trusted(errors, "conscan"),
                arriving=self.offsets.arriving(t_s),
                fault=fault,
            ),
        )
        if self.state.mode != before.mode:
            self.carrier.forget()
            self._calibrating = self._calibrating and self.state.mode != "calibrate"
        self.offsets.listen(t_s + self.params.transport_s, before.mode, self.state, error, beam)

    def _false_lock(self, state: AutotrackState, error: PointingError | None, beam: Array | None) -> str:
        if state.mode != "monopulse" or error is None or beam is None or error.sensor != "monopulse":
            return ""
        return self.carrier.false_lock(error, beam, self._range_m(error.t_s), self._table.params.carrier_off_db_hz)

    def _range_m(self, t_s: float) -> float:
        return float(self._targets.range_m([t_s])[0])

    def _follow(self, t_s: float) -> JointTrajectory | None:
        """Return the trajectory of this period; a refusal of the gate becomes the reason of a stop."""
        assert self._pass is not None
        params = self.params
        count = round((params.horizon_s - params.transport_s) / params.period_s) + 1
        # On whole microseconds, as on the wire: one instant is one number in every trajectory that has it.  Else the old
        # point would stay a rounding error before the new one, and the axes would follow it to the end.
        times = np.round(t_s + params.transport_s + params.period_s * np.arange(count, dtype=np.float64), 6)
        try:
            predicted = self._prediction(t_s, times)
        except ValueError as refused:
            self._stopping = str(refused)
            return None
        centre, moved = predicted, np.zeros_like(predicted.velocity)
        if t_s >= self._pass.aos_t_s:
            range_m = self._targets.range_m(times)
            self.offsets.stand(self.plan.course.plunge_at(float(times[0])))
            trimmed = self.offsets.add_trim(times, predicted, range_m)
            beside = partial(self.offsets.beside, range_m=float(range_m[0]))
            centre = self.plan.course.carry(times, predicted, trimmed, beside)
            moved = trimmed.velocity - predicted.velocity
        scanned = self.offsets.add_scan(times, centre)
        lead = self._lag.lead(times, moved + scanned.velocity - centre.velocity, self._model)
        position, velocity, acceleration = (a + b for a, b in zip(scanned, lead, strict=True))
        here = centre.position[0] + lead.position[0]
        self._centre = {**{k: c for k, c in self._centre.items() if k >= _key(t_s)}, _key(times[0]): here}
        self._beam.take_centre(float(times[0]), predicted.position[0] + lead.position[0])
        trajectory = self.plan.course.to_axes(
            JointTrajectory(t_s=times, position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=acceleration)
        )
        present = None if self._axes is None else (float(self._axes.position_rad[0]), float(self._axes.position_rad[1]))
        self._stopping = self.plan.refusal(
            MOTION_OF_MODE.get(self.state.mode, "track"), t_s, present, trajectory.position_rad
        )
        return None if self._stopping else trajectory

    def _prediction(self, t_s: float, times: Array) -> Motion:
        """Return the axis motion that would hold the target if it were where it is predicted.

        The bias model sees the target's own motion: its lags stand for steady rates, and fed with the small quick
        corrections of the tracking loop they would shake the antenna.
        """
        assert self._pass is not None
        near_rad = 0.5 * (self._pass.azimuth_min_rad + self._pass.azimuth_max_rad) + (self._turns_rad or 0.0)
        if t_s < self._pass.aos_t_s:
            start = np.array([self._pass.aos_azimuth_rad, self._pass.aos_elevation_rad])
            waiting = self._path.waiting(len(times), t_s, start, self._model, near_rad)
            next_rad = self.plan.to_start(t_s, self._axes, waiting.position[0])
            return waiting._replace(position=np.tile(next_rad, (len(times), 1)))
        return self._path.at(times, self._targets, self._model, near_rad)

    def _finish(self, t_s: float) -> tuple[JointTrajectory | None, TrackingStatus]:
        reason = self._stopping
        self.tally.end(reason, self.state.mode)
        self._pass = None
        self.plan.clear()
        self.state = AutotrackState(entered_s=t_s, reason=reason)
        return self._halt(t_s), self._status(t_s)

    def _halt(self, t_s: float) -> JointTrajectory | None:
        """Return one point at rest, where the axes can stop; None when their motion is unknown."""
        if self._axes is None:
            return None
        rate = self._axes.velocity_rad_s
        present = self._axes.position_rad + (t_s - self._axes.t_s) * rate
        position = present + rate * np.abs(rate) / (2.0 * self.params.stop_deceleration_rad_s2)
        still = np.zeros((1, 2))
        times = np.array([t_s + self.params.transport_s])
        return JointTrajectory(
            t_s=times, position_rad=position[None, :], velocity_rad_s=still, acceleration_rad_s2=still
        )

    def _usable_errors(self, t_s: float) -> list[PointingError]:
        return self._errors.usable(t_s, self.params.period_s, self.params.error_age_s)

    def _fresh_error(self, t_s: float) -> PointingError | None:
        """Return the newest usable error, that of the sensor in use as long as it reports."""
        return newest(self._usable_errors(t_s), self.state.mode)

    def _axis_error(self, t_s: float) -> float:
        """Largest difference between the commanded and the present axis angles, infinite when unknown."""
        centre = self._centre.get(_key(t_s))
        if centre is None or self._joints is None:
            return math.inf
        lag_s = t_s - self._joints.t_s
        return float(np.max(np.abs(centre - self._joints.position_rad - lag_s * self._joints.velocity_rad_s)))

    def _sky(self, t_s: float) -> Array:
        """Return the commanded apparent direction (2,) at `t_s`: the pass's start before it, its last one after it."""
        if self._pass is not None and t_s < self._pass.aos_t_s:
            self._last_sky = np.array([self._pass.aos_azimuth_rad, self._pass.aos_elevation_rad])
        elif self._pass is not None and self._targets.covers(t_s, t_s):
            self._last_sky = added(self._targets.at([t_s]), self.offsets.trim(t_s)[None, :], np.zeros((1, 2))).position[
                0
            ]
        return self._last_sky

    def _status(self, t_s: float) -> TrackingStatus:
        error, window = self._fresh_error(t_s), self._pass
        sensed = error is not None and error.valid and self.state.integrating and error.sensor == self.state.mode
        centre = self._centre.get(_key(t_s), np.zeros(2))
        sky = self._sky(t_s)
        trim = self.offsets.trim(t_s)
        return TrackingStatus(
            t_s=t_s,
            mode=self.state.mode,
            sensor=self._table.params.sensor,
            target=window.name if window else "",
            reason=self.state.reason,
            los_t_s=window.los_t_s if window else 0.0,
            azimuth_rad=float(sky[0]),
            elevation_rad=float(sky[1]),
            scan_centre_rad=centre,
            cross_elevation_error_rad=error.cross_elevation_rad if sensed and error else 0.0,
            elevation_error_rad=error.elevation_rad if sensed and error else 0.0,
            cross_elevation_offset_rad=float(trim[0]),
            elevation_offset_rad=float(trim[1]),
            carrier_to_noise_db_hz=error.carrier_to_noise_db_hz if error else 0.0,
            half_power_beamwidth_rad=self.offsets.half_power_beamwidth_rad,
            command_lead_s=self.params.horizon_s if window else 0.0,
        )


def _key(t_s: float) -> int:
    """Time in whole milliseconds: periods are compared without the rounding of floats."""
    return round(t_s * 1000.0)
