"""Services with a lease: while a signed commander has the antenna they are for who has its key.

ROS 2 tells a node nothing of who calls, and std_srvs/Trigger has no field for it.  The lease is the
newest stamp of a signed command, and it ends `LEASE_S` after it: a commander that falls silent
leaves the antenna to everybody.  Who has the key calls ~/signed with the request of the service,
serialized and signed (`command_key.py`).  What stops the antenna has no lease.  Without a key every
caller is served.
"""

import math
from collections.abc import Callable
from typing import Any

from rclpy.client import Client
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from rf_pointing_msgs.srv import SignedCall

from rf_pointing.core import require_choice
from rf_pointing.ros.command_key import CommandKey
from rf_pointing.ros.managed import ManagedNode
from rf_pointing.station.antenna.modes import OPERATED

OWNER, SIGNED = "antenna_servo", "antenna_servo/signed"
LEASED = tuple(f"{OWNER}/{name}" for name in (*OPERATED, "go_to", "jog", "stow_in_fault", "permit_sun"))
# An antenna whose commands end has stopped itself by then.
LEASE_S = 2.0


class LeasedServices:
    """The services of `antenna_servo` that a signed commander's lease closes; until cleanup."""

    def __init__(self, node: ManagedNode, key: CommandKey) -> None:
        self._node, self._key = node, key
        self._holder, self._stamp_s = "", -math.inf
        self._offered: dict[str, tuple[Any, Callable[[Any], str]]] = {}
        self.refused, self.last = 0, ""
        node.serve_action(SignedCall, f"~/{SIGNED.rpartition('/')[2]}", self._signed)

    def serve(self, service_type: Any, name: str, act: Callable[[Any], str]) -> None:
        """Offer `OWNER/name`; `act` takes the request and returns the message, as in a node."""
        full = self._node.resolve_service_name(f"~/{name}")
        self._offered[full] = service_type, act

        def unsigned(request: Any) -> str:
            if holder := self.holder:
                raise ValueError(self._refuse(
                    f"{full} is refused: {holder} commands the antenna. Stop its pass (pointing_controller/stop) or the "
                    f"antenna ({OWNER}/stop) first, or call with the key {self._key.path}, as `station` and the "
                    "operator's page do"
                ))  # fmt: skip
            return act(request)

        self._node.serve_action(service_type, f"~/{name}", unsigned)

    def note(self, holder: str, stamp_s: float) -> None:
        """Take a signed command; one that is sent again prolongs no lease."""
        # After a step back of the clock every newer command has an older stamp.
        if self._key.signed and (stamp_s > self._stamp_s or self._stamp_s > self._node.now_s() + LEASE_S):
            self._holder, self._stamp_s = holder, stamp_s

    @property
    def holder(self) -> str:
        """The signed commander that has the antenna, or ""."""
        return self._holder if abs(self._node.now_s() - self._stamp_s) <= LEASE_S else ""

    def values(self) -> dict[str, Any]:
        """Return what /diagnostics shows."""
        return {"lease": self.holder, "calls_refused": self.refused, "last_call_refused": self.last}

    def _signed(self, call: SignedCall.Request) -> str:
        try:
            self._key.check_call(call)
        except ValueError as error:
            raise ValueError(self._refuse(f"{call.service} is refused: {error}")) from error
        require_choice("service", call.service, self._offered)
        service_type, act = self._offered[call.service]
        return act(deserialize_message(bytes(call.request), service_type.Request))

    def _refuse(self, reason: str) -> str:
        self.refused, self.last = self.refused + 1, reason
        self._node.log_once("call refused", reason)
        return reason


class Caller:
    """Makes the clients of a node, and signs what it calls of the services with a lease.

    `space` comes before every name: "" is the namespace of the node, "/gs2/" another antenna.
    """

    def __init__(self, node: Node, key: CommandKey, space: str = "") -> None:
        self._node, self._key, self._space = node, key, space

    def client(self, service_type: Any, name: str) -> Client:
        """Return the client that `request` is for."""
        if self._signs(name):
            return self._node.create_client(SignedCall, self._space + SIGNED)
        return self._node.create_client(service_type, self._space + name)

    def request(self, name: str, request: Any) -> Any:
        """Return what to send: the request, or a signed call with it."""
        if not self._signs(name):
            return request
        call = SignedCall.Request(
            service=self._node.resolve_service_name(self._space + name), caller=self._node.get_fully_qualified_name(),
            request=list(serialize_message(request)),
        )  # fmt: skip
        self._key.sign_call(call)
        return call

    def _signs(self, name: str) -> bool:
        return self._key.signed and name in LEASED
