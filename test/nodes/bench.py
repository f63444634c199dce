"""One node on a bench: the node is real, its surroundings are the test's.

Clocks, the other ends of its topics, services and actions, and what the graph shows are replaced by public methods of
rclpy; nothing inside the node is touched.

    bench = make_bench(AntennaServo, **{"drive.type": "simulated_rotator"}).up()
    bench.give("joint_trajectory", message)     bench.sent["joint_states"][-1]
    bench.run(0.5)                              bench.health("drive").message
    bench.call("~/park")                        bench.goal("identify", Identify.Goal(axis="azimuth"))
"""

import json
import math
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Self

import pytest
import rclpy
import rclpy.node
from rclpy.action import CancelResponse, GoalResponse
from rclpy.context import Context
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_srvs.srv import Trigger

from rf_pointing.nodes.ephemeris_publisher import EphemerisPublisher
from rf_pointing.nodes.rf_receiver import RfReceiver
from rf_pointing.ros.station_node import StationNode

NOW_S, WALL_S = 1.8e9, 1000.0
"""Node time, and the steady clock, when a bench is made."""


class Bench:
    """Holds a node of `node_type` with the parameters `given`, as they would come from its command line.

    In `real_time` the clocks are the machine's: for what other programs do.
    """

    def __init__(
        self, node_type: Any, patch: pytest.MonkeyPatch, domain: int, *, namespace: str = "/", t_s: float = NOW_S,
        real_time: bool = False, **given: Any,
    ) -> None:  # fmt: skip
        self.t_s, self.wall_s, self.real_time = t_s, WALL_S, real_time
        self.sent: dict[str, list[Any]] = defaultdict(list)
        """Messages by topic as the node names it, as a subscriber gets them."""
        self.clients: dict[str, Service] = {}
        self.actions: dict[str, ActionServer] = {}
        self.publishers: dict[str, list[str]] = {}
        """Full names of the nodes that the graph shows as publishers of a topic."""
        self.log: list[tuple[str, str]] = []
        self._replace(patch)
        given = _named(node_type) | given
        words = [word for name, value in given.items() for word in ("-p", f"{name}:={_yaml(value)}")]
        # Of its own: the arguments of a context are those of all its nodes.
        self.context = Context()
        rclpy.init(
            args=["--ros-args", "-r", f"__ns:={namespace}", *words], context=self.context, domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )  # fmt: skip
        try:
            with patch.context() as inside:
                inside.setattr(rclpy.node, "get_default_context", lambda **_: self.context)
                self.node = type(node_type.__name__, (_OnBench, node_type), {"bench": self})()
        except BaseException:
            self.context.try_shutdown()
            raise

    def _replace(self, patch: pytest.MonkeyPatch) -> None:
        """Put the bench's clock and actions in place of those that the modules of the package have imported."""
        replaced = {"time": time, "ActionServer": rclpy.action.ActionServer, "ActionClient": rclpy.action.ActionClient}
        for name, module in list(sys.modules.items()):
            for attribute, real in replaced.items():
                kept = self.real_time and real is time
                if name.startswith("rf_pointing.") and not kept and vars(module).get(attribute) is real:
                    patch.setattr(module, attribute, Clock(self) if real is time else globals()[attribute])

    def close(self) -> None:
        """End the node as its process does."""
        self.node.end()
        self.node.lock.release()
        self.node.destroy_node()
        self.context.try_shutdown()

    # Lifecycle, parameters, time

    def step(self, transition: str) -> bool:
        """Take a transition: configure, activate, deactivate or cleanup; return whether it was taken."""
        return bool(getattr(self.node, f"trigger_{transition}")() == TransitionCallbackReturn.SUCCESS)

    def up(self) -> Self:
        """Configure and activate."""
        for transition in ("configure", "activate"):
            assert self.step(transition), self.health("state").message
        self.wait(0.0)
        return self

    def change(self, **values: Any) -> str:
        """Set parameters while the node runs; return "" or why they are refused."""
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        return str(self.node.set_parameters_atomically(parameters).reason)

    def run(self, seconds: float, step_s: float = 0.0) -> None:
        """Let both clocks go on, with the timers of the node's work, and the turns between events."""
        step_s = step_s or min((1e-9 * timer.timer_period_ns for timer in self._timers()), default=seconds)
        for _ in range(max(1, round(seconds / step_s))):
            self.wait(step_s)
            self.turn()

    def wait(self, seconds: float) -> None:
        """Let both clocks go on while nothing is done."""
        if self.real_time:
            time.sleep(seconds)
            self.t_s = self.node.now_s()
            return
        self.t_s, self.wall_s = round(self.t_s + seconds, 6), self.wall_s + seconds

    def turn(self) -> float:
        """Do what is due now; return the longest wait for the next event."""
        for timer in self._timers():
            timer.callback()
        return float(self.node.turn())

    def _timers(self) -> list[Any]:
        return [timer for timer in self.node.timers if timer.callback != self.node.diagnostics.publish]

    # What arrives and what is sent

    def give(self, topic: str, *messages: Any) -> None:
        """Deliver messages, or bytes, to the subscriptions of a topic; KeyError without any."""
        name = self.node.resolve_topic_name(topic)
        doors = [each.callback for each in self.node.subscriptions if each.topic_name == name]
        if not doors:
            raise KeyError(f"no subscription of {topic}")
        for message in messages:
            for door in doors:
                door(message if isinstance(message, bytes) else serialize_message(message))

    def inputs(self) -> list[tuple[str, Any]]:
        """Return topic and message type of every subscription of the node."""
        return [(each.topic_name, each.msg_type) for each in self.node.subscriptions]

    def call(self, name: str, request: Any = None) -> Any:
        """Call a service of the node, by default a Trigger; return its response."""
        full = self.node.resolve_service_name(name)
        (service,) = (each for each in self.node.offered if each.service_name == full)
        return service.callback(request or Trigger.Request(), service.srv_type.Response())

    def goal(self, action: str, goal: Any) -> "Goal | None":
        """Send a goal to an action of the node; return its handle, None if it is rejected."""
        return self.actions[action].take(goal)

    def health(self, name: str) -> Any:
        """Return level, message and values of one check on /diagnostics."""
        self.node.diagnostics.publish()
        status = next(each for each in self.sent["/diagnostics"][-1].status if each.name.endswith(f": {name}"))
        values = {each.key: each.value for each in status.values}
        return SimpleNamespace(level=status.level, message=status.message, values=values)

    def health_names(self) -> set[str]:
        """Return the names of the checks on /diagnostics."""
        self.node.diagnostics.publish()
        return {each.name.partition(": ")[2] for each in self.sent["/diagnostics"][-1].status}


