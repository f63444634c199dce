"""The mode of the pass in hand: sensed errors, the watch on the carrier, the state table.

Only errors about the time before the last period are used, so the result does not depend on how
fast messages travel.
"""

import math
from collections import deque
from dataclasses import replace

import numpy as np

from rf_pointing.core import Array, Mode, Pair, PointingError, Sensor, require_choice
from rf_pointing.ephemeris import Pass
from rf_pointing.planning import PassProfile
from rf_pointing.rf import LinkParams
from rf_pointing.station.pointing.motion import MotionSnapshot
from rf_pointing.station.pointing.params import PointingParams
from rf_pointing.tracking import Autotrack, AutotrackInputs, AutotrackParams, AutotrackState, LockWatch, LockWatchParams
from rf_pointing.tracking.autotrack import Request
from rf_pointing.tracking.lock_watch import SIDELOBE
from rf_pointing.tracking.sensors import SENSOR_CHOICES, SENSORS, sensors_of

# Two seconds of one sensor, one of two: more than any period may use.
KEPT_ERRORS = 20
# Age from which an error is used: older than any of the period that ends, whether stamped at its
# middle or its end.
LEAST_AGE_PERIODS = 0.75
CROSSING = "the zenith is being crossed: no scan"


class SensedErrors:
    """The latest errors that a pass may use."""

    def __init__(self) -> None:
        self._errors: deque[PointingError] = deque(maxlen=KEPT_ERRORS)
        self._accepted: frozenset[str] = frozenset()

    def restart(self, choice: str) -> None:
        """Begin a pass with `choice`, a sensor in the state table's words."""
        self._errors.clear()
        self._accepted = frozenset(name for traits in sensors_of(choice) for name in (traits.name, *traits.level_from))

    def take(self, error: PointingError) -> None:
        """Note what a sensor measured; only those that the pass may use count.

        Raises
        ------
        ValueError
            For a sensor that is not registered: a mistake of the configuration that must be seen.
        """
        require_choice("sensor", error.sensor, SENSORS)
        if error.sensor in self._accepted:
            self._errors.append(error)

    def awaited(self, t_s: float, mode: str, period_s: float, oldest_s: float) -> bool:
        """Whether a sensor that reports every period is late with what `t_s` should use."""
        last_s = {error.sensor: error.t_s for error in self._errors}
        tracking = SENSORS.get(mode)
        # While the beam is scanned for one sensor, what the others report does not matter to this
        # period.
        waited = [tracking] if tracking and tracking.scans else [t for t in SENSORS.values() if not t.scans]
        return any(
            traits.every_period and 2.0 * period_s <= t_s - last_s.get(traits.name, -math.inf) < oldest_s
            for traits in waited
        )

    def usable(self, t_s: float, period_s: float, oldest_s: float) -> list[PointingError]:
        """Return the errors about the time before the last period, the newest first.

        One about the period that ends now may have arrived already, or not: it belongs to the next
        period in any case.
        """
        newest_t_s = t_s - LEAST_AGE_PERIODS * period_s
        return [error for error in reversed(self._errors) if t_s - oldest_s <= error.t_s <= newest_t_s]


def newest(errors: list[PointingError], mode: str) -> PointingError | None:
    """Return the newest of usable errors, that of the sensor in use as long as it reports."""
    in_use = (error for error in errors if error.sensor == mode)
    return next(in_use, next(iter(errors), None))


def valid_sensors(errors: list[PointingError]) -> frozenset[str]:
    """Return the sensors whose newest estimate may be used; a scan may until its first."""
    latest = {error.sensor: error for error in reversed(errors)}
    found = []
    for name, traits in SENSORS.items():
        error = latest.get(name)
        valid = traits.scans if error is None else error.valid or (traits.scans and not error.estimated)
        if valid:
            found.append(name)
    return frozenset(found)


