"""Executable `rf_receiver`: simulated feed and receiver behind the simulated antenna.

Subscribes: sim/boresight, passes (which satellite is selected).  Publishes: monopulse,
carrier_power (10 Hz), sim/pointing_error (10 Hz, truth).  Parameters: source.* (the satellite, its
real offset from its elements included), signal.* (link, beam, feed, noise).
"""

from rf_pointing_msgs.msg import Boresight, CarrierPower, Monopulse, PassList, PointingError

from rf_pointing.ephemeris import NO_TARGET, ElementUpdates, SourceParams, load_track
from rf_pointing.ros import convert
from rf_pointing.ros.qos import LATCHED, SAMPLES, STREAM
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.antenna.receiver import SimulatedReceiver
from rf_pointing.station.derive.axes import kinematics_of


class RfReceiver(StationNode):
    """Turns boresights into samples at their stamps, without a timer."""

    def __init__(self) -> None:
        super().__init__("rf_receiver", defaults={"source": NO_TARGET})
        self._receiver: SimulatedReceiver | None = None

    def configure(self) -> None:
        source: SourceParams = self.parameters.value("source")
        ElementUpdates(source.elements).require()
        signal, mount = self.parameters.value("signal"), kinematics_of(self.station.content)
        self._receiver = SimulatedReceiver(signal, load_track(source), mount)
        self._monopulse = self.stream(Monopulse, "monopulse", STREAM)
        self._power = self.stream(CarrierPower, "carrier_power", STREAM)
        self._truth = self.stream(PointingError, "sim/pointing_error", STREAM)
        self.listen(Boresight, "sim/boresight", self._on_boresight, SAMPLES, required=True)
        self.listen(PassList, "passes", self._on_passes, LATCHED)

    def use_band(self) -> None:
        before, mount = self._receiver, kinematics_of(self.station.content)
        self._receiver = SimulatedReceiver(self.parameters.value("signal"), before.track, mount)

    def _on_passes(self, message: PassList) -> None:
        """Tune to the satellite that the ephemeris publisher predicts."""
        if message.target and message.target != self._receiver.target:
            source: SourceParams = self.parameters.value("source")
            self._receiver.tune(load_track(source.replace(satellite=message.target)))

    def _on_boresight(self, message: Boresight) -> None:
        if not self.active:
            return
        reception = self._receiver.take(convert.boresight_from_message(message))
        if reception is not None:
            self._monopulse.publish(convert.monopulse_to_message(reception.cluster))
            self._power.publish(convert.power_to_message(reception.power))
            self._truth.publish(convert.error_to_message(reception.truth))


main = RfReceiver.main
