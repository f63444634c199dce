"""Executable `signal_source`: the samples that a radio behind the simulated antenna delivers.

In place of rf_receiver where the receiver of a simulated station is a real one: the signal passes
as samples only.  Subscribes: sim/boresight, passes (which satellite is selected).  Publishes:
sim/pointing_error (10 Hz, truth).  Serves: rtl_tcp, DIFI, ZMQ or a SigMF recording.
Parameters: source.*, signal.* as rf_receiver; sdr.* (radio and transmitter), outlet.* (where).
"""

from rf_pointing_msgs.msg import Boresight, PassList, PointingError

from rf_pointing.ephemeris import ElementUpdates, SourceParams, TopocentricTrack, load_track
from rf_pointing.receiver.serving import Outlet, make_outlet
from rf_pointing.ros import convert
from rf_pointing.ros.diagnostics import Health
from rf_pointing.ros.qos import LATCHED, SAMPLES, STREAM
from rf_pointing.ros.station_node import StationNode
from rf_pointing.station.antenna.radio import SimulatedRadio, seeded
from rf_pointing.station.antenna.receiver import SignalParams
from rf_pointing.station.derive.axes import kinematics_of


class SignalSource(StationNode):
    """Turns boresights into samples at their stamps, without a timer."""

    def __init__(self) -> None:
        super().__init__("signal_source")
        self._radio: SimulatedRadio | None = None
        self._outlet: Outlet | None = None
        self._ticks = 0

    def configure(self) -> None:
        source: SourceParams = self.parameters.value("source")
        ElementUpdates(source.elements).require()
        self._serve(load_track(source))
        self._at_cleanup.callback(lambda: self._outlet.close())
        self._truth = self.stream(PointingError, "sim/pointing_error", STREAM)
        self.listen(Boresight, "sim/boresight", self._on_boresight, SAMPLES)
        self.listen(PassList, "passes", self._on_passes, LATCHED)
        self.diagnostics.add("samples", self._health)

    def _serve(self, track: TopocentricTrack) -> None:
        signal, radio = self.parameters.value("signal"), self.parameters.value("sdr")
        mount = kinematics_of(self.station.content)
        self._radio = SimulatedRadio(signal, seeded(radio, signal.seed), track, mount)
        old, where = self._outlet, (self.parameters.value("outlet"), radio.generator.rate_hz)
        if old is not None and (old.params, old.rate_hz) == where:
            old.centre_hz = radio.centre_hz
            return
        if old is not None:
            old.close()
        self._outlet = make_outlet(*where, radio.centre_hz)

    def use_band(self) -> None:
        self._serve(self._radio.track)

    def _on_passes(self, message: PassList) -> None:
        """Tune to the satellite that the ephemeris publisher predicts."""
        if message.target and message.target != self._radio.target:
            source: SourceParams = self.parameters.value("source")
            self._radio.tune(load_track(source.replace(satellite=message.target)))

    def _on_boresight(self, message: Boresight) -> None:
        piece = self._radio.take(convert.boresight_from_message(message)) if self.active else None
        if piece is not None:
            self._outlet.send(piece.samples, piece.t_s)
            self._ticks += 1
            # As often as rf_receiver, on the same grid.
            params: SignalParams = self.parameters.value("signal")
            if round(piece.truth.t_s / params.sample_s) % params.cluster_samples == 0:
                self._truth.publish(convert.error_to_message(piece.truth))

    def _health(self) -> Health:
        return Health(values={"pieces": self._ticks, "lost": self._outlet.lost})


main = SignalSource.main
