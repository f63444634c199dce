"""Executable `bias_calibrator`: holds the pointing model, and fits a new one to tracked passes.

Subscribes: target, joint_states, pointing_error, tracking_status; weather/temperature, without
which a model with thermal terms is refused.  Publishes: pointing_model (latched, with covariance).
Actions: ~/run_campaign (RunCampaign) tracks passes and takes observations, ~/fit_model (FitModel)
makes a candidate.  Services: ~/accept, ~/reject, ~/rollback (std_srvs/Trigger).  Until it is
accepted a candidate only runs in the shadow, and must have been better there (shadow.accept).
Parameters: calibrator.* (models, station, band, spacing and noise of the observations), shadow.*
(when a verdict is given, and which one is needed), orbit.* (errors of the reference orbit that the
fit estimates with every pass).
"""

import time
from functools import partial
from typing import Any

from rclpy.action import ActionClient, ActionServer, GoalResponse
from rf_pointing_msgs.action import FitModel, RunCampaign, TrackPass
from rf_pointing_msgs.msg import PointingError, PointingModel, Target, TrackingStatus
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import JointState, Temperature
from std_srvs.srv import Trigger

from rf_pointing.ros import convert
from rf_pointing.ros.convert_calibration import fit_to_result, in_force_to_message
from rf_pointing.ros.graph import TEMPERATURE
from rf_pointing.ros.managed import RESULT_TIMEOUT_S, conclude
from rf_pointing.ros.one_goal import OneGoal
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.repeated_call import call_for_pass
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.campaign.calibrator import Calibrator, Campaign
from rf_pointing.station.derive.axes import kinematics_of


class BiasCalibrator(StationNode):
    """Publishes the model in force; collects observations while a sensor tracks."""

    def __init__(self) -> None:
        super().__init__("bias_calibrator", live={"shadow": True, "orbit": True})
        self.calibrator: Calibrator | None = None
        self.parameters.on_change(lambda: self.calibrator and self.calibrator.retune(self.parameters.value("shadow")))
        self._campaign: Campaign | None = None
        self._shown = -1
        self._select = self.create_client(SelectTarget, "ephemeris_publisher/select_target")
        self._track = ActionClient(self, TrackPass, "track_pass")
        result = lambda reason: RunCampaign.Result(**self.calibrator.outcome(self._campaign, reason))  # noqa: E731
        self._goal = OneGoal(self, RunCampaign, "~/run_campaign", self._begin, result, self._cancel)
        self._fits = ActionServer(
            self, FitModel, "~/fit_model", self._on_fit, result_timeout=RESULT_TIMEOUT_S,
            goal_callback=lambda _: GoalResponse.ACCEPT if self.active else GoalResponse.REJECT,
        )  # fmt: skip

    def configure(self) -> None:
        given = self.parameters.value("calibrator"), self.parameters.value("shadow")
        self.calibrator = Calibrator(*given, kinematics_of(self.station.content))
        self._models = self.stream(PointingModel, "pointing_model", LATCHED)
        target, joints = convert.target_from_message, convert.joints_from_message
        self.listen(Target, "target", lambda m: self.calibrator.log.take_target(target(m)), STREAM, required=True)
        self._joints = self.listen_latest(JointState, "joint_states", joints, STREAM, required=True)
        self.listen(PointingError, "pointing_error", self._on_error, STREAM)
        take_status = lambda m: self.calibrator.log.take_status(*convert.scan_centre_from_message(m))  # noqa: E731
        self.listen(TrackingStatus, "tracking_status", take_status, STREAM, required=True)
        self.serve_action(Trigger, "~/accept", lambda _: self._publish(self.calibrator.accept(self.now_s())))
        self.serve_action(Trigger, "~/reject", lambda _: f"{self.calibrator.keeper.reject()} is dropped")
        self.serve_action(Trigger, "~/rollback", lambda _: self._publish(self.calibrator.roll_back()))
        self.listen(Temperature, TEMPERATURE, self._on_temperature, STREAM)
        self.diagnostics.add_report("model", lambda: self.calibrator.health())

    def use_band(self) -> None:
        given = self.parameters.value("calibrator"), self.parameters.value("shadow")
        self.calibrator = self.calibrator.in_band(*given, self.now_s())
        self._publish()

    def follow_band(self) -> None:
        # The models of a campaign are those of its band until it has ended.
        if not self._goal.lasts:
            super().follow_band()

    def activate(self) -> None:
        self.calibrator.keeper.begin(self.now_s())
        if self.calibrator.keeper.active is not None:
            self._publish()

    def deactivate(self) -> None:
        self._cancel()
        self.calibrator.log.write_waiting()

    def turn(self) -> float:
        """Continue the campaign, and end its goal when it is over."""
        if not self._goal.lasts:
            self.follow_band()
            return super().turn()
        self._campaign.poll(time.monotonic())
        if (count := len(self.calibrator.log)) != self._shown:
            self._shown = count
            self._goal.report(RunCampaign.Feedback(**self.calibrator.progress(self._campaign)))
        if self._campaign.over:
            self._goal.finish()
        return 0.02

    def _publish(self, text: str = "") -> str:
        """Publish the model in force, and return the answer to the client."""
        message = in_force_to_message(self.calibrator.keeper.active, self.station, self.band)
        message.header.stamp = stamp_from_seconds(self.now_s())
        self._models.publish(message)
        return text

    def _on_error(self, message: PointingError) -> None:
        if self.active:
            error = convert.error_from_message(message)
            # Not the newest encoders: at 1 deg/s a period is 100 mdeg.
            self.calibrator.take_error(error, self._joints.take(error.t_s))

    def _on_temperature(self, message: Temperature) -> None:
        kelvin = convert.temperature_from_message(message)
        self.calibrator.keeper.temperature_k = kelvin
        self.calibrator.log.take_temperature(seconds_from_stamp(message.header.stamp), kelvin)

    def _begin(self, request: RunCampaign.Goal) -> None:
        if not self._select.service_is_ready() or not self._track.server_is_ready():
            raise ValueError("ephemeris_publisher and pointing_controller must be running in this namespace")
        log, goal = self.calibrator.log, partial(TrackPass.Goal, band=self.band)
        offer = lambda each, sensor: self._track.send_goal_async(goal(target_pass=each, sensor=sensor))  # noqa: E731
        self._campaign = Campaign(request.passes, request.sensor, log, partial(call_for_pass, self._select), offer)
        if not request.resume:
            log.begin_anew(f"{self.now_s():.0f}")

    def _cancel(self) -> None:
        if self._campaign is not None:
            self._campaign.cancel()

    def _on_fit(self, goal: Any) -> FitModel.Result:
        goal.publish_feedback(FitModel.Feedback(stage="fit"))
        terms, name, orbit = goal.request.terms, goal.request.name, self.parameters.value("orbit")
        try:
            result = fit_to_result(*self.calibrator.fit(terms, name, orbit, self.now_s()))
        except ValueError as error:
            result = FitModel.Result(message=str(error))
        return conclude(goal, result)


main = BiasCalibrator.main
