"""Executable `pointing_controller`: the only author of motion.

Subscribes: target, joint_states, antenna_status, pointing_error, pointing_model, pass_profiles;
weather/temperature (sensor_msgs/Temperature) for the thermal terms of a model, without which a pass
is refused.
Publishes: joint_trajectory (10 Hz while a pass is tracked), tracking_status (10 Hz),
pass_certificate (latched).
Action: track_pass (rf_pointing_msgs/TrackPass); a pass by satellite and time is one that
ephemeris_publisher/select_target finds.
Services (std_srvs/Trigger): ~/stop ends the pass under control; ~/calibrate runs the circle on
which the monopulse tracker calibrates its feed.
Parameters: those of `ControllerParams`, certificate_folder (where every certificate is stored
as a file; empty: nowhere), and command_key_file (the key that signs joint_trajectory).
"""

import math
import time
from collections.abc import Sequence
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import (
    AntennaStatus,
    Pass,
    PassCertificate,
    PassProfileList,
    PointingError,
    PointingModel,
    Target,
    TrackingStatus,
)
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import JointState, Temperature
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from rf_pointing.calibration import BiasModel
from rf_pointing.core import Sensor
from rf_pointing.core.dates import utc_text
from rf_pointing.core.pass_outcome import LOSS_OF_SIGNAL
from rf_pointing.ros import convert, convert_calibration, convert_planning
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.diagnostics import ERROR, LEVELS, WARN, Health
from rf_pointing.ros.graph import STATION_IN_USE, TEMPERATURE
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import RESULT_TIMEOUT_S, conclude
from rf_pointing.ros.qos import COMMAND, IN_USE, LATCHED, STATUS, STREAM
from rf_pointing.ros.repeated_call import RepeatedCall
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_node import ClockWatch, ExecutiveWatch, StationCensus, StationInUse, StationNode
from rf_pointing.station.pointing.certificates import StoreParams, store_certificate
from rf_pointing.station.pointing.controller import PointingController
from rf_pointing.station.pointing.params import ControllerParams
from rf_pointing.station.pointing.status import TrackingStatus as Status
from rf_pointing.tracking.sensors import load_trackers

LIVE = {
    "axes": True,
    "alarm": True,
    "limits": True,
    "autotrack": True,
    "pointing": ("on_target_deg", "error_age_s", "stop_deceleration_deg_s2", "lag_averaging_s"),
}
"""What may change while the node is configured; the timing of the commands may not."""
FEEDBACK_EVERY = 10
TEMPERATURE_STEP_K = 0.1
LONGEST_WAIT_S = 0.05
"""Wall time that a period waits for the error of the one before; commands start after 0.1 s."""
PLAN_PATIENCE_WALL_S = 30.0
"""Wall time that a goal waits for its pass or certificate, also while simulated time is held."""
NEAR_S = 3600.0
"""How far from the requested time a pass may lie: less than an orbit."""


