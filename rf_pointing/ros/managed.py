"""What every node of the graph shares: lifecycle, parameters, diagnostics, periodic work.

A subclass declares its parameter sets in `__init__`, builds its core and its topics in `configure`,
and starts its timers in `activate`.  Activation never moves an antenna.  If a parameter or a
transition is refused, the node stays in its state; the reason is in the log and on /diagnostics.

With `lifecycle.autostart` a node configures and activates itself as soon as it knows the time.
"""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher

from rf_pointing.core import Params, parameter
from rf_pointing.ros.diagnostics import ERROR, OK, Diagnostics, EventLog, Health
from rf_pointing.ros.graph import FRAMES
from rf_pointing.ros.input_watchdog import Hearing
from rf_pointing.ros.main_loop import InstanceLock, take_priority
from rf_pointing.ros.params import ParameterGroups
from rf_pointing.ros.qos import LATCHED, SERVICE
from rf_pointing.ros.stamps import seconds_from_stamp
from rf_pointing.ros.streams import (
    FramedPublisher,
    InputCounter,
    Latest,
    SequencedPublisher,
    checked_message,
    frame_in,
    require_length,
)

# A message of this length takes 20 ms to decode; it is ten times that of any stream.
STREAM_BYTES = 256 * 1024
# Latched lists hold the profiles of days of passes.
LATCHED_BYTES = 16 * 1024 * 1024


@dataclass(frozen=True, kw_only=True)
class LifecycleParams(Params):
    """Who brings a node up."""

    autostart: bool = parameter(False, "whether the node configures and activates itself, now and after a restart")
    realtime_priority: int = parameter(0, "SCHED_FIFO priority of the process, 0: as it was started", low=0, high=98)


class Schedule:
    """The times at which periodic work is due: the whole multiples of `period_s` after `start_s`.

    The work is done once for every instant of the grid, in order.  A gap of more than
    `longest_gap_s` starts a new grid.  It is a jump of the clock, unless a steady clock has gone on
    as far: then the process itself has stalled.
    """

    # A timer may fire late, or twice at one time when the clock moves in steps.  Whole multiples
    # let two nodes of one period work at the same time.

    def __init__(self, start_s: float, period_s: float, longest_gap_s: float = 0.5) -> None:
        self._period_s = period_s
        self._longest_gap_s = max(longest_gap_s, 2.0 * period_s)
        self._origin_s, self._count = self._on_grid(start_s), 1
        self._steady_s: float | None = None
        self.jumped_s = self.stalled_s = 0.0

    def due(self, now_s: float, steady_s: float | None = None) -> list[float]:
        """Return the instants until `now_s` not returned yet.

        `jumped_s` is not 0 after a jump, `stalled_s` after a stall.  `steady_s` is the time of a
        clock that nobody sets, None where time is simulated.
        """
        self.jumped_s = self.stalled_s = 0.0
        late_s = now_s - self._next_s
        stood_s = 0.0 if steady_s is None or self._steady_s is None else steady_s - self._steady_s
        self._steady_s = steady_s
        if abs(late_s) > self._longest_gap_s:
            if abs(late_s - stood_s) > self._longest_gap_s:
                self.jumped_s = late_s - stood_s
            else:
                self.stalled_s = stood_s
            self._origin_s, self._count = self._on_grid(now_s), 0
        times = []
        while self._next_s <= now_s + 1e-3 * self._period_s:
            times.append(self._next_s)
            self._count += 1
        return times

    def _on_grid(self, t_s: float) -> float:
        return math.floor(t_s / self._period_s + 1e-4) * self._period_s

    @property
    def _next_s(self) -> float:
        # Whole microseconds: that is what stamps can hold.
        return round(self._origin_s + self._count * self._period_s, 6)


