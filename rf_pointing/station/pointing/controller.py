"""The pointing controller: the only author of motion.

It follows one pass at a time, from its start on the chosen turn to the controlled stop at its end.
Every period it decides the mode (`mode.py`), updates the corrections (`corrections.py`) and issues
the trajectory that starts `transport_s` from now (`motion.py`), if the safety gate allows it.

A pass has a certificate before anything moves.  While its profile or the position of the axes has
not arrived, the axes stay where they are; after `PLAN_PATIENCE_S` the pass is refused.

What stalls does not end the pass.  Without targets the profile of the pass is followed; beyond its
end, and while the safety gate refuses the way, the axes wait at rest.  After a gap in its own
periods or in the readings of the axes, the controller slews back to the target.  A fault ends the
pass.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rf_pointing.calibration import BiasModel
from rf_pointing.core import JointReading, JointTrajectory, Mode, PointingError, Sensor, Target, require_choice
from rf_pointing.core.kinematics import LEVEL
from rf_pointing.core.pass_outcome import LOSS_OF_SIGNAL, OF_ANTENNA, SCANNED
from rf_pointing.ephemeris import Pass, SolarDirection, SunPermit
from rf_pointing.planning import PassProfile, SensorCost
from rf_pointing.station.pointing.antenna_watch import AntennaWatch, AxisState
from rf_pointing.station.pointing.corrections import PointingCorrections
from rf_pointing.station.pointing.mode import LEAST_AGE_PERIODS, CarrierWatch, TrackingMode, newest
from rf_pointing.station.pointing.motion import CommandedMotion
from rf_pointing.station.pointing.outcome import BeamEvidence, CarrierLevels, PassStatistics
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.plan import PassPlan
from rf_pointing.station.pointing.scan_patterns import Scans, array_cost, sensor_cost
from rf_pointing.station.pointing.status import Level, TrackingStatus
from rf_pointing.station.pointing.uncertain_pass import uncertain_cost
from rf_pointing.tracking import AutotrackState, SkyMotion, prior_of
from rf_pointing.tracking.scan_program import ScanProgram, ScanProgramParams
from rf_pointing.tracking.sensors import SENSOR_CHOICES, SENSORS, SensorTraits, sensors_of

# A pass may be started before its profile has arrived, from an ephemeris that has stalled or starts
# again; not for longer.
PLAN_PATIENCE_S = 10.0
# Periods whose C/N0 is averaged: one alone is noisy, many would hide the loss of the carrier.
LEVEL_PERIODS = 3.0
# Averaging times after which the mount's lags have settled after a slew.
LAG_TIMES = 2.0
# A gap between two periods after which the axes have stopped.
STALLED_S = 1.0
# Range of a pass that does not say how near it comes, for what its ephemeris error is on the sky.
USUAL_RANGE_M = 1e6
# Horizon and Sun are judged by the angles of the axes.  What the beam is off them is covered by the
# clearance over the horizon, and by this share of the Sun's zone.
SUN_SHARE = 0.5
# A pass through the Sun ends so long before its permission, for the antenna to turn away then.
SUN_STOP_S = 2.0
# The band of the pass takes over once the target is known to this share of its beam: three sigmas
# are within half power.  Until it holds the target, after the change; and seconds worth a change.
TAKEN_OVER_BEAMWIDTHS = 1.0 / 6.0
CHANGE_S, WORTH_S = 8.0, 5.0
# A wider band without a carrier is left so long after nine targets of ten would have been found.
NOT_FOUND_S = 30.0


@dataclass(frozen=True, kw_only=True)
class WiderBand:
    """Another band of the station, `name`, in which passes of the band `own` may be acquired."""

    own: str
    name: str
    params: ControllerParams
    sensors: tuple[str, ...]


class PointingController:
    """Follows one pass at a time; `step` once a period, between them the inputs as they come."""

    def __init__(self, params: ControllerParams, wider: WiderBand | None = None) -> None:
        self.params = self._own = params
        self._wider, self._in_wider = wider, False
        # How long the wider band is used at most, and until when.
        self._wide_s, self._wide_until_s = 0.0, -math.inf
        self.plan = PassPlan(
            params.machine, params.mask, params.gate, params.limits, SolarDirection(params.sun, params.kinematics),
            params.pointing.on_target_rad, params.kinematics,
        )  # fmt: skip
        self._scans = Scans(params.spiral, params.calibration.scan, params.watch.probe, params)
        self.corrections = PointingCorrections(params.integrator, self._scans, params.trim)
        self.antenna = AntennaWatch(params.axes, params.pointing.on_target_rad, params.kinematics.axes)
        self._levels = CarrierLevels()
        self.carrier = CarrierWatch(params.watch, params.link)
        self._mode = TrackingMode(params.autotrack, params.pointing, self.carrier)
        self._motion = CommandedMotion(params.pointing, self.plan, self.corrections)
        self._pass: Pass | None = None
        self._asked: Pass
        self._turns_rad: float | None = None
        self._stopping, self._sensor = "", Sensor.PROGRAM.value
        self._started_s, self._stepped_s, self._returning = -math.inf, -math.inf, False
        self._alarm: tuple[Level, str] = Level.OK, ""
        self.deaf = False
        """Whether sensed errors are ignored: not every node has taken the band."""
        self._renewed = False
        self.model_doubt = ""
        self.statistics = PassStatistics()

    def in_band(self, params: ControllerParams, wider: WiderBand | None = None) -> "PointingController":
        """Return the controller of another band, which knows antenna and passes as this one."""
        other = PointingController(params, wider)
        other.antenna.take_status(self.antenna.mode, self.antenna.fault)
        other.plan.profiles = self.plan.profiles
        if self._motion.axes is not None:
            other.take_joints(self._motion.axes)
        return other

    def go_on_in_band(self, t_s: float, band: str) -> None:
        """Take the wider band for the pass in hand, or the pass's own again.

        Antenna, plan and what was learned of the target stay; the carrier is another one.
        """
        assert self._wider is not None
        self._in_wider = band == self._wider.name
        if not self._in_wider:
            # Once: a target that its own beam loses is looked for there.
            self._wide_until_s = -math.inf
        self.params = params = self._wider.params if self._in_wider else self._own
        self._scans = Scans(params.spiral, params.calibration.scan, params.watch.probe, params)
        self.carrier = CarrierWatch(params.watch, params.link)
        self._mode.use_band(t_s, params.autotrack, self.carrier, f"the {band} band takes over")
        self.corrections.use_band(t_s + params.pointing.transport_s, params.integrator, self._scans, params.trim)
        self._levels.clear()

    @property
    def wanted_band(self) -> str:
        """Band in which the pass in hand should go on, "" while that in use is the right one."""
        if self._wider is None:
            return ""
        if not self._in_wider:
            return self._wider.name if self._pass is not None and self._stepped_s < self._wide_until_s else ""
        known_rad = TAKEN_OVER_BEAMWIDTHS * self._own.spiral.half_power_beamwidth_rad
        found = self.state.integrating and self.corrections.learned_sigma_rad() < known_rad
        over = self._pass is None or self._stepped_s >= self._wide_until_s
        return self._wider.own if found or over else ""

    @property
    def busy(self) -> bool:
        """Whether a pass is being tracked, or waited for at its start."""
        return self._pass is not None

    @property
    def window(self) -> Pass | None:
        """The pass in hand on the sky, as far as it is certified by now."""
        if self._pass is None or self.plan.mount.level:
            return self._pass
        return replace(self._asked, los_t_s=self._pass.los_t_s)

    @property
    def stopping(self) -> bool:
        """Whether the next period ends the pass in hand."""
        return self._pass is not None and bool(self._stopping)

    @property
    def missing(self) -> str:
        """Input that the certificate of the pass in hand still waits for, or ""."""
        if self._pass is None or self._turns_rad is not None or self._stopping:
            return ""
        if self._motion.axes is None:
            return "the position of the axes (joint_states)"
        if self.plan.profile_of(self._pass) is None:
            return f"the profile of this pass of {self._pass.name} (pass_profiles)"
        return ""

    @property
    def state(self) -> AutotrackState:
        """Where the state table stands."""
        return self._mode.state

    def retune(self, params: ControllerParams) -> None:
        """Use new `pointing`, `axes`, `alarm`, `limits` and `autotrack` from the next period on.

        All other sets are read once, when the controller is made: a new one of them has no effect.
        """
        self.params, self._own = params, self._own if self._in_wider else params
        self.plan.retune(params.limits, params.pointing.on_target_rad)
        self._motion.retune(params.pointing)
        self._mode.retune(params.autotrack, params.pointing)
        self.antenna.retune(params.axes, params.pointing.on_target_rad)

    def take_model(self, model: BiasModel) -> None:
        """Use `model` from the next trajectory on; `model_doubt` states what is wrong with it."""
        model = model.on(self.params.kinematics)
        self._motion.take_model(model)
        self.model_doubt = self._doubt_of(model)

    def _doubt_of(self, model: BiasModel) -> str:
        sun_rad = SUN_SHARE * self.params.machine.sun_radius_rad
        margin_rad = min(sun_rad or math.inf, self.params.mask.clearance_rad)
        apart_rad, azimuth_rad, elevation_rad = model.departure()
        if apart_rad <= margin_rad:
            return ""
        return (
            f"the bias model holds the beam {math.degrees(apart_rad):.2f} deg off the axes at azimuth "
            f"{math.degrees(azimuth_rad):.0f} deg, elevation {math.degrees(elevation_rad):.0f} deg, must be <= "
            f"{math.degrees(margin_rad):.2f} deg: horizon and Sun are judged by the axes; set the zero of the drive"
        )

    def take_joints(self, reading: JointReading) -> None:
        """Note where the axes are."""
        self._motion.take_joints(reading)

    def take_target(self, target: Target) -> None:
        """Note where the target will be; other targets are ignored."""
        if self._pass is None or target.name != self._pass.name:
            return
        target = self.plan.mount.of_axes(target)
        self._motion.targets.add(target)
        if target.uncertainty is not None:
            right = target.azimuth_rate_rad_s * math.cos(target.elevation_rad)
            sky = SkyMotion(right, target.elevation_rate_rad_s, target.range_m)
            self.corrections.know(target.uncertainty, sky, self.plan.path)

    def take_error(self, error: PointingError) -> None:
        """Note what a sensor measured; only those that the pass may use count.

        Raises
        ------
        ValueError
            For a sensor that is not registered.
        """
        if self.deaf:
            return
        self._mode.errors.take(error)
        self._levels.take(error)

    def take_antenna(self, mode: str, fault: str) -> None:
        """Note the mode and the latched fault that the antenna publishes."""
        self.antenna.take_status(mode, fault)

    def permit_sun(self, permit: SunPermit | None, band: str = "") -> None:
        """Take who lets the beam look into the Sun; one for another than `band` lets it not."""
        self.plan.sun.permit = permit if permit is None or band in ("", permit.band) else None

    def awaits_input(self, t_s: float) -> bool:
        """Whether a sensor that reports every period, or the target, is late with what is used."""
        if self._pass is None:
            return False
        return self._mode.awaits_error(t_s) or self._motion.targets.late(t_s)

    def calibrate(self) -> str:
        """Request a calibration scan of the feed; return why not, "" when it will begin."""
        return self._mode.calibrate()

    def start(
        self, t_s: float, window: Pass, sensor: str, scan: ScanProgramParams | None = None
    ) -> None:  # fmt: skip
        """Begin to track a pass; the antenna moves once the pass has its certificate.

        With a `scan` the beam is led by it around the predicted target, and the pass ends with it:
        no sensor corrects what is being measured.

        Raises
        ------
        ValueError
            When the pass is over, another one is tracked, it does not fit the limits, its carrier
            is too weak, the antenna has a latched fault, or the scan does not fit the pass or the
            axes.  A pass that waits for its certificate (`missing`) is refused later, by its end.
        """
        sensor = Sensor.PROGRAM.value if scan is not None else sensor
        require_choice("sensor", sensor, SENSOR_CHOICES)
        if self._pass is not None:
            raise ValueError(f"{self._pass.name} is being tracked until its loss of signal; cancel that first")
        # Refused before anything moves: all of this is known without the axes.
        if t_s >= window.los_t_s:
            raise ValueError(f"the pass of {window.name} ended {t_s - window.los_t_s:.0f} s ago")
        if self.antenna.fault:
            raise ValueError(f"the antenna has a latched fault ({self.antenna.fault}); reset it first")
        self.carrier.require_level(window, sensor, self._mode.params, self.plan.profile_of(window))
        program = None if scan is None else ScanProgram(scan)
        if program is not None:
            self._require_scan(t_s, window, program)
        self._scans.program = program
        self.plan.forget()
        self._wide_until_s = -math.inf
        axes, known = self._motion.axes, self.plan.profile_of(window) is not None
        self._turns_rad = self._choose_turn(t_s, window, axes, sensor) if axes is not None and known else None
        self._sensor, self._started_s, self._asked = sensor, t_s, window
        self._pass, self._stopping = self.plan.seen(window, piece=program is not None), ""
        self._motion.restart()
        if self._turns_rad is not None:
            self._motion.resume(t_s)
        self.corrections.restart(t_s)
        self._mode.restart(t_s, sensor)
        self._levels.clear()
        self.antenna.restart(t_s)
        self.statistics, self._stepped_s, self._returning = PassStatistics(), t_s, False

    def _require_scan(self, t_s: float, window: Pass, program: ScanProgram) -> None:
        """Refuse a scan that is longer than the pass, or faster than the axes."""
        left_s = window.los_t_s - max(t_s, window.aos_t_s)
        if program.duration_s > left_s:
            whole_s = program.duration_s
            raise ValueError(f"the scan takes {whole_s:.0f} s; {left_s:.0f} s of the pass are left")
        planned, units = self.params.machine.planned, ("deg/s of rate", "deg/s^2 of acceleration")
        for unit, needed, most in zip(units, program.demand, planned, strict=True):
            if needed > min(most):
                raise ValueError(
                    f"the scan needs {math.degrees(needed):.3g} {unit}, the axes are planned with "
                    f"{math.degrees(min(most)):.3g}"
                )

    def certify(self, t_s: float) -> None:
        """Issue the certificate of the pass in hand if it waits for one and nothing is missing."""
        axes = self._motion.axes
        if self._pass is None or axes is None or self._turns_rad is not None or self._stopping or self.missing:
            return
        try:
            profile = self.plan.profile_of(self._pass)
            self.carrier.require_level(self._pass, self._sensor, self._mode.params, profile)
            self._turns_rad = self._choose_turn(t_s, self._pass, axes, self._sensor)
            self._pass = self.plan.seen(self._pass, piece=self._scans.program is not None)
            self._motion.resume(t_s)
        except ValueError as refused:
            self._stopping = str(refused)

    def refuse_incomplete(self, waited_s: float) -> None:
        """End a pass that waits for its certificate, with what has not arrived."""
        if missing := self.missing:
            self.stop(f"no certificate: {missing} has not arrived in {waited_s:.0f} s")

    def stop(self, reason: str) -> None:
        """End the pass at the next period with a controlled stop."""
        if self._pass is not None:
            self._stopping = reason

    def step(self, t_s: float) -> tuple[JointTrajectory | None, TrackingStatus]:
        """Return the trajectory of `t_s`, None when nothing is commanded, and the status."""
        doubted = self.antenna.state.doubt
        axes = self.antenna.step(t_s, self._motion.axes)
        if self._pass is None:
            return None, self._status(t_s, self._mode.fresh_error(t_s))
        if self._renewed:
            self._extend(t_s, self._pass)
        window = self._pass
        if not self._stopping and t_s >= window.los_t_s:
            beyond = self.plan.beyond
            self._stopping = f"no certificate beyond this time: {beyond}" if beyond else LOSS_OF_SIGNAL
        elif not self._stopping and axes.fault:
            self._stopping = self.statistics.fault = axes.fault
        elif not self._stopping and self._scans.program and t_s >= self.corrections.scan_end_s:
            self._stopping = SCANNED
        elif not self._stopping:
            permit = self.plan.permit
            if permit is not None and not self.plan.sun.permitted(t_s + SUN_STOP_S):
                self._stopping = f"over: {permit.text}"
        gap_s, self._stepped_s = t_s - self._stepped_s, t_s
        if gap_s > STALLED_S:
            self._slew_again(t_s, f"the controller stalled for {gap_s:.1f} s")
        elif doubted and not axes.doubt:
            self._slew_again(t_s, f"over: {doubted}")
        trajectory = self._command(t_s, window)
        error = self._mode.fresh_error(t_s)
        if t_s >= window.aos_t_s:
            self._count(t_s, error)
        if self._stopping:
            return self._finish(t_s)
        return trajectory, self._status(t_s, error)

    def take_profiles(self, profiles: list[PassProfile]) -> None:
        """Replace the profiles of the coming passes; one may lead on the pass in hand."""
        self.plan.take_profiles(profiles)
        self._renewed = True

    def _extend(self, t_s: float, window: Pass) -> None:
        """Make the pass in hand longer where its target is predicted further and certified."""
        axes, self._renewed = self._motion.axes, False
        if axes is None or self._turns_rad is None or self._stopping or self._scans.program:
            return
        averaging_s, cost = self.params.pointing.lag_averaging_s, partial(self._cost, self._sensor, window, t_s)
        self._pass = self.plan.extended(t_s, window, axes, self._motion.model, averaging_s, cost)

    def _motion_word(self) -> str:
        """Return what the safety gate calls the motion of the mode."""
        mode, commanded = self.state.mode, self._scans.program is not None
        if mode == Mode.CALIBRATE:
            return "calibration"
        scans = mode == Mode.SEARCH or (mode in SENSORS and SENSORS[mode].scans)
        return "scan" if scans or (commanded and mode == Mode.PROGRAM_TRACK) else "track"

    def _slew_again(self, t_s: float, reason: str) -> None:
        """Let the axes find the target again: they may have stopped meanwhile."""
        self._mode.interrupt(t_s, reason)
        self.antenna.unsettle()
        self.plan.rejoin()
        self._returning = True

    def _command(self, t_s: float, window: Pass) -> JointTrajectory | None:
        """Decide the mode, and return the trajectory of the period, None while the axes wait."""
        self.certify(t_s)
        if self.missing:
            if t_s - self._started_s > PLAN_PATIENCE_S:
                self.refuse_incomplete(t_s - self._started_s)
            return None
        # Before the trajectory: a lost carrier freezes the loop in the period that sees it.
        before = self.state.mode
        self._advance_mode(t_s, window)
        if self._stopping:
            return None
        if self.state.mode == Mode.IDLE:
            self.antenna.unsettle()
            self.plan.rejoin()
            # The axes wait at rest for the target to come back.
            return self._motion.halt(t_s) if before != Mode.IDLE else None
        joining = self.state.mode == Mode.SLEW and t_s >= window.aos_t_s
        if joining:
            # Axes that jump onto a moving target fall behind it first.
            self.antenna.unsettle()
            self._motion.slew()
        elif self._returning:
            self._returning = False
            # The lags of the mount follow the slew back, not the prediction: the beam moves against
            # the encoders as in a sidelobe.
            self.carrier.trust_until(t_s + LAG_TIMES * self.params.pointing.lag_averaging_s)
        trajectory, refused = self._motion.follow(
            t_s, window, self._turns_rad or 0.0, self._motion_word(), joining=joining
        )
        if trajectory is None:
            # A pass is worth what is left of it: the axes wait at rest until the way is free.
            self._slew_again(t_s, refused)
            return self._motion.halt(t_s)
        self.antenna.take_command(float(trajectory.t_s[0]), trajectory.position_rad[0])
        return trajectory

    def _count(self, t_s: float, error: PointingError | None) -> None:
        """Add the period to the outcome of the pass."""
        mode, course = self.state.mode, self.plan.course
        sensed = error if error is not None and error.valid and error.sensor == mode else None
        # A stare measures the beam itself, axis error included; a scan the centre of it.
        scanned = sensed is not None and SENSORS[sensed.sensor].scans
        # The seconds of a pass are those of its own band.
        timing, beamwidth_rad = self.params.pointing, self._own.spiral.half_power_beamwidth_rad
        newest_t_s = t_s - LEAST_AGE_PERIODS * timing.period_s
        oldest_t_s = newest_t_s - LEVEL_PERIODS * timing.period_s
        # A commanded scan leaves the source on purpose: its power tells nothing of the axes.
        power = self._levels.power(newest_t_s, oldest_t_s, self._mode.axis_db_hz)
        evidence = BeamEvidence(
            sensor=self._mode.sensor, axes=self.antenna.state, sensed=sensed,
            off_centre_rad=self._motion.off_centre_rad() if scanned else None,
            power=None if self._scans.program else power,
            planned_rad=0.0 if course.direct else course.planned_error_rad(t_s),
        )  # fmt: skip
        waiting = mode == Mode.IDLE
        self.statistics.note(sensed)
        # A pass that was joined is counted from then on.
        self.statistics.count(
            t_s, timing.period_s, None if waiting else evidence.error_rad(beamwidth_rad), beamwidth_rad
        )

    def _cost(self, sensor: str, window: Pass, t_s: float, profile: PassProfile) -> SensorCost:
        """Return what a sensor costs; of several, the first for which the link is enough."""
        sky = profile.velocity_rad_s[0] * np.array([math.cos(float(profile.position_rad[0, 1])), 1.0])
        range_m = window.smallest_range_m or USUAL_RANGE_M
        level, table = self.carrier.link.level_db_hz(range_m), self.params.autotrack
        traits: SensorTraits | None = None
        for traits in sensors_of(SENSOR_CHOICES[sensor]):
            if level >= table.monopulse_on_db_hz or not traits.needs_strong_carrier:
                break
        motion, levels = SkyMotion(float(sky[0]), float(sky[1]), range_m), self.carrier.levels_db_hz(profile)
        own = traits is not None and traits.own_level
        prior = prior_of(self.params.trim, profile.along_sigma_s, profile.cross_sigma_m)
        looks = None if own else traits
        cost = sensor_cost(looks, self._scans, self.params.trim, table, motion)
        if prior is not self.params.trim:
            latitude_rad, begin_s = self.plan.sun.site.latitude_rad, max(t_s, window.aos_t_s)
            found = uncertain_cost(
                looks, self._scans, prior, table, profile, latitude_rad, begin_s, self.plan.mount, levels
            )
            cost = replace(found, fresh=cost)
        if own:
            beamwidth_rad = self.corrections.half_power_beamwidth_rad
            cost = array_cost(self.params.array, self.params.integrator, table, levels, beamwidth_rad, cost)
        cost = replace(cost, carrier_to_noise_db_hz=(min(levels), max(levels)))
        return cost if prior is self.params.trim else self._cost_by_wider_band(cost, sensor, window, t_s, profile)

    def _cost_by_wider_band(
        self, cost: SensorCost, sensor: str, window: Pass, t_s: float, profile: PassProfile
    ) -> SensorCost:
        """Return what the pass costs if the wider band acquires it, where that saves time."""
        wider, names = self._wider, {traits.name for traits in sensors_of(SENSOR_CHOICES[sensor])}
        if wider is None or self._in_wider or not names or not names <= set(wider.sensors):
            return cost
        found = self.in_band(wider.params)._cost(sensor, window, t_s, profile)
        # A scan knows the direction after its window, once in either band.
        change_s = CHANGE_S + 4.0 * self._scans.age_s(sensor)
        if found.unheld_90_s + change_s + WORTH_S > cost.unheld_90_s:
            return cost
        self._wide_s = found.unheld_90_s + NOT_FOUND_S
        return replace(
            cost, acquisition_s=found.acquisition_s + change_s, unheld_s=found.unheld_s + change_s,
            unheld_90_s=found.unheld_90_s + change_s, acquisition_band=wider.name,
            search_rad_s=max(cost.search_rad_s, found.search_rad_s),
        )  # fmt: skip

    def _choose_turn(self, t_s: float, window: Pass, joints: JointReading, sensor: str) -> float:
        """Issue the certificate, and return the turns (rad) to track on."""
        averaging_s, cost = self.params.pointing.lag_averaging_s, partial(self._cost, sensor, window, t_s)
        # Over the top a scan would measure other offsets than those of a table.
        direct = self._scans.program is not None
        self.plan.choose(t_s, window, joints, self._motion.model, averaging_s, cost, direct=direct)
        certificate = self.plan.certificate
        if certificate is not None and certificate.acquisition_band and certificate.chosen is not None:
            self._wide_until_s = max(t_s, window.aos_t_s) + self._wide_s
        # Again, for over the top the same encoders are other direct angles.
        self.take_joints(joints)
        return self.plan.course.turns_rad

    def _advance_mode(self, t_s: float, window: Pass) -> None:
        """Decide the mode and update the corrections; a crossing is blind, and without a scan."""
        course = self.plan.course
        if not course.direct and course.crossing(t_s) and not self._stopping:
            if self._mode.cross(t_s):
                self.corrections.cross(t_s + self.params.pointing.transport_s, self.state.mode)
            return
        before, arriving = self.state.mode, t_s < self.corrections.arrived_s
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
        # A pass that was refused has moved nothing.
        halt = self._motion.halt(t_s) if self._turns_rad is not None else None
        return halt, self._status(t_s, self._mode.fresh_error(t_s))

    def _status(self, t_s: float, error: PointingError | None) -> TrackingStatus:
        state, window, axes = self._mode.state, self._pass, self.antenna.state
        sensed = error is not None and error.valid and state.carrier and error.sensor == state.mode
        self._alarm, centre = self._alarm_of(t_s, window, axes), self._motion.centre_rad(t_s)
        correction = self.corrections.correction_rad(t_s)
        sky = self._motion.sky_rad(t_s, window, correction)
        # A pass without its certificate is still on the sky.
        mount = LEVEL if self._turns_rad is None else self.plan.mount
        azimuth_rad, elevation_rad = float(sky[0]), float(sky[1])
        if not mount.level:
            azimuth_rad, elevation_rad = mount.sky_at(azimuth_rad, elevation_rad)
        axis_error = np.zeros(2) if axes.error_rad is None else axes.error_rad
        offset = self.corrections.shown_rad(t_s)
        shown = np.array([error.cross_elevation_rad, error.elevation_rad]) if sensed and error else axis_error
        return TrackingStatus(
            t_s=t_s,
            mode=state.mode,
            sensor=self._mode.sensor,
            target=window.name if window else "",
            reason=f"{self._wider.name} band: {state.reason}" if self._wider and self._in_wider else state.reason,
            los_t_s=window.los_t_s if window else 0.0, azimuth_rad=azimuth_rad,
            elevation_rad=elevation_rad, scan_centre_rad=centre,
            cross_elevation_error_rad=float(shown[0]), elevation_error_rad=float(shown[1]),
            cross_elevation_offset_rad=float(offset[0]), elevation_offset_rad=float(offset[1]),
            carrier_to_noise_db_hz=error.carrier_to_noise_db_hz if error else 0.0,
            half_power_beamwidth_rad=self.corrections.half_power_beamwidth_rad,
            command_lead_s=self.params.pointing.horizon_s if window else 0.0,
            axis_error_rad=axis_error, axis_distance_rad=axes.distance_rad,
            axis_age_s=axes.age_s if math.isfinite(axes.age_s) else -1.0,
            on_source=window is not None and axes.on_source, settle_count=axes.settle_count,
            held=self.statistics.held, seconds_tracked_s=self.statistics.outcome.tracked_s,
            seconds_lost_s=self.statistics.outcome.lost_s,
            mean_loss_db=self.statistics.outcome.mean_loss_db,
            offsets=self._motion.targets.offsets, level=self._alarm[0], alarm=self._alarm[1],
        )  # fmt: skip

    def _alarm_of(self, t_s: float, window: Pass | None, axes: AxisState) -> tuple[Level, str]:
        """Return how bad things are, and why, in the words for /diagnostics."""
        if window is None:
            # A fault of the antenna ends with its reset, one of the watch with the next pass.
            own = "" if self.statistics.fault.startswith(OF_ANTENNA) else self.statistics.fault
            fault = OF_ANTENNA + self.antenna.fault if self.antenna.fault else own
            return (Level.ERROR, fault) if fault else (Level.OK, "")
        if axes.fault or axes.doubt:
            return Level.ERROR, axes.fault or axes.doubt
        if missing := self.missing:
            return Level.WARN, f"no certificate yet: {missing} has not arrived"
        if t_s < window.aos_t_s:
            return Level.OK, ""
        state, limits = self.state, self.params.alarm
        lost_s = t_s - max(self.statistics.held_t_s, window.aos_t_s, self.statistics.begun_t_s)
        words = f"the target has not been held for {lost_s:.1f} s: {state.mode}, {state.reason}"
        if lost_s > limits.lost_error_s:
            return Level.ERROR, words
        if lost_s > limits.lost_warning_s:
            return Level.WARN, words
        if state.mode in (Mode.SEARCH, Mode.COAST, Mode.HOLD_OFF):
            return Level.WARN, f"{state.mode}: {state.reason}"
        # By how much the received prediction is shorter than the trajectories.
        silent_s = t_s + self._motion.params.horizon_s - self._motion.targets.received_until_s
        if silent_s > 0.0:
            since = f"for {silent_s:.1f} s" if math.isfinite(silent_s) else "yet"
            return Level.WARN, f"no target {since}: the pass goes on with what was predicted before"
        return Level.OK, ""
