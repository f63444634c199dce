"""A node of the graph: what it receives passes one door, and what it offers lasts until cleanup.

A subclass declares its parameter sets in `__init__`, builds its core and its topics in `configure`,
and starts its timers in `activate` (`lifecycle.py`).  Activation never moves an antenna.  Nothing
that arrives ends the node: what cannot be used is refused and counted on /diagnostics, and so is
whatever else a callback raises.
"""

import time
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse

from rf_pointing.ros.diagnostics import Health
from rf_pointing.ros.graph import FOREIGN, FRAMES, STEADY
from rf_pointing.ros.input_watchdog import InputWatchdog
from rf_pointing.ros.lifecycle import Lifecycle, Schedule
from rf_pointing.ros.qos import IN_USE, INSTRUMENT, LATCHED, SERVICE
from rf_pointing.ros.service_door import ServiceDoor
from rf_pointing.ros.streams import (
    AnyPublisher,
    FramedPublisher,
    InputCounter,
    LatchedPublisher,
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
RESULT_TIMEOUT_S = 1e8
"""How long an action server keeps the result of a goal, in node time: as good as forever."""
# When results expire (by default after 900 s), the events executor can lose the event of a timer on
# simulated time.  Time then waits in vain for that timer's work, and the antenna runs out of
# commands.  A kept result takes 1 kB.


class ManagedNode(Lifecycle):
    """A lifecycle node with counted inputs, numbered outputs, services and actions."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.inputs = InputCounter()
        self.diagnostics.add("inputs", self.inputs.health)
        self._lasting: dict[str, LatchedPublisher] = {}
        self._endpoints: dict[tuple[str, bool, str], list[Any]] = {}
        self.damaged_topics = set[str]()
        """Topics with an end whose name could not be decoded at the last look into the graph."""
        self.diagnostics.add("outputs", self._outputs_health)
        self.input_watchdog = InputWatchdog(self)

    def every(self, period_s: float, callback: Callable[[float], None], *, catches_up: bool = True) -> Schedule:
        """Do periodic work as `Lifecycle.every`; a node whose work is not done starts again."""
        done, forget = self.input_watchdog.watch_work(period_s)
        self._at_deactivation.callback(forget)

        def work(t_s: float) -> None:
            callback(t_s)
            done()

        return super().every(period_s, work, catches_up=catches_up)

    def listen(
        self, message_type: Any, topic: str, callback: Callable[[Any], None], qos: Any, *,
        raw: bool = False, required: bool = False,
        most_bytes: Callable[[], int] | None = None, refused: Callable[[str], object] = str,
    ) -> None:  # fmt: skip
        """Subscribe until cleanup; lost messages, and those refused by ValueError, are counted.

        A message is refused when it is too long, before it is decoded, when it cannot be decoded,
        and when a stamp or a number in it is impossible.  With `raw` the callback gets the bytes,
        of which only the length has been checked.  `refused` takes each reason.  This node is
        deaf if one of `STEADY` is silent while its publisher is active.
        Without a `required` one it has nothing to work on, and says so while it waits.
        """
        # In simulated time our own nodes send it, and a lost message would change the result.
        if topic in FOREIGN and not self.get_parameter("use_sim_time").value:
            qos = INSTRUMENT
        most = most_bytes or (lambda: LATCHED_BYTES if qos is LATCHED else STREAM_BYTES)
        # Raw messages are not decoded, so their numbers are not seen.
        counted = hasattr(message_type, "sequence") and not raw
        take = self.inputs.watching(topic, callback) if counted else callback
        if required:
            take = self.input_watchdog.require(topic, take)
            self._at_cleanup.callback(self.input_watchdog.require_no_longer, topic)
        arrived = None
        if topic in STEADY:
            arrived, forget = self.input_watchdog.watch(topic)
            self._at_cleanup.callback(forget)

        def door(payload: bytes) -> None:
            if arrived is not None:
                arrived()
            try:
                require_length(payload, most())
                take(payload if raw else checked_message(payload, message_type))
            except ValueError as error:
                self._ignore(topic, str(error))
                refused(str(error))
            except Exception as error:
                self.survived(topic, error)

        subscription = self.create_subscription(message_type, topic, door, qos, raw=True)
        self._at_cleanup.callback(self.destroy_subscription, subscription)

    def listen_latest(
        self, message_type: Any, topic: str, convert: Callable[[Any], Any], qos: Any, *,
        required: bool = False,
    ) -> Latest:  # fmt: skip
        """Subscribe until cleanup to a fast stream of which only the newest message counts."""
        latest = Latest(message_type, convert, lambda reason: self._ignore(topic, reason))
        self.listen(message_type, topic, latest.note, qos, raw=True, required=required)
        return latest

    def missing_inputs(self) -> str:
        return self.input_watchdog.missing()

    def _ignore(self, topic: str, reason: str) -> None:
        self.inputs.note_refusal(topic, reason)
        self.log_once(f"{topic} ignored", reason)

    def survived(self, where: str, error: BaseException) -> None:
        """Count an error of a callback that was not foreseen, and go on."""
        self.inputs.note_error(where, error)
        self.log_once(where, f"{type(error).__name__}: {error}; please report it", error=True)

    def get_publishers_info_by_topic(self, topic: str, no_mangle: bool = False) -> list[Any]:
        """Return the publishers of a topic; while a name is damaged, those of the last look."""
        return self._last_sound("to", super().get_publishers_info_by_topic, topic, no_mangle)

    def get_subscriptions_info_by_topic(self, topic: str, no_mangle: bool = False) -> list[Any]:
        """Return the subscriptions of a topic; while a name is damaged, those of the last look."""
        return self._last_sound("of", super().get_subscriptions_info_by_topic, topic, no_mangle)

    def _last_sound(
        self, ends: str, look: Callable[[str, bool], list[Any]], topic: str, no_mangle: bool
    ) -> list[Any]:  # fmt: skip
        # One damaged discovery packet leaves a name in the graph for good that cannot be decoded.
        try:
            self._endpoints[topic, no_mangle, ends] = look(topic, no_mangle)
            self.damaged_topics.discard(topic)
        except UnicodeDecodeError:
            self.damaged_topics.add(topic)
        return self._endpoints.get((topic, no_mangle, ends), [])

    @property
    def offered(self) -> list[Any]:
        """The services that are offered now."""
        return [*self.services, *(each for door in self.doors.values() for each in door.services)]

    @cached_property
    def doors(self) -> dict[bool, ServiceDoor]:
        """The services that nothing may fill (True), and the others."""
        return {urgent: ServiceDoor(self) for urgent in (True, False)}

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Any, *, qos_profile: Any = SERVICE, **_: Any
    ) -> Any:
        """Offer a service through the door of this node; so do those that rclpy itself creates."""
        return self.doors[False].open(srv_type, srv_name, callback, qos_profile)

    def _clear(self) -> None:
        # In a process that no longer receives DDS may never give back an end of a topic.
        if not self.input_watchdog.deaf:
            super()._clear()

    def destroy_node(self) -> None:
        for door in self.doors.values():
            door.close()
        super().destroy_node()

    def serve(self, service_type: Any, name: str, callback: Callable[[Any, Any], Any], *, urgent: bool = False) -> None:
        """Offer a service until cleanup; an `urgent` one has a way that no calls of others fill."""

        def answer(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                self.survived(name, error)
                # Without an answer the client would wait for ever.
                if hasattr(response, "success"):
                    response.success, response.message = False, f"{type(error).__name__}: {error}"
                return response

        door = self.doors[urgent]
        self._at_cleanup.callback(door.shut, door.open(service_type, name, answer, SERVICE))

    def serve_action(self, service_type: Any, name: str, act: Callable[[Any], str], *, urgent: bool = False) -> None:
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

        self.serve(service_type, name, answer, urgent=urgent)

    def serve_goals(
        self, action_type: Any, name: str, *, accepts: Callable[[Any], bool],
        begin: Callable[[Any], None], cancel: Callable[[], object], result: Callable[[], Any],
        lost: str = "",
    ) -> ActionServer:  # fmt: skip
        """Offer an action as long as the node lives, one goal at a time.

        `accepts(request)` says whether a goal is taken, and `begin(goal)` begins it.  Whoever ends
        it calls `goal.execute()`, which takes the `result()`.  `cancel()` requests that.  Clients
        of a process that was killed get a result with the words `lost`, "" for none.
        """

        def cancelled(_goal: Any) -> CancelResponse:
            cancel()
            return CancelResponse.ACCEPT

        # A callback that waited for the end would have to await a future, which this executor polls
        # in a busy loop.
        def concluded(goal: Any) -> Any:
            if clients is not None:
                clients.forget()
            return conclude(goal, result())

        server = ActionServer(
            self, action_type, name, concluded, handle_accepted_callback=begin,
            goal_callback=lambda request: GoalResponse.ACCEPT if accepts(request) else GoalResponse.REJECT,
            cancel_callback=cancelled, result_timeout=RESULT_TIMEOUT_S,
        )  # fmt: skip
        clients = None
        if lost:
            # Imported here: nodes that serve no action, and most do not, do without it.
            from rf_pointing.ros.lost_goals import LostGoals

            clients = LostGoals(self, server, action_type, name, lost)
        return server

    def _outputs_health(self) -> Health:
        """Look after the latched topics, and return how many had to be offered anew."""
        for topic, publisher in self._lasting.items():
            if publisher.look(time.monotonic()):
                self.log_once(topic, "not all of its readers took it: offered anew")
        return Health(values={"renewed": sum(each.renewed for each in self._lasting.values())})

    def stream(self, message_type: Any, topic: str, qos: Any) -> SequencedPublisher:
        """Create a publisher that numbers its messages."""
        return SequencedPublisher(self.publisher(message_type, topic, qos))

    def publisher(self, message_type: Any, topic: str, qos: Any) -> AnyPublisher | FramedPublisher:
        """Create a publisher that lasts until cleanup; it sets the frame that `FRAMES` names."""
        make = partial(self.create_publisher, message_type, topic, qos)
        publisher: AnyPublisher
        if qos in (LATCHED, IN_USE):
            readers = partial(self.count_subscribers, topic)
            publisher = LatchedPublisher(make, self.destroy_publisher, readers)
            self._lasting[topic] = publisher
            self._at_cleanup.callback(publisher.close)
            self._at_cleanup.callback(self._lasting.pop, topic)
        else:
            publisher = make()
            self._at_cleanup.callback(self.destroy_publisher, publisher)
        if topic not in FRAMES:
            return publisher
        return FramedPublisher(publisher, frame_in(self.get_namespace(), FRAMES[topic]))


def conclude(goal: Any, result: Any) -> Any:
    """End `goal` as canceled if that was requested, else by the `success` of its `result`."""
    if goal.is_cancel_requested:
        goal.canceled()
    elif result.success:
        goal.succeed()
    else:
        goal.abort()
    return result
