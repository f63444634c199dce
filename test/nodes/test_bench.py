"""The bench of the other tests: time, topics, services, actions and parameters of a node are the test's."""

from collections.abc import Callable
from typing import Any

from rf_pointing_msgs.action import Identify

from rf_pointing.nodes.antenna_servo import AntennaServo


def test_a_node_lives_on_the_clock_and_the_topics_of_the_bench(make_bench: Callable[..., Any]) -> None:
    bench = make_bench(AntennaServo, namespace="/gs1", **{"antenna.start_azimuth_deg": 30.0}).up()
    bench.run(0.2)
    assert len(bench.sent["joint_states"]) == 11
    assert bench.sent["joint_states"][-1].header.stamp.sec == int(bench.t_s)
    assert (bench.call("~/park").message, bench.call("~/park").success) == ("park accepted", True)
    assert bench.health("drive").message == "parking"
    goal = bench.goal("identify", Identify.Goal(axis="azimuth"))
    assert (goal.end, goal.result.success) == ("aborted", False)
    assert "cannot change while the drives are enabled" in bench.change(**{"loops.table.horizon_s": 60.0})
    assert bench.node.get_fully_qualified_name() == "/gs1/antenna_servo"
