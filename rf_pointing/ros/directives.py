"""Sends directives by name and type: services, actions and parameters of any node of the namespace.

What comes back is polled between two events: a response, and for an action its result, whose plain
fields are reported under the name of the directive.
"""

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from builtin_interfaces.msg import Time
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter import Parameter

from rf_pointing.core import require_choice
from rf_pointing.core.pass_outcome import NOT_OFFERED
from rf_pointing.operations.dictionary import DirectiveRow
from rf_pointing.ros.command_key import CommandKey, CommandKeyParams
from rf_pointing.ros.leased_services import Caller
from rf_pointing.ros.stamps import stamp_from_seconds

SUCCEEDED = 4
"""Status of a goal that has succeeded, as action_msgs/GoalStatus has it."""
Responded = Callable[[int, bool, str], None]
Answered = Callable[[int, bool, str, Any], None]
Ended = Callable[[int, str, bool, dict[str, Any]], None]


def type_of(type_name: str) -> Any:
    """Return the class of package/kind/Name; ValueError if it is not installed."""
    package, kind, name = type_name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"type {type_name} is not installed: {error}") from error


def filled(message: Any, values: Mapping[str, Any]) -> Any:
    """Fill the fields of a message from plain values; times are in UTC s."""
    for name, value in values.items():
        if not hasattr(message, name):
            raise ValueError(f"{type(message).__name__} has no field {name}")
        present = getattr(message, name)
        if isinstance(present, Time) and not isinstance(value, Time):
            value = stamp_from_seconds(float(value))
        elif isinstance(value, Mapping):
            value = filled(present, value)
        elif isinstance(present, float) and isinstance(value, int):
            value = float(value)
        # The setters of messages check nothing: a wrong type would end the node when it is sent.
        if isinstance(present, (str, bool, int, float)) and type(value) is not type(present):
            raise ValueError(f"{name}={value!r} is no {type(present).__name__}")
        setattr(message, name, value)
    return message


def plain_fields(message: Any) -> dict[str, Any]:
    """Return the fields of a message that are numbers, texts or truth values."""
    names = message.get_fields_and_field_types()
    return {name: value for name in names if isinstance(value := getattr(message, name), (str, bool, int, float))}


class DirectiveSender:
    """The clients of one dictionary; `responded` and `ended` take what comes back.

    `answered` takes the answers of services with their whole messages, in place of `responded`.
    The addresses of `rows` are below `space`: "" is the namespace of the node.
    """

    def __init__(
        self, node: Node, rows: Mapping[str, DirectiveRow], own: Mapping[str, Callable[..., str]],
        responded: Responded, ended: Ended, key: CommandKeyParams, answered: Answered | None = None, space: str = "",
    ) -> None:  # fmt: skip
        self._node, self._rows, self._own, self._space = node, rows, own, space
        self._caller = Caller(node, CommandKey(key), space)
        self._responded, self._ended = responded, ended
        self._answers = answered or (lambda number, accepted, text, _: responded(number, accepted, text))
        self._clients: dict[str, Any] = {}
        self._waiting: list[tuple[Any, Callable[[Any], None]]] = []
        for row in rows.values():
            self._connect(row)

    def _connect(self, row: DirectiveRow) -> None:
        if row.kind == "own":
            require_choice(f"directive {row.name}: own", row.address, self._own)
            return
        if row.kind == "parameter":
            owner = row.address.rpartition("/")[0]
            self._clients[row.name] = self._node.create_client(
                SetParametersAtomically, f"{self._space}{owner}/set_parameters_atomically"
            )
            return
        kind = type_of(row.type_name)
        blank = kind.Request() if row.kind == "service" else kind.Goal()
        unknown = [name for name in row.takes if not hasattr(blank, name)]
        if unknown:
            raise ValueError(f"directive {row.name}: {row.type_name} has no field {', '.join(unknown)}")
        make = (
            self._caller.client if row.kind == "service" else lambda t, n: ActionClient(self._node, t, self._space + n)
        )
        self._clients[row.name] = make(kind, row.address)

    def close(self) -> None:
        """Destroy the clients; what is under way goes on at the devices."""
        for name, client in self._clients.items():
            if self._rows[name].kind == "action":
                client.destroy()
            else:
                self._node.destroy_client(client)
        self._clients.clear()
        self._waiting.clear()

    def send(self, number: int, name: str, arguments: Mapping[str, Any]) -> None:
        """Send a directive; what is wrong with it is its response."""
        row = self._rows[name]
        try:
            if row.kind == "own":
                self._responded(number, True, self._own[row.address](**arguments))
                return
            client = self._clients[name]
            ready = client.server_is_ready if row.kind == "action" else client.service_is_ready
            if not ready():
                raise ValueError(f"{row.kind} {row.address} {NOT_OFFERED}")
            if row.kind == "action":
                goal = filled(type_of(row.type_name).Goal(), arguments)
                self._wait(client.send_goal_async(goal), lambda handle: self._offered(number, name, handle))
            else:
                self._wait(client.call_async(self._request(row, arguments)), lambda a: self._answered(number, name, a))
        except (ValueError, OSError) as error:
            self._responded(number, False, str(error))

    def poll(self) -> None:
        """Take what has come back."""
        done = [each for each in self._waiting if each[0].done()]
        if done:
            self._waiting = [each for each in self._waiting if not each[0].done()]
        for future, then in done:
            then(future.result())

    def _request(self, row: DirectiveRow, arguments: Mapping[str, Any]) -> Any:
        if row.kind == "service":
            return self._caller.request(row.address, filled(type_of(row.type_name).Request(), arguments))
        if "value" not in arguments:
            raise ValueError(f"directive {row.name} needs value")
        wanted = Parameter(row.address.rpartition("/")[2], value=arguments["value"])
        return SetParametersAtomically.Request(
            parameters=[ParameterMessage(name=wanted.name, value=wanted.get_parameter_value())]
        )

    def _wait(self, future: Any, then: Callable[[Any], None]) -> None:
        self._waiting.append((future, then))

    def _answered(self, number: int, name: str, answer: Any) -> None:
        if self._rows[name].kind == "parameter":
            self._responded(number, answer.result.successful, answer.result.reason)
            return
        # A service without `success` can only say that it was received.
        success, text = bool(getattr(answer, "success", True)), str(getattr(answer, "message", ""))
        self._answers(number, success, text, answer)

    def _offered(self, number: int, name: str, handle: Any) -> None:
        self._responded(number, handle.accepted, "" if handle.accepted else "the goal was refused")
        if handle.accepted:
            self._wait(handle.get_result_async(), lambda answer: self._over(number, name, answer))

    def _over(self, number: int, name: str, answer: Any) -> None:
        self._ended(number, name, answer.status == SUCCEEDED, plain_fields(answer.result))
