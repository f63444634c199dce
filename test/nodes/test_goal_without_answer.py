"""A goal by name whose ephemeris does not answer: periods go on meanwhile, and in the end a sentence."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.task import Future
from rf_pointing_msgs.action import TrackPass
from rf_pointing_msgs.msg import Pass
from rf_pointing_msgs.srv import SelectTarget

from rf_pointing.nodes import pointing_controller
from rf_pointing.nodes.pointing_controller import PointingControllerNode
from rf_pointing.ros.stamps import stamp_from_seconds

ANY_STATE = LifecycleState(state_id=1, label="unconfigured")


@pytest.fixture
def controller(default_context: None) -> Iterator[Any]:
    """Yield an active controller with a goal by name, whose answer is the future `answer`."""
    node: Any = PointingControllerNode()
    assert node.on_configure(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    assert node.on_activate(ANY_STATE) == TransitionCallbackReturn.SUCCESS
    answer: Future = Future()
    node.answer = answer
    node._ephemeris = SimpleNamespace(service_is_ready=lambda: True, call_async=lambda _request: answer)
    node.ended = []
    goal = SimpleNamespace(
        request=TrackPass.Goal(satellite="MYSAT"),
        is_cancel_requested=False,
        execute=lambda: node.ended.append(node._refusal),
    )
    node._on_accepted(goal)
    yield node
    node.end()
    node.lock.release()
    node.destroy_node()


def test_periods_go_on_while_the_answer_is_waited_for(controller: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = controller.now_s()
    for period in range(25):
        controller._due(now_s + 0.1 * period)
        controller.turn()
    assert controller.failure is None
    assert controller.ended == []
    monkeypatch.setattr(pointing_controller, "PLAN_PATIENCE_WALL_S", 0.0)
    controller.turn()
    assert controller.ended == ["no pass of 'MYSAT' is known: ephemeris_publisher does not answer, waited 0 s"]


def test_a_publisher_that_is_not_there_is_called_when_it_comes(
    controller: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []
    ephemeris = SimpleNamespace(ready=False, call_async=lambda request: calls.append(request) or controller.answer)
    ephemeris.service_is_ready = lambda: ephemeris.ready
    controller._selection, controller._ephemeris = None, ephemeris
    controller.turn()
    assert (calls, controller.ended) == ([], [])
    ephemeris.ready = True
    controller.turn()
    controller.turn()
    assert [request.target for request in calls] == ["MYSAT"]
    controller._selection, ephemeris.ready = None, False
    monkeypatch.setattr(pointing_controller, "PLAN_PATIENCE_WALL_S", 0.0)
    controller.turn()
    assert controller.ended == ["no pass of 'MYSAT' is known: ephemeris_publisher is not active, waited 0 s"]


def test_the_answer_of_a_publisher_that_finds_none_ends_the_goal(controller: Any) -> None:
    controller.answer.set_result(SelectTarget.Response(success=False, message="MYSAT has no pass above 0.0 deg"))
    controller.turn()
    assert controller.ended == ["MYSAT has no pass above 0.0 deg"]


def test_a_pass_that_is_over_is_refused_with_its_age(controller: Any) -> None:
    times = {
        name: stamp_from_seconds(controller.now_s() - ago_s)
        for name, ago_s in (("aos", 900), ("tca", 600), ("los", 300))
    }
    controller.answer.set_result(
        SelectTarget.Response(success=True, passes=[Pass(target="MYSAT", peak_elevation=0.5, **times)])
    )
    controller.turn()
    assert controller.ended == ["the pass of MYSAT ended 300 s ago"]


def test_a_goal_that_is_cancelled_while_it_waits_ends_and_the_controller_goes_on(controller: Any) -> None:
    controller._goal.is_cancel_requested = True
    controller.turn()
    assert controller.ended == ["the goal was cancelled"]
    controller._due(controller.now_s())
    controller.turn()
    assert controller.failure is None
