"""A call that may be made twice is made until an answer comes."""

from types import SimpleNamespace
from typing import Any

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import Parameter

from rf_pointing.ros import repeated_call
from rf_pointing.ros.repeated_call import AGAIN_S, ParametersOf, RepeatedCall
from test.nodes import bench
from test.ros.fake_station import Wall


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    wall = Wall()
    monkeypatch.setattr(repeated_call, "time", wall)
    return wall


def test_a_lost_answer_is_one_call_more_after_a_while(wall: Wall) -> None:
    service = bench.Service()
    call = RepeatedCall(service, "request")
    assert (call.done(), call.done(), service.requests) == (False, False, ["request"])
    wall.now_s += 0.9 * AGAIN_S
    assert (call.done(), len(service.requests)) == (False, 1)
    wall.now_s += 0.2 * AGAIN_S
    assert (call.done(), len(service.requests)) == (False, 2)
    service.answer("found")
    assert (call.done(), call.result(), service.futures[0].cancelled()) == (True, "found", True)
    wall.now_s += 10.0 * AGAIN_S
    assert (call.done(), len(service.requests)) == (True, 2)


def test_a_service_that_is_not_offered_is_not_called(wall: Wall) -> None:
    service = bench.Service()
    service.ready = False
    call = RepeatedCall(service, "request")
    wall.now_s += 3.0 * AGAIN_S
    assert (call.done(), call.made, call.result(), service.requests) == (False, False, None, [])
    service.ready = True
    call.done()
    service.answer("found")
    assert (call.done(), call.made, call.result()) == (True, True, "found")


def test_parameters_of_another_node_are_read_every_period(wall: Wall) -> None:
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
