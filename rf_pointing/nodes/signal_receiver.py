"""Executable `signal_receiver`: measures the signal of a radio, an instrument or a modem.

Subscribes: target (how fast the satellite recedes: the Doppler to expect).
Publishes: carrier_power, one every receiver.period_s; monopulse with three channels.
Parameters: receiver.*, which the station description gives (`receiver`).
"""

from rf_pointing_msgs.msg import CarrierPower, Monopulse, Target

from rf_pointing.receiver.receiver import SignalReceiver
from rf_pointing.receiver.stream_clock import SmoothClock
from rf_pointing.ros import convert
from rf_pointing.ros.diagnostics import OK, WARN, Health
from rf_pointing.ros.qos import STREAM
from rf_pointing.ros.station_node import StationNode

LOOK_S = 0.02
"""Wall time between two looks at the source; its own thread stamps what arrives meanwhile."""


class SignalReceiverNode(StationNode):
    """Publishes what the receiver measures; says on /diagnostics why it cannot."""

    def __init__(self) -> None:
        super().__init__("signal_receiver")
        self._receiver: SignalReceiver | None = None

    def configure(self) -> None:
        self._receive()
        self._at_cleanup.callback(lambda: self._receiver.end())
        self._power = self.stream(CarrierPower, "carrier_power", STREAM)
        self._monopulse = self.stream(Monopulse, "monopulse", STREAM)
        self.listen(Target, "target", self._on_target, STREAM)
        self.diagnostics.add("signal", self._health)

    def _receive(self) -> None:
        simulated = self.get_parameter("use_sim_time").value
        now_s = SmoothClock(self.now_s).now_s if simulated else self.now_s
        self._receiver = SignalReceiver(self.parameters.value("receiver"), now_s)
        if simulated:
            self._receiver.source.steady_s = now_s

    def use_band(self) -> None:
        # The device is opened anew, on the frequency of the band.
        self._receiver.end()
        self._receive()

    def _on_target(self, message: Target) -> None:
        target = convert.target_from_message(message)
        self._receiver.meter.doppler.take(target.t_s, target.range_rate_m_s)

    def turn(self) -> float:
        """Publish what was measured since the last turn."""
        wait_s = super().turn()
        if self._receiver is None:
            return wait_s
        # Also while inactive: what waits in a queue would be late afterwards.
        measured = self._receiver.step(self.now_s())
        for each in measured if self.active else ():
            self._power.publish(convert.power_to_message(each.power))
            if each.cluster is not None:
                self._monopulse.publish(convert.monopulse_to_message(each.cluster))
        return min(wait_s, LOOK_S)

    def silent_because(self) -> str:
        problem = self._receiver.source.problem if self._receiver is not None else ""
        return f"carrier_power is silent: {problem}" if problem else ""

    def _health(self) -> Health:
        problem = self._receiver.problem(self.now_s())
        return Health(WARN if problem else OK, problem or "the signal is measured", self._receiver.values())


main = SignalReceiverNode.main
