"""Executable `ephemeris_publisher`: where the target will be, and when it passes.

Publishes: target (10 Hz, ahead of time while above the mask; direction, rates, range, Doppler,
light time, refraction and covariance), passes, pass_profiles (latched).
Subscribes, where source.refraction is measured: weather/temperature, weather/pressure and
weather/humidity (sensor_msgs/Temperature, FluidPressure, RelativeHumidity) in place of
source.weather.  Where source.antenna has a width: satellite_attitude in place of its roll, pitch
and yaw.
Service: ~/select_target (rf_pointing_msgs/SelectTarget): choose the satellite and get its passes.
Parameters: source.* (elements or ephemeris, object, station; offsets, hold, weather and antenna,
live, read back on /diagnostics with the age of the elements and what it means on the sky; newer
elements of an address, or of files that were replaced, come into force between two passes),
publisher.* (lead, rate, mask, how far to look, state_file: what was selected and set outlives the
node), mask.* (the horizon by azimuth, as pointing_controller's: a pass begins and ends above both),
uncertainty.* (position errors of elements against their age).
"""

import math

from rf_pointing_msgs.msg import Attitude, PassList, PassProfileList, Target
from rf_pointing_msgs.srv import SelectTarget
from sensor_msgs.msg import FluidPressure, RelativeHumidity, Temperature

from rf_pointing import ephemeris
from rf_pointing.core.dates import DAY_S, utc_text
from rf_pointing.ephemeris import Pass, SatelliteAntennaParams, SkyUncertainty, TopocentricTrack, stale_warning
from rf_pointing.ephemeris.source import SourceParams, TargetMemory, load_track, refraction_at
from rf_pointing.planning import HorizonMask
from rf_pointing.ros import convert, convert_planning
from rf_pointing.ros.diagnostics import ERROR, OK, WARN, Health
from rf_pointing.ros.element_updates import ElementUpdates
from rf_pointing.ros.graph import HUMIDITY, PRESSURE, SATELLITE_ATTITUDE, TEMPERATURE
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.qos import LATCHED, STREAM
from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.parameters import PublisherParams
from rf_pointing.station.pointing.certificates import pass_profile

# What may change while the node is configured; ~/select_target takes another satellite.
LIVE_SOURCE = ("along_track_offset_s", "cross_track_offset_deg", "hold", "refraction", "weather", "antenna")


RENEWAL_S = 10.0
"""How often the elements are looked at for newer ones, and the weather."""
WEATHER_STEPS = {"temperature_k": 0.5, "pressure_hpa": 0.5, "relative_humidity": 0.02}
"""Changes of the weather that matter: each is 0.2 % of the refraction or less."""
WEATHER_AGE_S = 3600.0
ATTITUDE_SHARE = 0.02
"""Of the width of the satellite's beam: how far its axis moves before it matters, 0.005 dB."""


