"""The mode of the pass in hand: what the state table is told of target, axes, carrier and sensors once a period."""

import math

import numpy as np
from numpy.typing import NDArray

from rf_pointing.core import PointingError
from rf_pointing.ephemeris import Pass
from rf_pointing.station.pointing.carrier_watch import CarrierWatch
from rf_pointing.station.pointing.motion import CommandedMotion
from rf_pointing.station.pointing.params import PointingParams
from rf_pointing.station.pointing.sensed_errors import SENSOR_CHOICES, SensedErrors, newest, trusted
from rf_pointing.tracking import Autotrack, AutotrackInputs, AutotrackParams, AutotrackState

__all__ = ["TrackingMode"]

Array = NDArray[np.float64]


class TrackingMode:
    """The state table of one pass after another; `state` is where it stands."""

    def __init__(self, params: AutotrackParams, carrier: CarrierWatch) -> None:
        self.params = params
        self.state = AutotrackState()
        self._table = Autotrack(params)
        self._carrier = carrier
        self._errors = SensedErrors()
        self._calibrating = False

    @property
    def sensor(self) -> str:
        """Sensor that the table uses, in its own words."""
        return self._table.params.sensor

    def retune(self, params: AutotrackParams) -> None:
        """Take new gates and times between two periods; the sensor of the pass stays."""
        self.params = params
        self._table = Autotrack(params.replace(sensor=self.sensor))

    def restart(self, t_s: float, sensor: str) -> None:
        """Begin a pass with a sensor as the operator names it."""
        self._errors.clear()
        self._carrier.restart()
        self._calibrating = False
        self._table = Autotrack(self.params.replace(sensor=SENSOR_CHOICES[sensor]))
        self.state = AutotrackState(entered_s=t_s)

    def end(self, t_s: float, reason: str) -> None:
        """End the pass."""
        self.state = AutotrackState(entered_s=t_s, reason=reason)

    def calibrate(self) -> str:
        """Ask for a calibration scan of the monopulse feed; return why not, "" when it will begin."""
        if self.state.mode not in ("monopulse", "conscan", "program_track", "coast"):
            return f"the mode is {self.state.mode}: a calibration needs a target that is tracked"
        if not self.state.strong:
            return "a calibration needs a carrier strong enough for monopulse"
        self._calibrating = True
        return ""

    def take_error(self, error: PointingError) -> None:
        """Note what a sensor measured; only those that the pass may use count."""
        self._errors.take(error, self.sensor)

    def awaits_error(self, t_s: float, timing: PointingParams) -> bool:
        """Whether a sensor that reports every period has not reported yet what the period at `t_s` should use."""
        return self._errors.awaited(t_s, self.state.mode, timing.period_s, timing.error_age_s)

    def fresh_error(self, t_s: float, timing: PointingParams) -> PointingError | None:
        """Return the newest usable error, that of the sensor in use as long as it reports."""
        return newest(self._usable(t_s, timing), self.state.mode)

    def advance(
        self, t_s: float, window: Pass, motion: CommandedMotion, *, arriving: bool, ended: bool
    ) -> tuple[PointingError | None, Array | None]:
        """Decide the mode of the period at `t_s`; return the error that counted and where the beam was then (2,).

        `arriving`: the errors of now may still be those of the way to where the last mode began; `ended`: the pass is over.
        """
        errors = self._usable(t_s, motion.params)
        error = newest(errors, self.state.mode)
        before, beam = self.state, motion.beam.offset(error.t_s) if error else None
        known = motion.targets.covers(t_s, t_s)
        inputs = AutotrackInputs(
            t_s=t_s,
            request="idle" if ended else "calibrate" if self._calibrating else "track",
            target_available=motion.target_known(t_s, window),
            on_target=motion.on_target(t_s, window),
            carrier_to_noise_db_hz=error.carrier_to_noise_db_hz if error else -math.inf,
            axis_db_hz=self._carrier.level_db_hz(motion.range_m(t_s)) if known else -math.inf,
            monopulse_valid=trusted(errors, "monopulse"),
            conscan_valid=trusted(errors, "conscan"),
            arriving=arriving,
            fault=self._false_lock(error, beam, motion),
        )
        self.state = self._table.step(before, inputs)
        if self.state.mode != before.mode:
            self._carrier.forget()
            self._calibrating = self._calibrating and self.state.mode != "calibrate"
        return error, beam

    def _usable(self, t_s: float, timing: PointingParams) -> list[PointingError]:
        return self._errors.usable(t_s, timing.period_s, timing.error_age_s)

    def _false_lock(self, error: PointingError | None, beam: Array | None, motion: CommandedMotion) -> str:
        if self.state.mode != "monopulse" or error is None or beam is None or error.sensor != "monopulse":
            return ""
        return self._carrier.false_lock(error, beam, motion.range_m(error.t_s), self._table.params.carrier_off_db_hz)
