"""The goals of the pointing controller: which pass is meant, when it is stepped, how it ends.

A goal gives its pass, or a satellite whose pass the ephemeris finds.  A pass that is refused has
moved nothing, and the reason is the outcome of its goal.  A period is held while what it should use
may still arrive; simulated time waits for its status.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from rf_pointing.calibration import BiasModel
from rf_pointing.core import DESIGNATED, SCANNED, JointReading, JointTrajectory, utc_text
from rf_pointing.ephemeris import Pass
from rf_pointing.planning import Certificate
from rf_pointing.station.pointing.certificates import StoreParams, store_certificate
from rf_pointing.station.pointing.controller import PointingController, WiderBand
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.status import Level, Report, TrackingStatus
from rf_pointing.tracking.scan_program import ScanProgram, ScanProgramParams
from rf_pointing.tracking.sensors import SENSOR_CHOICES, sensors_of

FEEDBACK_S = 5.0
"""Node time between two feedbacks of one mode and level; `tracking_status` has every period."""
TEMPERATURE_STEP_K = 0.1
LONGEST_WAIT_S = 0.05
"""Wall time that a period waits for what it should use; commands start after 0.1 s."""
PATIENCE_WALL_S = 30.0
"""Wall time that a goal waits for its pass or certificate, also while simulated time is held."""
SCAN_SPARE_S = 1800.0
"""Time beyond a commanded scan that its pass needs: the slew to the target."""
LONGEST_SCANNED_S = 20.0 * 3600.0
"""Longest pass that is scanned: the Moon sets, a geostationary satellite does not."""
NEAR_S = 3600.0
"""How far from the requested time a pass may lie: less than an orbit."""


@dataclass(frozen=True, kw_only=True)
class PassGoal:
    """A pass to track: `window`, or that of a satellite nearest to `near_t_s` (0: the next one).

    Without a `band` it is tracked in the one that is in use.
    With a `scan` it ends with the scan, which begins as soon as the axes are on the target.
    """

    window: Pass | None = None
    satellite: str = ""
    near_t_s: float = 0.0
    minimum_peak_elevation_rad: float = 0.0
    sensor: str = ""
    band: str = ""
    scan: ScanProgramParams | None = None

    @property
    def designated(self) -> bool:
        """Whether reports lead to the target, and no orbit."""
        return self.satellite.split(" ")[0] == DESIGNATED

    def search_from_s(self, now_s: float) -> float:
        """Return the time from which passes of the satellite are looked for, 0 for now."""
        if not self.near_t_s:
            return 0.0
        # Passes that are over are looked for only where the time is over, too: to say so.
        early_s = self.near_t_s - NEAR_S
        return early_s if self.near_t_s <= now_s else max(early_s, now_s)


class Search(Protocol):
    """An answer of the ephemeris that is waited for; `made` is whether it could be requested."""

    @property
    def made(self) -> bool: ...
    def done(self) -> bool: ...
    def passes(self) -> Sequence[Pass]: ...


class Port(Protocol):
    """World outside of the goals.

    `joints` returns the newest reading up to a time, None without a new one; `difference` which
    nodes run on another station description or band, "" if none does.  `use_band` takes the band of
    a goal and returns whether the nodes have to follow; ValueError refuses it.  `warn` informs an
    operator at once of another level of alarm, and `end_goal` a client that its goal has an
    `outcome`.
    """

    def joints(self, until_s: float) -> JointReading | None: ...
    def difference(self) -> str: ...
    def band(self) -> str: ...
    def use_band(self, goal: PassGoal) -> bool: ...
    def find(self, goal: PassGoal, from_s: float) -> Search: ...
    def publish(self, t_s: float, trajectory: JointTrajectory | None, status: TrackingStatus) -> None: ...
    def show(self, certificate: Certificate) -> None: ...
    def feed_back(self, progress: float) -> None: ...
    def warn(self, alarm: str) -> None: ...
    def error(self, words: str) -> None: ...
    def end_goal(self) -> None: ...


class PassGoals:
    """Steps a pointing controller for one goal at a time, and without one.

    `due` once a period and `turn` between events, with node time and a steady clock.
    """

    def __init__(
        self, controller: PointingController, port: Port, sensor_of: Callable[[str], str], store: StoreParams
    ) -> None:
        self.controller = controller
        self.longest_wait_s = LONGEST_WAIT_S
        self.window: Pass | None = None
        """The pass of the newest goal, once it is known."""
        self._port, self._sensor_of, self._store = port, sensor_of, store
        self._goal: PassGoal | None = None
        self._search: Search | None = None
        self._changing = self._lacks_model = False
        """Whether nodes have yet to take the band of the goal, and its bias model to come."""
        # When and in which band the pass in hand goes on, while that is done; since when nodes
        # follow, by the steady clock; a band that cannot be taken.
        self._taking: tuple[float, str] | None = None
        self._following_s: float | None = None
        self._barred_band = ""
        self._refusal, self._cancelled, self._scanned = "", False, False
        self._begun_wall_s = 0.0
        # Mode and level of the last feedback, and when the next one is due.
        self._fed_back: tuple[Any, ...] = ()
        self._feedback_due_s = 0.0
        # The period that waits, and until when by the steady clock.
        self._period: tuple[float, float] | None = None
        self._issued: Certificate | None = None
        self._alarm: tuple[int, str] = Level.OK, ""
        self._model: BiasModel | None = None
        self._model_band = ""
        self._temperature_k: float | None = None
        self._no_temperature = ""

    @property
    def busy(self) -> bool:
        """Whether there is a goal."""
        return self._goal is not None

    @property
    def _waits(self) -> bool:
        """Whether the pass of the goal has yet to be found, or its band to be taken."""
        return self._changing or self._search is not None

    def retune(self, params: ControllerParams, store: StoreParams) -> None:
        """Use new parameters from the next period on."""
        self.controller.retune(params)
        self._store = store

    def use_band(
        self, params: ControllerParams, model: BiasModel, wider: WiderBand | None = None, *, calibrated: bool
    ) -> None:
        """Go on with the numbers of another band, and `model` until the calibrator sends one."""
        if self._taking is not None:
            # The pass goes on, with the model of before until that of the band comes.
            self.controller.go_on_in_band(*self._taking)
            if not calibrated:
                self.controller.take_model(model)
            return
        self.controller = self.controller.in_band(params, wider)
        self.controller.take_model(model)
        self._lacks_model, self._no_temperature = calibrated, ""
        if self._model_band:
            self._model = None
        self._use_model()

    def take_model(self, model: BiasModel, band: str = "") -> None:
        """Use a bias model of a band, "" for any, at the present temperature."""
        self._model, self._model_band, self._lacks_model = model, band, False
        self._use_model()

    def take_temperature(self, temperature_k: float) -> None:
        """Take the temperature of the mount; the offsets follow it in steps."""
        if self._temperature_k is None or abs(temperature_k - self._temperature_k) > TEMPERATURE_STEP_K:
            self._temperature_k = temperature_k
            self._use_model()

    def _use_model(self) -> None:
        if self._model is None:
            return
        try:
            self.controller.take_model(self._model.at_temperature(self._temperature_k))
            self._no_temperature = ""
        except ValueError as error:
            self._no_temperature = f"{error} on weather/temperature"

    # Goals

    def begin(self, goal: PassGoal, t_s: float, wall_s: float) -> None:
        """Start the pass of a goal, or look for it first; a refused goal ends at once."""
        self._goal, self._begun_wall_s = goal, wall_s
        self._refusal, self._cancelled, self.window = "", False, goal.window
        self._barred_band = ""
        self._fed_back, self._scanned = (), goal.scan is not None
        try:
            self._changing = self._port.use_band(goal)
            if not self._changing:
                self._look_for(goal, t_s, wall_s)
        except ValueError as error:
            self.refuse(str(error))

    def _look_for(self, goal: PassGoal, t_s: float, wall_s: float) -> None:
        # Known without the ephemeris, which would change its target for nothing.
        self._require_fit()
        if goal.window is not None:
            self._start(goal.window, t_s)
        else:
            self._search = self._port.find(goal, goal.search_from_s(t_s))
            self._take_passes(t_s, wall_s)

    def _follow_band(self, goal: PassGoal, t_s: float, wall_s: float) -> None:
        """Go on with the goal once every node has its band, or refuse it after a while."""
        lacks = f"no bias model of the {self._port.band()} band" if self._lacks_model else ""
        waits = self._difference() or lacks
        if waits and (waited_s := wall_s - self._begun_wall_s) <= PATIENCE_WALL_S:
            return
        self._changing = False
        try:
            if waits:
                raise ValueError(f"{waits}, waited {waited_s:.0f} s")
            self._look_for(goal, t_s, wall_s)
        except ValueError as error:
            self.refuse(str(error))

    def _advance(self, t_s: float, wall_s: float) -> None:
        """Go on with a goal whose pass has not been started, or is in another band by now."""
        since_s = self._following_s
        if since_s is not None and (not self._port.difference() or wall_s - since_s > PATIENCE_WALL_S):
            self._following_s, self.controller.deaf = None, False
        if self._goal is not None and self._cancelled and self._changing:
            self.refuse("the goal was cancelled")
        elif self._goal is not None and self._changing:
            self._follow_band(self._goal, t_s, wall_s)
        else:
            self._take_passes(t_s, wall_s)

    def _take_passes(self, t_s: float, wall_s: float) -> None:
        """Start the pass that the ephemeris has found, or refuse the goal after a while."""
        search, goal = self._search, self._goal
        if search is None or goal is None:
            return
        if self._cancelled:
            self.refuse("the goal was cancelled")
        elif search.done():
            self._search = None
            try:
                self._require_fit()
                self._start(nearest_pass(search.passes(), goal.near_t_s), t_s)
            except ValueError as error:
                self.refuse(str(error))
        # A node that is started with this one, or again, may be there a moment later.
        elif (waited_s := wall_s - self._begun_wall_s) > PATIENCE_WALL_S:
            why = "does not answer" if search.made else "is not active"
            who = "target_designate" if goal.designated else "ephemeris_publisher"
            self.refuse(f"no pass of {goal.satellite!r} is known: {who} {why}, waited {waited_s:.0f} s")

    def _require_fit(self) -> None:
        """ValueError where no pass can be tracked now."""
        if reason := self._difference() or self._no_temperature:
            raise ValueError(reason)

    def _difference(self) -> str:
        difference = self._port.difference()
        return f"the nodes run on different station descriptions: {difference}" if difference else ""

    def _start(self, window: Pass, t_s: float) -> None:
        assert self._goal is not None
        if (scan := self._goal.scan) is not None:
            # No more of it is certified: what never sets goes round the station.
            end_s = max(t_s, window.aos_t_s) + ScanProgram(scan).duration_s + SCAN_SPARE_S
            window = replace(window, los_t_s=min(window.los_t_s, end_s))
        self.window = window
        try:
            self._read_joints(t_s)
            sensor = self._sensor_of(self._goal.sensor)
            if window.duration_s > LONGEST_SCANNED_S and any(each.scans for each in sensors_of(SENSOR_CHOICES[sensor])):
                raise ValueError(
                    f"this pass of {window.name} lasts {window.duration_s / 3600.0:.1f} h, and {sensor} would turn the "
                    "antenna all the time: `station service` holds what never sets"
                )
            self.controller.start(t_s, window, sensor, self._goal.scan)
        finally:
            self._show_certificate()

    def refuse(self, reason: str) -> None:
        """End the goal with the reason for which its pass is not tracked."""
        self._refusal = reason
        self._port.error(f"pass refused: {reason}")
        self._end()

    def reject(self, reason: str) -> None:
        """Refuse a goal that cannot be read."""
        self.window = None
        self.refuse(reason)

    def _end(self) -> None:
        self._goal = self._search = None
        self._changing = False
        self._port.end_goal()

    def cancel(self) -> None:
        """End the goal at the request of its client."""
        # A goal that waits for its pass is ended by `_take_passes`.
        self._cancelled = True
        self.controller.stop("the goal was cancelled")

    def stop(self, reason: str) -> bool:
        """End the pass under control, or the search for it; return whether there is one."""
        if self._waits:
            self.refuse(reason)
            return True
        busy = self.controller.busy
        self.controller.stop(reason)
        return busy

    def outcome(self) -> dict[str, Any]:
        """Return what became of the newest goal, by the fields of its result."""
        core = self.controller
        if self._refusal:
            return {"message": self._refusal, "fault": core.antenna.fault, "predicted_loss": -1.0}
        statistics, certificate = core.statistics, core.plan.certificate
        seen = statistics.outcome
        why = seen.why_not_tracked(statistics.reason, statistics.fault, core.params.machine.least_share)
        if self._scanned:
            early = f"the scan is not complete: {statistics.reason}"
            why = "" if statistics.reason == SCANNED else early
        right_rad, up_rad = statistics.rms_rad
        return {
            "success": not why, "message": why or statistics.reason, "fault": statistics.fault,
            "seconds_tracked": float(seen.tracked_s), "seconds_lost": float(seen.lost_s),
            "rms_cross_elevation_error": right_rad, "rms_elevation_error": up_rad, "mean_loss": float(seen.mean_loss_db),
            "predicted_loss": certificate.chosen.mean_loss_db if certificate and certificate.chosen else -1.0,
        }  # fmt: skip

    # Periods

    def due(self, t_s: float, now_s: float, wall_s: float) -> None:
        """Begin the period at `t_s`; what is on its way may still arrive for it."""
        self._finish_period()
        self._certify(now_s, wall_s)
        if self.controller.missing or self._waits:
            # Simulated time waits for the status of this period, so it does not run ahead of the
            # pass of a goal, or of its certificate, on a busy machine.
            self._period = (t_s, math.inf)
        elif self.controller.awaits_input(t_s) or self._following_s is not None:
            self._period = (t_s, wall_s + self.longest_wait_s)
        else:
            self._step(t_s)
        self._take_band(t_s, wall_s)

    def _take_band(self, t_s: float, wall_s: float) -> None:
        """Let the pass in hand go on in the band that it wants by now; then the nodes follow."""
        core = self.controller
        band = core.wanted_band
        if not band or band == self._barred_band or self._following_s is not None:
            return
        self._taking = t_s, band
        try:
            self._port.use_band(replace(self._goal or PassGoal(), band=band))
            # What is measured meanwhile may be of either band.
            self._following_s, core.deaf = wall_s, True
        except ValueError as error:
            self._barred_band = band
            core.stop(str(error))
            self._port.error(str(error))
        finally:
            self._taking = None

    def turn(self, now_s: float, wall_s: float) -> float:
        """Finish a period that has waited long enough; return how long there is nothing to do."""
        self._advance(now_s, wall_s)
        self._certify(now_s, wall_s)
        if self._period is None:
            return math.inf
        t_s, until_s = self._period
        waits = self._waits or self.controller.missing or self.controller.awaits_input(t_s)
        waits = waits or self._following_s is not None
        if waits and until_s > wall_s:
            return until_s - wall_s
        self._finish_period()
        return 0.0

    def deactivate(self, now_s: float) -> None:
        """End the pass in hand under control."""
        self._finish_period()
        self.stop("the controller was deactivated")
        self._step(now_s)

    def _certify(self, now_s: float, wall_s: float) -> None:
        """Issue the certificate of a goal that waits for it, or refuse the goal after a while."""
        core = self.controller
        if self._goal is None or not core.missing:
            return
        self._read_joints(now_s)
        if not core.missing and (difference := self._difference()):
            core.stop(difference)
        core.certify(now_s)
        self._show_certificate()
        if (waited_s := wall_s - self._begun_wall_s) > PATIENCE_WALL_S:
            core.refuse_incomplete(waited_s)
        # While time is held there is no period that would end a refused pass.
        if core.stopping:
            self._period = None
            self._step(now_s)

    def _finish_period(self) -> None:
        if self._period is not None:
            (t_s, _), self._period = self._period, None
            self._step(t_s)

    def _step(self, t_s: float) -> None:
        core = self.controller
        # Readings of the period that ends now may have arrived or not: they belong to the next one.
        self._read_joints(t_s - core.params.pointing.period_s)
        busy = core.busy
        trajectory, status = core.step(t_s)
        self.window = core.window or self.window if busy else self.window
        self._show_certificate()
        self._port.publish(t_s, trajectory, status)
        was, self._alarm = self._alarm, (status.level, status.alarm)
        if status.level != was[0]:
            self._port.warn(status.alarm)
        # A goal whose pass is still looked for has nothing to feed back.
        if self._goal is None or self._waits or self.window is None:
            return
        now = status.mode, status.level
        if now != self._fed_back or status.t_s >= self._feedback_due_s:
            self._fed_back, self._feedback_due_s = now, status.t_s + FEEDBACK_S
            share = (status.t_s - self.window.aos_t_s) / max(self.window.duration_s, 1.0)
            self._port.feed_back(min(max(share, 0.0), 1.0))
        if busy and not core.busy:
            certificate = core.plan.certificate
            if certificate is None or certificate.chosen is None:
                self.refuse(core.statistics.reason)
            else:
                self._end()

    def _read_joints(self, until_s: float) -> None:
        reading = self._port.joints(until_s)
        if reading is not None:
            self.controller.take_joints(reading)

    def _show_certificate(self) -> None:
        """Publish and store the certificate that was issued since the last call, if one was."""
        certificate = self.controller.plan.certificate
        if certificate is None or certificate is self._issued:
            return
        self._issued, certificate = certificate, replace(certificate, band=self._port.band())
        self._port.show(certificate)
        try:
            store_certificate(self._store, certificate)
        except OSError as error:
            self._port.error(f"certificate not stored: {error}")

    def report(self) -> Report:
        """Return the worst that is known of the pass and its goal."""
        core, state = self.controller, self.controller.state
        learned = core.corrections.filter.state
        values: dict[str, object] = {
            "mode": state.mode, "reason": state.reason, "false_locks": core.carrier.faults,
            "last_false_lock": core.carrier.last_fault,
            "along_track_s": round(float(learned.mean[0]), 5),
            "cross_track_m": round(float(learned.mean[1]), 2), "trim_used": learned.used,
            "trim_refused": learned.refused,
        }  # fmt: skip
        level, alarm = self._alarm
        causes = (
            (Level(level), alarm), (Level.WARN, self._no_temperature), (Level.ERROR, self._refusal),
            (Level.WARN, core.model_doubt), (Level(level), state.mode),
        )  # fmt: skip
        return next(Report(worst, words, values) for worst, words in causes if words)


def nearest_pass(passes: Sequence[Pass], near_s: float) -> Pass:
    """Return the pass at, or nearest to, `near_s` (UTC, s since 1970), the first where that is 0.

    Raises
    ------
    ValueError
        Without any pass, and when the nearest is farther than `NEAR_S`.
    """
    if not passes:
        raise ValueError("ephemeris_publisher has found no pass")
    if not near_s:
        return passes[0]

    def distance_s(window: Pass) -> float:
        return max(window.aos_t_s - near_s, near_s - window.los_t_s, 0.0)

    found = min(passes, key=distance_s)
    if distance_s(found) > NEAR_S:
        raise ValueError(
            f"{found.name} has no pass within {NEAR_S / 60.0:.0f} min of {utc_text(near_s)}; "
            f"the next one begins at {utc_text(found.aos_t_s)}"
        )
    return found
