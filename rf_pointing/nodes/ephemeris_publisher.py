"""Executable `ephemeris_publisher`: where the target will be, and when it passes.

Publishes: target (10 Hz, ahead of time while above the mask), passes, pass_profiles (latched).
Subscribes: tracking_status, for what a pass teaches of the time along the orbit; where
source.refraction is measured: weather/temperature, weather/pressure and weather/humidity; where
source.antenna has a width: satellite_attitude in place of its roll, pitch and yaw; where
publisher.moves: base/fix (sensor_msgs/NavSatFix), where the station is now. Services:
~/select_target (SelectTarget): choose the satellite and get its passes; ~/clear_offsets,
~/forget_learned (std_srvs/Trigger), ~/keep_offsets, ~/recall_offsets, ~/forget_offsets (Named).
Parameters: source.* (elements or ephemeris, object; offsets, hold, weather and antenna, live, read
back on /diagnostics with the age of the elements; newer elements come into force between two
passes), publisher.* (lead, rate, mask, how far to look, state_file and learned_file), mask.* (the
horizon by azimuth: a pass begins and ends above both), uncertainty.* (errors of elements against
their age).
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from rf_pointing_msgs.msg import Attitude, PassList, PassProfileList, Target, TrackingStatus
from rf_pointing_msgs.srv import Named, SelectTarget
from sensor_msgs.msg import FluidPressure, NavSatFix, RelativeHumidity, Temperature
from std_srvs.srv import Trigger

from rf_pointing.core.parameters import leaves
from rf_pointing.ephemeris import NO_TARGET, Pass
from rf_pointing.ephemeris.target_offsets import OffsetSets, TargetOffsets
from rf_pointing.planning import PassProfile
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros.graph import BASE_FIX, HUMIDITY, PRESSURE, SATELLITE_ATTITUDE, TEMPERATURE
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.pointing.predicted_target import RENEWAL_S, PredictedTarget

LIVE = {
    # Another satellite is taken by ~/select_target.
    "source": (*leaves(TargetOffsets()), "hold", "refraction", "weather", "antenna"),
    "publisher": ("lead_s", "margin_s"), "uncertainty": True,
}  # fmt: skip
"""Parameters that may change while the node is configured."""
WEATHER = {
    TEMPERATURE: (Temperature, "temperature_k", convert.temperature_from_message),
    PRESSURE: (FluidPressure, "pressure_hpa", lambda message: 0.01 * message.fluid_pressure),
    HUMIDITY: (RelativeHumidity, "relative_humidity", lambda message: message.relative_humidity),
}


class EphemerisPublisher(StationNode):
    """Predicts one target at a time."""

    def __init__(self) -> None:
        super().__init__("ephemeris_publisher", live=LIVE, defaults={"source": NO_TARGET})
        self.parameters.on_change(self._on_parameters)
        self.prediction: PredictedTarget | None = None

    def configure(self) -> None:
        self.prediction = None
        values = (self.parameters.value(name) for name in ("publisher", "source", "mask", "uncertainty"))
        self.prediction = PredictedTarget(*values, self._show, self.log_once, self.band)
        self._at_cleanup.callback(self.prediction.updates.end)
        self._mirror()
        self._targets = self.stream(Target, "target", STREAM)
        self._passes = self.stream(PassList, "passes", LATCHED)
        self._profiles = self.stream(PassProfileList, "pass_profiles", LATCHED)
        self.listen(PassList, "passes", lambda m: self.prediction.yield_to(m.target), LATCHED)
        source = self.prediction.source
        for topic, (kind, name, read) in WEATHER.items() if source.refraction == "measured" else ():
            take = lambda m, name=name, read=read: self.prediction.take_weather(name, read(m), self.now_s())  # noqa: E731
            self.listen(kind, topic, take, STREAM, required=True)
        if source.antenna.half_power_beamwidth_rad > 0.0:
            self.listen(Attitude, SATELLITE_ATTITUDE, self._on_attitude, STREAM)
        if self.prediction.params.moves:
            place, take_place = convert.place_from_fix, self.prediction.take_place
            self.listen(NavSatFix, BASE_FIX, lambda m: take_place(place(m), self.now_s()), STREAM)
        held, take_held = convert.held_direction_from_message, self.prediction.take_tracking
        self.listen(TrackingStatus, "tracking_status", lambda m: take_held(m.target, held(m)), STREAM)
        self.serve_action(Trigger, "~/forget_learned", lambda _: self.prediction.forget_learned(self.now_s()))
        self.serve(SelectTarget, "~/select_target", self._on_select)
        for word, act in self.prediction.about_offsets.items():
            kind = Trigger if word == "clear" else Named
            self.serve_action(kind, f"~/{word}_offsets", partial(self._offset, act))
        self.diagnostics.add_report("target", lambda: self.prediction.health(self.now_s()))

    def use_band(self) -> None:
        self.prediction.sets = OffsetSets(self.prediction.params.state_file, self.band)

    def activate(self) -> None:
        # Without a pass: another target may be selected while the node is active.
        if no_pass := self.prediction.begin(self.now_s()):
            self.get_logger().warning(no_pass)
        self.every(self.parameters.value("publisher").period_s, self._publish)
        self.every(RENEWAL_S, self._renew)

    def _publish(self, now_s: float) -> None:
        if (found := self.prediction.target_at(now_s)) is not None:
            self._targets.publish(convert.target_to_message(found))

    def _show(self, passes: list[Pass] | None, profiles: list[PassProfile]) -> None:
        stamp = stamp_from_seconds(self.now_s())
        if passes is not None:
            message = PassList(target=passes[0].name, passes=list(map(convert_planning.pass_to_message, passes)))
            message.header.stamp = stamp
            self._passes.publish(message)
        shown = PassProfileList(profiles=list(map(convert_planning.profile_to_message, profiles)))
        shown.header.stamp = stamp
        self._profiles.publish(shown)

    def _on_attitude(self, message: Attitude) -> None:
        if message.valid:
            self.prediction.take_attitude(convert.satellite_quaternion_from_message(message))

    def _renew(self, now_s: float) -> None:
        news, bad = self.prediction.renew(now_s)
        self._mirror()
        if news and bad:  # One line of code that logs at two levels raises.
            self.get_logger().warning(news)
        elif news:
            self.get_logger().info(news)

    def _on_select(self, request: SelectTarget.Request, response: SelectTarget.Response) -> SelectTarget.Response:
        start_s = seconds_from_stamp(request.start) or self.now_s()
        try:
            passes = self.prediction.select(request.target, start_s, request.minimum_peak_elevation)
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        self._mirror()
        response.success, response.message = True, f"{len(passes)} passes of {passes[0].name}"
        response.passes = [convert_planning.pass_to_message(window) for window in passes]
        return response

    def _offset(self, act: Callable[[str, float], str], request: Any) -> str:
        text = act(getattr(request, "name", ""), self.now_s())
        self._mirror()
        return text

    def _mirror(self) -> None:
        """Set the parameters to what is in force."""
        self.parameters.put("source", self.prediction.source)

    def _on_parameters(self) -> None:
        if self.prediction is not None:
            value = self.parameters.value
            self.prediction.params, self.prediction.uncertainty = value("publisher"), value("uncertainty")
            self.prediction.set(value("source"), self.now_s())


main = EphemerisPublisher.main
