"""Executable `tripulse_attitude`: attitude of the satellite's array from its stations.

Subscribes: <station>/tripulse_measurement.
Publishes: attitude (one for every epoch; invalid ones carry their reason).
Parameters: attitude.*, epochs.*, orbit.*, stations.*, scene.*.
"""

from rf_pointing_msgs.msg import Attitude, TripulseMeasurement

from rf_pointing.array_sensors.attitude.pass_scene import pass_scene, scene_params
from rf_pointing.array_sensors.nodes import convert
from rf_pointing.array_sensors.nodes.shared import InputOutcomes, declare
from rf_pointing.array_sensors.tripulse.geostationary_scene import GeostationaryParams
from rf_pointing.array_sensors.tripulse.station_attitude import StationAttitudeParams
from rf_pointing.array_sensors.tripulse.system import EpochParams, TripulseAttitude, attitude_report
from rf_pointing.ros.main_loop import run
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.ros.qos import STREAM


class TripulseAttitudeNode(ManagedNode):
    """Estimates once all stations have reported an epoch, or when it waited too long."""

    def __init__(self) -> None:
        super().__init__("tripulse_attitude")
        declare(
            self,
            attitude=StationAttitudeParams(),
            epochs=EpochParams(),
            **scene_params(GeostationaryParams()),
        )
        self._solver: TripulseAttitude | None = None
        self._lines = InputOutcomes()

    def configure(self) -> None:
        value = self.parameters.value
        orbit, stations = pass_scene(value("scene"), value("orbit"), value("stations"))
        self._solver = TripulseAttitude(value("attitude"), value("epochs"), orbit, stations)
        self._attitudes = self.stream(Attitude, "attitude", STREAM)
        for station in stations:
            self.listen(
                TripulseMeasurement,
                f"{station.name}/tripulse_measurement",
                lambda message: self._lines.take(lambda: self._observe(message)),
                STREAM,
                required=True,
            )
        self.diagnostics.add("lines of sight", self._lines.health)

    def activate(self) -> None:
        self._lines.open = True

    def deactivate(self) -> None:
        self._lines.open = False

    def _observe(self, message: TripulseMeasurement) -> str:
        found = self._solver.take(convert.line_from_message(message), self.now_s())
        for attitude in found:
            self._attitudes.publish(
                convert.attitude_to_message(attitude_report(attitude), convert.ARRAY_FRAME)
            )
        return found[-1].reason if found else message.reason


def main() -> None:
    """Entry point of `ros2 run rf_pointing tripulse_attitude`."""
    run(TripulseAttitudeNode)