class CarrierWatch:
    """Compares the carrier with the link; `faults` counts the false locks of the pass."""

    def __init__(self, watch: LockWatchParams, link: LinkParams) -> None:
        self._watch, self.link, self._compares = LockWatch(watch), link, watch.compares_level
        self.restart()

    def restart(self) -> None:
        """Begin a pass."""
        self.faults, self.last_fault = 0, ""
        self._watched_s = -math.inf
        self._watch.reset()

    def trust_until(self, t_s: float) -> None:
        """Judge no error before `t_s`."""
        self._watched_s = max(self._watched_s, t_s)

    def forget(self) -> None:
        """Begin with a new mode."""
        self._watch.reset()

    def require_level(
        self, window: Pass, sensor: str, thresholds: AutotrackParams, profile: PassProfile | None = None
    ) -> None:
        """Refuse a sensor whose C/N0 threshold a pass never reaches, even on the beam's axis.

        Without its profile the satellite's antenna is taken to look at the station.  A pass that
        does not say how near it comes is not refused.
        """
        nearest_m = window.smallest_range_m
        if nearest_m <= 0.0 or sensor == Sensor.PROGRAM or not self._compares:
            return
        chosen, level = thresholds.replace(sensor=SENSOR_CHOICES[sensor]), self.link.level_db_hz(nearest_m)
        if profile is not None and np.any(profile.satellite_gain_db):
            level, nearest_m = max(zip(self.levels_db_hz(profile), profile.range_m.tolist(), strict=True))
        strong = sensor in SENSORS and SENSORS[sensor].needs_strong_carrier
        needed = thresholds.monopulse_on_db_hz if strong else chosen.carrier_db_hz[0]
        level += chosen.array_gain_db if chosen.own_level else 0.0
        if level < needed:
            raise ValueError(
                f"sensor={sensor} needs a carrier of {needed:.1f} dB-Hz; the link gives at most {level:.1f} dB-Hz on this "
                f"pass, {nearest_m / 1e3:.0f} km away"
            )

    def levels_db_hz(self, profile: PassProfile) -> list[float]:
        """Return the C/N0 to expect in every row of a pass, the beam on the target."""
        paths = zip(profile.range_m.tolist(), profile.satellite_gain_db.tolist(), strict=True)
        return [self.link.level_db_hz(*path) for path in paths]

    def axis_db_hz(self, path: Pair | None) -> float:
        """Return the C/N0 to expect on the axis, -inf where nothing can be compared with it."""
        return self.link.level_db_hz(*path) if path is not None and self._compares else -math.inf

    def false_lock(
        self, error: PointingError, beam_rad: Array, path: Pair, faint_db_hz: float, expected_db: float
    ) -> str:
        """Return why an error must not be followed, empty while it may.

        `beam_rad` (2,) is how far the beam was from the prediction then, `path` the distance of the
        target and the gain of its antenna; below `faint_db_hz`
        nothing is judged.  `expected_db` is the level of a right lock against the link's.
        """
        # In noise every response is as likely as any other.
        if error.carrier_to_noise_db_hz < faint_db_hz or error.t_s <= self._watched_s:
            return ""
        self._watched_s = error.t_s
        expected = self.axis_db_hz(path) + expected_db if self._compares else None
        fault = self._watch.add(error, float(beam_rad[0]), float(beam_rad[1]), expected)
        if fault:
            self.faults, self.last_fault = self.faults + 1, fault
        return fault