class PointingControllerNode(StationNode):
    """Runs the pointing controller once a period; a goal ends when the controller ends the pass."""

    def __init__(self) -> None:
        super().__init__("pointing_controller")
        # Before the declarations: `autotrack.sensor` takes their names.
        load_trackers()
        for prefix, defaults in ControllerParams().sets().items():
            self.parameters.declare(prefix, defaults, live=LIVE.get(prefix, False))
        self.parameters.declare("", StoreParams(), live=True)
        self.parameters.declare("", CommandKeyParams(), group="key")
        self.parameters.on_change(self._retune)
        self._controller: PointingController | None = None
        self._goal: Any = None
        self._window = Pass()
        """The pass of the goal, once it is known."""
        # The pass that is looked for, and what the ephemeris answers once it could be called.
        self._wanted: SelectTarget.Request | None = None
        self._selection: RepeatedCall | None = None
        """The answer of the ephemeris to a goal by name, while it is waited for."""
        self._ephemeris = self.create_client(SelectTarget, "ephemeris_publisher/select_target")
        self._steps = 0
        self._period: tuple[float, float] | None = None
        self._refusal = ""
        self._accepted_wall_s = 0.0
        self._alarm = 0, ""
        self._action = ActionServer(
            self, TrackPass, "track_pass", self._conclude, goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted, cancel_callback=self._on_cancel, result_timeout=RESULT_TIMEOUT_S,
        )  # fmt: skip

    def configure(self) -> None:
        self._controller = PointingController(self._params())
        self._commands = self.publisher(JointTrajectory, "joint_trajectory", COMMAND)
        self._key = CommandKey(self.parameters.value("key"), self.resolve_topic_name("joint_trajectory"))
        self._status = self.stream(TrackingStatus, "tracking_status", STREAM)
        self._certificates = self.stream(PassCertificate, "pass_certificate", LATCHED)
        self._issued: object = None
        self._sent = 0
        core = self._controller
        self.listen(Target, "target", lambda m: core.take_target(convert.target_from_message(m)), STREAM)
        self._joints = self.listen_latest(JointState, "joint_states", convert.joints_from_message, STREAM, steady=True)
        self.listen(AntennaStatus, "antenna_status", lambda m: core.take_antenna(m.mode, m.fault), STATUS, steady=True)
        self.listen(PointingError, "pointing_error", lambda m: core.take_error(convert.error_from_message(m)), STREAM)
        self._model: BiasModel | None = None
        self._temperature_k: float | None = None
        self._unfed = ""
        self.listen(PointingModel, "pointing_model", self._on_model, LATCHED)
        self.listen(Temperature, TEMPERATURE, self._on_temperature, STREAM)
        self.listen(PassProfileList, "pass_profiles", self._on_profiles, LATCHED)
        self._census = StationCensus()
        self.listen(StationInUse, STATION_IN_USE, self._census.note, IN_USE)
        self.serve(Trigger, "~/stop", self._on_stop)
        self.serve(Trigger, "~/calibrate", self._on_calibrate)
        self.diagnostics.add("tracking", self._health)
        ExecutiveWatch(self)
        ClockWatch(self)

    def activate(self) -> None:
        self.every(self._controller.params.pointing.period_s, self._due)

    def deactivate(self) -> None:
        self._finish_period()
        self._stop("the controller was deactivated")
        self._step(self.now_s())

    def _due(self, t_s: float) -> None:
        """Begin the period at `t_s`; what is on its way may still arrive for it."""
        self._finish_period()
        self._certify()
        if self._controller.missing or self._wanted is not None:
            # Simulated time waits for the status of this period, so it does not run ahead of the
            # pass of a goal, or of its certificate, on a busy machine.
            self._period = (t_s, math.inf)
        elif self._controller.awaits_error(t_s):
            self._period = (t_s, time.perf_counter() + LONGEST_WAIT_S)
        else:
            self._step(t_s)

    def turn(self) -> float:
        """Finish a period that has waited long enough."""
        self._take_selection()
        self._certify()
        if self._period is None:
            return super().turn()
        t_s, deadline_s = self._period
        left_s = deadline_s - time.perf_counter()
        waiting = self._wanted is not None or self._controller.missing
        if left_s > 0.0 and (waiting or self._controller.awaits_error(t_s)):
            return min(left_s, super().turn())
        self._finish_period()
        return 0.0

    def _certify(self) -> None:
        """Issue the certificate of a goal that waits for it, or refuse the goal after a while."""
        core = self._controller
        if self._goal is None or not core.missing:
            return
        now_s, waited_s = self.now_s(), time.perf_counter() - self._accepted_wall_s
        self._read_joints(now_s)
        if not core.missing and (difference := self._difference()):
            core.stop(difference)
        core.certify(now_s)
        self._show_certificate()
        if waited_s > PLAN_PATIENCE_WALL_S:
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
        # Those of the period that ends now may have arrived or not: they belong to the next one.
        self._read_joints(t_s - self._controller.params.pointing.period_s)
        busy = self._controller.busy
        trajectory, status = self._controller.step(t_s)
        self._show_certificate()
        if trajectory is not None:
            command = convert.trajectory_to_message(trajectory, t_s)
            self._key.sign(command, self.get_fully_qualified_name())
            self._commands.publish(command)
            self._sent += 1
        message = convert.tracking_status_to_message(status)
        message.commands_sent = self._sent
        self._status.publish(message)
        self._warn(status)
        # A goal whose pass is still looked for has nothing to feed back.
        if self._goal is not None and self._wanted is None:
            self._steps += 1
            if self._steps % FEEDBACK_EVERY == 0:
                self._feed_back(message, status)
            if busy and not self._controller.busy:
                certificate = self._controller.plan.certificate
                if certificate is None or certificate.chosen is None:
                    self._refuse(self._controller.statistics.reason)
                else:
                    self._end_goal()

    def _refuse(self, reason: str) -> None:
        """End the goal with the reason for which its pass is not tracked."""
        self._refusal = reason
        self.get_logger().error(f"pass refused: {reason}")
        self._end_goal()

    def _end_goal(self) -> None:
        goal, self._goal, self._wanted, self._selection = self._goal, None, None, None
        goal.execute()

    def _warn(self, status: Status) -> None:
        """Publish the diagnostics at once when their level changes: an operator waits for that."""
        if status.level != self._alarm[0]:
            self._alarm = status.level, status.alarm
            self.diagnostics.publish()
            if status.alarm:
                self.get_logger().warning(status.alarm)
        self._alarm = status.level, status.alarm

    def _on_model(self, message: PointingModel) -> None:
        self._model = convert_calibration.model_from_message(message)
        self._use_model()

    def _on_temperature(self, message: Temperature) -> None:
        """Take the temperature of the mount; the offsets follow it in steps."""
        now_k = convert.temperature_from_message(message)
        if self._temperature_k is None or abs(now_k - self._temperature_k) > TEMPERATURE_STEP_K:
            self._temperature_k = now_k
            self._use_model()

    def _use_model(self) -> None:
        if self._model is None:
            return
        try:
            self._controller.take_model(self._model.at_temperature(self._temperature_k))
            self._unfed = ""
        except ValueError as error:
            self._unfed = f"{error} on {TEMPERATURE}"

    def _on_profiles(self, message: PassProfileList) -> None:
        profiles = [convert_planning.profile_from_message(profile) for profile in message.profiles]
        self._controller.plan.take_profiles(profiles)

    def _show_certificate(self) -> None:
        """Publish and store the certificate that was issued since the last call, if one was."""
        certificate = self._controller.plan.certificate
        if certificate is None or certificate is self._issued:
            return
        self._issued = certificate
        self._certificates.publish(convert_planning.certificate_to_message(certificate))
        try:
            store_certificate(self.parameters.value(""), certificate)
        except OSError as error:
            self.get_logger().error(f"certificate not stored: {error}")

    def _read_joints(self, until_s: float) -> None:
        reading = self._joints.take(until_s)
        if reading is not None:
            self._controller.take_joints(reading)

    def _feed_back(self, message: TrackingStatus, status: Status) -> None:
        window = convert_planning.pass_from_message(self._window)
        share = (status.t_s - window.aos_t_s) / max(window.duration_s, 1.0)
        feedback = TrackPass.Feedback(status=message, progress=min(max(share, 0.0), 1.0), target_pass=self._window)
        self._goal.publish_feedback(feedback)

    def _on_goal(self, _request: TrackPass.Goal) -> GoalResponse:
        if self.active and self._goal is None:
            return GoalResponse.ACCEPT
        self.get_logger().error("goal refused: " + ("another pass is tracked" if self.active else "not active"))
        return GoalResponse.REJECT

    def _on_accepted(self, goal: Any) -> None:
        """Start the pass, or look for it first.

        The goal is executed only when the pass is over: a callback that waited for the end would
        have to await a future, which this executor polls in a busy loop.
        """
        self._goal, self._accepted_wall_s = goal, time.perf_counter()
        self._refusal, self._window = "", Pass()
        try:
            if goal.request.satellite:
                self._wanted = self._selection_of(goal.request)
                self._take_selection()
            else:
                self._start(goal.request.target_pass)
        except ValueError as error:
            self._refuse(str(error))

    def _selection_of(self, request: TrackPass.Goal) -> SelectTarget.Request:
        """Return the request to the ephemeris for a goal by name."""
        if request.target_pass.target:
            raise ValueError(
                f"satellite={request.satellite!r} and a target_pass of {request.target_pass.target!r}: give one of them"
            )
        # Known without the ephemeris, which would change its target for nothing.
        self._require_fit()
        wanted = SelectTarget.Request(target=request.satellite, minimum_peak_elevation=request.minimum_peak_elevation)
        if near_s := seconds_from_stamp(request.near):
            now_s = self.now_s()
            # Passes that are over are looked for only where the time is over, too: to say so.
            wanted.start = stamp_from_seconds(near_s - NEAR_S if near_s <= now_s else max(near_s - NEAR_S, now_s))
        return wanted

    def _take_selection(self) -> None:
        """Start the pass that the ephemeris has found, or refuse the goal after a while."""
        if self._wanted is None:
            return
        if self._goal.is_cancel_requested:
            self._refuse("the goal was cancelled")
            return
        if self._selection is None:
            self._selection = RepeatedCall(self._ephemeris, self._wanted)
        # A node that is started with this one, or again, may be there a moment later.
        if not self._selection.done():
            waited_s = time.perf_counter() - self._accepted_wall_s
            if waited_s > PLAN_PATIENCE_WALL_S:
                why = "does not answer" if self._selection.made else "is not active"
                name = self._goal.request.satellite
                self._refuse(f"no pass of {name!r} is known: ephemeris_publisher {why}, waited {waited_s:.0f} s")
            return
        answer, self._wanted, self._selection = self._selection.result(), None, None
        try:
            if not answer.success:
                raise ValueError(answer.message)
            self._start(nearest_pass(answer.passes, seconds_from_stamp(self._goal.request.near)))
        except ValueError as error:
            self._refuse(str(error))

    def _require_fit(self) -> None:
        """ValueError where no pass can be tracked now."""
        if difference := self._difference():
            raise ValueError(difference)
        if self._unfed:
            raise ValueError(self._unfed)

    def _start(self, window: Pass) -> None:
        self._window, sensor, now_s = window, self._goal.request.sensor, self.now_s()
        try:
            self._require_fit()
            self._read_joints(now_s)
            assert self.station is not None
            sensor = sensor or next(iter(self.station.sensors(self.band)), Sensor.PROGRAM)
            sensor = self.station.chosen_sensor(sensor, self.band)
            self._controller.start(now_s, convert_planning.pass_from_message(window), sensor)
        finally:
            self._show_certificate()

    def _stop(self, reason: str) -> bool:
        """End the pass under control, or the search for it; return whether there is one."""
        if self._wanted is not None:
            self._refuse(reason)
            return True
        busy: bool = self._controller.busy
        self._controller.stop(reason)
        return busy

    def _difference(self) -> str:
        """Return "" or which nodes run on another station."""
        difference = self._census.difference(self)
        return f"the nodes run on different station descriptions: {difference}" if difference else ""

    def _on_cancel(self, _goal: Any) -> CancelResponse:
        # A goal that waits for its pass is ended by `_take_selection`.
        self._controller.stop("the goal was cancelled")
        return CancelResponse.ACCEPT

    def _conclude(self, goal: Any) -> TrackPass.Result:
        core = self._controller
        result = TrackPass.Result(
            message=self._refusal, predicted_loss=-1.0, fault=core.antenna.fault, target_pass=self._window
        )
        if not self._refusal:
            statistics, outcome = core.statistics, core.statistics.outcome
            result.seconds_tracked, result.seconds_lost = outcome.tracked_s, outcome.lost_s
            result.rms_cross_elevation_error, result.rms_elevation_error = statistics.rms_rad
            result.mean_loss, result.fault = outcome.mean_loss_db, statistics.fault
            least = core.params.machine.least_share
            why = outcome.why_not_tracked(statistics.reason, statistics.fault, least)
            result.success, result.message = not why, why or LOSS_OF_SIGNAL
            chosen = core.plan.certificate.chosen if core.plan.certificate else None
            result.predicted_loss = chosen.mean_loss_db if chosen else -1.0
        return conclude(goal, result)

    def _on_stop(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._stop("stop was requested")
        response.message = "stopping" if response.success else "nothing is being tracked"
        return response

    def _on_calibrate(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        refused = self._controller.calibrate()
        response.success, response.message = not refused, refused or "calibrating"
        return response

    def _params(self) -> ControllerParams:
        present = self.parameters.declared()
        return ControllerParams().replace(**{name: present[name] for name in ControllerParams().sets()})

    def _retune(self) -> None:
        if self._controller is not None:
            self._controller.retune(self._params())

    def _health(self) -> Health:
        core, state = self._controller, self._controller.state
        learned = core.corrections.filter.state
        values = {
            "mode": state.mode,
            "reason": state.reason,
            "false_locks": core.carrier.faults,
            "last_false_lock": core.carrier.last_fault,
            "along_track_s": round(float(learned.mean[0]), 5),
            "cross_track_m": round(float(learned.mean[1]), 2),
            "trim_used": learned.used,
            "trim_refused": learned.refused,
        }
        level, alarm = self._alarm
        if self._unfed and not alarm:
            return Health(WARN, self._unfed, values)
        if self._refusal and not alarm:
            return Health(ERROR, self._refusal, values)
        if core.model_doubt and not alarm:
            return Health(WARN, core.model_doubt, values)
        return Health(LEVELS[level], alarm or state.mode, values)


def nearest_pass(passes: Sequence[Pass], near_s: float) -> Pass:
    """Return the pass at, or nearest to, `near_s` (UTC, s since 1970), the first where that is 0.

    Raises
    ------
    ValueError
        When none lies within `NEAR_S`, or there is none.
    """
    if not passes:
        raise ValueError("ephemeris_publisher has found no pass")
    if not near_s:
        return passes[0]

    def distance_s(window: Pass) -> float:
        return max(seconds_from_stamp(window.aos) - near_s, near_s - seconds_from_stamp(window.los), 0.0)

    found = min(passes, key=distance_s)
    if distance_s(found) > NEAR_S:
        raise ValueError(
            f"{found.target} has no pass within {NEAR_S / 60.0:.0f} min of {utc_text(near_s)}; "
            f"the next one begins at {utc_text(seconds_from_stamp(found.aos))}"
        )
    return found


def main() -> None:
    """Entry point of `ros2 run rf_pointing pointing_controller`."""
    run(PointingControllerNode)