class EphemerisPublisher(StationNode):
    """Predicts one target at a time."""

    def __init__(self) -> None:
        super().__init__("ephemeris_publisher")
        self.parameters.declare("source", SourceParams(), live=LIVE_SOURCE)
        self.parameters.declare("publisher", PublisherParams(), live=("lead_s", "margin_s"))
        self.parameters.declare("mask", HorizonMask())
        self.parameters.declare("uncertainty", ephemeris.ElementUncertainty(), live=True)
        self.parameters.on_change(self._on_parameters)
        self._track: TopocentricTrack | None = None
        self._unknown, self._no_pass = "", ""
        self._passes: list[Pass] = []
        self._peak_rad = 0.0
        self._updates = ElementUpdates("")
        self._not_renewed = ""

    def configure(self) -> None:
        self._track, self._passes, self._no_pass = None, [], ""
        self._memory = TargetMemory(self.parameters.value("publisher").state_file, self.parameters.value("source"))
        self.parameters.put("source", self._memory.source)
        self._peak_rad = self._memory.peak_rad
        self._updates.end()
        self._updates, self._not_renewed = ElementUpdates(self._memory.source.elements), ""
        self._updates.require()
        self._track = load_track(self._memory.source, self._memory.hold_t_s)
        self._targets = self.stream(Target, "target", STREAM)
        self._pass_list = self.stream(PassList, "passes", LATCHED)
        self._profiles = self.stream(PassProfileList, "pass_profiles", LATCHED)
        self._weather, self._weather_s, self._weather_problem = {}, math.inf, ""
        if self._memory.source.refraction == "measured":
            self.listen(
                Temperature,
                TEMPERATURE,
                lambda m: self._on_weather("temperature_k", convert.temperature_from_message(m)),
                STREAM,
            )
            self.listen(
                FluidPressure, PRESSURE, lambda m: self._on_weather("pressure_hpa", 0.01 * m.fluid_pressure), STREAM
            )
            self.listen(
                RelativeHumidity, HUMIDITY, lambda m: self._on_weather("relative_humidity", m.relative_humidity), STREAM
            )
        self._attitude: SatelliteAntennaParams | None = None
        if self._memory.source.antenna.half_power_beamwidth_rad > 0.0:
            self.listen(Attitude, SATELLITE_ATTITUDE, self._on_attitude, STREAM)
        self.serve(SelectTarget, "~/select_target", self._on_select)
        self.diagnostics.add("target", self._health)

    def activate(self) -> None:
        try:
            self._choose(self._track, self.now_s(), self._peak_rad)
        except ValueError as error:
            # Another target may pass: it can only be selected while the node is active.
            self._no_pass = str(error)
            self.get_logger().warning(self._no_pass)
        self.every(self.parameters.value("publisher").period_s, self._publish)
        self.every(RENEWAL_S, self._renew)

    def end(self) -> None:
        """End the command that fetches elements, too."""
        self._updates.end()
        super().end()

    def _publish(self, now_s: float) -> None:
        params: PublisherParams = self.parameters.value("publisher")
        # Whole microseconds, as stamps are: the target is that of its own stamp.
        t_s = round(now_s + params.lead_s, 6)
        margin_s = params.margin_s
        if not (self._near_a_pass(t_s, margin_s) and self._track.covers(t_s)):
            return
        try:
            target = self._track.target_at(t_s)
        except ValueError as error:
            # What is set while the node runs may need more than elements or an ephemeris can give.
            self._unknown = str(error)
            self.log_once("no target is published", str(error))
            return
        self._unknown = ""
        self._targets.publish(convert.target_to_message(target, self._uncertainty(t_s)))

    def _near_a_pass(self, t_s: float, margin_s: float) -> bool:
        return any(window.aos_t_s - margin_s <= t_s <= window.los_t_s + margin_s for window in self._passes)

    def _on_weather(self, name: str, value: float) -> None:
        self._weather[name], self._weather_s = value, self.now_s()

    def _use_weather(self) -> None:
        """Bring the measured weather into force where it has changed by enough to bend a ray."""
        source: SourceParams = self.parameters.value("source")
        changed = any(
            abs(value - getattr(source.weather, name)) > WEATHER_STEPS[name] for name, value in self._weather.items()
        )
        if not changed:
            return
        try:
            weather = source.weather.replace(**self._weather)
        except ValueError as error:
            self._weather_problem = f"measured weather is not used: {error}"
            return
        self._weather_problem = ""
        self.parameters.put("source", source.replace(weather=weather))
        self._on_parameters()

    def _on_attitude(self, message: Attitude) -> None:
        if message.valid:
            antenna: SatelliteAntennaParams = self.parameters.value("source").antenna
            self._attitude = antenna.turned(convert.satellite_quaternion_from_message(message))

    def _use_attitude(self) -> None:
        """Bring the measured attitude into force where the satellite's beam has moved enough."""
        source: SourceParams = self.parameters.value("source")
        if self._attitude is None or self._track is None:
            return
        moved_rad = math.dist(self._attitude.axis, source.antenna.axis)
        if moved_rad > ATTITUDE_SHARE * source.antenna.half_power_beamwidth_rad:
            self.parameters.put("source", source.replace(antenna=self._attitude))
            self._on_parameters()
            self._publish_profiles()

    def _renew(self, now_s: float) -> None:
        """Bring newer elements into force, but neither in a pass nor just before one."""
        self._use_weather()
        self._use_attitude()
        params, source = self.parameters.value("publisher"), self.parameters.value("source")
        if not self._updates.changed() or source.hold:
            return
        if self._near_a_pass(now_s, params.margin_s + params.lead_s + RENEWAL_S):
            return
        # Tried once: a broken file is not read every ten seconds, the next one is.
        self._updates.accept()
        try:
            self._choose(load_track(source), now_s, self._peak_rad)
        except (ValueError, OSError) as error:
            self._not_renewed = f"elements were not renewed: {error}"
            self.get_logger().warning(self._not_renewed)
        else:
            self._not_renewed = ""
            self.get_logger().info(f"newer elements of {self._track.name} are in force")

    def _on_select(self, request: SelectTarget.Request, response: SelectTarget.Response) -> SelectTarget.Response:
        try:
            passes = self._select(request)
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        response.success = True
        response.message = f"{len(passes)} passes of {self._track.name}"
        response.passes = [convert_planning.pass_to_message(window) for window in passes]
        return response

    def _select(self, request: SelectTarget.Request) -> list[Pass]:
        source: SourceParams = self.parameters.value("source")
        track, start_s = self._track, seconds_from_stamp(request.start) or self.now_s()
        if request.target:
            source = source.replace(satellite=request.target, hold=False)
            track = load_track(source)
        passes = self._choose(track, start_s, request.minimum_peak_elevation)
        self.parameters.put("source", source)
        self._memory.keep(source, self._peak_rad, self._track.hold_t_s)
        return passes

    def _choose(self, track: TopocentricTrack, start_s: float, peak_rad: float) -> list[Pass]:
        """Make `track` the target, if it passes, and publish its passes."""
        params: PublisherParams = self.parameters.value("publisher")
        horizon = self.parameters.value("mask").above(params.mask_rad)
        found = ephemeris.passes_with_present(_moving(track), start_s, params.span_s, horizon)
        passes = [window for window in found if window.peak_elevation_rad >= peak_rad]
        if not passes:
            peak, span = f"{math.degrees(peak_rad):.1f} deg", f"{params.span_s / 3600.0:.1f} h"
            raise ValueError(f"{track.name} has no pass above {peak} in the {span} after {utc_text(start_s)}")
        # Only now: a target without a pass must not replace the present one.
        self._track, self._passes, self._peak_rad, self._no_pass = track, passes, peak_rad, ""
        message = PassList(target=track.name, passes=[convert_planning.pass_to_message(window) for window in passes])
        message.header.stamp = stamp_from_seconds(self.now_s())
        self._pass_list.publish(message)
        self._publish_profiles()
        return passes

    def _publish_profiles(self) -> None:
        moving = _moving(self._track)
        profiles = [convert_planning.profile_to_message(pass_profile(moving, window)) for window in self._passes]
        message = PassProfileList(profiles=profiles)
        message.header.stamp = stamp_from_seconds(self.now_s())
        self._profiles.publish(message)

    def _on_parameters(self) -> None:
        if self._track is not None:
            source: SourceParams = self.parameters.value("source")
            # A hold that is set again keeps its instant; only a new one begins now.
            held_s = self._track.hold_t_s if self._track.hold_t_s is not None else self.now_s()
            self._track = self._track.with_offsets(
                along_track_offset_s=source.along_track_offset_s,
                cross_track_offset_rad=source.cross_track_offset_rad,
                hold_t_s=held_s if source.hold else None,
                refraction=refraction_at(source, self._track.site),
                antenna=source.antenna,
            )
            self._memory.keep(source, self._peak_rad, self._track.hold_t_s)

    def _health(self) -> Health:
        age_s = self.now_s() - self._weather_s
        old = f"the measured weather is {age_s / 3600.0:.1f} h old" if age_s > WEATHER_AGE_S else ""
        problems = (
            self._no_pass,
            self._memory.problem,
            self._updates.problem,
            self._not_renewed,
            self._stale(),
            self._weather_problem,
            old,
        )
        warnings = "; ".join(filter(None, (*self._track.warnings(self.now_s()), *problems)))
        values = {
            "passes": len(self._passes),
            "along_track_offset_s": self._track.along_track_offset_s,
            "cross_track_offset_deg": math.degrees(self._track.cross_track_offset_rad),
            "hold_since": "" if self._track.hold_t_s is None else utc_text(self._track.hold_t_s),
            **self._orientation_values(),
            **self._uncertainty_values(),
        }
        if self._unknown:
            return Health(ERROR, self._unknown, values)
        return Health(WARN if warnings else OK, warnings or self._track.name, values)

    def _stale(self) -> str:
        """Return "" or how old the elements are at the closest approach of the next pass."""
        now_s, source = self.now_s(), self.parameters.value("source")
        t_s = next((window.tca_t_s for window in self._passes if window.los_t_s >= now_s), now_s)
        try:
            return stale_warning(self._track, t_s, source.stale_days * DAY_S, self.parameters.value("uncertainty"))
        except ValueError as error:
            return str(error)

    def _uncertainty(self, t_s: float) -> SkyUncertainty | None:
        """Return the uncertainty of the elements on the sky, None for a target without elements."""
        if not isinstance(getattr(self._track.target, "elements", None), ephemeris.Elements):
            return None
        try:
            return ephemeris.sky_uncertainty(self._track, t_s, self.parameters.value("uncertainty"))
        except ValueError as error:
            self.log_once("uncertainty unknown", str(error))
            return None

    def _orientation_values(self) -> dict[str, float]:
        """Return the pointing error that the Earth's orientation makes, if it is predicted."""
        try:
            sigma_rad = ephemeris.orientation_sigma_rad(self._track, self.now_s())
        except ValueError:
            # The target's place is unknown now: `_publish` reports it when it is due.
            return {}
        return {"earth_orientation_sigma_deg": round(math.degrees(sigma_rad), 6)}

    def _uncertainty_values(self) -> dict[str, float]:
        sky = self._uncertainty(self.now_s())
        if sky is None:
            return {}
        return {
            "element_age_h": round(sky.age_s / 3600.0, 3),
            "along_track_sigma_s": round(sky.along_track_s, 4),
            "along_track_sigma_deg": round(math.degrees(sky.along_track_rad), 5),
            "cross_track_sigma_deg": round(math.degrees(sky.cross_track_rad), 5),
        }


def _moving(track: TopocentricTrack) -> TopocentricTrack:
    """Return the track without its hold: a target that is held passes never, or always."""
    return track.with_offsets(
        along_track_offset_s=track.along_track_offset_s, cross_track_offset_rad=track.cross_track_offset_rad
    )


def main() -> None:
    """Entry point of `ros2 run rf_pointing ephemeris_publisher`."""
    run(EphemerisPublisher)
