"""Executable `bias_calibrator`: holds the pointing model, and fits a new one to tracked passes.

Subscribes: target, joint_states, pointing_error, tracking_status; weather/temperature
(sensor_msgs/Temperature), without which a model with thermal terms is refused.
Publishes: pointing_model (latched, with covariance).
Actions: ~/run_campaign (RunCampaign) tracks passes and takes observations, ~/fit_model (FitModel)
makes a candidate.
Services: ~/accept, ~/reject, ~/rollback (std_srvs/Trigger).  Until it is accepted a candidate only
runs in the shadow, and it is accepted only if it was better there (shadow.accept).
Parameters: calibrator.* (models, station, band, spacing and noise of the observations), shadow.*
(when a verdict is given, and which one is needed), orbit.* (errors of the reference orbit that the
fit estimates with every pass).

With `calibrator.folder` every observation is on the disk before the next one is taken, one file and
one set of models for each station and band: a killed node continues where it was.
"""

from dataclasses import dataclass
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rf_pointing_msgs.action import FitModel, RunCampaign
from rf_pointing_msgs.msg import PointingError, PointingModel, Target, TrackingStatus
from sensor_msgs.msg import JointState, Temperature
from std_srvs.srv import Trigger

from rf_pointing import __version__, calibration
from rf_pointing.calibration import ModelVersion, PassPriors, SectorRule, ShadowRules
from rf_pointing.core import MDEG, Params, parameter
from rf_pointing.ros import convert, convert_calibration
from rf_pointing.ros.campaign_runner import CampaignRunner
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.graph import TEMPERATURE
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import RESULT_TIMEOUT_S, conclude
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import stamp_from_seconds
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.campaign.log import CalibrationLog
from rf_pointing.station.campaign.model_keeper import ModelKeeper, journal_of

SECTORS = SectorRule()
CAMPAIGN_TURN_S = 0.02


@dataclass(frozen=True, kw_only=True)
class CalibratorParams(Params):
    """Where the models live and how observations are taken."""

    folder: str = parameter("", "folder of models and observations; empty: none are kept after the node ends")
    keep_observations: bool = parameter(True, "whether observations are kept in the folder as well")
    model_file: str = parameter("", "model in force before one is accepted; empty: no correction")
    station: str = parameter("Goldstone DSS-13", "station that the model must belong to")
    band: str = parameter("X", "band that the model must belong to")
    spacing_s: float = parameter(1.0, "time between two observations", low=0.1, high=600.0)
    scan_spacing_s: float = parameter(
        8.0, "the same while the beam scans: estimates from the same window differ little", low=0.1, high=600.0
    )
    sigma_rad: float = parameter(
        2.0 * MDEG, "standard deviation of one observation on the sky, added to the sensor's own", low=1e-7, high=0.01
    )
    largest_error_rad: float = parameter(
        6.0 * MDEG, "sensed error above which nothing is observed: a tenth of a beamwidth", low=1e-7, high=0.1
    )
    settle_s: float = parameter(
        0.0, "time with a valid sensor before the first observation of a pass", low=0.0, high=600.0
    )


