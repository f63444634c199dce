"""Conscan and step-track from carrier power, encoder angles and the controller's status.

A power waits until the encoders and the scan centre are known on either side of the middle of its
integration.  A sliding conscan window refers to an origin fixed to the prediction, not to the
centre: the centre moves with every correction, and samples from before a correction would
contradict those after it.  What is published is target minus centre at the newest sample.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from rf_pointing.core import CarrierPower, JointReading, Params, PointingError, Sensor, leaves, parameter
from rf_pointing.core.derived import BandNumbers, Rows
from rf_pointing.core.signals import BeamPosition, TimeBuffer
from rf_pointing.core.types import Array
from rf_pointing.tracking.conscan import ConscanTracker, DelayEstimator, DelayParams
from rf_pointing.tracking.conscan_design import ScanDesignParams, conscan_of_band, scan_for_accuracy
from rf_pointing.tracking.conscan_estimate import ConscanParams
from rf_pointing.tracking.sensors import SENSORS
from rf_pointing.tracking.steptrack import StepTracker, StepTrackParams, steptrack_of_band

# Sensors that are measured here, and the modes of the same names.
TRACKED = (Sensor.CONSCAN, Sensor.STEPTRACK)
# Node that runs it, by which a station description names its parameters.
NODE = SENSORS[Sensor.CONSCAN].node
# Longest period of a chosen scan: over two periods the error must stay the same.
LONGEST_TURN_S = 32.0
# What a choice changes of the station's scan.
CHOSEN = ("radius_deg", "period_s", "window_samples", "fewest_samples", "bandwidth_hz")
# While nothing is scanned, every second power is passed on for its C/N0.
IDLE_EVERY = 2
# A delay of the receiving chain is corrected once it is this sure.
DELAY_SIGMAS = 4.0
# How far a power may be ahead of the other streams; one stamped later would hold up all that
# follow.
LARGEST_LEAD_S = 5.0
# A power older than this against the one before means that time was set back, not that two came in
# the wrong order.
STEPPED_BACK_S = 60.0
# Farther from its origin a sample is not well described by the beam near its axis.
LARGEST_SHIFT_BEAMWIDTHS = 0.1
# No loop moves the beam so far between two statuses.
JUMP_BEAMWIDTHS = 0.1
# An answer to the centre's motion that is not of its size is the target's own motion.
GAIN_TOLERANCE = 0.3


@dataclass(frozen=True, kw_only=True)
class PowerTrackerParams(Params):
    """Both scans, as the node of this name declares them."""

    conscan: ConscanParams = parameter(ConscanParams(), "conical scan")
    steptrack: StepTrackParams = parameter(StepTrackParams(), "step-track")

    def scan_for_accuracy(self, carrier_to_noise_db_hz: float, wanted_sigma_rad: float) -> ConscanParams:
        """Return the scan that is known to this sigma per axis; ValueError out of reach."""
        limits = ScanDesignParams(longest_period_s=LONGEST_TURN_S)
        return scan_for_accuracy(self.conscan, limits, carrier_to_noise_db_hz, wanted_sigma_rad)


def scan_tuning(scan: Params) -> dict[str, object]:
    """Return what was chosen of a scan, by the names of a station description's `tuning`."""
    return {f"{Sensor.CONSCAN}.{name}": leaves(scan)[name][1] for name in CHOSEN}


def scans_of_band(of: BandNumbers) -> dict[str, Rows]:
    """Return the rows of both scans by the names of their parameter sets."""
    return {Sensor.CONSCAN.value: conscan_of_band(of), Sensor.STEPTRACK.value: steptrack_of_band(of)}


class CarrierTracker(Protocol):
    """A tracker of the carrier power, as `simulate_pass` runs it and as a node would."""

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles."""

    def take_status(self, t_s: float, scan_centre_rad: Array, offset_rad: Array, mode: str, sensor: str, /) -> None:
        """Note the controller's status, as `PowerTracker.take_status`."""

    def take_power(self, power: CarrierPower) -> list[PointingError]:
        """Take one carrier power; return the errors that it gives."""


