"""Executable `pointing_controller`: the only author of motion.

Subscribes: target, joint_states, antenna_status, pointing_error, pointing_model, pass_profiles;
weather/temperature (sensor_msgs/Temperature) for the thermal terms of a model, without which a pass
is refused.
Publishes: joint_trajectory and command_signature (10 Hz while a pass is tracked), tracking_status
(10 Hz), pass_certificate (latched), band_in_use (latched: the other nodes take it).
Actions: track_pass (rf_pointing_msgs/TrackPass); a pass by satellite and time is one that
ephemeris_publisher/select_target finds; scan (rf_pointing_msgs/Scan): the beam led around it.
Services (std_srvs/Trigger): ~/stop ends the pass under control; ~/calibrate runs the circle on
which the monopulse tracker calibrates its feed.
Parameters: those of `ControllerParams`, certificate_folder (where every certificate is stored
as a file; empty: nowhere), command_key_file (the key that signs the commands), and
lifecycle.standby (first or second of two: `ros/standby.py`).
"""

import time

from rf_pointing_msgs import msg as ours
from sensor_msgs.msg import Temperature
from std_srvs.srv import Trigger

from rf_pointing.ephemeris.solar import SunPermit
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros.convert_calibration import model_from_message
from rf_pointing.ros.graph import TEMPERATURE
from rf_pointing.ros.qos import LATCHED, STATUS, STREAM
from rf_pointing.ros.standby import StandbyParams
from rf_pointing.ros.station_node import StationNode
from rf_pointing.ros.station_watches import ClockWatch, ExecutiveWatch
from rf_pointing.ros.track_pass import TrackPassServer
from rf_pointing.station.clients.goals import PassGoals
from rf_pointing.station.derive.axes import feed_model
from rf_pointing.station.parameters import wider_band
from rf_pointing.station.pointing.controller import PointingController, WiderBand
from rf_pointing.station.pointing.params import LIVE, ControllerParams
from rf_pointing.tracking.sensors import load_trackers

SIMULATED_WAIT_S = 1.0
"""Wall time that a period of simulated time waits for what it should use."""


class PointingControllerNode(StationNode):
    """Steps the goals of the pointing controller once a period, and between events."""

    # What commands the antenna refuses a description that any node would refuse.
    CHECKS_EVERY_NODE = True
    LEADS_BAND = True
    LIFECYCLE = StandbyParams()

    def __init__(self) -> None:
        # Before the declarations: `autotrack.sensor` takes their names.
        load_trackers()
        super().__init__("pointing_controller", live={**LIVE, "": True})
        self.parameters.on_change(self._retune)
        self._permit: SunPermit | None = None
        self._goals: PassGoals | None = None
        self._server = TrackPassServer(self)

    def configure(self) -> None:
        core, store = PointingController(self._params(), self._wider()), self.parameters.value("")
        goals = self._goals = PassGoals(core, self._server, self._sensor, store)
        real = self.station is not None and self.station.receiver != "simulated"
        core.take_model(feed_model(self.station.content, self.band))
        if self.get_parameter("use_sim_time").value and not real:
            # Simulated time waits for the period; what a real receiver measures needs its time.
            goals.longest_wait_s = SIMULATED_WAIT_S
        self._server.configure(goals, self.parameters.value("key"))

        def take_status(message: ours.AntennaStatus) -> None:
            self._permit = convert_planning.sun_permit_from_message(message)
            goals.controller.take_antenna(message.mode, message.fault)
            goals.controller.permit_sun(self._permit, self.band)

        def take_profiles(message: ours.PassProfileList) -> None:
            goals.controller.take_profiles([*map(convert_planning.profile_from_message, message.profiles)])

        def take_model(message: ours.PointingModel) -> None:
            # The calibrator may not have followed to this band yet.
            if message.band in ("", self.band):
                goals.take_model(model_from_message(message), message.band)

        target, error = convert.target_from_message, convert.error_from_message
        take_error = lambda m: goals.controller.take_error(error(m))  # noqa: E731
        self.listen(ours.Target, "target", lambda m: goals.controller.take_target(target(m)), STREAM, required=True)
        self.listen(ours.AntennaStatus, "antenna_status", take_status, STATUS, required=True)
        self.listen(ours.PointingError, "pointing_error", take_error, STREAM)
        self.listen(ours.PointingModel, "pointing_model", take_model, LATCHED)
        temperature_k = convert.temperature_from_message
        self.listen(Temperature, TEMPERATURE, lambda m: goals.take_temperature(temperature_k(m)), STREAM)
        self.listen(ours.PassProfileList, "pass_profiles", take_profiles, LATCHED)
        self.serve_action(Trigger, "~/stop", self._stop, urgent=True)
        self.serve_action(Trigger, "~/calibrate", self._calibrate)
        self.diagnostics.add_report("tracking", goals.report)
        ExecutiveWatch(self)
        ClockWatch(self)

    def activate(self) -> None:
        goals = self._goals
        due = lambda t_s: goals.due(t_s, self.now_s(), time.perf_counter())  # noqa: E731
        self.every(goals.controller.params.pointing.period_s, due)

    def deactivate(self) -> None:
        self._goals.deactivate(self.now_s())

    def turn(self) -> float:
        longest_s = super().turn()
        self._server.turn()
        return min(self._goals.turn(self.now_s(), time.perf_counter()), longest_s) if self._goals else longest_s

    def follow_band(self) -> None:
        # A pass that is followed takes its band by itself.
        if not self._goals.busy:
            super().follow_band()

    def use_band(self) -> None:
        senders = {each.node_name for each in self.get_publishers_info_by_topic("pointing_model")}
        model = feed_model(self.station.content, self.band)
        self._goals.use_band(self._params(), model, self._wider(), calibrated="bias_calibrator" in senders)
        self._goals.controller.permit_sun(self._permit, self.band)

    def _sensor(self, sensor: str) -> str:
        assert self.station is not None
        return self.station.chosen_sensor(sensor, self.band)

    def _wider(self) -> WiderBand | None:
        return wider_band(self.station, self.band) if self.station is not None else None

    def _params(self) -> ControllerParams:
        return ControllerParams(**{prefix: self.parameters.value(prefix) for prefix in ControllerParams().sets()})

    def _retune(self) -> None:
        if self._goals is not None:
            self._goals.retune(self._params(), self.parameters.value(""))

    def _stop(self, _request: Trigger.Request) -> str:
        if not self._goals.stop("stop was requested"):
            raise ValueError("nothing is being tracked")
        return "stopping"

    def _calibrate(self, _request: Trigger.Request) -> str:
        if refused := self._goals.controller.calibrate():
            raise ValueError(refused)
        return "calibrating"


main = PointingControllerNode.main