class ManagedNode(LifecycleNode):
    """A lifecycle node with parameter sets, diagnostics, and timers that run while it is active."""

    LIFECYCLE = LifecycleParams()

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.lock = InstanceLock(self.get_fully_qualified_name())
        self.parameters = ParameterGroups(self)
        self.parameters.declare("lifecycle", self.LIFECYCLE)
        self.brings_itself_up: bool = self.parameters.value("lifecycle").autostart
        if refused := take_priority(self.parameters.value("lifecycle").realtime_priority):
            self.get_logger().warning(refused)
        self.diagnostics = Diagnostics(self)
        self.inputs, self._events = InputCounter(), EventLog()
        self.diagnostics.add("state", self._state_health)
        self.diagnostics.add("inputs", self.inputs.health)
        self.hearing = Hearing(self)
        self._state_name = "unconfigured"
        self._reason = ""
        self.failure: Exception | None = None
        """The error by which periodic work has failed."""
        self._at_deactivation, self._at_cleanup = ExitStack(), ExitStack()
        # rclpy has no public way to guard the transitions of its own service.
        self._change_state_of_rclpy = self._service_change_state.callback
        self._service_change_state.callback = self._change_state_if_possible

    def set_parameters_atomically(self, parameter_list: Any) -> SetParametersResult:
        """Set parameters, all or none; an unknown one is refused with the nearest name."""
        # rclpy raises, and its service answers with a tuple of words.
        for each in parameter_list:
            if not self.has_parameter(each.name):
                return SetParametersResult(successful=False, reason=self.parameters.unknown(each.name))
        return super().set_parameters_atomically(parameter_list)

    def configure(self) -> None:
        """Build the core and the topics; ValueError refuses the configuration with its message."""

    def activate(self) -> None:
        """Start timers; ValueError refuses the activation with its message."""

    def deactivate(self) -> None:
        """Bring what moves to a stop; timers are stopped by the base."""

    @property
    def active(self) -> bool:
        """Whether the node works: from the end of `activate` to that of `deactivate`."""
        return self._state_name == "active"

    def now_s(self) -> float:
        """Return the node clock's time in seconds."""
        return seconds_from_stamp(self.get_clock().now().to_msg())

    def knows_time(self) -> bool:
        """Return whether the node clock has a time: simulated time has to be received first."""
        return not self.get_parameter("use_sim_time").value or self.get_clock().now().nanoseconds != 0

    def ready(self) -> bool:
        """Return whether a node that brings itself up may be activated yet."""
        return self.knows_time()

    def every(self, period_s: float, callback: Callable[[float], None]) -> Schedule:
        """Call `callback(t_s)` at every instant of a grid of node time until deactivation."""
        schedule, simulated = Schedule(self.now_s(), period_s), self.get_parameter("use_sim_time").value

        def fire() -> None:
            try:
                # More than one instant where timers fired late: each is done, none is skipped.
                for t_s in schedule.due(self.now_s(), None if simulated else time.monotonic()):
                    callback(t_s)
            except Exception as error:
                # Work that moves an antenna cannot be left out: the main loop ends this node.
                self.failure = error
                raise

        self._at_deactivation.callback(self.destroy_timer, self.create_timer(period_s, fire))
        return schedule

    def listen_latest(
        self, message_type: Any, topic: str, convert: Callable[[Any], Any], qos: Any, *, steady: bool = False
    ) -> Latest:
        """Subscribe until cleanup to a fast stream of which only the newest message counts."""
        latest = Latest(message_type, convert, lambda reason: self._ignore(topic, reason))
        self.listen(message_type, topic, latest.note, qos, raw=True, steady=steady)
        return latest

    def turn(self) -> float:
        """Do what is due between two events; return the longest wait in s for the next event."""
        # A signal is noticed between two events, so the wait bounds the time to react to it.
        return 0.2

    def bring_up(self) -> None:
        """Take the steps of `lifecycle.autostart` that are possible now; each is tried once."""
        # A manager's requests can go to a killed node alone for as long as its services stay in the
        # graph (20 s), and its discovery takes time: a node that acts itself is back within 3 s.
        if not self.brings_itself_up:
            return
        if self._state_name == "unconfigured":
            self.trigger_configure()
        if self._state_name == "inactive" and not self.ready():
            return
        # Before the attempt: a node that refuses must not try again and again.
        self.brings_itself_up = False
        if self._state_name == "inactive":
            self.trigger_activate()

    def end(self) -> None:
        """Deactivate if active; called once before the process ends."""
        if self.active:
            self.deactivate()
            self._state_name = "finalized"
        self._clear()

    def fail(self, reason: str) -> None:
        """Bring what moves to a stop although the work has failed; called before `end`."""

    def survived(self, where: str, error: BaseException) -> None:
        """Count an error of a callback that was not foreseen, and go on."""
        self.inputs.note_error(where, error)
        self.log_once(where, f"{type(error).__name__}: {error}; please report it", error=True)

    def log_once(self, subject: str, words: str, *, error: bool = False) -> None:
        """Log what may repeat with every message or period; its count is on /diagnostics."""
        if self._events.is_news(subject, words, time.monotonic()):
            # rclpy refuses another severity at the same place.
            if error:
                self.get_logger().error(f"{subject}: {words}")
            else:
                self.get_logger().warning(f"{subject}: {words}")

    def listen(
        self,
        message_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos: Any,
        *,
        raw: bool = False,
        steady: bool = False,
        most_bytes: Callable[[], int] | None = None,
        refused: Callable[[str], object] = str,
    ) -> None:
        """Subscribe until cleanup; lost messages, and those refused by ValueError, are counted.

        What arrives passes one door: a message is refused when it is too long, before it is
        decoded, when it cannot be decoded, and when a stamp or a number in it can be none.  With
        `raw` the callback gets the bytes, of which only the length has been checked.  `refused`
        takes each reason.  A `steady` topic is sent all the time while its publisher is active:
        this node is deaf if it is silent then.
        """
        most = most_bytes or (lambda: LATCHED_BYTES if qos is LATCHED else STREAM_BYTES)
        door = self._door(message_type, topic, callback, raw, most, refused)
        if steady:
            door = _both(self.hearing.watch(topic), door)
        subscription = self.create_subscription(message_type, topic, door, qos, raw=True)
        self._at_cleanup.callback(self.destroy_subscription, subscription)

    def _door(
        self,
        message_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        raw: bool,
        most_bytes: Callable[[], int],
        refused: Callable[[str], object],
    ) -> Callable[[bytes], None]:
        """Return what takes the bytes of a subscription; nothing that it gets makes it raise."""
        # Raw messages are not decoded, so their numbers are not seen.
        counted = hasattr(message_type, "sequence") and not raw
        take = self.inputs.watching(topic, callback) if counted else callback

        def door(payload: bytes) -> None:
            try:
                require_length(payload, most_bytes())
                take(payload if raw else checked_message(payload, message_type))
            except ValueError as error:
                self._ignore(topic, str(error))
                refused(str(error))
            except Exception as error:
                self.survived(topic, error)

        return door

    def _ignore(self, topic: str, reason: str) -> None:
        self.inputs.note_refusal(topic, reason)
        self.log_once(f"{topic} ignored", reason)

    def serve(self, service_type: Any, name: str, callback: Callable[[Any, Any], Any]) -> None:
        """Offer a service until cleanup."""

        def answer(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                self.survived(name, error)
                # Without an answer the client would wait for ever.
                if hasattr(response, "success"):
                    response.success, response.message = False, f"{type(error).__name__}: {error}"
                return response

        self._at_cleanup.callback(
            self.destroy_service, self.create_service(service_type, name, answer, qos_profile=SERVICE)
        )

    def serve_action(self, service_type: Any, name: str, act: Callable[[Any], str]) -> None:
        """Offer a service that answers with success and a message until cleanup.

        `act` takes the request and returns the message; its ValueError or OSError is that of a
        failure.
        """

        def answer(request: Any, response: Any) -> Any:
            try:
                response.success, response.message = True, act(request)
            except (ValueError, OSError) as error:
                response.success, response.message = False, str(error)
            return response

        self.serve(service_type, name, answer)

    def stream(self, message_type: Any, topic: str, qos: Any) -> SequencedPublisher:
        """Create a publisher that numbers its messages."""
        return SequencedPublisher(self.publisher(message_type, topic, qos))

    def publisher(self, message_type: Any, topic: str, qos: Any) -> Publisher | FramedPublisher:
        """Create a publisher that lasts until cleanup; it sets the frame that `FRAMES` names."""
        publisher = self.create_publisher(message_type, topic, qos)
        self._at_cleanup.callback(self.destroy_publisher, publisher)
        if topic not in FRAMES:
            return publisher
        return FramedPublisher(publisher, frame_in(self.get_namespace(), FRAMES[topic]))

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.parameters.refuse_unknown()
        try:
            if self.parameters.reasons:
                raise ValueError("; ".join(self.parameters.reasons))
            self.configure()
        except (ValueError, OSError) as error:
            self._reason = str(error)
            self.get_logger().error(f"not configured: {error}")
            self._clear()
            return TransitionCallbackReturn.FAILURE
        self._state_name, self._reason, self.parameters.configured = "inactive", "", True
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            if not self.knows_time():
                raise ValueError("use_sim_time is set, but no time has been received on the clock topic")
            self.activate()
        except ValueError as error:
            self._reason = str(error)
            self.get_logger().error(f"not activated: {error}")
            self._at_deactivation.close()
            return TransitionCallbackReturn.FAILURE
        self._state_name, self._reason = "active", ""
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.deactivate()
        self._at_deactivation.close()
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

    def _change_state_if_possible(self, request: Any, response: Any) -> Any:
        # A second activation, for example, raises in rclpy, which would end the process.
        try:
            return self._change_state_of_rclpy(request, response)
        except rclpy_implementation.RCLError:
            wanted = request.transition.label or request.transition.id
            self.get_logger().error(f"transition {wanted} refused: the node is {self._state_name}")
            response.success = False
            return response

    def _clear(self) -> None:
        self._at_deactivation.close()
        self._at_cleanup.close()

    def _state_health(self) -> Health:
        reasons = "; ".join(self.parameters.reasons) or self._reason
        return Health(ERROR if reasons else OK, reasons or self._state_name, {"state": self._state_name})


def _both(count: Callable[[], None], door: Callable[[bytes], None]) -> Callable[[bytes], None]:
    def counted(payload: bytes) -> None:
        count()
        door(payload)

    return counted


RESULT_TIMEOUT_S = 1e8
"""How long an action server keeps the result of a goal, in node time: as good as forever."""
# When results expire (by default after 900 s), the events executor can lose the event of a timer on
# simulated time.  Time then waits in vain for that timer's work, and the antenna runs out of
# commands.  A kept result takes 1 kB.


def conclude(goal: Any, result: Any) -> Any:
    """End `goal` as canceled if that was requested, else by the `success` of its `result`."""
    if goal.is_cancel_requested:
        goal.canceled()
    elif result.success:
        goal.succeed()
    else:
        goal.abort()
    return result
