"""The services of a node: a thread takes and answers calls, the node's own loop carries them out.

An answer blocks the process for 0.1 s where the middleware does not know the caller's end yet, and
is lost: of 200 callers that had just started 14 were answered, and the node did nothing for 4 s.
Here an answer waits until the ends of all callers are known, and is sent again while its own is
not.  Whoever calls more often than can be served is refused at once.
"""

import atexit
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from threading import Thread
from typing import Any

from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.service import Service
from rclpy.type_support import check_is_valid_srv_type

InvalidHandle = rclpy_implementation.InvalidHandle

MOST_WAITING = 1000
"""Calls that may wait for the node; further ones are refused."""
TURN_S = 0.005
"""Time of the node's loop that calls take between two other events."""
# Every client of a service gets the answers to all of them, and keeps ten until it looks.
BURST, PACE_S, PACE_EACH_S = 4, 0.01, 0.0006
"""Answers sent in a row, the pause after them, and what each caller adds to it."""
UNKNOWN_S, KNOWN_S, WORTH_S = 0.05, 5.0, 30.0
"""Time between two looks for the ends of callers, the longest waits for all and for one of them."""


class ServiceDoor:
    """Services of one node, served until they are destroyed; `close` ends the thread."""

    def __init__(self, node: Node) -> None:
        self._node, self._closed = node, False
        self.services: list[Service] = []
        self._calls = deque[tuple[Service, Any, Any]]()
        # With the time until which each is worth sending.
        self._answers = deque[tuple[Service, Any, Any, float]]()
        # Services with a call since their callers were known, with the times of the calls.
        self._unknown = dict[Service, float]()
        self._callers = 0
        self._called = False
        self._wake = GuardCondition(None, None, context=node.context)
        self._thread = Thread(target=self._work, name="services", daemon=True)

    def open(self, kind: Any, name: str, callback: Callable[[Any, Any], Any], qos: Any) -> Service:
        """Offer a service; `callback` takes request and response in the node's loop."""
        check_is_valid_srv_type(kind)
        with self._node.handle:
            made = rclpy_implementation.Service(self._node.handle, kind, name, qos.get_c_qos_profile())
        service = Service(made, kind, name, callback, self._node.default_callback_group, qos)
        self.services.append(service)
        if not self._thread.ident:
            self._thread.start()
            # A process that ends while its thread waits in the middleware would abort.
            atexit.register(self.close)
        self._wake.trigger()
        return service

    def shut(self, service: Service) -> None:
        """Offer a service no longer."""
        self.services.remove(service)
        self._wake.trigger()
        service.destroy()

    def close(self) -> None:
        """End the thread and the services."""
        atexit.unregister(self.close)
        self._closed = True
        self._wake.trigger()
        if self._thread.ident:
            self._thread.join(2.0)
        while self.services:
            self.services.pop().destroy()

    # In the node's loop

    def _carry_out(self) -> None:
        until_s, self._called = time.perf_counter() + TURN_S, False
        while self._calls and time.perf_counter() < until_s:
            service, request, header = self._calls.popleft()
            # What is left when the node has closed the service is answered by nobody.
            if service in self.services:
                answer = service.callback(request, service.srv_type.Response())
                # Two nodes of one name both obey, and the one that works answers.
                if not getattr(self._node, "quiet", False):
                    self._answers.append((service, answer, header, time.monotonic() + WORTH_S))
        self._wake.trigger()
        if self._calls:
            self._call_node()

    def _call_node(self) -> None:
        """Let the node's loop carry out what waits; safe in any thread."""
        executor = self._node.executor
        if executor is not None and not self._called:
            self._called = True
            executor.create_task(self._carry_out)

    # In the thread

    def _work(self) -> None:
        while not self._closed and self._node.context.ok():
            try:
                self._come_round()
            except Exception as error:
                # A node whose thread has ended would take calls and never answer one.
                self._node.survived("a call", error)
                time.sleep(UNKNOWN_S)

    def _come_round(self) -> None:
        with ExitStack() as held:
            services = [each for each in tuple(self.services) if _hold(held, each)]
            self._wait(services)
            for service in services:
                self._take(service)
        if self._calls:
            self._call_node()
        self._send()

    def _wait(self, services: list[Service]) -> None:
        """Wait for calls or answers."""
        context = self._node.context.handle
        wait_set = rclpy_implementation.WaitSet(0, 1, 0, 0, len(services), 0, context)
        wait_set.clear_entities()
        wait_set.add_guard_condition(self._wake.handle)
        for service in services:
            wait_set.add_service(service.handle)
        wait_set.wait(int(1e9 * (PACE_S if self._answers else 1.0)))

    def _take(self, service: Service) -> None:
        while True:
            request, header = service.handle.service_take_request(service.srv_type.Request)
            if header is None:
                return
            self._unknown[service] = time.monotonic()
            if len(self._calls) < MOST_WAITING:
                self._calls.append((service, request, header))
                continue
            answer = service.srv_type.Response()
            if hasattr(answer, "success"):
                answer.success, answer.message = False, f"{MOST_WAITING} calls wait; call again later"
            self._answers.append((service, answer, header, time.monotonic() + WORTH_S))

    def _send(self) -> None:
        """Send a few answers; those whose callers are not known yet go to the end."""
        known = dict[Service, bool]()
        for _ in range(min(BURST, len(self._answers))):
            service, response, header, until_s = answer = self._answers.popleft()
            try:
                if known.setdefault(service, self._knows_callers(service)):
                    service.send_response(response, header)
            except InvalidHandle:
                continue  # the service is closed
            except (rclpy_implementation.RCLError, UnicodeDecodeError):
                # The end of this caller is not known yet, or the graph cannot be read.
                known[service] = False
            if not known[service] and time.monotonic() < until_s:
                self._answers.append(answer)
        if self._answers:
            time.sleep(PACE_S + self._callers * PACE_EACH_S if any(known.values()) else UNKNOWN_S)

    def _knows_callers(self, service: Service) -> bool:
        """Return whether the answers of a service need not wait, or have waited long enough."""
        if service not in self._unknown:
            return True
        name, node = service.service_name, self._node
        self._callers = len(node.get_publishers_info_by_topic(f"rq{name}Request", True))
        known = self._callers <= len(node.get_subscriptions_info_by_topic(f"rr{name}Reply", True))
        if known or time.monotonic() - self._unknown[service] > KNOWN_S:
            self._unknown.pop(service)
        return service not in self._unknown


def _hold(held: ExitStack, service: Service) -> bool:
    """Keep a service from being destroyed meanwhile; return whether it still is."""
    try:
        held.enter_context(service.handle)
    except InvalidHandle:
        return False
    return True
