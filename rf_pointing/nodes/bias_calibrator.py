"""Executable `bias_calibrator`: keeps the pointing model, and fits a new one to what was tracked.

Subscribes: target, joint_states, pointing_error.  Publishes: pointing_model (latched).
Services: ~/fit, ~/accept, ~/reject (std_srvs/Trigger): a fitted model is a candidate until it is accepted.
Parameters: calibrator.* (model file, station, band, spacing and noise of the observations).
"""

import math
from dataclasses import dataclass
from pathlib import Path

from rf_pointing_msgs.msg import PointingError, PointingModel, Target
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from rf_pointing import __version__
from rf_pointing.calibration import BiasModel, ModelFile, read_model, write_model
from rf_pointing.geometry import MDEG, Params, parameter
from rf_pointing.nodes import convert
from rf_pointing.nodes.diagnostics import OK, WARN, Health
from rf_pointing.nodes.managed import ManagedNode, run
from rf_pointing.nodes.qos import LATCHED, STREAM
from rf_pointing.nodes.stamps import stamp_from_seconds
from rf_pointing.station.calibration_log import CalibrationLog


@dataclass(frozen=True, kw_only=True)
class CalibratorParams(Params):
    """Where the model lives and how observations are taken."""

    model_file: str = parameter("", "file of the model in force; empty: no correction")
    accepted_file: str = parameter("", "file that an accepted model is written to; empty: it is only published")
    station: str = parameter("Goldstone DSS-13", "station that the model must belong to")
    band: str = parameter("X", "band that the model must belong to")
    spacing_s: float = parameter(1.0, "time between two observations", low=0.1, high=600.0)
    sigma_rad: float = parameter(2.0 * MDEG, "standard deviation of one observation on the sky", low=1e-7, high=0.01)


class BiasCalibrator(ManagedNode):
    """Publishes the model in force; collects observations while a sensor tracks."""

    def __init__(self) -> None:
        super().__init__("bias_calibrator")
        self.parameters.declare("calibrator", CalibratorParams())
        self._model: ModelFile | None = None
        self._candidate: ModelFile | None = None
        self._log: CalibrationLog | None = None

    def configure(self) -> None:
        params: CalibratorParams = self.parameters.value("calibrator")
        self._model = read_model(params.model_file) if params.model_file else None
        self._log = CalibrationLog(params.station, params.band, params.spacing_s, params.sigma_rad)
        self._models = self.stream(PointingModel, "pointing_model", LATCHED)
        self.listen(Target, "target", lambda m: self._log.take_target(convert.target_from_message(m)), STREAM)
        self._joints = self.listen_latest(JointState, "joint_states", convert.joints_from_message, STREAM)
        self.listen(PointingError, "pointing_error", self._on_error, STREAM)
        for name, callback in (("fit", self._on_fit), ("accept", self._on_accept), ("reject", self._on_reject)):
            self.serve(Trigger, f"~/{name}", callback)
        self.diagnostics.add("model", self._health)

    def activate(self) -> None:
        params: CalibratorParams = self.parameters.value("calibrator")
        if self._model is not None:
            self._model.check_for(params.station, params.band, self.now_s())
        self._publish()

    def _publish(self) -> None:
        if self._model is not None:
            message = convert.model_to_message(self._model)
            message.header.stamp = stamp_from_seconds(self.now_s())
            self._models.publish(message)

    def _on_error(self, message: PointingError) -> None:
        if not message.valid:
            return
        reading = self._joints.take()
        if reading is not None:
            self._log.take_joints(reading)
        self._log.take_error(convert.error_from_message(message))

    def _on_fit(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        present = self._model.model if self._model else BiasModel.zero()
        try:
            result = self._log.fit(present)
        except ValueError as refusal:
            response.success, response.message = False, str(refusal)
            return response
        now_s = self.now_s()
        self._candidate = ModelFile.from_fit(
            result, name=f"fit-{now_s:.0f}", software=f"rf_pointing {__version__}", created_t_s=now_s
        )
        rms = [math.degrees(value) * 1e3 for value in result.rms_rad()]
        response.success = True
        response.message = (
            f"{len(self._log)} observations, residual rms {rms[0]:.2f} mdeg cross-elevation, {rms[1]:.2f} mdeg elevation; "
            "accept or reject it"
        )
        return response

    def _on_accept(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._candidate is None:
            response.success, response.message = False, "no model has been fitted"
            return response
        self._model, self._candidate = self._candidate, None
        path = self.parameters.value("calibrator").accepted_file
        if path:
            write_model(Path(path), self._model)
        self._publish()
        response.success, response.message = True, f"{self._model.name} is in force"
        return response

    def _on_reject(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._candidate is not None
        response.message = "candidate dropped" if response.success else "no model has been fitted"
        self._candidate = None
        return response

    def _health(self) -> Health:
        values = {"observations": len(self._log), "candidate": self._candidate.name if self._candidate else ""}
        if self._model is None:
            return Health(WARN, "no model: commands are not corrected", values)
        return Health(OK, self._model.name, values)


def main() -> None:
    """Entry point of `ros2 run rf_pointing bias_calibrator`."""
    run(BiasCalibrator)