class PowerTracker:
    """Feeds the tracker of the mode in force; silent while the pass uses neither of them."""

    def __init__(self, params: PowerTrackerParams) -> None:
        self.conscan, self.steptrack = ConscanTracker(params.conscan), StepTracker(params.steptrack)
        self._beam, self._centre = BeamPosition(), TimeBuffer()
        self._waiting: list[CarrierPower] = []
        self._mode, self._wanted = "", True
        self._idle = 0
        self._origin = np.zeros(2)
        self._refused, self._last_refusal = 0, ""
        self._newest_s, self._status_s = -np.inf, -np.inf
        self._delay_centre: Array | None
        self._since_delay: int
        self._forget_delay()

    @property
    def scanning(self) -> bool:
        """Whether a scan runs; encoder angles matter only then."""
        return bool(self._mode)

    @property
    def delay_s(self) -> float:
        """The delay of the receiving chain in use: configured, and what was learned beyond it."""
        return self.conscan.params.delay_s

    @property
    def rejections(self) -> tuple[int, str]:
        """How many samples could not be used, and why the last one could not."""
        return self._refused + self.conscan.state.rejected + self.steptrack.state.rejected, self._last_refusal

    def take_joints(self, reading: JointReading) -> None:
        """Note the encoder angles, while a scan runs."""
        if self.scanning:
            self._beam.take_joints(reading)

    def take_status(self, t_s: float, scan_centre_rad: Array, offset_rad: Array, mode: str, sensor: str) -> None:
        """Note the controller's status.

        `scan_centre_rad` (2,), axis angles, and its `offset_rad` (2,) on the sky from the
        prediction; the mode; the sensor that the pass may use.
        """
        self._wanted = sensor in (*TRACKED, Sensor.AUTO)
        scanned = mode if mode in TRACKED else ""
        # Samples of another scan, or from before it, are about another centre.
        if scanned != self._mode:
            self._mode = scanned
            self._waiting.clear()
            self._beam.clear()
            self._centre.clear()
            self.conscan.reset()
            self.steptrack.reset()
            self._forget_delay()
        # The prediction went ahead to where the target was found: samples from before it are about
        # another place.
        jump = offset_rad - (self._centre.values[-1] if self._centre.times else offset_rad)
        if float(np.hypot(*jump)) > JUMP_BEAMWIDTHS * self.conscan.params.half_power_beamwidth_rad:
            self._waiting.clear()
            self._centre.clear()
            self.conscan.reset()
            self._forget_delay()
        self._status_s = t_s
        self._beam.take_centre(t_s, scan_centre_rad)
        self._centre.add(t_s, offset_rad)

    def take_power(self, power: CarrierPower) -> list[PointingError]:
        """Add one carrier power; return an error for every one that could be placed.

        One from before the scan is dropped: where the beam was then is not known and never will be.
        While a window or a round is not complete the error is invalid, says so, carries the C/N0
        and has no covariance.
        """
        fault = self._fault(power)
        if fault:
            self._refused, self._last_refusal = self._refused + 1, fault
            return []
        self._newest_s = power.t_s
        if not self.scanning:
            self._idle += 1
            wanted = self._wanted and self._idle % IDLE_EVERY == 0
            return [_not_usable(power, Sensor.CONSCAN, "nothing is scanned")] if wanted else []
        self._waiting.append(power)
        errors = []
        while self._waiting:
            beam_s = self.conscan.beam_time_s(self._waiting[0])
            if self._beam.too_old(beam_s):
                del self._waiting[0]
                continue
            away, centre = self._beam.offset(beam_s), self._centre.at(beam_s)
            if away is None or centre is None:
                break
            before = self.rejections[0]
            errors.append(self._measure(self._waiting.pop(0), beam_s, away, centre))
            if self.rejections[0] > before:
                state = self.steptrack.state if self._mode == Sensor.STEPTRACK else self.conscan.state
                self._last_refusal = state.last_rejection
        # A stream that never comes must not let the queue grow.
        del self._waiting[: max(0, len(self._waiting) - self.conscan.params.window_samples)]
        return errors

    def _fault(self, power: CarrierPower) -> str:
        """Return why the power cannot even wait for its place, empty if it can."""
        if not np.isfinite([power.t_s, power.integration_s, power.carrier_to_noise_db_hz]).all():
            return "time, integration time and C/N0 of a carrier power must be finite"
        if not power.integration_s > 0.0:
            return f"integration_s={power.integration_s} must be > 0"
        if 0.0 <= self._newest_s - power.t_s < STEPPED_BACK_S:
            return f"t_s={power.t_s} must be later than that of the power before, {self._newest_s}"
        lead_s = power.t_s - self._status_s
        if self.scanning and lead_s > LARGEST_LEAD_S:
            return f"t_s={power.t_s} is {lead_s:.1f} s after the newest status: where the beam will be is not known"
        return ""

    def _measure(self, power: CarrierPower, beam_s: float, away: Array, centre: Array) -> PointingError:
        """Return the error of the centre at `beam_s`, the beam being `away` (2,) from it."""
        if self._mode == Sensor.STEPTRACK:
            error = self.steptrack.add(power, float(away[0]), float(away[1]))
            counts = self.steptrack.state.counts
            if error is None:
                return _not_usable(power, Sensor.STEPTRACK, f"round holds {min(counts)} samples on its poorest point")
            return replace(error, t_s=beam_s)
        self._follow_centre(centre)
        beam = away + centre - self._origin
        error = self.conscan.add(power, float(beam[0]), float(beam[1]))
        if error is None:
            filled = len(self.conscan.state.window)
            missing = f"window holds {filled} of {self.conscan.params.fewest_samples} samples"
            return _not_usable(power, Sensor.CONSCAN, missing)
        x_rad = error.cross_elevation_rad + float(self._origin[0] - centre[0])
        y_rad = error.elevation_rad + float(self._origin[1] - centre[1])
        error = replace(error, t_s=beam_s, cross_elevation_rad=x_rad, elevation_rad=y_rad)
        self._learn_delay(error, centre)
        return error

    def _follow_centre(self, centre: Array) -> None:
        """Keep the window's origin near the centre, so that its samples stay within the beam."""
        params, moved = self.conscan.params, centre - self._origin
        if not len(self.conscan.state.window):
            self._origin = centre
        elif float(np.hypot(*moved)) > LARGEST_SHIFT_BEAMWIDTHS * params.half_power_beamwidth_rad:
            self.conscan.recentre(float(moved[0]), float(moved[1]))
            self._origin = centre

    def _learn_delay(self, error: PointingError, centre: Array) -> None:
        """Compare the estimates of separate windows with how the centre was moved between them."""
        self._since_delay += 1
        if self._since_delay < self.conscan.params.window_samples:
            return
        moved = np.zeros(2) if self._delay_centre is None else centre - self._delay_centre
        self._since_delay, self._delay_centre = 0, centre
        self._delay.add(error, float(moved[0]), float(moved[1]))
        found = self._delay.estimate()
        if found is None or abs(found.delay_s) <= DELAY_SIGMAS * found.sigma_s:
            return
        if abs(found.gain - 1.0) < GAIN_TOLERANCE:
            self.conscan.retune(self.conscan.params.replace(delay_s=self.delay_s + found.delay_s))
            self._forget_delay()

    def _forget_delay(self) -> None:
        self._delay = DelayEstimator(DelayParams(period_s=self.conscan.params.period_s))
        self._delay_centre, self._since_delay = None, 0


def _not_usable(power: CarrierPower, sensor: str, reason: str) -> PointingError:
    return PointingError(
        t_s=power.t_s - 0.5 * power.integration_s, sensor=sensor, cross_elevation_rad=0.0,
        elevation_rad=0.0, carrier_to_noise_db_hz=power.carrier_to_noise_db_hz, valid=False,
        reason=reason,
    )  # fmt: skip