class BiasCalibrator(StationNode):
    """Publishes the model in force; collects observations while a sensor tracks."""

    def __init__(self) -> None:
        super().__init__("bias_calibrator")
        self.parameters.declare("calibrator", CalibratorParams())
        self.parameters.declare("shadow", ShadowRules(), live=True)
        self.parameters.declare("orbit", PassPriors(along_track_m=100.0, cross_track_m=60.0, radial_m=30.0), live=True)
        self.parameters.on_change(self._retune)
        self._keeper: ModelKeeper | None = None
        self._log: CalibrationLog | None = None
        self._campaign: Any = None
        self._shown, self._reason = -1, ""
        self._runner = CampaignRunner(self)
        self._actions = [
            ActionServer(
                self, RunCampaign, "~/run_campaign", self._conclude, goal_callback=self._on_goal,
                handle_accepted_callback=self._on_campaign, cancel_callback=self._on_cancel, result_timeout=RESULT_TIMEOUT_S,
            ),
            ActionServer(
                self, FitModel, "~/fit_model", self._on_fit, goal_callback=self._on_fit_goal,
                result_timeout=RESULT_TIMEOUT_S,
            ),
        ]  # fmt: skip

    def configure(self) -> None:
        params: CalibratorParams = self.parameters.value("calibrator")
        start = calibration.read_model(params.model_file) if params.model_file else None
        self._keeper = ModelKeeper(params.station, params.band, params.folder, start, self.parameters.value("shadow"))
        journal = None
        if params.folder and params.keep_observations:
            journal = journal_of(params.folder, params.station, params.band)
        self._log = CalibrationLog(
            params.station, params.band, params.spacing_s, params.sigma_rad, scan_spacing_s=params.scan_spacing_s,
            largest_error_rad=params.largest_error_rad, settle_s=params.settle_s, journal=journal,
        )  # fmt: skip
        self._models = self.stream(PointingModel, "pointing_model", LATCHED)
        self.listen(Target, "target", lambda m: self._log.take_target(convert.target_from_message(m)), STREAM)
        self._joints = self.listen_latest(JointState, "joint_states", convert.joints_from_message, STREAM)
        self.listen(PointingError, "pointing_error", self._on_error, STREAM)
        status_of = convert.scan_centre_from_message
        self.listen(TrackingStatus, "tracking_status", lambda m: self._log.take_status(*status_of(m)), STREAM)
        self.serve_action(Trigger, "~/accept", self._accept)
        self.serve_action(Trigger, "~/reject", lambda _: f"{self._keeper.reject()} is dropped")
        self.serve_action(Trigger, "~/rollback", self._roll_back)
        self.listen(Temperature, TEMPERATURE, self._on_temperature, STREAM)
        self.diagnostics.add("model", self._health)

    def _on_temperature(self, message: Temperature) -> None:
        self._keeper.temperature_k = convert.temperature_from_message(message)

    def activate(self) -> None:
        self._keeper.begin(self.now_s())
        self._publish()

    def deactivate(self) -> None:
        self._runner.cancel()
        # The last chance for observations that the disk did not take before.
        self._log.write_waiting()

    def turn(self) -> float:
        """Continue the campaign, and end its goal when it is over."""
        if self._campaign is None:
            return super().turn()
        self._runner.poll()
        if len(self._log) != self._shown:
            self._shown = len(self._log)
            self._campaign.publish_feedback(self._progress())
        if not self._runner.busy:
            goal, self._campaign = self._campaign, None
            goal.execute()
        return CAMPAIGN_TURN_S

    def _publish(self) -> None:
        # Latched: a controller that starts later receives the model too.
        file = self._keeper.active
        if file is not None:
            message = convert_calibration.model_to_message(file)
            message.header.stamp = stamp_from_seconds(self.now_s())
            self._models.publish(message)

    def _on_error(self, message: PointingError) -> None:
        if not self.active:
            return
        error = convert.error_from_message(message)
        # The encoders read next to the error's stamp, not the newest: at 1 deg/s a period is 100
        # mdeg.
        reading = self._joints.take(error.t_s)
        if reading is not None:
            self._log.take_joints(reading)
        row = self._log.take_error(error)
        if row is not None:
            self._keeper.observe(row)

    # One campaign at a time: there is one antenna.
    def _on_goal(self, _request: RunCampaign.Goal) -> GoalResponse:
        return GoalResponse.ACCEPT if self.active and self._campaign is None else GoalResponse.REJECT

    def _on_campaign(self, goal: Any) -> None:
        self._reason = ""
        try:
            self._runner.start(goal.request.passes, goal.request.sensor, self._log)
            if not goal.request.resume:
                self._log.begin_anew(f"{self.now_s():.0f}")
        except ValueError as error:
            # Executed at once, so that the client receives the reason as a result: a rejection has
            # no text.
            self._reason = str(error)
            goal.execute()
            return
        self._campaign = goal

    def _on_cancel(self, _goal: Any) -> CancelResponse:
        self._runner.cancel()
        return CancelResponse.ACCEPT

    def _conclude(self, goal: Any) -> RunCampaign.Result:
        runner, verdict = self._runner, self._keeper.verdict()
        result = RunCampaign.Result(
            observations=len(self._log),
            sectors_filled=self._sectors_filled(),
            message=self._reason,
            verdict=verdict.word if verdict else "",
        )
        if not self._reason:
            wanted = len(goal.request.passes)
            result.passes_observed = runner.observed
            result.success, result.fault = runner.observed == wanted and not runner.fault, runner.fault
            stopped = (
                [f"stopped by a fault in pass {runner.number} of {wanted}: {runner.fault}"] if runner.fault else []
            )
            lines = [f"{runner.observed} of {wanted} passes observed, {result.observations} observations"]
            if verdict is not None:
                lines.append(f"{self._keeper.candidate.name} is {self._keeper.verdict_text()}")
            result.message = "; ".join([*stopped, *lines, *runner.failures])
        return conclude(goal, result)

    def _progress(self) -> RunCampaign.Feedback:
        runner = self._runner
        return RunCampaign.Feedback(
            pass_number=runner.number, target=runner.target, observations=len(self._log),
            sectors_filled=self._sectors_filled(), progress=(runner.number - 1) / max(runner.count, 1),
        )  # fmt: skip

    def _sectors_filled(self) -> int:
        return SECTORS.count - len(self._log.coverage(SECTORS).thin)

    def _on_fit_goal(self, _request: FitModel.Goal) -> GoalResponse:
        return GoalResponse.ACCEPT if self.active else GoalResponse.REJECT

    def _on_fit(self, goal: Any) -> FitModel.Result:
        request, now_s = goal.request, self.now_s()
        goal.publish_feedback(FitModel.Feedback(stage="fit"))
        try:
            orbit = self.parameters.value("orbit")
            fit = self._log.fit(self._keeper.model, terms=tuple(request.terms), pass_priors=orbit)
            name = request.name or self._keeper.free_name(f"fit-{now_s:.0f}")
            file = ModelVersion.from_fit(fit, name=name, software=f"rf_pointing {__version__}", created_t_s=now_s)
            self._keeper.propose(file)
        except ValueError as error:
            goal.abort()
            return FitModel.Result(message=str(error))
        goal.succeed()
        return convert_calibration.fit_to_result(fit, file, calibration.doubts_of(fit, self._log.observations()))

    def _accept(self, _request: Trigger.Request) -> str:
        verdict = self._keeper.verdict_text()
        file = self._keeper.accept(self.now_s())
        self._publish()
        return f"{file.name} is in force; it was {verdict}"

    def _roll_back(self, _request: Trigger.Request) -> str:
        file = self._keeper.roll_back()
        if file is None:
            self._models.publish(convert_calibration.no_model_to_message(self.parameters.value("calibrator").station))
        self._publish()
        return f"{file.name if file else 'no model'} is in force again"

    def _retune(self) -> None:
        if self._keeper is not None:
            self._keeper.retune(self.parameters.value("shadow"))

    def _health(self) -> Health:
        keeper = self._keeper
        values = {
            "observations": len(self._log),
            "candidate": keeper.candidate.name if keeper.candidate else "",
            "shadow": keeper.verdict_text(),
        }
        missing = "" if keeper.active else "no model: commands are not corrected"
        problems = "; ".join(filter(None, (self._log.problem, missing)))
        return Health(WARN, problems, values) if problems else Health(OK, keeper.active.name, values)


def main() -> None:
    """Entry point of `ros2 run rf_pointing bias_calibrator`."""
    run(BiasCalibrator)