class TrackingMode:
    """The state table of one pass after another; `state` is where it stands."""

    def __init__(self, params: AutotrackParams, timing: PointingParams, carrier: CarrierWatch) -> None:
        self.params, self.timing = params, timing
        self.state = AutotrackState()
        self.errors = SensedErrors()
        self._table = Autotrack(params)
        self.sensor = params.sensor
        """Sensor that the table uses, in its own words."""
        self._carrier = carrier
        self._calibrating = False
        self.axis_db_hz = -math.inf
        """C/N0 that the link gives on the beam's axis in the last period, -inf if not known."""
        self.errors.restart(self.sensor)

    def retune(self, params: AutotrackParams, timing: PointingParams) -> None:
        """Use new thresholds and times from the next period on; the sensor of the pass stays."""
        self.params, self.timing = params, timing
        # The sensor was chosen with the pass; a changed default is for the next one.
        self._table = Autotrack(params.replace(sensor=self.sensor))

    def use_band(self, t_s: float, params: AutotrackParams, carrier: CarrierWatch, reason: str) -> None:
        """Go on in another band: its carrier has to be found by itself."""
        self.retune(params, self.timing)
        self._carrier, self._calibrating = carrier, False
        self.errors.restart(self.sensor)
        mode = self.state.mode if self.state.mode in (Mode.IDLE, Mode.SLEW) else Mode.COAST
        self.state = AutotrackState(mode=mode, entered_s=t_s, reason=reason)

    def restart(self, t_s: float, sensor: str) -> None:
        """Begin a pass with a sensor as the operator names it."""
        self._carrier.restart()
        self._calibrating = False
        self.sensor, self.axis_db_hz = SENSOR_CHOICES[sensor], -math.inf
        self._table = Autotrack(self.params.replace(sensor=self.sensor))
        self.errors.restart(self.sensor)
        self.state = AutotrackState(entered_s=t_s)

    def end(self, t_s: float, reason: str) -> None:
        """End the pass."""
        self.state = AutotrackState(entered_s=t_s, reason=reason)

    def interrupt(self, t_s: float, reason: str) -> None:
        """Go back to the slew: the axes have to find the target again."""
        if self.state.mode != Mode.IDLE:
            self.state = replace(self.state, mode=Mode.IDLE, entered_s=t_s, reason=reason, invalid_since_s=None)
            self._carrier.forget()

    def cross(self, t_s: float) -> bool:
        """Note that the antenna crosses the zenith; return whether that ends a scan.

        The coast that follows begins with the crossing's end.
        """
        before, traits = self.state.mode, SENSORS.get(self.state.mode)
        if traits is not None and traits.scans:
            self.state = replace(self.state, mode=Mode.COAST, reason=CROSSING, invalid_since_s=None)
            self._carrier.forget()
        if self.state.mode == Mode.COAST:
            self.state = replace(self.state, entered_s=t_s)
        return self.state.mode != before

    def calibrate(self) -> str:
        """Request a calibration scan of the feed; return why not, "" when it will begin."""
        # The scan is of the monopulse feed: step-track has no use for it.
        automatic = [traits.name for traits in SENSORS.values() if traits.automatic]
        if self.state.mode not in (*automatic, Mode.PROGRAM_TRACK, Mode.COAST):
            return f"the mode is {self.state.mode}: a calibration needs a target that is tracked"
        if not self.state.strong:
            return "a calibration needs a carrier strong enough for monopulse"
        self._calibrating = True
        return ""

    def awaits_error(self, t_s: float) -> bool:
        """Whether a sensor that reports every period is late with what `t_s` should use."""
        return self.errors.awaited(t_s, self.state.mode, self.timing.period_s, self.timing.error_age_s)

    def usable_errors(self, t_s: float) -> list[PointingError]:
        """Return the errors that the period at `t_s` may use, the newest first."""
        return self.errors.usable(t_s, self.timing.period_s, self.timing.error_age_s)

    def fresh_error(self, t_s: float) -> PointingError | None:
        """Return the newest usable error, that of the sensor in use as long as it reports."""
        return newest(self.usable_errors(t_s), self.state.mode)

    def advance(
        self, t_s: float, errors: list[PointingError], motion: MotionSnapshot, *, arriving: bool, ended: bool
    ) -> None:
        """Decide the mode of the period at `t_s` from its usable errors and the motion.

        `arriving`: the beam is still on its way to where the last mode began; `ended`: the pass is
        over.
        """
        error, before, valid = newest(errors, self.state.mode), self.state, valid_sensors(errors)
        fault = self._false_lock(error, motion)
        self.axis_db_hz = self._carrier.axis_db_hz(motion.path)
        if self._table.params.own_level:
            self.axis_db_hz += self.params.array_gain_db
        request = Request.CALIBRATE if self._calibrating else Request.TRACK
        inputs = AutotrackInputs(
            t_s=t_s, request=Request.IDLE if ended else request,
            target_available=motion.target_available, on_target=motion.on_target,
            carrier_to_noise_db_hz=error.carrier_to_noise_db_hz if error else -math.inf,
            axis_db_hz=self.axis_db_hz, valid=valid, arriving=arriving, heard=bool(errors),
            fault=fault, sidelobe=fault.startswith(SIDELOBE),
        )  # fmt: skip
        self.state = self._table.step(before, inputs)
        if self.state.mode != before.mode:
            # Errors of another mode say nothing about this lock.
            self._carrier.forget()
            self._calibrating = self._calibrating and self.state.mode != Mode.CALIBRATE

    def _false_lock(self, error: PointingError | None, motion: MotionSnapshot) -> str:
        sensor = SENSORS.get(self.state.mode)
        if sensor is None or not sensor.watched or error is None or error.sensor != sensor.name:
            return ""
        if motion.beam_rad is None or motion.error_path is None:
            return ""
        faint_db_hz = self._table.params.carrier_off_db_hz
        # The level that proved a lock also judges it: against the link's, a lock taken over just
        # within `beam_drop_db` would be a sidelobe as soon as its level falls by a tenth of a dB.
        expected_db = min(self.state.learned_db, self.state.lock_db)
        return self._carrier.false_lock(error, motion.beam_rad, motion.error_path, faint_db_hz, expected_db)