def _named(node_type: Any) -> dict[str, str]:
    """Return the station, and the target, of a node that takes them: neither has a default."""
    station = {"station": "dss13"} if issubclass(node_type, StationNode) else {}
    return station | ({"source.satellite": "28057"} if node_type in (EphemerisPublisher, RfReceiver) else {})


def _yaml(value: Any) -> str:
    return ".nan" if isinstance(value, float) and math.isnan(value) else json.dumps(value)


class _OnBench:
    """What a node asks of rclpy, answered by the bench."""

    bench: Bench

    def now_s(self) -> float:
        return float(super().now_s()) if self.bench.real_time else self.bench.t_s  # type: ignore[misc]

    def create_publisher(self, message_type: Any, topic: str, *given: Any, **options: Any) -> Any:
        publisher = super().create_publisher(message_type, topic, *given, **options)  # type: ignore[misc]
        # Through the wire format: what cannot be sent fails here, and later changes are not seen.
        publisher.publish = lambda message: self.bench.sent[topic].append(
            deserialize_message(message if isinstance(message, bytes) else serialize_message(message), message_type)
        )
        return publisher

    def create_client(self, _service_type: Any, name: str, **_options: Any) -> "Service":
        return self.bench.clients.setdefault(name, Service())

    def get_publishers_info_by_topic(self, topic: str, *_: Any) -> list[Any]:
        names = [name.rpartition("/") for name in self.bench.publishers.get(topic, [])]
        return [SimpleNamespace(node_namespace=space or "/", node_name=name) for space, _, name in names]

    def get_logger(self) -> Any:
        log = self.bench.log
        return SimpleNamespace(**{
            level: (lambda words, level=level, **_: log.append((level, str(words))))
            for level in ("debug", "info", "warning", "error", "fatal")
        })  # fmt: skip


