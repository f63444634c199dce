"""A call that may be made twice is made until an answer comes."""

from types import SimpleNamespace
from typing import Any

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import Parameter
from rclpy.task import Future

from rf_pointing.ros import repeated_call
from rf_pointing.ros.repeated_call import AGAIN_S, ParametersOf, RepeatedCall
from test.nodes import bench


class Time:
    """Wall time of the test."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


class Service:
    """A client whose service answers call number `answered` with `answer`, and loses what is before."""

    def __init__(self, answered: int, answer: Any) -> None:
        self.ready, self.calls, self.removed = True, [], []  # type: bool, list[Any], list[Any]
        self._answered, self._answer = answered, answer

    def service_is_ready(self) -> bool:
        return self.ready

    def call_async(self, request: Any) -> Future:
        future: Future = Future()
        self.calls.append(request)
        if len(self.calls) == self._answered:
            future.set_result(self._answer)
        return future

    def remove_pending_request(self, future: Future) -> None:
        self.removed.append(future)


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Time:
    wall = Time()
    monkeypatch.setattr(repeated_call, "time", wall)
    return wall


def test_a_lost_answer_is_one_call_more_after_a_while(wall: Time) -> None:
    service = Service(answered=2, answer="found")
    call = RepeatedCall(service, "request")
    assert (call.done(), call.done(), service.calls) == (False, False, ["request"])
    wall.now_s += 0.9 * AGAIN_S
    assert (call.done(), len(service.calls)) == (False, 1)
    wall.now_s += 0.2 * AGAIN_S
    assert call.done() or call.done()
    assert (call.result(), len(service.calls), len(service.removed)) == ("found", 2, 1)
    wall.now_s += 10.0 * AGAIN_S
    assert (call.done(), len(service.calls)) == (True, 2)


def test_a_service_that_is_not_offered_is_not_called(wall: Time) -> None:
    service = Service(answered=1, answer="found")
    service.ready = False
    call = RepeatedCall(service, "request")
    wall.now_s += 3.0 * AGAIN_S
    assert (call.done(), call.made, call.result(), service.calls) == (False, False, None, [])
    service.ready = True
    call.done()
    assert (call.done(), call.made, call.result()) == (True, True, "found")


def test_parameters_of_another_node_are_read_every_period(wall: Time) -> None:
    service: Any = bench.Service()
    node: Any = SimpleNamespace(create_client=lambda _kind, _name: service)
    reader = ParametersOf(node, "pointing_controller", ["low", "unset", "mask"], 600.0)
    assert reader.take() is None
    values = [Parameter("x", value=value).get_parameter_value() for value in (0.5, None, [1.0, 2.0])]
    assert service.answer(GetParameters.Response(values=values)).names == ["low", "unset", "mask"]
    assert reader.take() == {"low": 0.5, "mask": (1.0, 2.0)}
    for seconds, calls in ((599.9, 1), (0.2, 2)):
        wall.now_s += seconds
        assert (reader.take(), len(service.requests)) == (None, calls)
    # A node that has another set of them says nothing.
    service.answer(GetParameters.Response(values=values[:2]))
    assert reader.take() is None
