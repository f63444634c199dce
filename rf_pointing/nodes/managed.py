"""What every node of the graph shares: lifecycle, parameters, diagnostics, one instance per name.

A subclass declares its parameter sets in `__init__`, builds its core and its topics in `configure`, starts its timers in
`activate`.  Activation never moves an antenna.  A refused parameter or a refused start keeps the node unconfigured and
says why in the log and on /diagnostics.

With `lifecycle.autostart` a node takes itself through its lifecycle as soon as it knows the time.  A killed node that is
started again is then back without anybody's help: requests of a manager can go astray for as long as the dead one's
services are still in the graph (20 s), and those that arrive wait for discovery.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher

from rf_pointing.core import Params, parameter
from rf_pointing.nodes.diagnostics import ERROR, OK, Diagnostics, Health
from rf_pointing.nodes.instance_lock import InstanceLock
from rf_pointing.nodes.params import ParameterGroups
from rf_pointing.nodes.schedule import Schedule
from rf_pointing.nodes.stamps import seconds_from_stamp
from rf_pointing.nodes.streams import InputCounter, Latest, SequencedPublisher

__all__ = ["ManagedNode"]


@dataclass(frozen=True, kw_only=True)
class LifecycleParams(Params):
    """Who brings a node up."""

    autostart: bool = parameter(False, "whether the node configures and activates itself, now and after a restart")


class ManagedNode(LifecycleNode):
    """A lifecycle node with parameter sets, diagnostics and timers that run only while it is active."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.lock = InstanceLock(self.get_fully_qualified_name())
        self.parameters = ParameterGroups(self)
        self.parameters.declare("lifecycle", LifecycleParams())
        self.brings_itself_up: bool = self.parameters.value("lifecycle").autostart
        self.diagnostics = Diagnostics(self)
        self.inputs = InputCounter()
        self.diagnostics.add("state", self._state_health)
        self.diagnostics.add("inputs", self.inputs.health)
        self._state_name = "unconfigured"
        self._refusal = ""
        self._active_timers: list[Any] = []
        self._inputs: list[Any] = []
        self._outputs: list[Publisher] = []
        self._services_offered: list[Any] = []
        self._service_change_state.callback = self._refusing_the_impossible(self._service_change_state.callback)

    def configure(self) -> None:
        """Build the core and the topics; ValueError refuses the configuration with its message."""

    def activate(self) -> None:
        """Start timers; ValueError refuses the activation with its message."""

    def deactivate(self) -> None:
        """Bring what moves to a stop; timers are stopped by the base."""

    def now_s(self) -> float:
        """Return the node clock's time in seconds."""
        return seconds_from_stamp(self.get_clock().now().to_msg())

    def knows_time(self) -> bool:
        """Return whether the node clock runs, or has run: simulated time has to be heard first."""
        return not self.get_parameter("use_sim_time").value or self.get_clock().now().nanoseconds != 0

    def ready(self) -> bool:
        """Return whether a node that brings itself up may be activated yet."""
        return self.knows_time()

    def every(self, period_s: float, callback: Callable[[float], None]) -> Schedule:
        """Call `callback(t_s)` for every instant of a grid of node time until deactivation; return the grid."""
        schedule = Schedule(self.now_s(), period_s)

        def fire() -> None:
            for t_s in schedule.due(self.now_s()):
                callback(t_s)

        self._active_timers.append(self.create_timer(period_s, fire))
        return schedule

    def listen_latest(self, message_type: Any, topic: str, convert: Callable[[Any], Any], qos: Any) -> Latest:
        """Subscribe until cleanup to a stream of which only the newest message counts, now and then."""
        latest = Latest(message_type, convert)
        self.listen(message_type, topic, latest.note, qos, raw=True)
        return latest

    def turn(self) -> float:
        """Do what is due between two events; return how many seconds to wait for the next event at most.

        A signal is noticed between two events, so the wait bounds the time to react to it.
        """
        return 0.2

    def bring_up(self) -> None:
        """Take the steps of `lifecycle.autostart` that are possible by now; each is tried once."""
        if not self.brings_itself_up:
            return
        if self._state_name == "unconfigured":
            self.trigger_configure()
        if self._state_name == "inactive" and not self.ready():
            return
        self.brings_itself_up = False
        if self._state_name == "inactive":
            self.trigger_activate()

    def end(self) -> None:
        """Deactivate if active; called once before the process ends."""
        if self._state_name == "active":
            self.deactivate()
            self._state_name = "finalized"
        self._clear()

    def listen(
        self, message_type: Any, topic: str, callback: Callable[[Any], None], qos: Any, *, raw: bool = False
    ) -> None:
        """Subscribe until cleanup; gaps of a numbered stream and messages refused by ValueError show on /diagnostics."""
        if not raw and hasattr(message_type, "sequence"):
            callback = self.inputs.watching(topic, callback)
        guarded = self._guarded(topic, callback)
        self._inputs.append(self.create_subscription(message_type, topic, guarded, qos, raw=raw))

    def _guarded(self, topic: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return `callback` behind a guard: an exception that left a callback would end the process."""

        def take(message: Any) -> None:
            try:
                callback(message)
            except ValueError as refusal:
                self.inputs.note_refusal(topic, str(refusal))
                self.get_logger().warning(f"{topic} ignored: {refusal}", throttle_duration_sec=1.0)

        return take

    def serve(self, service_type: Any, name: str, callback: Callable[[Any, Any], Any]) -> None:
        """Offer a service until cleanup."""
        self._services_offered.append(self.create_service(service_type, name, callback))

    def stream(self, message_type: Any, topic: str, qos: Any) -> SequencedPublisher:
        """Create a publisher that numbers its messages."""
        return SequencedPublisher(self.publisher(message_type, topic, qos))

    def publisher(self, message_type: Any, topic: str, qos: Any) -> Publisher:
        """Create a publisher that lasts until cleanup."""
        publisher = self.create_publisher(message_type, topic, qos)
        self._outputs.append(publisher)
        return publisher

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.parameters.refuse_unknown()
        try:
            if self.parameters.refusals:
                raise ValueError("; ".join(self.parameters.refusals))
            self.configure()
        except (ValueError, OSError) as error:
            self._refusal = str(error)
            self.get_logger().error(f"not configured: {error}")
            self._clear()
            return TransitionCallbackReturn.FAILURE
        self._state_name, self._refusal, self.parameters.configured = "inactive", "", True
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            if not self.knows_time():
                raise ValueError("use_sim_time is set, but no time has been received on the clock topic")
            self.activate()
        except ValueError as error:
            self._refusal = str(error)
            self.get_logger().error(f"not activated: {error}")
            self._stop_timers()
            return TransitionCallbackReturn.FAILURE
        self._state_name, self._refusal = "active", ""
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.deactivate()
        self._stop_timers()
        self._state_name = "inactive"
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._clear()
        self._state_name, self.parameters.configured = "unconfigured", False
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.end()
        self._state_name = "finalized"
        return super().on_shutdown(state)

    def _refusing_the_impossible(self, change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Return the service's callback behind a guard.

        A transition that the present state does not have, such as a second activation, raises in rclpy, and an exception
        that left a callback would end the process.
        """

        def change(request: Any, response: Any) -> Any:
            try:
                return change_state(request, response)
            except rclpy_implementation.RCLError:
                wanted = request.transition.label or request.transition.id
                self.get_logger().error(f"transition {wanted} refused: the node is {self._state_name}")
                response.success = False
                return response

        return change

    def _stop_timers(self) -> None:
        for timer in self._active_timers:
            self.destroy_timer(timer)
        self._active_timers.clear()

    def _clear(self) -> None:
        self._stop_timers()
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self._inputs.clear()
        for publisher in self._outputs:
            self.destroy_publisher(publisher)
        self._outputs.clear()
        for service in self._services_offered:
            self.destroy_service(service)
        self._services_offered.clear()

    def _state_health(self) -> Health:
        refusals = "; ".join(self.parameters.refusals) or self._refusal
        return Health(ERROR if refusals else OK, refusals or self._state_name, {"state": self._state_name})
