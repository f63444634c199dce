"""A campaign goes from pass to pass: what gave observations counts, what failed is named, a cancel stops the pass."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="the runner is part of a node", exc_type=ImportError)
from rf_pointing_msgs.msg import Pass

from rf_pointing.ros import campaign_runner


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


@pytest.mark.parametrize("missing", ["select", "track"])
def test_without_passes_or_without_a_node_that_tracks_nothing_starts(graph, missing):
    with pytest.raises(ValueError, match="passes is empty"):
        graph.runner.start([], "monopulse", graph.log)
    server = {"select": (graph.runner._select, "service_is_ready"), "track": (graph.runner._track, "server_is_ready")}
    client, ready = server[missing]
    setattr(client, ready, lambda: False)
    with pytest.raises(ValueError, match="ephemeris_publisher and pointing_controller must be running"):
        graph.runner.start([Pass(target="a")], "monopulse", graph.log)
    assert not graph.runner.busy


def test_a_pass_is_selected_two_hours_before_it_rises_and_tracked_with_the_sensor(graph):
    requests, goals, send = [], [], graph.runner._track.send_goal_async
    call = graph.runner._select.call_async
    graph.runner._select.call_async = lambda request: (requests.append(request), call(request))[1]
    graph.runner._track.send_goal_async = lambda goal: (goals.append(goal), send(goal))[1]
    wanted = Pass(target="a")
    wanted.aos.sec = 1_151_384_000
    graph.runner.start([wanted], "conscan", graph.log)
    assert requests == [], "called with the first look"
    poll(graph, 3)
    ((request,), (goal,)) = requests, goals
    assert (request.target, request.start.sec) == ("a", 1_151_384_000 - 7200)
    assert (goal.target_pass, goal.sensor) == (wanted, "conscan")


def test_where_a_campaign_is_shows_at_each_instant(graph):
    runner = graph.runner
    assert (runner.busy, runner.target, runner.count, runner.number) == (False, "", 0, 0)
    runner.poll()
    runner.start([Pass(target="a"), Pass(target="b")], "monopulse", graph.log)
    assert (runner.busy, runner.target, runner.count, runner.number) == (True, "a", 2, 1)
    graph.tracked.is_done = True
    poll(graph, 3)
    assert (runner.target, runner.number) == ("b", 2)
    poll(graph, 3)
    assert (runner.busy, runner.number, runner.observed, len(runner.failures)) == (False, 2, 0, 2)
    # A new campaign begins with nothing of the old one.
    runner.start([Pass(target="c")], "monopulse", graph.log)
    assert (runner.target, runner.number, runner.observed, runner.failures) == ("c", 1, 0, [])


def test_each_pass_begins_its_own_count_of_reasons(graph):
    begun = []
    graph.log.begin_pass = lambda: begun.append(graph.runner.target)
    graph.tracked.is_done = True
    graph.runner.start([Pass(target="a"), Pass(target="b")], "monopulse", graph.log)
    poll(graph, 6)
    assert begun == ["a", "b"]


def test_a_refused_goal_is_a_failure_and_the_next_pass_follows(graph):
    graph.runner._track.send_goal_async = lambda _: Answer(SimpleNamespace(accepted=False))
    graph.runner.start([Pass(target="a"), Pass(target="b")], "monopulse", graph.log)
    poll(graph, 2)
    assert graph.runner.failures == ["a: the controller refused the pass"]
    assert graph.runner.target == "b"
    graph.runner.cancel()
    assert graph.cancelled == 0, "no pass is in work"
    poll(graph, 2)
    assert not graph.runner.busy


@pytest.mark.parametrize(("waited_s", "given_up"), [(19.9, False), (20.1, True)])
def test_an_answer_is_waited_for_twenty_seconds(graph, monkeypatch, waited_s, given_up):
    now = [1000.0]
    monkeypatch.setattr(campaign_runner.time, "monotonic", lambda: now[0])
    graph.runner._select.call_async = lambda _: Answer(done=False)
    graph.runner.start([Pass(target="a")], "monopulse", graph.log)
    now[0] += waited_s
    poll(graph, 1)
    assert graph.runner.busy is not given_up
