"""Executable `target_designate`: the antenna led by reports of a target without an orbit.

Subscribes: designate/fix (sensor_msgs/NavSatFix) with designate/velocity (geometry_msgs/
TwistStamped: east, north, up), designate/direction (rf_pointing_msgs/Target: true azimuth,
elevation and range, of a radar); passes (another target that is selected ends this one's).
Publishes: target (10 Hz, ahead of time, with covariance), passes, pass_profiles (latched).
Services: ~/select_target (rf_pointing_msgs/SelectTarget): `designated NAME`, or `designated` for
the only target that is known.
Parameters: designate.* (addresses of the sources, class of the target, errors of the reports).
"""

from dataclasses import replace

import numpy as np
from geometry_msgs.msg import TwistStamped
from rf_pointing_msgs.msg import PassList, PassProfileList, Target
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import NavSatFix

from rf_pointing.designate import Report
from rf_pointing.ephemeris import Pass
from rf_pointing.planning import PassProfile
from rf_pointing.receiver.stream_clock import SmoothClock
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.designated.target import DesignatedTarget

VELOCITY_AGE_S = 1.0
FIX, DIRECTION = "fix", "direction"
"""Names of the targets that topics report."""


class TargetDesignate(StationNode):
    """Leads the antenna to one reported target at a time."""

    def __init__(self) -> None:
        super().__init__("target_designate")
        self._target: DesignatedTarget | None = None

    def configure(self) -> None:
        simulated = self.get_parameter("use_sim_time").value
        now_s = SmoothClock(self.now_s).now_s if simulated else self.now_s
        params = self.parameters.value("designate")
        self._target = DesignatedTarget(
            params, self.parameters.value("site"), self.parameters.value("mask"), self._show, now_s
        )
        self._at_cleanup.callback(self._target.end)
        self._velocity: tuple[float, tuple[float, float, float]] | None = None
        self._targets = self.stream(Target, "target", STREAM)
        self._passes = self.stream(PassList, "passes", LATCHED)
        self._profiles = self.stream(PassProfileList, "pass_profiles", LATCHED)
        self.listen(NavSatFix, "designate/fix", self._on_fix, STREAM)
        self.listen(TwistStamped, "designate/velocity", self._on_velocity, STREAM)
        self.listen(Target, "designate/direction", self._on_direction, STREAM)
        self.listen(PassList, "passes", self._on_passes, LATCHED)
        self.serve(SelectTarget, "~/select_target", self._on_select)
        self.diagnostics.add_report("target", lambda: self._target.health(self.now_s()))

    def activate(self) -> None:
        self.every(self.parameters.value("designate").period_s, self._step)

    def _step(self, now_s: float) -> None:
        try:
            self._target.step(now_s)
        except ValueError as error:
            self.log_once("target not selected", str(error))
        found = self._target.target_at(now_s)
        if found is not None:
            self._targets.publish(convert.target_to_message(replace(found[0], uncertainty=found[1])))

    def _show(self, passes: list[Pass], profiles: list[PassProfile]) -> None:
        messages = [convert_planning.pass_to_message(each) for each in passes]
        self._passes.publish(self._stamped(PassList(target=passes[0].name, passes=messages)))
        shown = [convert_planning.profile_to_message(each) for each in profiles]
        self._profiles.publish(self._stamped(PassProfileList(profiles=shown)))

    def _stamped(self, message: PassList | PassProfileList) -> PassList | PassProfileList:
        message.header.stamp = self.get_clock().now().to_msg()
        return message

    def _on_passes(self, message: PassList) -> None:
        if self._target.name not in ("", message.target):
            self._target.release()

    def _on_fix(self, message: NavSatFix) -> None:
        place = convert.place_from_fix(message)
        t_s, noise = seconds_from_stamp(message.header.stamp), self.parameters.value("designate").noise
        # A receiver that states its errors knows them better than the parameters do.
        if message.position_covariance_type != NavSatFix.COVARIANCE_TYPE_UNKNOWN:
            east, north, up = np.sqrt(np.diag(np.reshape(message.position_covariance, (3, 3)))).tolist()
            noise = noise.replace(horizontal_m=max(east, north, 0.1), vertical_m=max(up, 0.1))
        known = self._velocity
        velocity = known[1] if known is not None and abs(t_s - known[0]) <= VELOCITY_AGE_S else None
        self._target.take_stamped(Report.of_place(t_s, FIX, place, noise, velocity), self.now_s())

    def _on_velocity(self, message: TwistStamped) -> None:
        linear = message.twist.linear
        self._velocity = seconds_from_stamp(message.header.stamp), (linear.x, linear.y, linear.z)

    def _on_direction(self, message: Target) -> None:
        place = message.azimuth, message.elevation, message.range
        t_s, noise = seconds_from_stamp(message.header.stamp), self.parameters.value("designate").noise
        report = Report.of_direction(t_s, DIRECTION, *place, self._target.site, noise)
        self._target.take_stamped(report, self.now_s())

    def _on_select(self, request: SelectTarget.Request, response: SelectTarget.Response) -> SelectTarget.Response:
        try:
            passes = self._target.select(request.target, self.now_s())
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        response.success, response.message = True, f"{len(passes)} passes of {passes[0].name}"
        response.passes = [convert_planning.pass_to_message(window) for window in passes]
        return response


main = TargetDesignate.main