class Clock:
    """The module `time` on a bench: a sleep passes at once."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def monotonic(self) -> float:
        return self._bench.wall_s

    perf_counter = monotonic

    def time(self) -> float:
        return self._bench.t_s

    def sleep(self, seconds: float) -> None:
        self._bench.wait(seconds)

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)


class Service:
    """A service or an action of another node, as its client sees it."""

    def __init__(self) -> None:
        self.ready = True
        self.requests: list[Any] = []
        self.futures: list[Future] = []

    def service_is_ready(self) -> bool:
        return self.ready

    server_is_ready = service_is_ready

    def call_async(self, request: Any, **_options: Any) -> Future:
        self.requests.append(request)
        self.futures.append(Future())
        return self.futures[-1]

    send_goal_async = call_async

    def answer(self, response: Any) -> Any:
        """Answer the newest request; return it."""
        self.futures[-1].set_result(response)
        return self.requests[-1]

    def remove_pending_request(self, future: Future) -> None:
        future.cancel()

    def destroy(self) -> None: ...


class ActionClient(Service):
    """A client of an action, among the clients of its bench by name."""

    def __init__(self, node: Any, _action_type: Any, name: str, **_options: Any) -> None:
        super().__init__()
        node.bench.clients[name] = self


class Goal:
    """A goal of a node's action; `end` is "" until the node ends it, `result` what it then returned."""

    def __init__(self, request: Any, server: "ActionServer") -> None:
        self.request, self.is_cancel_requested = request, False
        self.end, self.result = "", None
        self.feedback: list[Any] = []
        self.publish_feedback = self.feedback.append
        self._server = server

    def execute(self) -> None:
        self.result = self._server.execute(self)

    def cancel(self) -> bool:
        """Request that the goal is cancelled; return whether the node accepts."""
        self.is_cancel_requested = self._server.cancel(self) == CancelResponse.ACCEPT
        return self.is_cancel_requested

    def succeed(self) -> None:
        self.end = "succeeded"

    def abort(self) -> None:
        self.end = "aborted"

    def canceled(self) -> None:
        self.end = "canceled"


class ActionServer:
    """An action of the node: rclpy's own would hand goals to an executor."""

    def __init__(
        self, node: Any, _action_type: Any, name: str, execute_callback: Callable[[Any], Any], *,
        goal_callback: Callable[[Any], Any] = lambda _: GoalResponse.ACCEPT,
        handle_accepted_callback: Callable[[Any], None] = Goal.execute,
        cancel_callback: Callable[[Any], Any] = lambda _: CancelResponse.REJECT, **_options: Any,
    ) -> None:  # fmt: skip
        self.execute, self.accepts = execute_callback, goal_callback
        self.accepted, self.cancel = handle_accepted_callback, cancel_callback
        node.bench.actions[name] = self

    def take_data(self) -> dict[str, Any]:
        return {}

    def take(self, request: Any) -> Goal | None:
        if self.accepts(request) != GoalResponse.ACCEPT:
            return None
        goal = Goal(request, self)
        self.accepted(goal)
        return goal

    def destroy(self) -> None: ...
