"""A campaign goes from pass to pass: what gave observations counts, what failed is named, a cancel stops the pass."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="the runner is part of a node", exc_type=ImportError)
from rf_pointing_msgs.msg import Pass

from rf_pointing.nodes import campaign_runner


class Answer:
    """A future whose answer is there, or not yet."""

    def __init__(self, value=None, done=True):
        self.value, self.is_done = value, done

    def done(self):
        return self.is_done

    def result(self):
        return self.value


class Log:
    """A calibration log that has as many observations as the graph says."""

    def __init__(self, graph):
        self.graph = graph

    def __len__(self):
        return self.graph.observations

    def begin_pass(self):
        pass

    def reasons(self):
        return "7 errors: not valid"


@pytest.fixture
def graph(monkeypatch):
    """Return a graph that knows every target but "unknown"; `tracked` is the result of the pass in work."""
    tracked = Answer(SimpleNamespace(result=SimpleNamespace(seconds_tracked=1.0, message="lost", fault="")), done=False)
    graph = SimpleNamespace(tracked=tracked, cancelled=0, observations=0)

    def cancel():
        graph.cancelled += 1

    handle = SimpleNamespace(accepted=True, get_result_async=lambda: graph.tracked, cancel_goal_async=cancel)
    select = SimpleNamespace(
        service_is_ready=lambda: True,
        call_async=lambda request: Answer(
            SimpleNamespace(success=request.target != "unknown", message="no such target")
        ),
    )
    track = SimpleNamespace(server_is_ready=lambda: True, send_goal_async=lambda _: Answer(handle))
    monkeypatch.setattr(campaign_runner, "ActionClient", lambda *_: track)
    node = SimpleNamespace(create_client=lambda *_: select)
    graph.runner = campaign_runner.CampaignRunner(node)
    graph.log = Log(graph)
    return graph


def poll(graph, times):
    for _ in range(times):
        graph.runner.poll()


def test_a_pass_counts_when_it_gave_observations_and_a_failure_is_named(graph):
    graph.runner.start([Pass(target="a"), Pass(target="unknown"), Pass(target="b")], "monopulse", graph.log)
    poll(graph, 3)
    assert graph.runner.target == "a"
    graph.observations, graph.tracked.is_done = 5, True
    poll(graph, 2)
    assert (graph.runner.observed, graph.runner.target) == (1, "b")
    poll(graph, 3)
    assert not graph.runner.busy
    assert graph.runner.failures == [
        "unknown: no such target",
        "b: no observation, 1 s on target, lost; 7 errors: not valid",
    ]


def test_a_fault_of_the_antenna_ends_the_campaign_and_is_named(graph):
    graph.runner.start([Pass(target="a"), Pass(target="b"), Pass(target="c")], "monopulse", graph.log)
    poll(graph, 3)
    graph.tracked.value.result.fault = graph.tracked.value.result.message = "antenna fault: drives cut"
    graph.tracked.is_done = True
    poll(graph, 1)
    assert not graph.runner.busy
    assert (graph.runner.number, graph.runner.fault) == (1, "antenna fault: drives cut")
    assert graph.runner.failures == ["a: no observation, 1 s on target, antenna fault: drives cut; 7 errors: not valid"]
    graph.tracked.value.result.fault = ""
    graph.runner.start([Pass(target="a")], "monopulse", graph.log)
    assert graph.runner.fault == ""


def test_a_cancel_stops_the_pass_in_work_and_begins_no_other(graph):
    graph.runner.start([Pass(target="a"), Pass(target="b")], "monopulse", graph.log)
    poll(graph, 3)
    graph.runner.cancel()
    assert graph.cancelled == 1
    graph.tracked.is_done = True
    poll(graph, 1)
    assert not graph.runner.busy


def test_a_service_that_does_not_answer_is_given_up_and_a_pass_is_not(graph, monkeypatch):
    graph.runner.start([Pass(target="a")], "monopulse", graph.log)
    poll(graph, 2)
    monkeypatch.setattr(campaign_runner.time, "monotonic", lambda: 1e9)
    poll(graph, 1)
    assert graph.runner.busy
    graph.runner._select.call_async = lambda _: Answer(done=False)
    graph.runner.start([Pass(target="a")], "monopulse", graph.log)
    monkeypatch.setattr(campaign_runner.time, "monotonic", lambda: 2e9)
    poll(graph, 1)
    assert graph.runner.failures == ["a: no answer within 20 s"]
