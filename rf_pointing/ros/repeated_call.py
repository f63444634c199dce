"""A service call that is made again while its answer is late.

A server drops its answer, and tells nobody, where its middleware does not know the caller's end of
the service within 0.1 s: that happens to callers that have just started, and on busy machines.
"""

import time
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rf_pointing_msgs.msg import Pass
from rf_pointing_msgs.srv import SelectTarget

from rf_pointing.ros.stamps import seconds_from_stamp, stamp_from_seconds

AGAIN_S = 5.0


class RepeatedCall:
    """A call that may be made twice, made every `AGAIN_S` of wall time until an answer comes.

    The first goes out with the first look at `done` that is `after_s` later than now.
    """

    def __init__(self, client: Any, request: Any, after_s: float = 0.0) -> None:
        self._client, self._request = client, request
        self._next_s = time.monotonic() + after_s
        self._futures: list[Any] = []

    @property
    def made(self) -> bool:
        """Whether the service was there to be called."""
        return bool(self._futures)

    def done(self) -> bool:
        """Return whether an answer is there; call again where it is time and the service ready."""
        if not self._answered() and time.monotonic() >= self._next_s and self._client.service_is_ready():
            self._futures.append(self._client.call_async(self._request))
            self._next_s = time.monotonic() + AGAIN_S
        return self._answered()

    def _answered(self) -> bool:
        return any(each.done() for each in self._futures)

    def result(self) -> Any:
        """Return the first answer, or None; the client does not wait for the others any longer."""
        late = [each for each in self._futures if not each.done()]
        for each in late:
            self._client.remove_pending_request(each)
        return next((each.result() for each in self._futures if each not in late), None)


def call_for_pass(select: Any, wanted: Pass) -> RepeatedCall:
    """Return the call by which the ephemeris publisher takes the target of a pass."""
    # A pass may rise two hours before the piece of it that is wanted.
    start = stamp_from_seconds(seconds_from_stamp(wanted.aos) - 7200.0)
    return RepeatedCall(select, SelectTarget.Request(target=wanted.target, start=start))


class ParametersOf:
    """Parameters of another node by name, read every `period_s` of wall time until `close`."""

    def __init__(self, node: Node, owner: str, names: Sequence[str], period_s: float) -> None:
        self._node, self._names, self._period_s = node, names, period_s
        self._client = node.create_client(GetParameters, f"{owner}/get_parameters")
        self._call = self._called(0.0)

    def take(self) -> dict[str, Any] | None:
        """Return what has arrived since the last look, without parameters that are not set."""
        if not self._call.done():
            return None
        values, self._call = self._call.result().values, self._called(self._period_s)
        if len(values) != len(self._names):
            return None
        read = zip(self._names, map(parameter_value_to_python, values), strict=True)
        plain = (bool, int, float, str)
        return {name: value if isinstance(value, plain) else tuple(value) for name, value in read if value is not None}

    def close(self) -> None:
        """Destroy the client."""
        self._node.destroy_client(self._client)

    def _called(self, after_s: float) -> RepeatedCall:
        return RepeatedCall(self._client, GetParameters.Request(names=self._names), after_s)
